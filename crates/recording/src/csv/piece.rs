//! The rows of a piece of text, on their way into the table: values column by column, lines counted from the piece's first.
//!
//! Judges one row at a time: its number of fields, and each cell. Which row is the last of the file is known later, so a
//! row that is too short is held back here and judged in `assembly.rs`.

use super::cell::{self, Cell, Decimal};
use crate::channel::Channel;
use crate::layout::{Field, Layout};
use crate::stamp::{self, Stamp};
use crate::table::Missing;
use crate::unknown::Cells;

/// How to read the rows of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dialect<'a> {
    pub(super) layout: &'a Layout,
    pub(super) separator: u8,
    pub(super) decimal: Decimal,
    /// The first time, where times are written as dates.
    pub(super) first: Option<Stamp>,
}

impl Dialect<'_> {
    /// A cell of a channel, by its place in the layout; where it is neither a number nor missing, what it should be.
    fn cell(&self, at: usize, content: &[u8]) -> Result<Option<f64>, &'static str> {
        let is_time = self.layout.channels.get(at) == Some(&Channel::Time);
        let read = match self.first.filter(|_| is_time).map(|first| first.seconds_to(content)) {
            Some(Some(seconds)) => Cell::Number(seconds),
            Some(None) if !matches!(cell::read(content, self.decimal), Cell::Missing) => Cell::Text,
            _ => cell::read(content, self.decimal),
        };
        match read {
            Cell::Number(value) => Ok(Some(value)),
            Cell::Missing => Ok(None),
            Cell::Text if is_time => Err(self.first.map_or(stamp::WANTED, Stamp::wanted)),
            Cell::Text => Err(self.decimal.wanted()),
        }
    }
}

/// What is wrong with a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    FieldCount { line: u64, found: usize },
    Cell { line: u64, column: usize, text: String, wanted: &'static str },
}

/// A row that is cut off, or would be were it the last of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Short {
    pub(super) line: u64,
    pub(super) fields: usize,
}

/// Rows read from a piece of text. All lines are relative to the first line of the piece.
#[derive(Debug, Default)]
pub(super) struct Piece {
    values: Vec<f64>,
    stride: usize,
    pub(super) rows: usize,
    pub(super) texts: Vec<Cells>,
    pub(super) missing: Vec<Missing>,
    /// (row, its line), where a row does not stand on the line after the row before it (the first: on line 0).
    pub(super) jumps: Vec<(usize, u64)>,
    /// Lines in the piece.
    pub(super) lines: u64,
    pub(super) blank_lines: u64,
    pub(super) first_blank: Option<u64>,
    /// The line after that of the last row.
    following: u64,
    pub(super) short: Option<Short>,
    /// Line of the last row, where that line has no end.
    pub(super) unterminated: Option<u64>,
    pub(super) fault: Option<Fault>,
}

impl Piece {
    /// Empties it and makes room for so many rows.
    pub(super) fn reset(&mut self, layout: &Layout, capacity: usize) {
        let wanted = capacity * layout.channels.len();
        if self.values.len() < wanted {
            // Fresh zeros cost nothing until they are touched; growing would touch and copy them.
            self.values = vec![0.0; wanted + wanted / 8];
        }
        self.stride = capacity;
        self.texts.resize_with(layout.unknown.len(), Cells::default);
        self.texts.iter_mut().for_each(Cells::clear);
        self.missing.clear();
        self.missing.resize(layout.channels.len(), Missing::default());
        self.jumps.clear();
        (self.rows, self.lines, self.blank_lines, self.following) = (0, 0, 0, 0);
        (self.first_blank, self.short, self.unterminated, self.fault) = (None, None, None, None);
    }

    /// The values of a channel, by its place in the layout.
    pub(super) fn column(&self, at: usize) -> &[f64] {
        &self.values[at * self.stride..][..self.rows]
    }

    /// All values and the distance from a channel's to the next channel's, for a reader that fills row [`Self::rows`].
    pub(super) fn slots(&mut self) -> (&mut [f64], usize, &mut [Cells]) {
        (&mut self.values, self.stride, &mut self.texts)
    }

    /// Counts the row whose values are in place.
    #[inline]
    pub(super) fn commit(&mut self, line: u64) {
        if line != self.following {
            self.jumps.push((self.rows, line));
        }
        self.following = line + 1;
        self.rows += 1;
    }

    /// Counts a line with nothing on it.
    pub(super) fn add_blank(&mut self, line: u64) {
        self.blank_lines += 1;
        self.first_blank.get_or_insert(line);
    }

    /// Adds a row of fields without their quotes; on a fault, notes it and adds nothing.
    pub(super) fn add<'f>(
        &mut self,
        dialect: &Dialect<'_>,
        fields: impl Iterator<Item = &'f [u8]> + Clone,
        line: u64,
        is_terminated: bool,
    ) {
        if let Some(short) = self.short.take() {
            self.fault = Some(Fault::FieldCount { line: short.line, found: short.fields });
            return;
        }
        let (mut found, expected) = (fields.clone().count(), dialect.layout.fields.len());
        let padding: &[&[u8]] = if dialect.layout.is_last_optional && found + 1 == expected { &[b""] } else { &[] };
        let fields = fields.chain(padding.iter().copied());
        found += padding.len();
        if found < expected {
            self.short = Some(Short { line, fields: found });
            return;
        }
        if found > expected {
            self.fault = Some(Fault::FieldCount { line, found });
            return;
        }
        if !is_terminated && padding.is_empty() && fields.clone().last().is_some_and(|last| is_cut_off(dialect, last)) {
            self.short = Some(Short { line, fields: found });
            return;
        }
        let row = self.rows;
        for (column, (field, content)) in dialect.layout.fields.iter().zip(fields).enumerate() {
            let refused = match *field {
                Field::Number(at) => {
                    let read = dialect.cell(at, content);
                    self.values[at * self.stride + row] = read.ok().flatten().unwrap_or(f64::NAN);
                    if read == Ok(None) {
                        self.missing[at].add(row);
                    }
                    read.err()
                }
                Field::Text(at) => match std::str::from_utf8(content) {
                    Ok(text) => {
                        self.texts[at].push(text);
                        None
                    }
                    Err(_) => Some("text in UTF-8"),
                },
            };
            if let Some(wanted) = refused {
                let text = shortened(content);
                self.fault = Some(Fault::Cell { line, column, text, wanted });
                return;
            }
        }
        if !is_terminated {
            self.unterminated = Some(line);
        }
        self.commit(line);
    }
}

/// Whether the last field of a line without an end is one that was cut off: nothing, or not yet a number.
fn is_cut_off(dialect: &Dialect<'_>, last: &[u8]) -> bool {
    match dialect.layout.fields.last() {
        Some(Field::Number(at)) => !matches!(dialect.cell(*at, last), Ok(Some(_))),
        _ => last.is_empty(),
    }
}

fn shortened(content: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(content);
    let mut short: String = text.chars().take(LONGEST).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}
