//! CSV in: the head, then blocks of whole lines, cut into pieces that are read in parallel and put together in order.
//!
//! The file is never in memory as a whole: one block is read while the one before it is parsed and the one before that is
//! appended. From the first block on that has a quote, records are read one by one, exactly.

mod assembly;
mod beneath;
mod blocks;
pub(crate) mod cell;
mod digits;
mod head;
mod piece;
mod plain;
mod preamble;
mod record;
mod write;

use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

use rayon::prelude::*;

use self::assembly::Assembly;
use self::blocks::{Block, BlockError, Blocks, LONGEST_LINE};
use self::cell::{Cell, Decimal};
use self::piece::{Dialect, Piece};
use self::record::{Record, RecordError, Records};
use super::Recording;
use super::admission;
use super::channel::Channel;
use super::error::ReadError;
use super::layout::Field;
use super::naming::Naming;
use super::table::{Missing, Table};
use crate::stamp::Stamp;

/// How much text is taken at a time.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    /// Bytes that are read at a time.
    block: usize,
    /// Bytes that one thread parses at a time.
    piece: usize,
    /// Records that are read before they are appended, where there are quotes.
    records: usize,
}

const SIZES: Sizes = Sizes { block: 4 << 20, piece: 256 << 10, records: 16 << 10 };

/// Reads a recording; `size` is the number of bytes, where it is known.
pub(super) fn read(
    reader: impl Read + Send,
    size: Option<u64>,
    naming: &Naming,
    source: &Path,
) -> Result<Recording, ReadError> {
    admission::admit(read_table(reader, size, naming, source, SIZES)?, naming, source)
}

/// A block and the pieces it is cut into.
#[derive(Debug, Default)]
struct Batch {
    block: Block,
    has_quotes: bool,
    pieces: Vec<Piece>,
    used: usize,
}

impl Batch {
    fn fill<R: Read>(&mut self, blocks: &mut Blocks<R>) -> Result<bool, BlockError> {
        self.used = 0;
        let is_filled = blocks.fill(&mut self.block)?;
        self.has_quotes = self.block.has_quotes();
        Ok(is_filled)
    }

    fn parse(&mut self, dialect: &Dialect<'_>, piece_bytes: usize) {
        let ends = blocks::cuts(self.block.lines(), piece_bytes);
        self.used = ends.len();
        if self.pieces.len() < self.used {
            self.pieces.resize_with(self.used, Piece::default);
        }
        let text = self.block.padded();
        let is_terminated = !self.block.unterminated;
        self.pieces[..self.used].par_iter_mut().enumerate().for_each(|(at, piece)| {
            let start = at.checked_sub(1).map_or(0, |before| ends[before]);
            plain::read(dialect, text, start..ends[at], is_terminated || at + 1 < ends.len(), piece);
        });
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.used]
    }
}

