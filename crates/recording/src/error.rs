//! What can be wrong with a file: what it is, where it is, and what would be right.
//!
//! These errors speak of files only. Whether a well-formed recording tells anything of the instrument is the
//! identification's to say.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::channel::Channel;
use super::gzip::Stopped;
use super::memory;

/// Where in a file: lines of text start at 1 (the header counts), rows of a table without lines as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Place {
    /// Line of a text file, from 1.
    Line(u64),
    /// Row of a Parquet file, from 1.
    Row(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
        }
    }
}

/// Why a recording or a campaign was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Nothing has this path.
    #[error("{}: there is no such file", path.display())]
    NotFound {
        /// The path as given.
        path: PathBuf,
    },
    /// The path is a directory.
    #[error("{}: is a directory; wanted a recording (.csv, .parquet) or a campaign file (campaign.toml)", path.display())]
    Directory {
        /// The path as given.
        path: PathBuf,
    },
    /// The system could not read the file.
    #[error("{}: cannot be read: {source}", path.display())]
    Io {
        /// The path as given.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is of another kind than a recording.
    #[error("{}: {what}; wanted {wanted}", path.display())]
    Format {
        /// The path as given.
        path: PathBuf,
        /// What it is.
        what: String,
        /// What would be right.
        wanted: &'static str,
    },
    /// There is nothing in the file.
    #[error("{}: is empty; wanted a header line and rows", path.display())]
    Empty {
        /// The path as given.
        path: PathBuf,
    },
    /// The header is there, the rows are not.
    #[error("{}: {place} is the header and no rows follow it", path.display())]
    NoRows {
        /// The path as given.
        path: PathBuf,
        /// The header.
        place: Place,
    },
    /// The header cannot be understood.
    #[error("{}: line {line}: {what}; wanted {wanted}", path.display())]
    Header {
        /// The path as given.
        path: PathBuf,
        /// Line of the header, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
        /// What would be right.
        wanted: &'static str,
    },
    /// Two columns have one name.
    #[error("{}: columns {first} and {second} are both named `{name}`; every column wants a name of its own", path.display())]
    DuplicateColumn {
        /// The path as given.
        path: PathBuf,
        /// The name.
        name: String,
        /// Number of the first of the two, from 1.
        first: usize,
        /// Number of the second, from 1.
        second: usize,
    },
    /// Columns are missing that this kind of run needs.
    #[error("{}: {needed_for} needs {needed}; there are {present}", path.display())]
    MissingColumns {
        /// The path as given.
        path: PathBuf,
        /// The kind of run.
        needed_for: &'static str,
        /// What it needs.
        needed: &'static str,
        /// The columns that are there, unknown ones too.
        present: String,
    },
    /// A cell is not a number, or a text not UTF-8.
    #[error("{}: {place}, column {number} (`{column}`): {text:?} is not {wanted}", path.display())]
    Cell {
        /// The path as given.
        path: PathBuf,
        /// The row.
        place: Place,
        /// Number of the column, from 1.
        number: usize,
        /// Name of the column.
        column: String,
        /// The text of the cell, shortened.
        text: String,
        /// What would be right.
        wanted: &'static str,
    },
    /// A row has another number of fields than the header.
    #[error("{}: {place} has {found} fields, the header has {expected}", path.display())]
    FieldCount {
        /// The path as given.
        path: PathBuf,
        /// The row.
        place: Place,
        /// Fields in the row.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// Quoting is not as RFC 4180 has it.
    #[error("{}: line {line}: {what}", path.display())]
    Quoting {
        /// The path as given.
        path: PathBuf,
        /// Line in which the quoted field starts, from 1.
        line: u64,
        /// What is wrong, and what would be right.
        what: &'static str,
    },
    /// A line goes on for longer than any row can be.
    #[error("{}: line {line} does not end within {limit} bytes; wanted text with one row a line", path.display())]
    EndlessLine {
        /// The path as given.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// Bytes that were looked at.
        limit: usize,
    },
    /// The time runs backwards.
    #[error(
        "{}: {place}: the time goes back from {before_s} s to {t_s} s; wanted `t_s` increasing (are two recordings in one file?)",
        path.display()
    )]
    TimeBackwards {
        /// The path as given.
        path: PathBuf,
        /// The row.
        place: Place,
        /// Time of the last good row before it, s.
        before_s: f64,
        /// Its time, s.
        t_s: f64,
    },
    /// Every row was dropped.
    #[error("{}: none of the {rows} rows can be used: {why}", path.display())]
    NothingUsable {
        /// The path as given.
        path: PathBuf,
        /// Rows that were read.
        rows: u64,
        /// What they lack.
        why: String,
    },
    /// The settling time is as long as the run.
    #[error(
        "{}: nothing is left after {settle_s} s of settling, the recording lasts {duration_s} s; wanted a smaller `settle_s`",
        path.display()
    )]
    NothingSettled {
        /// The recording.
        path: PathBuf,
        /// Settling time, s.
        settle_s: f64,
        /// Time from the first to the last row, s.
        duration_s: f64,
    },
    /// The file would take more memory than is allowed.
    #[error(
        "{}: {what} would take up to {} MB of memory, {} MB are allowed; wanted a smaller recording or a larger limit",
        path.display(), needed.div_ceil(1_000_000), allowed / 1_000_000
    )]
    TooLarge {
        /// The path as given.
        path: PathBuf,
        /// What is too large.
        what: String,
        /// Bytes that it would take at most.
        needed: u64,
        /// Bytes that are allowed.
        allowed: u64,
    },
    /// The Parquet file cannot be decoded.
    #[error("{}: is not a Parquet file that can be read here: {what}", path.display())]
    Parquet {
        /// The path as given.
        path: PathBuf,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// A file of arrays cannot be decoded.
    #[error("{}: is not {kind} that can be read here: {what}", path.display())]
    Container {
        /// The path as given.
        path: PathBuf,
        /// What it should be.
        kind: &'static str,
        /// What is wrong.
        what: String,
    },
    /// A column that a channel is mapped to is not there.
    #[error(
        "{}: `{channel}` is mapped to a column `{column}` that is not there{}; there are {present}",
        path.display(),
        crate::naming::one_factor(column)
    )]
    MappedColumn {
        /// The path as given.
        path: PathBuf,
        /// The channel.
        channel: Channel,
        /// The column.
        column: String,
        /// The columns that are there.
        present: String,
    },
    /// A column is in a unit that is not known to be one of its channel.
    #[error(
        "{}: `{channel}` is in {unit:?}; wanted {wanted}, or the factor that takes it there: \
         --map '{channel}={column}*FACTOR', or the same in the [columns] of a campaign.toml (a factor of 1 keeps it)",
        path.display()
    )]
    Unit {
        /// The path as given.
        path: PathBuf,
        /// The channel.
        channel: Channel,
        /// The unit as it is written.
        unit: String,
        /// The unit of the channel.
        wanted: &'static str,
        /// What the file calls the column.
        column: String,
    },
    /// The campaign file says something that it cannot mean.
    #[error("{}: line {line}, column {column}: {what}; wanted {wanted}", path.display())]
    Campaign {
        /// The campaign file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, in characters, from 1.
        column: usize,
        /// What is wrong.
        what: String,
        /// What would be right.
        wanted: String,
    },
}

