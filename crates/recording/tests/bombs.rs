//! Files of a few bytes that say they hold more than a machine does: refused in one line, before they are believed.
#![cfg(all(feature = "hdf5", feature = "matlab", feature = "parquet"))]
#![allow(clippy::unwrap_used)]

use std::collections::VecDeque;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use cvg_recording::{Naming, ReadError, Recording, limit_memory};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use tempfile::TempDir;

/// What these tests may take: with what is allowed, each of the files here would take several times as much.
const ALLOWED: u64 = 32_000_000;
/// Numbers that take more than that.
const MANY: usize = 8_000_000;

fn read(bytes: &[u8]) -> Result<Recording, ReadError> {
    limit_memory(ALLOWED);
    Recording::read_from(bytes, &Naming::default(), Path::new("bomb"))
}

fn read_file(bytes: &[u8]) -> Result<Recording, ReadError> {
    limit_memory(ALLOWED);
    let folder = TempDir::new().unwrap();
    let path: PathBuf = folder.path().join("bomb");
    fs::write(&path, bytes).unwrap();
    Recording::read(&path)
}

fn assert_too_large(read: Result<Recording, ReadError>) {
    let error = read.expect_err("the file is refused");
    assert!(matches!(error, ReadError::TooLarge { allowed: ALLOWED, .. }), "{error}");
    let said = error.to_string();
    assert!(said.contains("32 MB are allowed; wanted a smaller recording or a larger limit"), "{said}");
    assert_eq!(said.lines().count(), 1);
}

/// A recording of this many rows in which nothing happens, which packs into next to nothing.
fn standstill(rows: usize) -> Recording {
    let zeros = || Some(vec![0.0; rows]);
    Recording { t_s: vec![0.0; rows], theta_deg: zeros(), rate_dps: zeros(), ..Recording::default() }
}

fn parquet(recording: &Recording) -> Vec<u8> {
    let mut bytes = vec![];
    recording.write_parquet(&mut bytes).unwrap();
    bytes
}

#[test]
fn a_small_parquet_file_of_many_rows_is_refused() {
    let bytes = parquet(&standstill(4_000_000));
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert_too_large(read_file(&bytes));
}

#[test]
fn a_page_that_is_larger_than_its_column_is_refused() {
    let mut bytes = parquet(&standstill(1000));
    // after `PAR1`: field 1, the kind of page; field 2, its size unfolded, a number whose bytes but the last begin with 1
    assert_eq!((bytes[4], bytes[6]), (0x15, 0x15));
    let last = (7..).find(|&at| bytes[at] < 0x80).unwrap();
    bytes[7..last].fill(0xfe);
    bytes[last] = 0x7e;
    let said = read_file(&bytes).expect_err("the file is refused").to_string();
    assert!(said.contains("a page is larger than its column") || said.contains("dictionary"), "{said}");
}

fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), u32::try_from(bytes.len()).unwrap().to_le_bytes()].concat();
    out.extend_from_slice(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A column of zeros as MATLAB writes it: numbers that fit are stored in a byte each.
fn zeros(name: &str, rows: usize) -> Vec<u8> {
    let flags = [6_u32.to_le_bytes(), 0_u32.to_le_bytes()].concat();
    let size = [u32::try_from(rows).unwrap().to_le_bytes(), 1_u32.to_le_bytes()].concat();
    let parts = [element(6, &flags), element(5, &size), element(1, name.as_bytes()), element(2, &vec![0; rows])];
    element(14, &parts.concat())
}

/// An array as MATLAB writes it: compressed.
fn folded(array: &[u8]) -> Vec<u8> {
    let mut folded = ZlibEncoder::new(vec![], Compression::best());
    folded.write_all(array).unwrap();
    let folded = folded.finish().unwrap();
    [&15_u32.to_le_bytes(), &u32::try_from(folded.len()).unwrap().to_le_bytes(), folded.as_slice()].concat()
}

fn folded_zeros(name: &str, rows: usize) -> Vec<u8> {
    folded(&zeros(name, rows))
}

fn mat_5(arrays: &[Vec<u8>]) -> Vec<u8> {
    let mut file = format!("{:124}", "MATLAB 5.0 MAT-file, by a test").into_bytes();
    file.extend_from_slice(&[0x00, 0x01, b'I', b'M']);
    file.extend(arrays.concat());
    file
}

#[test]
fn a_matlab_file_that_unfolds_to_more_than_is_allowed_is_refused() {
    let bytes = mat_5(&[folded_zeros("t_s", MANY), folded_zeros("theta_deg", MANY)]);
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert_too_large(read(&bytes));
}

/// A struct of the time and an angle, both zeros.
fn folded_struct(rows: usize) -> Vec<u8> {
    let flags = [2_u32.to_le_bytes(), 0_u32.to_le_bytes()].concat();
    let size = [1_u32.to_le_bytes(), 1_u32.to_le_bytes()].concat();
    let width = element(5, &10_u32.to_le_bytes());
    let names = element(1, b"t_s\0\0\0\0\0\0\0theta_deg\0");
    let head = [element(6, &flags), element(5, &size), element(1, b"run"), width, names].concat();
    folded(&element(14, &[head, zeros("", rows), zeros("", rows)].concat()))
}

#[test]
fn a_matlab_struct_that_unfolds_to_more_than_is_allowed_is_refused() {
    // a fifth of what is allowed as bytes, and several times as much as numbers
    let bytes = mat_5(&[folded_struct(MANY / 4)]);
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert_too_large(read(&bytes));
    assert_eq!(read(&mat_5(&[folded_struct(3)])).unwrap().t_s, [0.0]);
}

#[test]
fn a_matlab_file_is_refused_by_the_beginning_of_an_array_before_that_is_unfolded() {
    // as bytes it is allowed twice over, and not as numbers; only its beginning is there to be unfolded
    let mut stored = ZlibEncoder::new(vec![], Compression::none());
    stored.write_all(&zeros("t_s", MANY / 4)).unwrap();
    let mut stored = stored.finish().unwrap();
    stored.truncate(4096);
    let array =
        [&15_u32.to_le_bytes(), &u32::try_from(stored.len()).unwrap().to_le_bytes(), stored.as_slice()].concat();
    assert_too_large(read(&mat_5(&[array])));
}

#[test]
fn a_folded_matlab_file_of_few_numbers_is_read() {
    let recording = read(&mat_5(&[folded_zeros("t_s", 3), folded_zeros("theta_deg", 3)])).unwrap();
    assert_eq!((recording.t_s, recording.theta_deg), (vec![0.0], Some(vec![0.0])));
    assert_eq!(recording.dropped.repeated_time.count, 2, "time stands still");
}

fn hdf5(of: &[(&str, Vec<f64>)]) -> Vec<u8> {
    let mut file = hdf5_pure::FileBuilder::new();
    for (name, values) in of {
        file.create_dataset(name).with_f64_data(values).with_chunks(&[values.len() as u64]).with_deflate(9);
    }
    file.finish().unwrap()
}

#[test]
fn an_hdf5_file_that_unfolds_to_more_than_is_allowed_is_refused() {
    let zeros = vec![0.0; MANY / 4];
    let bytes = hdf5(&[("t_s", zeros.clone()), ("theta_deg", zeros)]);
    assert!(bytes.len() < 200_000, "{} bytes", bytes.len());
    assert_too_large(read(&bytes));
}

#[test]
fn a_data_set_that_is_no_column_is_not_read_however_large() {
    let (time, angle) = (vec![0.0, 0.1, 0.2], vec![0.0, 10.0, 20.0]);
    let recording = read(&hdf5(&[
        ("t_s", time.clone()),
        ("theta_deg", angle),
        ("rate_dps", vec![100.0; 3]),
        ("camera", vec![0.0; MANY]),
    ]));
    let recording = recording.unwrap();
    assert_eq!(recording.t_s, time);
    let left_out = "`camera` has 8000000 values, the time 3, and is left out";
    assert!(recording.warnings.iter().any(|warning| warning.contains(left_out)), "{:?}", recording.warnings);
}

#[test]
fn rows_without_an_end_are_refused_when_they_take_more_than_is_allowed() {
    limit_memory(ALLOWED);
    assert_too_large(Recording::read_from(Endless::default(), &Naming::default(), Path::new("bomb")));
}

/// A pipe into which an instrument writes and never stops.
#[derive(Default)]
struct Endless {
    rows: u64,
    left: VecDeque<u8>,
}

impl std::io::Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.left.is_empty() {
            if self.rows == 0 {
                self.left.extend(b"t_s,theta_deg,rate_dps\n");
            }
            for _ in 0..1000 {
                self.rows += 1;
                self.left.extend(format!("{},0,0\n", self.rows).as_bytes());
            }
        }
        self.left.read(buffer)
    }
}

/// A footer with a field that no version of Parquet has: a list of two thousand million booleans, which take no byte.
#[test]
fn a_footer_with_a_list_of_booleans_without_end_is_refused() {
    let sound = parquet(&standstill(10));
    let before = sound.len() - 8;
    let footer = u32::from_le_bytes(sound[before..before + 4].try_into().unwrap()) as usize;
    let (head, own) = (&sound[..before - footer], &sound[before - footer..before]);
    // a long field number, 99, of a list (9) of booleans (0xf1) as long as an i32 goes, before the fields that it has
    let list = [0x09, 0xc6, 0x01, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07];
    // the first field has its number in full, because it does not follow on zero any more
    let (kind, rest) = (own[0] & 0x0f, &own[1..]);
    assert_eq!(own[0] >> 4, 1, "the version comes first");
    let footer = [&list[..], &[kind, 0x02], rest].concat();
    let length = u32::try_from(footer.len()).unwrap().to_le_bytes();
    let said = read_file(&[head, &footer, &length, b"PAR1"].concat()).expect_err("the file is refused").to_string();
    assert!(said.contains("its footer is damaged"), "{said}");
}
