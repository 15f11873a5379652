//! Any bytes as Parquet, MATLAB's `.mat` or HDF5, or what gzip makes of them and of text, by their first bytes: read or
//! refused, never a panic that leaves the reader; what is read is as promised and can be written. Parquet also as a lake of
//! devices, whose columns are of one length.

use std::fs;
use std::path::Path;
use std::sync::{LazyLock, Once};

use cvg_recording::{Lake, Naming, ReadError, Recording, limit_memory};
use tempfile::TempDir;

use super::csv::{ALLOWED, admitted, as_promised};

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| TempDir::new().expect("a temporary folder"));
static QUIET: Once = Once::new();

pub fn run(bytes: &[u8]) {
    limit_memory(ALLOWED);
    // of a decoder's panic the reader makes a refusal; nobody wants to read of each
    QUIET.call_once(|| {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let of_ours =
                info.location().is_some_and(|l| ["crates/", "fuzz/"].iter().any(|part| l.file().contains(part)));
            if of_ours {
                hook(info);
            }
        }));
    });
    let read = if bytes.starts_with(b"PAR1") {
        // Parquet is read from its end
        let path = FOLDER.path().join(format!("{:?}.parquet", std::thread::current().id()));
        fs::write(&path, bytes).expect("a temporary file");
        lake(&path);
        Recording::read(&path)
    } else if [&b"MATLAB"[..], b"\x89HDF", b"\x1f\x8b"].iter().any(|head| bytes.starts_with(head)) {
        Recording::read_from(bytes, &Naming::default(), Path::new("fuzz.mat"))
    } else {
        return;
    };
    let Some(recording) = admitted(read) else { return };
    as_promised(&recording);
    recording.write_csv(std::io::sink()).expect("what was read can be written");
    let mut parquet = vec![];
    recording.write_parquet(&mut parquet).expect("what was read can be written");
    reads_back(&recording, &parquet);
}

/// What was written as Parquet is read as what it was: the same columns, in the same units.
fn reads_back(recording: &Recording, parquet: &[u8]) {
    let path = FOLDER.path().join(format!("{:?}-again.parquet", std::thread::current().id()));
    fs::write(&path, parquet).expect("a temporary file");
    let again = Recording::read(&path).expect("what was written is read");
    let written = |recording: &Recording| {
        let mut text = vec![];
        recording.write_csv(&mut text).expect("what was read can be written");
        text
    };
    assert_eq!(written(&again), written(recording));
}

/// Takes the file as one of many devices.
fn lake(path: &Path) {
    let Some(Some(lake)) = admitted(Lake::open(path)) else { return };
    let known: Vec<String> = lake.devices().map(str::to_owned).collect();
    let given = lake.each::<ReadError>(|device, columns| {
        assert!(known.contains(&device));
        let is_even = columns.windows(2).all(|pair| pair[0].1.len() == pair[1].1.len());
        assert!(is_even, "columns of one device have one length");
        if let Some(recording) = admitted(Recording::of_columns(columns, Naming::NONE, path)) {
            as_promised(&recording);
        }
        Ok(())
    });
    admitted(given);
}
