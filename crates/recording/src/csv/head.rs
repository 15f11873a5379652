//! The head of a CSV file: everything up to and with the header line and a row of units, and the dialect that it tells.
//!
//! Before the header may come a byte-order mark, a line `sep=…`, blank lines, comments that begin with `#` or `%`, and what
//! a program such as LabVIEW writes of itself. A header that was written as a comment is found too. No data is read here.

use std::collections::VecDeque;
use std::io::{BufRead, Read};
use std::path::Path;

use super::beneath;
use super::blocks::LONGEST_LINE;
use super::preamble::{END_OF_PREAMBLE, Preamble, TIMES};
use super::record::{Record, Records};
use crate::channel::Channel;
use crate::error::ReadError;
use crate::layout::Layout;
use crate::naming::Naming;
use crate::requirement;

const SEPARATORS: [u8; 4] = [b',', b';', b'\t', b'|'];
/// Lines among which a header is looked for.
const MOST_LINES: usize = 200;

/// What the head of a file tells.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) layout: Layout,
    pub(super) separator: u8,
    /// Line of the header, from 1.
    pub(super) header_line: u64,
    /// Line that comes after the head, from 1.
    pub(super) next_line: u64,
    /// What was read beyond the head.
    pub(super) read_ahead: Vec<u8>,
    /// Units that the file states for channels.
    pub(super) units: Vec<(Channel, String)>,
    /// First time and interval, where the file says them above its header and leaves the column of times empty.
    pub(super) even_times: Option<(f64, f64)>,
    /// What was passed over.
    pub(super) warnings: Vec<String>,
}

/// Lines of text with their numbers.
struct Lines<'a, R> {
    reader: &'a mut R,
    source: &'a Path,
    next: u64,
    /// Lines that were read to look at and belong to what follows.
    ahead: VecDeque<Vec<u8>>,
    /// Whether the text has ended.
    is_done: bool,
}

impl<R: BufRead> Lines<'_, R> {
    /// Looks at the line `at` after the next; nothing where there is none.
    fn peek(&mut self, at: usize) -> Result<Option<&[u8]>, ReadError> {
        while self.ahead.len() <= at && !self.is_done {
            let mut raw = vec![];
            let limit = LONGEST_LINE as u64 + 1;
            let read = self.reader.by_ref().take(limit).read_until(b'\n', &mut raw);
            let count = read.map_err(|error| ReadError::io(self.source, error))?;
            let line = self.next + self.ahead.len() as u64;
            if line == 1 && raw.starts_with(b"\xef\xbb\xbf") {
                raw.drain(..3);
            }
            // only the line that is asked for is asked to end: what lies beyond is the rows'
            if count > LONGEST_LINE && self.ahead.is_empty() {
                return Err(ReadError::EndlessLine { path: self.source.to_path_buf(), line, limit: LONGEST_LINE });
            }
            self.is_done = count == 0 || count > LONGEST_LINE;
            if count > 0 {
                self.ahead.push_back(raw);
            }
        }
        Ok(self.ahead.get(at).map(Vec::as_slice))
    }

    /// Goes past the next line.
    fn pass(&mut self) -> Option<Vec<u8>> {
        let line = self.ahead.pop_front()?;
        self.next += 1;
        Some(line)
    }
}

/// Reads the head of a file.
pub(super) fn read(reader: &mut impl BufRead, naming: &Naming, source: &Path) -> Result<Head, ReadError> {
    let mut lines = Lines { reader, source, next: 1, ahead: VecDeque::new(), is_done: false };
    let mut comment: Option<(u64, Vec<u8>)> = None;
    let mut told = None;
    loop {
        let line = lines.next;
        let Some(raw) = lines.peek(0)? else { return Err(ReadError::Empty { path: source.to_path_buf() }) };
        let text = raw.trim_ascii();
        if let [b'#' | b'%', rest @ ..] = text {
            comment = Some((line, rest.to_vec()));
        } else if let [b's' | b'S', b'e' | b'E', b'p' | b'P', b'=', separator] = text {
            told = Some(*separator);
        } else if raw.trim_ascii_end() == b"sep=" {
            // A separator told by `sep=` may be a tab, which is a blank.
            told = Some(b'\t');
        } else if !text.is_empty() {
            comment = comment.filter(|(_, names)| is_header_of(names, text, told, naming));
            break;
        }
        lines.pass();
    }
    let mut head = match comment {
        Some((line, names)) => understand(&names, line, None, told, naming, source)?,
        None => below_a_preamble(&mut lines, told, naming, source)?,
    };
    if let Some(units) = lines.peek(0)?.and_then(|line| beneath::units(&head, line)) {
        head.units = units;
        lines.pass();
    }
    head.next_line = lines.next;
    head.read_ahead = lines.ahead.into_iter().flatten().collect();
    Ok(head)
}

