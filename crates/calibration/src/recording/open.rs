//! Which reader a file wants, told by its first bytes and its name.
//!
//! Refuses what is plainly something else (a directory, an archive, UTF-16 text) by saying what it is.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use super::error::ReadError;
use super::{Recording, csv, parquet};

const WANTED: &str = "CSV text in UTF-8, or Parquet";

impl Recording {
    /// Reads a recording: Parquet where the file begins with `PAR1`, CSV otherwise.
    ///
    /// # Errors
    /// [`ReadError`]: the file is not there, is no recording, has no time or no angle, or has dirt that could mean two
    /// things. Whether the columns suffice for a run is asked with [`Recording::require_rotation`] and
    /// [`Recording::require_ringdown`].
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let io = |error| ReadError::io(path, error);
        let mut file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            return Err(ReadError::Directory { path: path.to_path_buf() });
        }
        let mut magic = Vec::with_capacity(4);
        (&mut file).take(4).read_to_end(&mut magic).map_err(io)?;
        if magic == *b"PAR1" {
            return parquet::read(file, path);
        }
        refuse_other_kinds(&magic, path)?;
        let size = metadata.is_file().then_some(metadata.len());
        csv::read(Cursor::new(magic).chain(file), size, path)
    }

    /// Reads a recording from the bytes of a CSV file; `source` is the name that errors and warnings give it.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn parse_csv(bytes: &[u8], source: &Path) -> Result<Self, ReadError> {
        refuse_other_kinds(&bytes[..bytes.len().min(4)], source)?;
        csv::read(bytes, Some(bytes.len() as u64), source)
    }
}

fn refuse_other_kinds(magic: &[u8], path: &Path) -> Result<(), ReadError> {
    let refuse =
        |what: &str| Err(ReadError::Format { path: path.to_path_buf(), what: what.to_owned(), wanted: WANTED });
    if magic.starts_with(&[0xff, 0xfe]) || magic.starts_with(&[0xfe, 0xff]) {
        return refuse("is text in UTF-16");
    }
    if magic.starts_with(&[0x1f, 0x8b]) {
        return refuse("is compressed with gzip");
    }
    if magic.starts_with(b"PK\x03\x04") {
        return refuse("is a zip archive or a spreadsheet");
    }
    if magic.starts_with(b"\x89HDF") {
        return refuse("is HDF5 (or MATLAB 7.3)");
    }
    let is_named_parquet = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"));
    if is_named_parquet && !magic.is_empty() {
        return refuse("is named .parquet and does not begin with PAR1");
    }
    Ok(())
}
