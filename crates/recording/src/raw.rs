//! Raw numbers, as an oscilloscope or a streaming converter saves them: little-endian, all channels of a row, then the next row.
//! Nothing in such a file says what it is, so that the campaign does.
//!
//! Columns that are no channel are left out. What is left over of a last row is a cut-off row, as in text.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::Recording;
use super::admission;
use super::channel::Channel;
use super::error::{Place, ReadError};
use super::layout::Layout;
use super::memory;
use super::naming::Naming;
use super::table::{Places, Table};

/// What a campaign says of a raw file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raw {
    /// names of the columns, in their order
    pub(super) columns: Vec<String>,
    pub(super) number: Number,
    /// rows a second
    pub(super) sample_hz: f64,
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    /// integer of 16 bits
    I16,
    /// integer of 32 bits
    I32,
    /// floating point of 32 bits
    F32,
    /// floating point of 64 bits
    F64,
}

impl Number {
    /// The names that a campaign file calls them by.
    pub(super) const NAMES: [(&str, Self); 4] =
        [("i16", Self::I16), ("i32", Self::I32), ("f32", Self::F32), ("f64", Self::F64)];

    const fn bytes(self) -> usize {
        match self {
            Self::I16 => 2,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number that begins at the first of these bytes; NaN where there are too few.
    fn of(self, bytes: &[u8]) -> f64 {
        match self {
            Self::I16 => bytes.first_chunk().map(|b| f64::from(i16::from_le_bytes(*b))),
            Self::I32 => bytes.first_chunk().map(|b| f64::from(i32::from_le_bytes(*b))),
            Self::F32 => bytes.first_chunk().map(|b| f64::from(f32::from_le_bytes(*b))),
            Self::F64 => bytes.first_chunk().map(|b| f64::from_le_bytes(*b)),
        }
        .unwrap_or(f64::NAN)
    }
}

/// Bytes that are read at a time, or a row.
const BLOCK: usize = 1 << 18;

/// Reads a recording.
pub(super) fn read(path: &Path, raw: &Raw, naming: &Naming) -> Result<Recording, ReadError> {
    let io = |error| ReadError::io(path, error);
    let mut file = File::open(path).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    if metadata.is_dir() {
        return Err(ReadError::Directory { path: path.to_path_buf() });
    }
    let time = naming.column(Channel::Time).unwrap_or(Channel::Time.name());
    let kept: Vec<usize> = (0..raw.columns.len()).filter(|at| naming.channel(&raw.columns[*at]).is_some()).collect();
    let names: Vec<&str> = std::iter::once(time).chain(kept.iter().map(|at| raw.columns[*at].as_str())).collect();
    let layout = Layout::new(&names, naming, path)?;
    let row_bytes = (raw.number.bytes() * raw.columns.len()).max(1);
    let rows = usize::try_from(metadata.len()).unwrap_or(usize::MAX) / row_bytes;
    memory::allow_columns(names.len(), rows, "the file", path)?;

    let mut table = Table::new(&layout, Place::Row(0), Places::Rows);
    let left_out = raw.columns.iter().enumerate().filter(|(at, _)| !kept.contains(at));
    table.warnings = left_out.map(|(_, name)| format!("column `{name}` is no channel and is left out")).collect();
    for column in &mut table.numbers {
        // without room now the columns grow as they need it
        let _ = column.values.try_reserve_exact(rows);
    }
    let mut block = vec![0; (BLOCK / row_bytes).max(1) * row_bytes];
    loop {
        let filled = fill(&mut file, &mut block).map_err(io)?;
        let whole = filled - filled % row_bytes;
        for row in block[..whole].chunks_exact(row_bytes) {
            add(&mut table, raw, naming, &kept, row);
        }
        if filled < block.len() {
            if filled > whole {
                table.truncated = Some(Place::Row(table.rows as u64 + 1));
            }
            break;
        }
    }
    admission::admit(table, naming, path)
}

/// Adds a row.
fn add(table: &mut Table, raw: &Raw, naming: &Naming, kept: &[usize], bytes: &[u8]) {
    let at = table.rows;
    if let Some((time, values)) = table.numbers.split_first_mut() {
        // in the unit from which the mapping takes it to s
        time.values.push(at as f64 / raw.sample_hz / naming.factor(Channel::Time).unwrap_or(1.0));
        for (column, place) in values.iter_mut().zip(kept) {
            let value = raw.number.of(bytes.get(raw.number.bytes() * place..).unwrap_or_default());
            if !value.is_finite() {
                column.missing.add(at);
            }
            column.values.push(if value.is_finite() { value } else { f64::NAN });
        }
    }
    table.rows += 1;
}

/// Fills a block as far as the file goes.
fn fill(file: &mut File, block: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < block.len() {
        match file.read(&mut block[filled..]) {
            Ok(0) => break,
            Ok(more) => filled += more,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