/// Finds the header among the next lines, and understands it.
fn below_a_preamble(
    lines: &mut Lines<'_, impl BufRead>,
    told: Option<u8>,
    naming: &Naming,
    source: &Path,
) -> Result<Head, ReadError> {
    let above = header_at(lines, told, naming)?;
    let first = lines.next;
    let mut preamble = Preamble::default();
    for _ in 0..above {
        preamble.read(&lines.pass().unwrap_or_default());
    }
    let header_line = lines.next;
    let header = lines.pass().unwrap_or_default();
    let mut head = understand(&header, header_line, lines.peek(0)?, told, naming, source)?;
    if above > 0 {
        let last = header_line - 1;
        head.warnings.push(if first == last {
            format!("line {first}, above the header, is passed over")
        } else {
            format!("lines {first} to {last}, above the header, are passed over")
        });
        preamble.tell(&mut head).map_err(|what| ReadError::Header {
            path: source.to_path_buf(),
            line: header_line,
            what,
            wanted: "one time for all columns, as X_Columns One writes it",
        })?;
    }
    Ok(head)
}

/// How many lines stand above the header: it is the first that names a time and an angle; where none does, the first above
/// numbers, so that a reader is told its names and not those of what stands above it.
fn header_at(lines: &mut Lines<'_, impl BufRead>, told: Option<u8>, naming: &Naming) -> Result<usize, ReadError> {
    let mut seen: Vec<Vec<u8>> = vec![];
    let mut bytes = 0;
    while seen.len() < MOST_LINES && bytes <= LONGEST_LINE {
        let Some(line) = lines.peek(seen.len())? else { break };
        if candidates(told).any(|separator| names_an_angle(line, separator, naming)) {
            return Ok(seen.len());
        }
        bytes += line.len();
        seen.push(line.to_vec());
    }
    let is_mark = |line: &Vec<u8>| line.starts_with(END_OF_PREAMBLE);
    let from = seen.iter().rposition(is_mark).map_or(0, |mark| mark + 1);
    let above_numbers = |at: &usize| candidates(told).any(|s| beneath::stands_above_numbers(&seen[*at..], s));
    Ok((from..seen.len()).find(above_numbers).unwrap_or(0))
}

/// Whether a line has the columns of a recording if this is its separator.
fn names_an_angle(text: &[u8], separator: u8, naming: &Naming) -> bool {
    let record = split(text, separator).filter(|record| !record.has_stray_quote).unwrap_or_default();
    let name = |field| std::str::from_utf8(field).ok().and_then(|name| naming.channel(name));
    let channels: Vec<Channel> = record.fields().filter_map(name).collect();
    requirement::holds_an_angle(|channel| channels.contains(&channel))
}

/// Whether a comment names channels above a line that does not, or names of its own above numbers.
fn is_header_of(comment: &[u8], line: &[u8], told: Option<u8>, naming: &Naming) -> bool {
    let channels = |text: &[u8]| candidates(told).map(|separator| known(text, separator, naming)).max().unwrap_or(0);
    let both = [comment.to_vec(), line.to_vec()];
    let names = || candidates(told).any(|separator| beneath::stands_above_numbers(&both, separator));
    (channels(comment) > 0 && channels(line) == 0) || names()
}

