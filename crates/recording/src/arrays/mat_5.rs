//! MATLAB's `.mat` of version 5.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use matfile::{MatFile, NumericData};

use crate::Recording;
use crate::admission;
use crate::arrays::columns::{push, refuse, table};
use crate::error::ReadError;
use crate::naming::Naming;

/// Reads a recording from the bytes of a `.mat` file of version 5.
pub(super) fn read(bytes: &[u8], naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    // the decoder is not proof against every damaged file
    let decoded = catch_unwind(AssertUnwindSafe(|| MatFile::parse(bytes).map_err(|e| e.to_string())));
    let file = decoded.unwrap_or_else(|_| Err("the file is damaged".into()));
    let file = file.map_err(|what| refuse(source, "a MATLAB file", what))?;
    let mut arrays = Vec::new();
    for array in file.arrays() {
        push(&mut arrays, array.name(), array.size(), real(array.data()), true);
    }
    admission::admit(table(arrays, naming, source)?, source)
}

fn real(data: &NumericData) -> Option<Vec<f64>> {
    fn all<T: Copy + Into<f64>>(values: &[T]) -> Option<Vec<f64>> {
        Some(values.iter().map(|v| (*v).into()).collect())
    }
    match data {
        NumericData::Int8 { real, imag: None } => all(real),
        NumericData::UInt8 { real, imag: None } => all(real),
        NumericData::Int16 { real, imag: None } => all(real),
        NumericData::UInt16 { real, imag: None } => all(real),
        NumericData::Int32 { real, imag: None } => all(real),
        NumericData::UInt32 { real, imag: None } => all(real),
        NumericData::Int64 { real, imag: None } => Some(real.iter().map(|v| *v as f64).collect()),
        NumericData::UInt64 { real, imag: None } => Some(real.iter().map(|v| *v as f64).collect()),
        NumericData::Single { real, imag: None } => all(real),
        NumericData::Double { real, imag: None } => all(real),
        _ => None,
    }
}
