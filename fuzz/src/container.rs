//! Any bytes as Parquet, MATLAB's `.mat` or HDF5, by their first bytes: read or refused, never a panic that leaves the
//! reader; what is read is as promised and can be written.

use std::fs;
use std::path::Path;
use std::sync::{LazyLock, Once};

use cvg_calibration::recording::{Naming, Recording};
use tempfile::TempDir;

use super::csv::as_promised;

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| TempDir::new().expect("a temporary folder"));
static QUIET: Once = Once::new();

pub fn run(bytes: &[u8]) {
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
        Recording::read(&path)
    } else if bytes.starts_with(b"MATLAB") || bytes.starts_with(b"\x89HDF") {
        Recording::read_from(bytes, &Naming::default(), Path::new("fuzz.mat"))
    } else {
        return;
    };
    let Ok(recording) = read else { return };
    as_promised(&recording);
    recording.write_csv(std::io::sink()).expect("what was read can be written");
    recording.write_parquet(std::io::sink()).expect("what was read can be written");
}
