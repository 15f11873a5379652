//! Which reader a file wants, told by its first bytes and its name; of a compressed file, by the first bytes in it.
//!
//! Refuses what is plainly something else (a directory, an archive) by saying what it is.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use super::error::ReadError;
use super::naming::Naming;
use super::{Recording, arrays, csv, gzip, memory, parquet, utf_16};

const WANTED: &str = "CSV text in UTF-8 or UTF-16 (as it is or in gzip), Parquet, MATLAB's .mat or HDF5";
/// First bytes that tell every kind of file.
const HEAD: u64 = 16;

impl Recording {
    /// Reads a recording: Parquet, MATLAB's `.mat` (version 5 or 7.3) or HDF5 by their first bytes, CSV otherwise; CSV and
    /// the files of arrays compressed with gzip as well.
    ///
    /// # Errors
    /// [`ReadError`]: the file is not there, is no recording, has no time or no angle, or has dirt that could mean two
    /// things. Whether the columns suffice for a run is asked with [`Recording::require_rotation`] and
    /// [`Recording::require_ringdown`].
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        Self::read_named(path, Naming::NONE)
    }

    /// Reads a recording whose columns have names of their own.
    ///
    /// # Errors
    /// As [`Recording::read`], and where a mapped column is not there.
    pub fn read_named(path: &Path, naming: &Naming) -> Result<Self, ReadError> {
        let io = |error| ReadError::io(path, error);
        let mut file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            return Err(ReadError::Directory { path: path.to_path_buf() });
        }
        let head = head_of(&mut file).map_err(io)?;
        if head.starts_with(b"PAR1") {
            parquet::read(file, naming, path)
        } else if arrays::is_one(&head) {
            memory::allow(metadata.len(), "the file", path)?;
            arrays::read(whole(head, file, path)?, naming, path)
        } else {
            let size = metadata.is_file().then_some(metadata.len());
            stream(head, file, size, naming, path)
        }
    }

    /// Reads a recording that comes in one piece, as from standard input; `source` is the name that errors and warnings
    /// give it. Parquet wants a file.
    ///
    /// # Errors
    /// As [`Recording::read_named`].
    pub fn read_from(mut reader: impl Read + Send, naming: &Naming, source: &Path) -> Result<Self, ReadError> {
        let head = head_of(&mut reader).map_err(|error| ReadError::io(source, error))?;
        let mut recording = stream(head, reader, None, naming, source)?;
        recording.in_memory = true;
        Ok(recording)
    }

    /// Reads a recording from the bytes of a CSV file; `source` is the name that errors and warnings give it.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn parse_csv(bytes: &[u8], source: &Path) -> Result<Self, ReadError> {
        if utf_16::is_one(bytes) {
            return csv::read(utf_16::Decoding::new(bytes), None, Naming::NONE, source);
        }
        refuse_other_kinds(&bytes[..bytes.len().min(HEAD as usize)], source)?;
        csv::read(bytes, Some(bytes.len() as u64), Naming::NONE, source)
    }
}

/// The first bytes of a file.
fn head_of(reader: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut head = Vec::with_capacity(HEAD as usize);
    reader.take(HEAD).read_to_end(&mut head)?;
    Ok(head)
}

/// Reads what comes in one piece; of the bytes of a file, `size` is their number where it is known.
fn stream(
    head: Vec<u8>,
    rest: impl Read + Send,
    size: Option<u64>,
    naming: &Naming,
    source: &Path,
) -> Result<Recording, ReadError> {
    if !gzip::is_one(&head) {
        return unpacked(head, rest, size, naming, source);
    }
    let mut inner = gzip::Unfolding::new(Cursor::new(head).chain(rest));
    let head = head_of(&mut inner).map_err(|error| ReadError::io(source, error))?;
    unpacked(head, inner, None, naming, source)
}

/// Reads what is not compressed, or not any more.
fn unpacked(
    head: Vec<u8>,
    rest: impl Read + Send,
    size: Option<u64>,
    naming: &Naming,
    source: &Path,
) -> Result<Recording, ReadError> {
    if arrays::is_one(&head) {
        return arrays::read(whole(head, rest, source)?, naming, source);
    }
    if head.starts_with(b"PAR1") {
        let what = "is Parquet, which is read from its end".to_owned();
        return Err(ReadError::Format { path: source.to_path_buf(), what, wanted: "a file, or another format" });
    }
    if utf_16::is_one(&head) {
        return csv::read(utf_16::Decoding::new(Cursor::new(head).chain(rest)), None, naming, source);
    }
    refuse_other_kinds(&head, source)?;
    csv::read(Cursor::new(head).chain(rest), size, naming, source)
}

/// All bytes of a file, which may have no end.
fn whole(head: Vec<u8>, rest: impl Read, source: &Path) -> Result<Vec<u8>, ReadError> {
    let mut bytes = head;
    rest.take(memory::memory_limit()).read_to_end(&mut bytes).map_err(|error| ReadError::io(source, error))?;
    memory::allow(bytes.len() as u64, "the file", source)?;
    Ok(bytes)
}

/// What a text is that begins as no table does: a report, for people or for programs.
fn written_page(head: &[u8]) -> Option<&'static str> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let begins = |with: &str| text.get(..with.len()).is_some_and(|start| start.eq_ignore_ascii_case(with.as_bytes()));
    match text {
        // a line of an instrument may begin with one and go on
        [b'{', b'\r' | b'\n', ..] => Some("is JSON and no recording"),
        _ if ["<!doctype", "<html", "<?xml", "<svg"].iter().any(|start| begins(start)) => {
            Some("is HTML or XML and no recording")
        }
        _ => None,
    }
}

fn refuse_other_kinds(magic: &[u8], path: &Path) -> Result<(), ReadError> {
    let refuse =
        |what: &str| Err(ReadError::Format { path: path.to_path_buf(), what: what.to_owned(), wanted: WANTED });
    if magic.starts_with(&[0x1f, 0x8b]) {
        return refuse("is compressed with gzip twice");
    }
    if magic.starts_with(b"PK\x03\x04") {
        return refuse("is a zip archive or a spreadsheet");
    }
    if magic.starts_with(b"\x89HDF") {
        return refuse("begins like HDF5 and is none");
    }
    if let Some(what) = written_page(magic) {
        return refuse(what);
    }
    let is_named_parquet = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"));
    if is_named_parquet && !magic.is_empty() {
        return refuse("is named .parquet and does not begin with PAR1");
    }
    Ok(())
}
