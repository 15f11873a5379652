//! Why a command did not do its work, and where in which file.

use std::fmt;
use std::path::PathBuf;

use cvg_calibration::recording::{Place, ReadError};
use cvg_calibration::{Cause, Refusal};

/// Why a command did not do its work.
#[derive(Debug, Clone)]
pub struct Failure {
    pub(crate) message: String,
    pub(crate) status: u8,
    file: Option<PathBuf>,
    place: Option<Place>,
    column: Option<usize>,
}

impl Failure {
    /// Bad use or bad input.
    pub fn input(message: impl fmt::Display) -> Self {
        Self { message: message.to_string(), status: 2, file: None, place: None, column: None }
    }

    /// Sound input without an answer in it.
    pub fn no_answer(message: impl fmt::Display) -> Self {
        Self { status: 1, ..Self::input(message) }
    }

    /// What a reader refused, in other words than its own.
    pub(crate) fn of_file(message: impl fmt::Display, error: &ReadError) -> Self {
        let file = Some(error.path().to_owned());
        Self { file, place: error.place(), column: error.column(), ..Self::input(message) }
    }

    /// What is wrong with a file or a text that is called `name`.
    pub(crate) fn within(message: impl fmt::Display, name: &str) -> Self {
        Self { file: Some(PathBuf::from(name)), ..Self::input(message) }
    }

    /// The same failure at a byte of the text.
    pub(crate) fn at(self, text: &str, byte: Option<usize>) -> Self {
        let Some((line, column)) = byte.and_then(|byte| line_and_column(text, byte)) else { return self };
        Self { place: Some(Place::Line(line as u64)), column: Some(column), ..self }
    }

    /// Whether the input was sound, and did not carry an answer.
    #[must_use]
    pub fn is_no_answer(&self) -> bool {
        self.status == 1
    }

    /// The file that is to blame.
    #[must_use]
    pub fn file(&self) -> Option<&std::path::Path> {
        self.file.as_deref()
    }

    /// The line or row in it.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        self.place
    }

    /// The column in it, from 1.
    #[must_use]
    pub fn column(&self) -> Option<usize> {
        self.column
    }
}

/// Line and column of a byte of a text, both from 1.
pub(crate) fn line_and_column(text: &str, byte: usize) -> Option<(usize, usize)> {
    let before = text.get(..byte)?;
    Some((before.matches('\n').count() + 1, before.chars().rev().take_while(|c| *c != '\n').count() + 1))
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        match refusal.cause {
            Cause::BadInput if refusal.place.is_empty() => Self::input(refusal),
            Cause::BadInput => Self::within(&refusal, &refusal.place),
            Cause::NoAnswer => Self::no_answer(refusal),
        }
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::of_file(&error, &error)
    }
}