fn candidates(told: Option<u8>) -> impl Iterator<Item = u8> {
    // The last of equals wins in `max_by_key`: the comma comes last.
    SEPARATORS.into_iter().rev().filter(move |&separator| told.is_none_or(|told| told == separator)).chain(told)
}

pub(super) fn split(text: &[u8], separator: u8) -> Option<Record> {
    let mut record = Record::default();
    let found = Records::new(text, separator, 1).read(&mut record).ok()?;
    found.then_some(record)
}

/// How many channels a header names if this is its separator. It is not, if it leaves a quote within a field.
fn known(text: &[u8], separator: u8, naming: &Naming) -> usize {
    let record = split(text, separator).filter(|record| !record.has_stray_quote).unwrap_or_default();
    let is_channel = |field: &&[u8]| std::str::from_utf8(field).is_ok_and(|name| naming.channel(name).is_some());
    record.fields().filter(is_channel).count()
}

/// Whether a line is of so many numbers with nothing but blanks between them.
fn separated_by_blanks(line: &[u8], count: usize) -> bool {
    let text = String::from_utf8_lossy(line);
    let numbers: Vec<Option<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    numbers.len() == count && numbers.iter().all(Option::is_some)
}

fn understand(
    text: &[u8],
    line: u64,
    beneath: Option<&[u8]>,
    told: Option<u8>,
    naming: &Naming,
    source: &Path,
) -> Result<Head, ReadError> {
    let refuse = |what: String, wanted| Err(ReadError::Header { path: source.to_path_buf(), line, what, wanted });
    if text.trim_ascii().contains(&b'\r') {
        return refuse("the header holds carriage returns".to_owned(), "lines that end with LF or CRLF");
    }
    if let Err(error) = std::str::from_utf8(text) {
        let what = format!("the header is not UTF-8 from byte {} of the line on", error.valid_up_to() + 1);
        return refuse(what, "a header in UTF-8, as `iconv -f windows-1252 -t utf-8` makes of the usual other one");
    }
    let fields = |separator: u8| text.iter().filter(|&&byte| byte == separator).count();
    let separator =
        candidates(told).max_by_key(|&separator| (known(text, separator, naming), fields(separator))).unwrap_or(b',');
    let Some(record) = split(text, separator).filter(|_| text.iter().filter(|&&byte| byte == b'"').count() % 2 == 0)
    else {
        let as_a_unit = [&b"[\"]"[..], b"(\")"].iter().any(|unit| text.windows(3).any(|part| part == *unit));
        let wanted = if as_a_unit {
            "arc seconds as [arcsec] or [″]: a quote opens a name, which has to be closed"
        } else {
            "names without line breaks, quotes in pairs"
        };
        return refuse("the header has a quote that is not closed".to_owned(), wanted);
    };
    let mut names: Vec<String> = record.fields().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    // LabVIEW may write the times once more beside each column
    for (number, again) in names.iter_mut().filter(|name| name.trim() == TIMES).enumerate().skip(1) {
        *again = format!("{TIMES} {}", number + 1);
    }
    let is_number = |name: &String| name.trim().replace(',', ".").parse::<f64>().is_ok();
    if names.iter().all(is_number) {
        return refuse("the first line holds numbers".to_owned(), "a header line with the column names above them");
    }
    if let ([one], false) = (names.as_slice(), told.is_some()) {
        let words: Vec<&str> = one.split_whitespace().collect();
        // an instrument's names have no blanks in them where blanks separate its columns
        if words.len() >= 3 && beneath.is_some_and(|row| separated_by_blanks(row, words.len())) {
            let wanted = "`,`, `;`, `|` or tabs between them, as `tr -s ' ' ','` makes of blanks";
            return refuse("the columns are separated by blanks".to_owned(), wanted);
        }
    }
    let layout = Layout::new(&names, naming, source)?;
    let (read_ahead, units, warnings) = (vec![], vec![], vec![]);
    Ok(Head {
        layout,
        separator,
        header_line: line,
        next_line: line + 1,
        read_ahead,
        units,
        even_times: None,
        warnings,
    })
}