fn read_table(
    reader: impl Read + Send,
    size: Option<u64>,
    naming: &Naming,
    source: &Path,
    sizes: Sizes,
) -> Result<Table, ReadError> {
    let mut reader = BufReader::new(reader);
    let mut head = head::read(&mut reader, naming, source)?;
    let mut blocks = Blocks::new(Cursor::new(std::mem::take(&mut head.read_ahead)).chain(reader), sizes.block);
    let mut dialect = Dialect { layout: &head.layout, separator: head.separator, decimal: Decimal::Point, first: None };

    let [mut previous, mut current, mut next] = [(); 3].map(|()| Batch::default());
    let mut is_filled = current.fill(&mut blocks).map_err(|error| refuse_block(error, source, head.next_line))?;
    if let Some(decimal) = decimal_mark(&dialect, current.block.lines()) {
        dialect.decimal = decimal;
    }
    dialect.first = first_stamp(&dialect, current.block.lines());
    if dialect.first.is_some() {
        let units = &mut head.units;
        units.retain(|(channel, _)| *channel != Channel::Time);
        units.push((Channel::Time, "s".to_owned()));
        if naming.factor(Channel::Time).is_some_and(|factor| factor != 1.0) {
            return Err(ReadError::Header {
                path: source.to_path_buf(),
                line: head.header_line,
                what: "the times below it are dates, and the mapping of `t_s` has a factor".to_owned(),
                wanted: "the mapping without a factor",
            });
        }
    }
    let mut assembly = Assembly::new(dialect, source, head.header_line, head.next_line);
    let mut bytes_parsed = 0;
    while is_filled && !current.has_quotes {
        let (appended, (filled, ())) = rayon::join(
            || assembly.append(previous.pieces()),
            || rayon::join(|| next.fill(&mut blocks), || current.parse(&dialect, sizes.piece)),
        );
        appended?;
        if bytes_parsed == 0 {
            let rows: usize = current.pieces().iter().map(|piece| piece.rows).sum();
            expect_rows(&mut assembly, rows, current.block.lines().len(), size);
        }
        bytes_parsed += current.block.lines().len();
        if let Err(error) = filled {
            assembly.append(current.pieces())?;
            return Err(refuse_block(error, source, assembly.next_line()));
        }
        is_filled = filled.unwrap_or(false);
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
    assembly.append(previous.pieces())?;
    if is_filled {
        let (carry, rest) = blocks.into_rest();
        let text = Cursor::new(current.block.lines_as_read()).chain(Cursor::new(carry)).chain(BufReader::new(rest));
        read_records(text, &dialect, &mut assembly, source, sizes)?;
    }
    let mut table = assembly.finish();
    if let Some(first) = dialect.first {
        let times = table.numbers.iter_mut().filter(|column| column.channel == Channel::Time);
        head.warnings.extend(times.map(|column| first.over_midnights(&mut column.values)));
    }
    (table.units, table.warnings) = (head.units.clone(), head.warnings.clone());
    if let Some(even) = head.even_times {
        fill_times(&mut table, even);
    }
    Ok(table)
}

/// Counts the times of a column that the file leaves empty.
fn fill_times(table: &mut Table, (first, step): (f64, f64)) {
    let rows = table.rows as u64;
    for column in table.numbers.iter_mut().filter(|c| c.channel == Channel::Time && c.missing.count == rows) {
        column.values.iter_mut().enumerate().for_each(|(row, t)| *t = first + row as f64 * step);
        column.missing = Missing::default();
        table.warnings.push(format!("X_Columns is No: `t_s` is counted from {first} in steps of {step}"));
    }
}

/// Makes room for the rows of a whole file, told by its first block.
fn expect_rows(assembly: &mut Assembly<'_>, rows: usize, bytes: usize, size: Option<u64>) {
    let Some(size) = size.and_then(|size| usize::try_from(size).ok()).filter(|&size| size > bytes && bytes > 0) else {
        return;
    };
    assembly.expect_rows((size as f64 / bytes as f64 * rows as f64 * 1.03) as usize);
}

/// The decimal mark of a text: told by the first number that has one, where the separator is not a comma itself.
fn decimal_mark(dialect: &Dialect<'_>, lines: &[u8]) -> Option<Decimal> {
    if dialect.separator == b',' {
        return None;
    }
    let mut records = Records::new(lines, dialect.separator, 1);
    let mut record = Record::default();
    while records.read(&mut record).ok()? {
        let mark = plain::decimal_mark(dialect, record.fields());
        if mark.is_some() {
            return mark;
        }
    }
    None
}

/// The first time of a text, where it is a date.
fn first_stamp(dialect: &Dialect<'_>, lines: &[u8]) -> Option<Stamp> {
    let is_time = |field: &Field| matches!(*field, Field::Number(at) if dialect.layout.channels[at] == Channel::Time);
    let column = dialect.layout.fields.iter().position(is_time)?;
    let mut records = Records::new(lines, dialect.separator, 1);
    let mut record = Record::default();
    while records.read(&mut record).ok()? {
        let cell = record.fields().nth(column).map(|cell| (cell, cell::read(cell, dialect.decimal)));
        match cell.filter(|_| !record.is_blank && !plain::is_comment(dialect, record.fields().next())) {
            None | Some((_, Cell::Missing)) => {}
            Some((cell, _)) => return Stamp::of(cell),
        }
    }
    None
}

/// Reads what has quotes, record by record.
fn read_records(
    text: impl BufRead,
    dialect: &Dialect<'_>,
    assembly: &mut Assembly<'_>,
    source: &Path,
    sizes: Sizes,
) -> Result<(), ReadError> {
    let mut records = Records::new(text, dialect.separator, assembly.next_line());
    let mut record = Record::default();
    let mut piece = Piece::default();
    let mut is_read = true;
    while is_read {
        piece.reset(dialect.layout, sizes.records);
        let mut failed = None;
        while piece.rows < sizes.records && piece.fault.is_none() {
            match records.read(&mut record) {
                Ok(true) if record.is_blank || plain::is_comment(dialect, record.fields().next()) => {
                    piece.add_blank(record.line - assembly.next_line());
                }
                Ok(true) => {
                    piece.add(dialect, record.fields(), record.line - assembly.next_line(), record.is_terminated);
                }
                Ok(false) => is_read = false,
                Err(error) => failed = Some(error),
            }
            if !is_read || failed.is_some() {
                break;
            }
        }
        piece.lines = records.next_line() - assembly.next_line();
        assembly.append(std::slice::from_ref(&piece))?;
        if let Some(error) = failed {
            return Err(refuse_record(error, source));
        }
    }
    Ok(())
}

fn refuse_block(error: BlockError, source: &Path, line: u64) -> ReadError {
    match error {
        BlockError::Io(error) => ReadError::io(source, error),
        BlockError::EndlessLine => ReadError::EndlessLine { path: source.to_path_buf(), line, limit: LONGEST_LINE },
    }
}

fn refuse_record(error: RecordError, source: &Path) -> ReadError {
    let path = source.to_path_buf();
    match error {
        RecordError::Io(error) => ReadError::io(source, error),
        RecordError::EndlessLine(line) => ReadError::EndlessLine { path, line, limit: LONGEST_LINE },
        RecordError::OpenQuote(line) => {
            ReadError::Quoting { path, line, what: "a quote is opened and never closed; wanted quotes in pairs" }
        }
        RecordError::TextAfterQuote(line) => {
            let what = "text follows a closing quote; wanted a separator, or the quote doubled";
            ReadError::Quoting { path, line, what }
        }
    }
}

#[cfg(test)]
mod tests;
