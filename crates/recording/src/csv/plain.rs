//! The rows of a text without quotes: the fast way for plain numbers, the exact way for each row that is not plain.
//!
//! Quotes are not understood here; a text that has them goes to `record.rs`.

use std::ops::Range;

use super::cell::{self, Decimal};
use super::digits::plain_number;
use super::piece::{Dialect, Piece};
use crate::layout::Field;
use crate::stamp::Stamp;

/// Reads the whole lines of `text[range]` into a piece. What is behind the range is looked at and not used.
///
/// `is_terminated` is false where the end of the last line is not in the file.
pub(super) fn read(dialect: &Dialect<'_>, text: &[u8], range: Range<usize>, is_terminated: bool, piece: &mut Piece) {
    // A row has as many bytes as fields at least: separators and the line end.
    piece.reset(dialect.layout, range.len() / dialect.layout.fields.len() + 1);
    let (mut at, end) = (range.start, range.end);
    while at < end && piece.fault.is_none() {
        let line = piece.lines;
        let ends_text = |next: usize| next >= end && !is_terminated;
        let may_be_plain = piece.short.is_none() && dialect.first.is_none();
        let plain = if may_be_plain { plain_row(dialect, text, at, end, piece) } else { None };
        if let Some(next) = plain.filter(|&next| !ends_text(next)) {
            piece.commit(line);
            at = next;
        } else {
            let row = piece.rows;
            piece.texts.iter_mut().for_each(|cells| cells.truncate(row));
            let next = memchr::memchr(b'\n', &text[at..end]).map_or(end, |length| at + length + 1);
            exact_row(dialect, &text[at..next], line, !ends_text(next), piece);
            at = next;
        }
        piece.lines += 1;
    }
}

/// Reads the row that starts at `start` if it is plain: gives the index behind its line end.
#[inline]
fn plain_row(dialect: &Dialect<'_>, text: &[u8], start: usize, end: usize, piece: &mut Piece) -> Option<usize> {
    let row = piece.rows;
    let (values, stride, texts) = piece.slots();
    let mark = dialect.decimal.byte();
    let separator = dialect.separator;
    let mut at = start;
    let (last, others) = dialect.layout.fields.split_last()?;
    for field in others {
        match *field {
            Field::Number(column) => {
                let (value, next) = plain_number(text, at, mark)?;
                if *text.get(next)? != separator {
                    return None;
                }
                *values.get_mut(column * stride + row)? = value;
                at = next + 1;
            }
            Field::Text(column) => {
                let length = memchr::memchr2(separator, b'\n', &text[at..end])?;
                if text[at + length] != separator {
                    return None;
                }
                texts[column].push(plain_text(&text[at..at + length])?);
                at += length + 1;
            }
        }
    }
    match *last {
        Field::Number(column) => {
            let (value, next) = plain_number(text, at, mark)?;
            *values.get_mut(column * stride + row)? = value;
            at = next;
            if *text.get(at)? == b'\r' {
                at += 1;
            }
            (*text.get(at)? == b'\n').then_some(at + 1)
        }
        Field::Text(column) => {
            let length = memchr::memchr2(separator, b'\n', &text[at..end])?;
            if text[at + length] != b'\n' {
                return None;
            }
            texts[column].push(plain_text(&text[at..at + length])?);
            Some(at + length + 1)
        }
    }
}

fn plain_text(cell: &[u8]) -> Option<&str> {
    std::str::from_utf8(cell::trim(cell)).ok()
}

fn exact_row(dialect: &Dialect<'_>, line: &[u8], number: u64, is_terminated: bool, piece: &mut Piece) {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let separator = dialect.separator;
    if line.iter().all(|&byte| byte.is_ascii_whitespace() && byte != separator) {
        piece.add_blank(number);
        return;
    }
    let fields = line.split(|&byte| byte == separator).map(cell::trim);
    if is_comment(dialect, fields.clone().next()) {
        piece.add_blank(number);
        return;
    }
    piece.add(dialect, fields, number, is_terminated);
}

/// Whether a line is a remark among the rows: it begins with `#` or `%` where a number should be.
pub(super) fn is_comment(dialect: &Dialect<'_>, first: Option<&[u8]>) -> bool {
    let wants_number = matches!(dialect.layout.fields.first(), Some(Field::Number(_)));
    wants_number && first.is_some_and(|cell| matches!(cell.first(), Some(b'#' | b'%')))
}

/// The decimal mark of a row, if the row tells it: the first mark in a cell of numbers.
pub(super) fn decimal_mark<'f>(dialect: &Dialect<'_>, fields: impl Iterator<Item = &'f [u8]>) -> Option<Decimal> {
    let is_number = |field: &Field, cell: &[u8]| matches!(field, Field::Number(_)) && Stamp::of(cell).is_none();
    dialect.layout.fields.iter().zip(fields).filter(|(field, cell)| is_number(field, cell)).find_map(|(_, cell)| {
        let mark = cell.iter().find(|byte| matches!(byte, b'.' | b','))?;
        Some(if *mark == b',' { Decimal::Comma } else { Decimal::Point })
    })
}
