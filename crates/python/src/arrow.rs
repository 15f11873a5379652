//! Tables in and out by Arrow's C stream interface, and as numpy arrays. All unsafe code of the crate is here.

use std::ffi::CStr;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types as number;
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, RecordBatchReader, StringArray};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use cvg_calibration::recording::Channel;
use cvg_calibration::recording::{Cells, Recording, Values};
use cvg_cli::service::Columns;
use numpy::{PyArray1, PyUntypedArray};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};

use crate::errors::bad;

/// The name that the interface gives its capsules.
const STREAM: &CStr = c"arrow_array_stream";
/// How pandas names an index that it hands out as a column.
const INDEX: &str = "__index_level_";

/// Columns of what `__arrow_c_stream__` gives.
pub(crate) fn imported(stream: Bound<'_, PyAny>) -> PyResult<Columns> {
    let py = stream.py();
    let capsule = stream.cast_into::<PyCapsule>()?;
    let pointer = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: a capsule of this name holds a valid stream, which is moved out of it: what is left is marked as released
    let stream = unsafe { FFI_ArrowArrayStream::from_raw(pointer.as_ptr()) };
    let broken = |e: arrow_schema::ArrowError| bad(py, format!("the stream of Arrow data cannot be read: {e}"));
    let reader = RecordBatchStreamReader::try_new(stream).map_err(broken)?;
    let schema = reader.schema();
    let mut columns: Vec<(String, Option<Values>)> = schema.fields().iter().map(|f| (f.name().clone(), None)).collect();
    for batch in reader {
        let batch = batch.map_err(broken)?;
        for ((name, values), array) in columns.iter_mut().zip(batch.columns()) {
            append(name, values, array)?;
        }
    }
    let own = columns.into_iter().filter(|(name, _)| !name.starts_with(INDEX));
    Ok(own.map(|(name, values)| (name, values.unwrap_or(Values::Numbers(Vec::new())))).collect())
}

/// Appends an array to a column.
fn append(name: &str, column: &mut Option<Values>, array: &ArrayRef) -> PyResult<()> {
    let more = values(array);
    let Some(column) = column else {
        *column = Some(more);
        return Ok(());
    };
    match (column, more) {
        (Values::Numbers(all), Values::Numbers(more)) => all.extend(more),
        (Values::Texts(all), Values::Texts(more)) => more.iter().for_each(|text| all.push(text)),
        (Values::Unreadable { rows, .. }, Values::Unreadable { rows: more, .. }) => *rows += more,
        _ => return Err(PyTypeError::new_err(format!("column `{name}` changes its type"))),
    }
    Ok(())
}

/// The values of an array as a recording keeps them.
fn values(array: &dyn Array) -> Values {
    if let Some(numbers) = numbers(array) {
        return Values::Numbers(numbers);
    }
    if let Some(texts) = texts(array) {
        return Values::Texts(texts);
    }
    let Some(dictionary) = array.as_any_dictionary_opt() else {
        let why = format!("is of the Arrow type {}", array.data_type());
        return Values::Unreadable { rows: array.len(), why };
    };
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the keys of a dictionary are places in it"
    )]
    let keys = numbers(dictionary.keys()).unwrap_or_default();
    let keys = keys.into_iter().map(|key| key.is_finite().then_some(key as usize));
    match values(dictionary.values().as_ref()) {
        Values::Numbers(own) => {
            Values::Numbers(keys.map(|key| key.and_then(|key| own.get(key)).copied().unwrap_or(f64::NAN)).collect())
        }
        Values::Texts(own) => {
            Values::Texts(keys.map(|key| key.and_then(|key| own.get(key)).unwrap_or_default()).collect())
        }
        Values::Unreadable { why, .. } => Values::Unreadable { rows: array.len(), why },
    }
}

/// Numbers of any type as f64, nulls as NaN; none where they are no numbers.
fn numbers(array: &dyn Array) -> Option<Vec<f64>> {
    macro_rules! from {
        ($type:ty, $convert:expr) => {
            Some(array.as_primitive::<$type>().iter().map(|v| v.map_or(f64::NAN, $convert)).collect())
        };
    }
    // as a text, which is rounded once
    macro_rules! decimal {
        ($type:ty, $scale:expr) => {
            from!($type, |v| format!("{v}e{}", -i32::from(*$scale)).parse().unwrap_or(f64::NAN))
        };
    }
    #[allow(clippy::cast_precision_loss, reason = "numbers of a recording are f64")]
    match array.data_type() {
        DataType::Float64 if array.null_count() == 0 => {
            Some(array.as_primitive::<number::Float64Type>().values().to_vec())
        }
        DataType::Float64 => from!(number::Float64Type, |v| v),
        DataType::Float32 => from!(number::Float32Type, f64::from),
        DataType::Float16 => from!(number::Float16Type, f64::from),
        DataType::Int8 => from!(number::Int8Type, f64::from),
        DataType::Int16 => from!(number::Int16Type, f64::from),
        DataType::Int32 => from!(number::Int32Type, f64::from),
        DataType::Int64 => from!(number::Int64Type, |v| v as f64),
        DataType::UInt8 => from!(number::UInt8Type, f64::from),
        DataType::UInt16 => from!(number::UInt16Type, f64::from),
        DataType::UInt32 => from!(number::UInt32Type, f64::from),
        DataType::UInt64 => from!(number::UInt64Type, |v| v as f64),
        DataType::Decimal32(_, scale) => decimal!(number::Decimal32Type, scale),
        DataType::Decimal64(_, scale) => decimal!(number::Decimal64Type, scale),
        DataType::Decimal128(_, scale) => decimal!(number::Decimal128Type, scale),
        DataType::Decimal256(_, scale) => decimal!(number::Decimal256Type, scale),
        DataType::Null => Some(vec![f64::NAN; array.len()]),
        _ => None,
    }
}

