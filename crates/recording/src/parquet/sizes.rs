//! What the columns of a Parquet file will take, from its own words, before the decoder believes them.
//!
//! The decoder allocates what the header of a page says before it looks at the page. A page is part of its column's chunk,
//! so it may not be larger than that, nor hold more values.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};

use crate::error::ReadError;
use crate::memory::{self, HELD, PER_TEXT};

/// Bytes within which the header of a page ends.
const LONGEST_HEADER: u64 = 64 << 10;
/// Structures within structures that a header may have; a footer has ten.
const DEEPEST: usize = 16;
/// A structure, as Thrift numbers its types.
const STRUCTURE: u8 = 12;

/// Bytes at the end of a file: the length of its footer, and the name of the format.
const END: u64 = 8;

/// Refuses a file whose footer holds a list or a map that is no structure's of Parquet and that a decoder would go through for as
/// long as it says it is: the decoder takes no byte for a boolean, so that four bytes are two thousand million of them.
pub(super) fn check_footer(file: &mut File, source: &Path) -> Result<(), ReadError> {
    let io = |error| ReadError::io(source, error);
    let length = file.metadata().map_err(io)?.len();
    let Some(before) = length.checked_sub(END) else { return Ok(()) };
    let mut end = [0; END as usize];
    file.seek(SeekFrom::Start(before)).map_err(io)?;
    file.read_exact(&mut end).map_err(io)?;
    let [a, b, c, d, name @ ..] = end;
    let footer = u64::from(u32::from_le_bytes([a, b, c, d]));
    if name != *b"PAR1" || footer > before {
        return Ok(());
    }
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(before - footer)).map_err(io)?;
    file.take(footer).read_to_end(&mut bytes).map_err(io)?;
    let read = Thrift { bytes: &bytes, at: 0 }.skip(STRUCTURE, 0);
    read.ok_or_else(|| ReadError::Parquet { path: source.to_path_buf(), what: "its footer is damaged".into() })
}

/// Refuses columns that would take too much, and pages that contradict their columns.
pub(super) fn check(
    groups: &[RowGroupMetaData],
    kept: &[usize],
    is_text: &[bool],
    mut file: File,
    source: &Path,
) -> Result<(), ReadError> {
    let length = file.metadata().map_err(|error| ReadError::io(source, error))?.len();
    let damaged = |what: String| ReadError::Parquet { path: source.to_path_buf(), what };
    // chunks are unfolded one after the other
    let (mut needed, mut chunk_bytes) = (0_u64, 0_u64);
    for group in groups {
        let rows = u64::try_from(group.num_rows()).map_err(|_| damaged("the file is damaged".into()))?;
        for (&at, &is_text) in kept.iter().zip(is_text) {
            let Some(chunk) = group.columns().get(at) else { return Err(damaged("the file is damaged".into())) };
            let stated = u64::try_from(chunk.uncompressed_size()).unwrap_or(u64::MAX);
            // dictionaries are unfolded: a text is at most the longest of them, which the chunk holds
            let row = if is_text { PER_TEXT } else { HELD };
            needed = rows.saturating_mul(row).saturating_add(needed);
            chunk_bytes = stated.max(chunk_bytes);
        }
    }
    memory::allow(needed.saturating_add(chunk_bytes.saturating_mul(2)), "its columns", source)?;
    for group in groups {
        for chunk in kept.iter().filter_map(|&at| group.columns().get(at)) {
            pages(chunk, group.num_rows(), &mut file, length)
                .map_err(|what| damaged(format!("column `{}`: {what}", chunk.column_path().string())))?;
        }
    }
    Ok(())
}

/// Goes through the headers of a chunk's pages.
fn pages(chunk: &ColumnChunkMetaData, rows: i64, file: &mut File, length: u64) -> Result<(), &'static str> {
    const DAMAGED: &str = "the file is damaged";
    let (start, bytes) = chunk.byte_range();
    let end = start.checked_add(bytes).filter(|end| *end <= length).ok_or("its end is beyond the file's")?;
    let (mut at, mut values, mut unfolded) = (start, 0_i64, 0_i64);
    while at < end {
        let mut head = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(|_| DAMAGED)?;
        file.take(LONGEST_HEADER.min(end - at)).read_to_end(&mut head).map_err(|_| DAMAGED)?;
        let mut reader = Thrift { bytes: &head, at: 0 };
        let page = reader.page().ok_or(DAMAGED)?;
        unfolded = unfolded.saturating_add(page.uncompressed);
        if page.compressed < 0 || page.uncompressed < 0 || unfolded > chunk.uncompressed_size() {
            return Err("a page is larger than its column");
        }
        if page.is_dictionary {
            // of a dictionary, every value takes a bit at least
            if page.values < 0 || page.values / 8 > page.uncompressed {
                return Err("a dictionary is larger than its page");
            }
        } else {
            values = values.saturating_add(page.values);
        }
        if page.values < 0 || values > rows {
            return Err("its pages hold more rows than it says");
        }
        let skipped = u64::try_from(page.compressed).map_err(|_| DAMAGED)?;
        at = at.saturating_add(reader.at as u64).saturating_add(skipped);
    }
    Ok(())
}

/// What the header of a page says.
#[derive(Default)]
struct Page {
    uncompressed: i64,
    compressed: i64,
    values: i64,
    is_dictionary: bool,
}

/// A reader of Thrift's compact protocol, as far as footers and headers of pages need it.
struct Thrift<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Thrift<'_> {
    fn page(&mut self) -> Option<Page> {
        let mut page = Page::default();
        let mut id = 0;
        while let Some(kind) = self.field(&mut id)? {
            match (id, kind) {
                (2, 5) => page.uncompressed = self.integer()?,
                (3, 5) => page.compressed = self.integer()?,
                // data, dictionary, data of version 2: the number of values is the first in each
                (5 | 7 | 8, STRUCTURE) => {
                    page.is_dictionary = id == 7;
                    page.values = self.first_integer()?;
                }
                _ => self.skip(kind, 0)?,
            }
        }
        Some(page)
    }

    /// The first field of a structure, an integer.
    fn first_integer(&mut self) -> Option<i64> {
        let (mut id, mut first) = (0, None);
        while let Some(kind) = self.field(&mut id)? {
            if (id, kind) == (1, 5) { first = Some(self.integer()?) } else { self.skip(kind, 0)? }
        }
        first
    }

    /// Type of the next field, whose number is put into `id`; `Some(None)` at the end of the structure.
    fn field(&mut self, id: &mut i64) -> Option<Option<u8>> {
        let byte = self.byte()?;
        if byte == 0 {
            return Some(None);
        }
        *id = if byte >> 4 == 0 { self.integer()? } else { id.checked_add(i64::from(byte >> 4))? };
        Some(Some(byte & 0x0f))
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(bytes).ok()?).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            1 | 2 => Some(()),
            3 => self.pass(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.pass(8),
            8 => self.varint().and_then(|length| self.pass(length)),
            9 | 10 if depth < DEEPEST => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                match head & 0x0f {
                    // no structure of Parquet that is read has booleans in a list
                    1 | 2 if count > 0 => None,
                    kind => (0..count).try_for_each(|_| self.skip(kind, depth + 1)),
                }
            }
            STRUCTURE if depth < DEEPEST => {
                let mut id = 0;
                while let Some(kind) = self.field(&mut id)? {
                    self.skip(kind, depth + 1)?;
                }
                Some(())
            }
            _ => None,
        }
    }
}
