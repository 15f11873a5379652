//! Text that was compressed with gzip, unfolded as it is read and never further than the limit of memory.
//!
//! Deflate unfolds a byte to a thousand. What is in a table is counted where it is put together; blank lines, remarks and
//! long texts are not, so that the bytes themselves are counted here.

use std::error::Error;
use std::fmt;
use std::io::{self, BufReader, Read};

use flate2::bufread::MultiGzDecoder;

use super::memory;

/// Whether bytes begin a file that gzip wrote.
pub(super) fn is_one(head: &[u8]) -> bool {
    head.starts_with(&[0x1f, 0x8b])
}

/// Why no more is unfolded; travels within an [`io::Error`] to where the file has a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Stopped {
    /// As many bytes came out as may be held.
    TooLarge,
    /// What is compressed is cut off or changed.
    Damaged(String),
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLarge => f.write_str("it unfolds to more than is allowed"),
            Self::Damaged(what) => f.write_str(what),
        }
    }
}

impl Error for Stopped {}

/// A reader of what is in a gzip file.
pub(super) struct Unfolding<R: Read> {
    decoder: MultiGzDecoder<BufReader<R>>,
    left: u64,
}

impl<R: Read> Unfolding<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { decoder: MultiGzDecoder::new(BufReader::new(reader)), left: memory::memory_limit() }
    }
}

impl<R: Read> Read for Unfolding<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 && !buffer.is_empty() {
            return Err(io::Error::other(Stopped::TooLarge));
        }
        let room = usize::try_from(self.left).unwrap_or(usize::MAX).min(buffer.len());
        let count = self.decoder.read(&mut buffer[..room]).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => io::Error::other(Stopped::Damaged("it is cut off".to_owned())),
            io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
                io::Error::other(Stopped::Damaged(error.to_string()))
            }
            _ => error,
        })?;
        self.left -= count as u64;
        Ok(count)
    }
}