impl ReadError {
    /// The file that it speaks of, as it was given.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::NotFound { path }
            | Self::Directory { path }
            | Self::Io { path, .. }
            | Self::Format { path, .. }
            | Self::Empty { path }
            | Self::NoRows { path, .. }
            | Self::Header { path, .. }
            | Self::DuplicateColumn { path, .. }
            | Self::MissingColumns { path, .. }
            | Self::Cell { path, .. }
            | Self::FieldCount { path, .. }
            | Self::Quoting { path, .. }
            | Self::EndlessLine { path, .. }
            | Self::TimeBackwards { path, .. }
            | Self::NothingUsable { path, .. }
            | Self::NothingSettled { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Parquet { path, .. }
            | Self::Container { path, .. }
            | Self::MappedColumn { path, .. }
            | Self::Unit { path, .. }
            | Self::Campaign { path, .. } => path,
        }
    }

    /// The line or row that it speaks of.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        match self {
            Self::NoRows { place, .. }
            | Self::Cell { place, .. }
            | Self::FieldCount { place, .. }
            | Self::TimeBackwards { place, .. } => Some(*place),
            Self::Header { line, .. } | Self::Quoting { line, .. } | Self::EndlessLine { line, .. } => {
                Some(Place::Line(*line))
            }
            Self::Campaign { line, .. } => Some(Place::Line(*line as u64)),
            _ => None,
        }
    }

    /// The column that it speaks of, from 1: of a table that of its numbers, of a campaign file that of its letters.
    #[must_use]
    pub fn column(&self) -> Option<usize> {
        match self {
            Self::Cell { number, .. } => Some(*number),
            Self::DuplicateColumn { second, .. } => Some(*second),
            Self::Campaign { column, .. } => Some(*column),
            _ => None,
        }
    }

    /// The error for a failed system call, with those that have a plainer name told apart.
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_path_buf();
        if let Some(stopped) = source.get_ref().and_then(|error| error.downcast_ref::<Stopped>()) {
            let allowed = memory::memory_limit();
            return match stopped {
                Stopped::TooLarge => {
                    let (what, needed) = ("what gzip has compressed".to_owned(), allowed.saturating_add(1));
                    Self::TooLarge { path, what, needed, allowed }
                }
                Stopped::Damaged(what) => Self::Container { path, kind: "a gzip file", what: what.clone() },
            };
        }
        match source.kind() {
            io::ErrorKind::NotFound => Self::NotFound { path },
            io::ErrorKind::IsADirectory => Self::Directory { path },
            _ => Self::Io { path, source },
        }
    }

    /// The error for a format that this program was built without.
    #[cfg(not(all(feature = "hdf5", feature = "matlab", feature = "parquet")))]
    pub(crate) fn not_built_in(path: &Path, what: &str) -> Self {
        let wanted = "CSV: this program was built without that format";
        Self::Format { path: path.to_path_buf(), what: what.to_owned(), wanted }
    }
}
