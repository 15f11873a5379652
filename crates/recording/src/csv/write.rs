//! CSV out: comma, LF, a header, numbers in the shortest form that reads back as the same number, NaN as an empty cell.
//!
//! Writes the columns in the order of the file they came from, unknown ones included. It has no other dialect. A row of units
//! follows the header only where a column would otherwise be taken for one in another unit (`stated.rs`).

use std::io::{self, Write};

use rayon::prelude::*;

use crate::{Outlet, Recording};

/// Rows that one thread formats at a time.
const ROWS: usize = 16 << 10;
/// Pieces that are formatted before they are written.
const PIECES: usize = 16;

impl Recording {
    /// Writes the recording as CSV. Read back, it has the same columns in the same order, bit for bit.
    ///
    /// # Errors
    /// What the writer says, or [`io::ErrorKind::InvalidInput`] for a column without one value a row.
    pub fn write_csv(&self, mut writer: impl Write) -> io::Result<()> {
        let outlets = self.even_outlets()?;
        let mut head = vec![];
        for (at, (name, _)) in outlets.iter().enumerate() {
            if at > 0 {
                head.push(b',');
            }
            push_text(&mut head, name, at == 0);
        }
        head.push(b'\n');
        if let Some(units) = self.stated_units(&outlets) {
            for (at, unit) in units.into_iter().enumerate() {
                if at > 0 {
                    head.push(b',');
                }
                push_text(&mut head, unit, at == 0);
            }
            head.push(b'\n');
        }
        writer.write_all(&head)?;
        let columns: Vec<Outlet<'_>> = outlets.into_iter().map(|(_, outlet)| outlet).collect();
        for batch in (0..self.len()).step_by(ROWS * PIECES) {
            let starts: Vec<usize> = (batch..self.len().min(batch + ROWS * PIECES)).step_by(ROWS).collect();
            let texts: Vec<Vec<u8>> = starts
                .into_par_iter()
                .map(|start| {
                    let mut text = Vec::with_capacity(ROWS * columns.len() * 10);
                    for row in start..self.len().min(start + ROWS) {
                        push_row(&mut text, &columns, row);
                    }
                    text
                })
                .collect();
            for text in texts {
                writer.write_all(&text)?;
            }
        }
        writer.flush()
    }
}

fn push_row(text: &mut Vec<u8>, columns: &[Outlet<'_>], row: usize) {
    for (at, column) in columns.iter().enumerate() {
        if at > 0 {
            text.push(b',');
        }
        match column {
            Outlet::Numbers(values) => push_number(text, values[row]),
            Outlet::Texts(cells) => push_text(text, cells.get(row).unwrap_or_default(), false),
        }
    }
    text.push(b'\n');
}

fn push_number(text: &mut Vec<u8>, value: f64) {
    if !value.is_finite() {
        return;
    }
    let size = value.abs();
    let is_plain = size == 0.0 || (1e-5..1e16).contains(&size);
    // Writing to memory does not fail.
    let _ = if is_plain { write!(text, "{value}") } else { write!(text, "{value:e}") };
}

/// A name or a cell, in quotes where it would be read as something else without.
fn push_text(text: &mut Vec<u8>, cell: &str, is_first: bool) {
    let is_read_otherwise = |byte: u8| matches!(byte, b',' | b';' | b'\t' | b'"' | b'\n' | b'\r');
    let is_head = is_first && (cell.starts_with(['#', '%']) || cell.to_ascii_lowercase().starts_with("sep="));
    if !is_head && !cell.bytes().any(is_read_otherwise) && cell.trim() == cell {
        text.extend_from_slice(cell.as_bytes());
        return;
    }
    text.push(b'"');
    text.extend_from_slice(cell.replace('"', "\"\"").as_bytes());
    text.push(b'"');
}
