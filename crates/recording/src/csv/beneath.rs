//! What stands beneath a header: rows of numbers, or first a row of their units.

use super::cell::{self, Cell, Decimal};
use super::head::{Head, split};
use crate::channel::Channel;
use crate::layout::Field;
use crate::stamp::Stamp;
use crate::units;

/// The units of channels, where a line holds them: no number where one belongs, and a word in one of these places at
/// least. A line that was written as a remark is one of units where nothing but units stands in it.
pub(super) fn units(head: &Head, line: &[u8]) -> Option<Vec<(Channel, String)>> {
    let text = line.trim_ascii();
    let (text, is_remark) = match text {
        [b'#' | b'%', rest @ ..] => (rest, true),
        // a tab may separate an empty field
        _ => (line, false),
    };
    let record = split(text, head.separator).filter(|record| !record.has_stray_quote)?;
    if !(1..=head.layout.fields.len()).contains(&record.len()) || record.len() + 1 < head.layout.fields.len() {
        return None;
    }
    let mut found = vec![];
    for (field, content) in head.layout.fields.iter().zip(record.fields()) {
        let Field::Number(at) = *field else { continue };
        let channel = head.layout.channels[at];
        if is_number(content) {
            return None;
        }
        let unit = in_letters(content);
        let unit = units::bare(&unit);
        // nanoamperes, and no value that is "not available"
        let is_missing = cell::read(content, Decimal::Point) == Cell::Missing && unit != "nA";
        if is_missing || unit.chars().all(|c| c == '-') {
            continue;
        }
        if is_remark && units::conversion(channel, unit).is_none() {
            return None;
        }
        found.push((channel, unit.to_owned()));
    }
    (!found.is_empty()).then_some(found)
}

/// Whether the first of these lines is of names and the next, or the one after a row of units, of numbers.
pub(super) fn stands_above_numbers(lines: &[Vec<u8>], separator: u8) -> bool {
    let Some((names, beneath)) = lines.split_first() else { return false };
    let Some(names) = split(names, separator).filter(|names| !names.has_stray_quote) else { return false };
    if names.fields().any(is_number) || names.fields().filter(|name| !name.is_empty()).count() < 2 {
        return false;
    }
    let filled = beneath.iter().filter(|line| !line.trim_ascii().is_empty());
    for line in filled.take(2) {
        let Some(row) = split(line, separator).filter(|row| row.len().abs_diff(names.len()) <= 1) else { return false };
        let numbers = row.fields().filter(|field| is_number(field)).count();
        if numbers > 0 {
            return numbers >= 2 && 2 * numbers >= row.len();
        }
    }
    false
}

/// Whether a cell has a number, whatever its decimal mark, or a date.
fn is_number(content: &[u8]) -> bool {
    let with = |decimal| matches!(cell::read(content, decimal), Cell::Number(_));
    with(Decimal::Point) || with(Decimal::Comma) || Stamp::of(content).is_some()
}

/// A text that may be older than UTF-8: a degree sign is then a byte of its own.
fn in_letters(content: &[u8]) -> String {
    std::str::from_utf8(content).map_or_else(|_| content.iter().map(|&byte| char::from(byte)).collect(), str::to_owned)
}
