//! One cell as a number, a missing number or neither: exactly, whatever its form.
//!
//! The reader of plain rows has a faster way for plain numbers; it and this agree bit for bit.

/// How numbers are written in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Decimal {
    Point,
    Comma,
}

impl Decimal {
    /// The byte between the whole and the fraction.
    pub(super) const fn byte(self) -> u8 {
        match self {
            Self::Point => b'.',
            Self::Comma => b',',
        }
    }

    /// What a cell that is no number should have been.
    pub(super) const fn wanted(self) -> &'static str {
        match self {
            Self::Point => "a number, such as -1.25e-3, or empty",
            Self::Comma => "a number, such as -1,25e-3 (the numbers before it have a decimal comma), or empty",
        }
    }
}

/// What a cell says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cell {
    /// A finite number.
    Number(f64),
    /// Empty, or a word for a number that is not there, or not finite.
    Missing,
    /// Something else.
    Text,
}

const MISSING: [&str; 7] = ["na", "n/a", "#n/a", "null", "none", "-nan(ind)", "nan(ind)"];
/// What instruments write, of either sign, for what lies beyond their range.
const OVERLOAD: [&str; 7] = ["ol", "o.l", "ovl", "ovld", "overload", "overflow", "overrange"];

/// A cell without blanks at its ends.
pub(super) fn trim(cell: &[u8]) -> &[u8] {
    cell.trim_ascii()
}

/// Reads a cell.
pub(crate) fn read(cell: &[u8], decimal: Decimal) -> Cell {
    let cell = trim(cell);
    if cell.is_empty() {
        return Cell::Missing;
    }
    let parsed = match decimal {
        Decimal::Point => number(cell),
        Decimal::Comma => with_point(cell).and_then(|cell| number(&cell)),
    };
    match parsed {
        Some(value) if value.is_finite() => Cell::Number(value),
        Some(_) => Cell::Missing,
        None if says(cell, &MISSING) || says(unsigned(cell), &OVERLOAD) => Cell::Missing,
        None => Cell::Text,
    }
}

fn unsigned(cell: &[u8]) -> &[u8] {
    match cell {
        [b'+' | b'-', rest @ ..] => rest,
        _ => cell,
    }
}

fn says(cell: &[u8], words: &[&str]) -> bool {
    words.iter().any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
}

/// The number in a cell with a decimal point; NaN and infinities are numbers here.
fn number(cell: &[u8]) -> Option<f64> {
    let unsigned = match cell {
        [b'+', rest @ ..] if !matches!(rest, [b'+' | b'-', ..]) => rest,
        _ => cell,
    };
    fast_float2::parse(unsigned).ok()
}

/// A cell with its decimal comma made a point; none where it has a point already.
fn with_point(cell: &[u8]) -> Option<Vec<u8>> {
    if cell.contains(&b'.') {
        return None;
    }
    Some(cell.iter().map(|&byte| if byte == b',' { b'.' } else { byte }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_cells_and_words_for_nothing_are_missing() {
        for cell in [
            "",
            "  ",
            "NaN",
            "nan",
            "-NaN",
            "inf",
            "-Infinity",
            "NA",
            "n/a",
            "null",
            "1e999",
            "OVL",
            "-OL",
            "+Overflow",
        ] {
            assert_eq!(read(cell.as_bytes(), Decimal::Point), Cell::Missing, "{cell:?}");
        }
    }

    #[test]
    fn numbers_are_read_in_all_their_forms() {
        for (cell, value) in [("1", 1.0), (" +2.5 ", 2.5), ("-1e-3", -1e-3), (".5", 0.5), ("3.", 3.0), ("1E+2", 100.0)]
        {
            assert_eq!(read(cell.as_bytes(), Decimal::Point), Cell::Number(value), "{cell:?}");
        }
    }

    #[test]
    fn what_is_no_number_is_text() {
        for cell in ["abc", "1.2.3", "1,5", "0x10", "1 2", "--1", "+-1", "-", "1e", "12V"] {
            assert_eq!(read(cell.as_bytes(), Decimal::Point), Cell::Text, "{cell:?}");
        }
    }

    #[test]
    fn a_decimal_comma_is_a_comma_and_never_a_point() {
        assert_eq!(read(b"-1,25e-3", Decimal::Comma), Cell::Number(-1.25e-3));
        assert_eq!(read(b"1.25", Decimal::Comma), Cell::Text);
        assert_eq!(read(b"1,234,5", Decimal::Comma), Cell::Text);
    }
}
