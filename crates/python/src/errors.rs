//! What went wrong, as an exception of the package with file, line, row and column.

use cvg_calibration::recording::Place;
use cvg_cli::Failure;
use cvg_cli::service::Unanswered;
use pyo3::prelude::*;

fn raised(py: Python<'_>, class: &str, arguments: impl for<'py> pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py.import("cvg._errors").and_then(|m| m.getattr(class)).and_then(|class| class.call1(arguments));
    made.map_or_else(|e| e, PyErr::from_value)
}

/// The exception of a failure.
pub(crate) fn failed(py: Python<'_>, failure: &Failure) -> PyErr {
    if failure.is_no_answer() {
        return raised(py, "NoAnswer", (failure.to_string(), None::<String>));
    }
    let file = failure.file().map(|f| f.display().to_string());
    let (line, row) = match failure.place() {
        Some(Place::Line(line)) => (Some(line), None),
        Some(Place::Row(row)) => (None, Some(row)),
        None => (None, None),
    };
    raised(py, "InputError", (failure.to_string(), file, line, row, failure.column()))
}

/// The exception of a campaign without an answer.
pub(crate) fn unanswered(py: Python<'_>, why: Unanswered) -> PyErr {
    match why.json {
        Some(json) => raised(py, "NoAnswer", (why.failure.to_string(), Some(json))),
        None => failed(py, &why.failure),
    }
}

/// Input that no file is to blame for.
pub(crate) fn bad(py: Python<'_>, message: impl std::fmt::Display) -> PyErr {
    failed(py, &Failure::input(message))
}
