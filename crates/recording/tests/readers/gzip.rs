//! Recordings that gzip has compressed: known by their first bytes, read as what is in them, bounded by the limit of memory.

use std::io::Write as _;
use std::path::Path;

use cvg_recording::{Naming, ReadError, Recording, limit_memory};
use flate2::Compression;
use flate2::write::GzEncoder;

const TEXT: &str = "t_s,xc_v,yc_v,table_deg\n0,1,0,0\n0.1,0.5,0.5,10\n0.2,0,1,20\n";
/// What these tests may take.
const ALLOWED: u64 = 32_000_000;

fn folded(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(vec![], Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn read(bytes: &[u8]) -> Result<Recording, ReadError> {
    limit_memory(ALLOWED);
    Recording::read_from(bytes, Naming::NONE, Path::new("rot.csv.gz"))
}

fn refusal(bytes: &[u8]) -> String {
    let said = read(bytes).expect_err("it is refused").to_string();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("rot.csv.gz: "), "{said}");
    said
}

#[test]
fn a_compressed_recording_is_read_whatever_its_name_says() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["rot.csv.gz", "rot.csv"] {
        let path = folder.path().join(name);
        std::fs::write(&path, folded(TEXT.as_bytes())).unwrap();
        let recording = Recording::read(&path).unwrap();
        assert_eq!(recording.t_s, [0.0, 0.1, 0.2]);
        assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
    }
}

#[test]
fn parts_that_were_compressed_one_by_one_are_one_text() {
    let (first, second) = TEXT.as_bytes().split_at(40);
    assert_eq!(read(&[folded(first), folded(second)].concat()).unwrap().t_s, [0.0, 0.1, 0.2]);
}

#[test]
fn an_hdf5_file_is_read_from_gzip_too() {
    let mut file = hdf5_pure::FileBuilder::new();
    file.create_dataset("t_s").with_f64_data(&[0.0, 0.1, 0.2]);
    file.create_dataset("theta_deg").with_f64_data(&[0.0, 10.0, 20.0]);
    assert_eq!(read(&folded(&file.finish().unwrap())).unwrap().t_s, [0.0, 0.1, 0.2]);
}

#[test]
fn a_compressed_file_that_is_cut_off_or_changed_is_refused() {
    let mut bytes = folded(TEXT.as_bytes());
    let said = refusal(&bytes[..bytes.len() - 9]);
    assert!(said.contains("is not a gzip file that can be read here: it is cut off"), "{said}");
    let sum = bytes.len() - 6;
    bytes[sum] ^= 1;
    assert!(refusal(&bytes).contains("corrupt gzip stream"), "{}", refusal(&bytes));
}

#[test]
fn what_is_compressed_twice_is_refused() {
    let said = refusal(&folded(&folded(TEXT.as_bytes())));
    assert!(said.contains("is compressed with gzip twice; wanted CSV text"), "{said}");
}

#[test]
fn a_small_file_that_unfolds_to_more_than_is_allowed_is_refused_in_one_line() {
    // rows, blank lines, remarks and texts: none of them may get past what is counted
    for line in ["\n", "# a remark that says nothing\n", "0.3,0,1,20\n"] {
        let bytes = folded((TEXT.to_owned() + &line.repeat(80_000_000 / line.len())).as_bytes());
        assert!(bytes.len() < 400_000, "{} bytes", bytes.len());
        let error = read(&bytes).expect_err("it is refused");
        assert!(matches!(error, ReadError::TooLarge { allowed: ALLOWED, .. }), "{error}");
        assert!(
            error.to_string().contains("32 MB are allowed; wanted a smaller recording or a larger limit"),
            "{error}"
        );
    }
}
