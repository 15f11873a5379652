//! The head of a CSV file: everything up to and with the header line, and the dialect that it tells.
//!
//! Before the header may come a byte-order mark, a line `sep=…`, blank lines, and comments that begin with `#` or `%`. A
//! header that was written as a comment is found too. No data is read here.

use std::io::{BufRead, Read};
use std::path::Path;

use super::blocks::LONGEST_LINE;
use super::record::{Record, Records};
use crate::error::ReadError;
use crate::layout::Layout;
use crate::naming::Naming;

const SEPARATORS: [u8; 3] = [b',', b';', b'\t'];

/// What the head of a file tells.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) layout: Layout,
    pub(super) separator: u8,
    /// Line of the header, from 1.
    pub(super) header_line: u64,
    /// Line that comes after the head, from 1.
    pub(super) next_line: u64,
    /// What was read beyond the head: the first line of data, where the header was a comment.
    pub(super) read_ahead: Vec<u8>,
}

/// Reads the head of a file.
pub(super) fn read(reader: &mut impl BufRead, naming: &Naming, source: &Path) -> Result<Head, ReadError> {
    let mut comment: Option<(u64, Vec<u8>)> = None;
    let mut told_separator = None;
    let mut raw = vec![];
    for line in 1.. {
        raw.clear();
        let limit = LONGEST_LINE as u64 + 1;
        let count =
            reader.by_ref().take(limit).read_until(b'\n', &mut raw).map_err(|error| ReadError::io(source, error))?;
        if count == 0 {
            break;
        }
        if count > LONGEST_LINE {
            return Err(ReadError::EndlessLine { path: source.to_path_buf(), line, limit: LONGEST_LINE });
        }
        let start = if line == 1 && raw.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        let text = raw[start..].trim_ascii();
        if let [b'#' | b'%', rest @ ..] = text {
            comment = Some((line, rest.to_vec()));
            continue;
        }
        if let [b's' | b'S', b'e' | b'E', b'p' | b'P', b'=', separator] = text {
            told_separator = Some(*separator);
            continue;
        }
        // A separator told by `sep=` may be a tab, which is a blank.
        if raw[start..].trim_ascii_end() == b"sep=" {
            told_separator = Some(b'\t');
            continue;
        }
        if text.is_empty() {
            continue;
        }
        if let Some((comment_line, names)) =
            comment.filter(|(_, names)| is_header_of(names, text, told_separator, naming))
        {
            let mut head = understand(&names, comment_line, told_separator, naming, source)?;
            (head.next_line, head.read_ahead) = (line, raw[start..].to_vec());
            return Ok(head);
        }
        return understand(&raw[start..], line, told_separator, naming, source);
    }
    Err(ReadError::Empty { path: source.to_path_buf() })
}

/// Whether a comment names channels above a line that does not.
fn is_header_of(comment: &[u8], line: &[u8], told: Option<u8>, naming: &Naming) -> bool {
    let channels = |text: &[u8]| candidates(told).map(|separator| known(text, separator, naming)).max().unwrap_or(0);
    channels(comment) > 0 && channels(line) == 0
}

fn candidates(told: Option<u8>) -> impl Iterator<Item = u8> {
    // The last of equals wins in `max_by_key`: the comma comes last.
    SEPARATORS.into_iter().rev().filter(move |&separator| told.is_none_or(|told| told == separator)).chain(told)
}

fn split(text: &[u8], separator: u8) -> Option<Record> {
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

fn understand(text: &[u8], line: u64, told: Option<u8>, naming: &Naming, source: &Path) -> Result<Head, ReadError> {
    let refuse = |what: String, wanted| Err(ReadError::Header { path: source.to_path_buf(), line, what, wanted });
    if text.trim_ascii().contains(&b'\r') {
        return refuse("the header holds carriage returns".to_owned(), "lines that end with LF or CRLF");
    }
    if let Err(error) = std::str::from_utf8(text) {
        let what = format!("the header is not UTF-8 from byte {} of the line on", error.valid_up_to() + 1);
        return refuse(what, "a header in UTF-8");
    }
    let fields = |separator: u8| text.iter().filter(|&&byte| byte == separator).count();
    let separator =
        candidates(told).max_by_key(|&separator| (known(text, separator, naming), fields(separator))).unwrap_or(b',');
    let Some(record) = split(text, separator).filter(|_| text.iter().filter(|&&byte| byte == b'"').count() % 2 == 0)
    else {
        return refuse(
            "the header has a quote that is not closed".to_owned(),
            "names without line breaks, quotes in pairs",
        );
    };
    let names: Vec<String> = record.fields().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
    let is_number = |name: &String| name.trim().replace(',', ".").parse::<f64>().is_ok();
    if names.iter().all(is_number) {
        return refuse("the first line holds numbers".to_owned(), "a header line with the column names above them");
    }
    let layout = Layout::new(&names, naming, source)?;
    Ok(Head { layout, separator, header_line: line, next_line: line + 1, read_ahead: vec![] })
}