/// Texts, nulls as empty ones, and time stamps as ISO 8601 writes them: those that have a zone are of UTC.
fn texts(array: &dyn Array) -> Option<Cells> {
    macro_rules! stamps {
        ($type:ty, $zone:expr) => {{
            let (array, zone) = (array.as_primitive::<$type>(), $zone.as_ref().map_or("", |_| "Z"));
            let text =
                |row| array.value_as_datetime(row).filter(|_| array.is_valid(row)).map(|at| format!("{at}{zone}"));
            Some((0..array.len()).map(|row| text(row).unwrap_or_default()).collect())
        }};
    }
    match array.data_type() {
        DataType::Utf8 => Some(array.as_string::<i32>().iter().map(Option::unwrap_or_default).collect()),
        DataType::LargeUtf8 => Some(array.as_string::<i64>().iter().map(Option::unwrap_or_default).collect()),
        DataType::Utf8View => Some(array.as_string_view().iter().map(Option::unwrap_or_default).collect()),
        DataType::Boolean => {
            Some(array.as_boolean().iter().map(|v| v.map_or("", |v| if v { "true" } else { "false" })).collect())
        }
        DataType::Timestamp(TimeUnit::Second, zone) => stamps!(number::TimestampSecondType, zone),
        DataType::Timestamp(TimeUnit::Millisecond, zone) => stamps!(number::TimestampMillisecondType, zone),
        DataType::Timestamp(TimeUnit::Microsecond, zone) => stamps!(number::TimestampMicrosecondType, zone),
        DataType::Timestamp(TimeUnit::Nanosecond, zone) => stamps!(number::TimestampNanosecondType, zone),
        _ => None,
    }
}

/// A table of columns, for whoever takes Arrow's C stream (`pyarrow.table`, `polars.DataFrame`, `pandas`) or numpy arrays.
#[pyclass(frozen, module = "cvg")]
#[derive(Debug)]
pub(crate) struct Table {
    batch: RecordBatch,
}

impl Table {
    pub(crate) fn of(columns: Columns) -> PyResult<Self> {
        let mut fields = Vec::new();
        let mut arrays: Vec<ArrayRef> = Vec::new();
        for (name, values) in columns {
            let array: ArrayRef = match values {
                Values::Numbers(values) => Arc::new(Float64Array::from(values)),
                Values::Texts(cells) => Arc::new(StringArray::from_iter_values(cells.iter())),
                Values::Unreadable { why, .. } => return Err(PyTypeError::new_err(format!("column `{name}` {why}"))),
            };
            fields.push(Field::new(name, array.data_type().clone(), false));
            arrays.push(array);
        }
        let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays);
        Ok(Self { batch: batch.map_err(|e| PyValueError::new_err(e.to_string()))? })
    }

    /// The columns of a recording in the order in which it is written; those of the names `numbers` came as numbers, and are.
    pub(crate) fn recording(recording: &Recording, numbers: &[String]) -> PyResult<Self> {
        let as_they_came = |name: &str, cells: &Cells| {
            if numbers.iter().any(|n| n == name) {
                // a recording keeps what is no channel as text, with all digits
                Values::Numbers(cells.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect())
            } else {
                Values::Texts(cells.clone())
            }
        };
        let of = |name: &str| {
            let channel = Channel::of(name).and_then(|c| recording.channel(c)).map(|v| Values::Numbers(v.to_vec()));
            let other = || recording.unknown.iter().find(|u| u.name == name).map(|u| as_they_came(name, &u.cells));
            channel.or_else(other).map(|values| (name.to_owned(), values))
        };
        Self::of(recording.column_names().filter_map(of).collect())
    }
}

#[pymethods]
impl Table {
    /// A table of arrays of numbers and lists of texts.
    #[staticmethod]
    #[pyo3(name = "of")]
    fn of_arrays(columns: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Self> {
        let values = |column: &Bound<'_, PyAny>| match column.extract::<Vec<String>>() {
            Ok(texts) if !column.is_instance_of::<PyUntypedArray>() => Ok(Values::Texts(texts.into_iter().collect())),
            _ => column.extract().map(Values::Numbers),
        };
        Self::of(columns.iter().map(|(name, c)| Ok((name.clone(), values(c)?))).collect::<PyResult<_>>()?)
    }

    /// Pickled as its columns.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let columns = self.to_dict(py)?.items();
        Ok((py.import("cvg._travel")?.getattr("table")?, (columns,).into_bound_py_any(py)?))
    }

    // what never changes is its own copy
    fn __copy__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __deepcopy__(this: Py<Self>, memo: Bound<'_, PyAny>) -> Py<Self> {
        drop(memo);
        this
    }

    /// Arrow's C stream of the table.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // a request, which nobody has to grant
        drop(requested_schema);
        let batches = RecordBatchIterator::new([Ok(self.batch.clone())], self.batch.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, STREAM)
    }

    /// The names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.batch.schema_ref().fields().iter().map(|f| f.name().clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    fn __repr__(&self) -> String {
        format!("<cvg.Table: {} rows of {}>", self.batch.num_rows(), self.column_names().join(", "))
    }

    /// Columns by their names: numpy arrays, lists of texts.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (name, array) in self.column_names().into_iter().zip(self.batch.columns()) {
            match array.data_type() {
                DataType::Float64 => {
                    let values = array.as_primitive::<number::Float64Type>().values();
                    out.set_item(name, PyArray1::from_slice(py, values))?;
                }
                _ => out.set_item(name, array.as_string::<i32>().iter().flatten().collect::<Vec<_>>())?,
            }
        }
        Ok(out)
    }
}
