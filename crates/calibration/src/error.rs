//! Why an answer is not given.

use std::fmt;

/// What kind of refusal it is: it decides the exit status of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// the input is not what it should be: mend the file or the campaign
    BadInput,
    /// the input is sound but does not carry the answer
    NoAnswer,
}

/// A refusal to answer: what was wrong, where, and what would be right.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// bad input, or input without an answer in it
    pub cause: Cause,
    /// file or run
    pub place: String,
    /// what is wrong
    pub problem: String,
    /// what would be right
    pub wanted: String,
}

impl Refusal {
    /// Input that has to be mended.
    pub fn new(place: &str, problem: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { cause: Cause::BadInput, place: place.into(), problem: problem.into(), wanted: wanted.into() }
    }

    /// Sound input that does not carry the answer.
    pub fn no_answer(place: &str, problem: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { cause: Cause::NoAnswer, ..Self::new(place, problem, wanted) }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.place.is_empty(), self.wanted.is_empty()) {
            (true, true) => f.write_str(&self.problem),
            (true, false) => write!(f, "{}; wanted: {}", self.problem, self.wanted),
            _ => write!(f, "{}: {}; wanted: {}", self.place, self.problem, self.wanted),
        }
    }
}

impl std::error::Error for Refusal {}

impl From<crate::recording::ReadError> for Refusal {
    fn from(error: crate::recording::ReadError) -> Self {
        Self::new("", error.to_string(), "")
    }
}
