//! One record after the other, as RFC 4180 has it: fields may be quoted and then hold separators, line ends and doubled
//! quotes. Blanks around a field and around its quotes are not part of it.
//!
//! Exact and not hurried: for headers and for texts with quotes. What fields mean is not known here.

use std::io::{self, BufRead, Read};

use super::blocks::LONGEST_LINE;

/// The fields of a record.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    bytes: Vec<u8>,
    ends: Vec<usize>,
    /// Line on which it starts, from 1.
    pub(super) line: u64,
    /// Whether its last line has a line end, and no quote is open.
    pub(super) is_terminated: bool,
    /// Whether there is nothing but blanks on its line.
    pub(super) is_blank: bool,
    /// Whether a quote stands within a field that does not begin with one.
    pub(super) has_stray_quote: bool,
}

impl Record {
    /// Number of fields.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// All fields, in order.
    pub(super) fn fields(&self) -> impl Iterator<Item = &[u8]> + Clone {
        (0..self.len()).map(|at| {
            let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
            &self.bytes[start..self.ends[at]]
        })
    }
}

/// Why there is no next record.
#[derive(Debug)]
pub(super) enum RecordError {
    Io(io::Error),
    /// On this line something other than a separator follows a closing quote.
    TextAfterQuote(u64),
    /// The quote that is opened on this line is not closed.
    OpenQuote(u64),
    EndlessLine(u64),
}

/// Reads records.
#[derive(Debug)]
pub(super) struct Records<R> {
    reader: R,
    separator: u8,
    next_line: u64,
    raw: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Start,
    Bare,
    Quoted,
    Closed,
}

impl<R: BufRead> Records<R> {
    /// A reader of records whose first line is `first_line`.
    pub(super) fn new(reader: R, separator: u8, first_line: u64) -> Self {
        Self { reader, separator, next_line: first_line, raw: vec![] }
    }

    /// Line of the first line that is not yet read.
    pub(super) const fn next_line(&self) -> u64 {
        self.next_line
    }

    /// Reads the next record; false where there is none.
    pub(super) fn read(&mut self, record: &mut Record) -> Result<bool, RecordError> {
        (record.line, record.is_terminated, record.is_blank) = (self.next_line, false, true);
        record.has_stray_quote = false;
        record.bytes.clear();
        record.ends.clear();
        let mut state = State::Start;
        let mut bytes_read = 0;
        loop {
            self.raw.clear();
            let limit = (LONGEST_LINE + 1 - bytes_read) as u64;
            bytes_read += (&mut self.reader).take(limit).read_until(b'\n', &mut self.raw).map_err(RecordError::Io)?;
            let has_end = self.raw.last() == Some(&b'\n');
            if bytes_read > LONGEST_LINE && !has_end {
                let open = state == State::Quoted || self.next_line > record.line;
                return Err(if open {
                    RecordError::OpenQuote(record.line)
                } else {
                    RecordError::EndlessLine(record.line)
                });
            }
            if self.raw.is_empty() {
                if bytes_read == 0 {
                    return Ok(false);
                }
                // The text ends within quotes. A single line may have been cut off; more are a quote that was forgotten.
                if self.next_line > record.line + 1 {
                    return Err(RecordError::OpenQuote(record.line));
                }
                close(record, state);
                return Ok(true);
            }
            self.next_line += 1;
            state = self.scan(record, state).map_err(|()| RecordError::TextAfterQuote(self.next_line - 1))?;
            if state != State::Quoted {
                close(record, state);
                record.is_terminated = has_end;
                return Ok(true);
            }
            if bytes_read > LONGEST_LINE {
                return Err(RecordError::OpenQuote(record.line));
            }
        }
    }

    /// Takes in a line; the fields before the last are then whole.
    fn scan(&self, record: &mut Record, mut state: State) -> Result<State, ()> {
        let is_blank = |byte: u8| byte == b' ' || (byte == b'\t' && self.separator != b'\t');
        let mut bytes = self.raw.iter().copied().peekable();
        while let Some(byte) = bytes.next() {
            if state == State::Quoted {
                if byte != b'"' {
                    record.bytes.push(byte);
                } else if bytes.next_if_eq(&b'"').is_some() {
                    record.bytes.push(b'"');
                } else {
                    state = State::Closed;
                }
                continue;
            }
            let ends_line = byte == b'\n' || (byte == b'\r' && bytes.peek() == Some(&b'\n'));
            if ends_line {
                continue;
            }
            if byte == self.separator {
                close(record, state);
                state = State::Start;
                record.is_blank = false;
                continue;
            }
            if is_blank(byte) && state != State::Bare {
                continue;
            }
            record.is_blank = false;
            state = match (state, byte) {
                (State::Closed, _) => return Err(()),
                (State::Start, b'"') => State::Quoted,
                _ => {
                    record.has_stray_quote |= byte == b'"';
                    record.bytes.push(byte);
                    State::Bare
                }
            };
        }
        Ok(state)
    }
}

/// Ends the last field; a bare one without the blanks behind it.
fn close(record: &mut Record, state: State) {
    if state == State::Bare {
        let start = record.ends.last().copied().unwrap_or(0);
        let trimmed = record.bytes[start..].trim_ascii_end().len();
        record.bytes.truncate(start + trimmed);
    }
    record.ends.push(record.bytes.len());
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn all(text: &str) -> Result<Vec<(u64, Vec<String>)>, RecordError> {
        let mut records = Records::new(text.as_bytes(), b',', 1);
        let mut record = Record::default();
        let mut found = vec![];
        while records.read(&mut record)? {
            let fields = record.fields().map(|field| String::from_utf8_lossy(field).into_owned()).collect();
            found.push((record.line, fields));
        }
        Ok(found)
    }

    #[test]
    fn quoted_fields_hold_separators_line_ends_and_quotes() {
        let found = all("a, \"b,\"\"\nc\" ,d\r\n1,2,3").unwrap();
        let strings = |fields: [&str; 3]| fields.map(str::to_owned).to_vec();
        assert_eq!(found, [(1, strings(["a", "b,\"\nc", "d"])), (3, strings(["1", "2", "3"]))]);
    }

    #[test]
    fn blanks_within_quotes_are_kept_and_around_fields_are_not() {
        assert_eq!(all(" a ,\" b \"").unwrap()[0].1, ["a", " b "]);
    }

    #[test]
    fn a_quote_that_is_never_closed_is_named_by_its_line() {
        assert!(matches!(all("a\n\"b\nc\nd\n"), Err(RecordError::OpenQuote(2))));
    }

    #[test]
    fn text_after_a_closing_quote_is_named_by_its_line() {
        assert!(matches!(all("a\n\"b\"c\n"), Err(RecordError::TextAfterQuote(2))));
    }

    proptest! {
        #[test]
        fn what_another_writer_wrote_is_read_as_it_was(
            rows in proptest::collection::vec(proptest::collection::vec("[ab,\"\r\n;]{0,6}", 2..5), 1..6)
        ) {
            let mut writer = csv::WriterBuilder::new().flexible(true).quote_style(csv::QuoteStyle::Always).from_writer(vec![]);
            for row in &rows {
                writer.write_record(row).unwrap();
            }
            let text = String::from_utf8(writer.into_inner().unwrap()).unwrap();
            let found: Vec<_> = all(&text).unwrap().into_iter().map(|(_, fields)| fields).collect();
            prop_assert_eq!(found, rows);
        }
    }
}
