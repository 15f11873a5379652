//! Pieces put together into a table, in the order of the file: lines become absolute, faults get their names.
//!
//! No text is read here.

use std::path::Path;

use rayon::prelude::*;

use super::piece::{Dialect, Fault, Piece, Short};
use crate::error::{Place, ReadError};
use crate::memory::{self, PER_TEXT};
use crate::table::{Places, Table};

/// A table that grows piece by piece.
#[derive(Debug)]
pub(super) struct Assembly<'a> {
    table: Table,
    source: &'a Path,
    dialect: Dialect<'a>,
    /// Line of the first line of the next piece.
    next_line: u64,
    /// The line after that of the last row.
    following: u64,
    /// A row that is too short unless it is the last.
    short: Option<Short>,
}

impl<'a> Assembly<'a> {
    pub(super) fn new(dialect: Dialect<'a>, source: &'a Path, header_line: u64, first_line: u64) -> Self {
        let places = Places::Lines(vec![(0, first_line)]);
        let table = Table::new(dialect.layout, Place::Line(header_line), places);
        Self { table, source, dialect, next_line: first_line, following: first_line, short: None }
    }

    /// Line of the first line that is not yet in the table.
    pub(super) const fn next_line(&self) -> u64 {
        self.next_line
    }

    /// Makes room for so many rows in all, as far as there is memory for it.
    pub(super) fn expect_rows(&mut self, rows: usize) {
        for column in &mut self.table.numbers {
            let more = rows.saturating_sub(column.values.len());
            // Without room now the columns grow as they need it.
            let _ = column.values.try_reserve_exact(more);
        }
    }

    /// Adds the rows of pieces that follow each other.
    pub(super) fn append(&mut self, pieces: &[Piece]) -> Result<(), ReadError> {
        for piece in pieces {
            self.append_places(piece)?;
        }
        self.table.numbers.par_iter_mut().enumerate().for_each(|(at, column)| {
            for piece in pieces {
                column.values.extend_from_slice(piece.column(at));
            }
        });
        self.table.unknown.par_iter_mut().enumerate().for_each(|(at, column)| {
            for piece in pieces {
                column.cells.append(&piece.texts[at]);
            }
        });
        Ok(())
    }

    fn append_places(&mut self, piece: &Piece) -> Result<(), ReadError> {
        let first_line = self.next_line;
        let has_more = piece.rows > 0 || piece.short.is_some() || piece.fault.is_some();
        if let Some(short) = self.short.filter(|_| has_more) {
            return Err(self.refuse(&Fault::FieldCount { line: short.line, found: short.fields }, 0));
        }
        if let Some(fault) = &piece.fault {
            return Err(self.refuse(fault, first_line));
        }
        if let Some(short) = piece.short {
            self.short = Some(Short { line: short.line + first_line, ..short });
        }
        if let (Places::Lines(jumps), true) = (&mut self.table.places, piece.rows > 0) {
            let rows = self.table.rows;
            if piece.jumps.first().is_none_or(|&(row, _)| row > 0) && first_line != self.following {
                jumps.push((rows, first_line));
            }
            jumps.extend(piece.jumps.iter().map(|&(row, line)| (row + rows, line + first_line)));
            let (row, line) = piece.jumps.last().copied().unwrap_or_default();
            self.following = first_line + line + (piece.rows - row) as u64;
        }
        for (column, &missing) in self.table.numbers.iter_mut().zip(&piece.missing) {
            column.missing.append(missing, self.table.rows);
        }
        if let Some(blank) = piece.first_blank {
            self.table.blank_lines.first.get_or_insert(Place::Line(blank + first_line));
            self.table.blank_lines.count += piece.blank_lines;
        }
        let row = 2 * 8 * self.table.numbers.len() + PER_TEXT as usize * self.table.unknown.len();
        memory::allow((self.table.rows + piece.rows) as u64 * row as u64, "the rows so far", self.source)?;
        self.table.unterminated = piece.unterminated.map(|line| Place::Line(line + first_line));
        self.table.rows += piece.rows;
        self.next_line += piece.lines;
        Ok(())
    }

    /// The table; a short row at the end was cut off.
    pub(super) fn finish(mut self) -> Table {
        self.table.truncated = self.short.map(|short| Place::Line(short.line));
        self.table
    }

    fn refuse(&self, fault: &Fault, first_line: u64) -> ReadError {
        let path = self.source.to_path_buf();
        let layout = self.dialect.layout;
        match *fault {
            Fault::FieldCount { line, found } => {
                let place = Place::Line(line + first_line);
                ReadError::FieldCount { path, place, found, expected: layout.fields.len() }
            }
            Fault::Cell { line, column, ref text, wanted } => ReadError::Cell {
                path,
                place: Place::Line(line + first_line),
                number: column + 1,
                column: layout.names[column].clone(),
                text: text.clone(),
                wanted,
            },
        }
    }
}
