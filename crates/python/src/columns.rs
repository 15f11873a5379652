//! Columns of what Python programs keep recordings in.

use cvg_calibration::recording::{Cells, Naming, Values};
use cvg_cli::service::Columns;
use numpy::PyReadonlyArray1;
use pyo3::exceptions::{PyException, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyMapping;

use crate::arrow;
use crate::errors::bad;

/// Kinds of numpy types that are numbers.
const NUMBERS: &str = "fiu";

/// The kind of numpy types that are text, and of those that are differences of times.
const TEXTS: &str = "U";
const DIFFERENCES: &str = "m";
/// How Python, numpy and pandas write what is not there.
const ABSENT: [&str; 4] = ["None", "NaT", "<NA>", "nan"];

/// The columns of a frame, a table, or a mapping of names to arrays.
pub(crate) fn columns(object: &Bound<'_, PyAny>) -> PyResult<Columns> {
    if object.hasattr("__arrow_c_stream__")? {
        match object.call_method0("__arrow_c_stream__") {
            Ok(stream) => return arrow::imported(stream),
            // pandas without pyarrow, or with a column of objects that Arrow has no type for: one after the other
            Err(e) if e.is_instance_of::<PyException>(object.py()) && object.hasattr("columns")? => {}
            Err(e) => return Err(e),
        }
    }
    if let Ok(mapping) = object.cast::<PyMapping>() {
        let items = mapping.items()?;
        return items.iter().map(|item| named(&item.get_item(0)?, &item.get_item(1)?)).collect();
    }
    // an array of records: its fields are the columns
    if let Ok(names) = object.getattr("dtype").and_then(|dtype| dtype.getattr("names"))
        && !names.is_none()
    {
        return names.try_iter()?.map(|name| name.and_then(|n| named(&n, &object.get_item(&n)?))).collect();
    }
    // a frame that is yet to be worked out has no rows
    if object.hasattr("__len__")? && object.hasattr("columns")? {
        let names = object.getattr("columns")?;
        return names.try_iter()?.map(|name| name.and_then(|n| named(&n, &object.get_item(&n)?))).collect();
    }
    let what = format!(
        "{} is no recording; wanted a frame with its rows, an Arrow table, or a mapping of column names to arrays",
        object.get_type().name()?
    );
    Err(PyTypeError::new_err(what))
}

fn named(name: &Bound<'_, PyAny>, values: &Bound<'_, PyAny>) -> PyResult<(String, Values)> {
    let py = name.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (unmasked(&numpy, values)?,))?;
    let name = name.str()?.to_string_lossy().into_owned();
    if array.getattr("ndim")?.extract::<usize>()? != 1 {
        let wanted = "one value a row, and one column of a name";
        return Err(bad(py, format!("column `{name}` is no array of one dimension; wanted {wanted}")));
    }
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if NUMBERS.contains(&kind) {
        let array = numpy.call_method1("ascontiguousarray", (array, "f8"))?;
        let array: PyReadonlyArray1<'_, f64> = array.extract()?;
        return Ok((name, Values::Numbers(array.as_slice()?.to_vec())));
    }
    // a difference of times is a number of no unit that is known here
    if kind == DIFFERENCES {
        let why = format!("is of numpy's type {}", array.getattr("dtype")?.str()?);
        return Ok((name, Values::Unreadable { rows: array.len()?, why }));
    }
    let mut cells = Cells::default();
    for value in array.try_iter()? {
        let text = value?.str()?;
        let text = text.to_string_lossy();
        // texts stay what they are
        let is_missing = kind != TEXTS && ABSENT.contains(&text.as_ref());
        cells.push(if is_missing { "" } else { &text });
    }
    Ok((name, Values::Texts(cells)))
}

/// A masked array with nothing in its masked cells: `asarray` would give what lies beneath the mask.
fn unmasked<'py>(numpy: &Bound<'py, PyModule>, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if !numpy.getattr("ma")?.call_method1("isMaskedArray", (values,))?.extract()? {
        return Ok(values.clone());
    }
    let kind: String = values.getattr("dtype")?.getattr("kind")?.extract()?;
    if NUMBERS.contains(&kind) {
        values.call_method1("astype", ("f8",))?.call_method1("filled", (f64::NAN,))
    } else {
        values.call_method1("astype", ("O",))?.call_method1("filled", ("",))
    }
}

/// What columns are called, from `CHANNEL=COLUMN*FACTOR`.
pub(crate) fn naming(py: Python<'_>, entries: &[String]) -> PyResult<Naming> {
    let mut naming = Naming::default();
    for entry in entries {
        naming.add(entry).map_err(|e| bad(py, format!("map: {e}")))?;
    }
    Ok(naming)
}
