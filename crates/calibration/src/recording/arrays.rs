//! Recordings in containers of arrays: MATLAB's `.mat` (version 5, and 7.3 as HDF5) and HDF5.
//!
//! A column is an array of one value a row; of a matrix, each column is one, named `name(:,1)` as MATLAB does. Arrays of
//! another length than the time's are left out with a warning. Groups of an HDF5 file are looked through; a column keeps
//! the last part of its path as its name where no other has it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use matfile::{MatFile, NumericData};

use super::Recording;
use super::admission;
use super::channel::Channel;
use super::error::{Place, ReadError};
use super::layout::{Field, Layout};
use super::naming::Naming;
use super::table::{Missing, Places, Table};
use super::unknown::Cells;

/// Groups within groups that are looked into.
const DEEPEST_GROUP: usize = 8;
/// Columns that a matrix may have: one with more is no list of channels.
const MOST_COLUMNS: usize = 64;

/// What bytes begin with that are one of these.
pub(super) fn is_mat_5(head: &[u8]) -> bool {
    head.starts_with(b"MATLAB 5.0")
}

/// Whether bytes are HDF5, with or without MATLAB's header before it.
pub(super) fn is_hdf5(head: &[u8]) -> bool {
    head.starts_with(b"\x89HDF\r\n\x1a\n") || head.starts_with(b"MATLAB 7.3")
}

/// A named array of numbers, or why it is none.
type Named = (String, Result<Vec<f64>, &'static str>);

/// Reads a recording from the bytes of a `.mat` file of version 5.
pub(super) fn read_mat_5(bytes: &[u8], naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
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

/// Reads a recording from the bytes of an HDF5 file.
pub(super) fn read_hdf5(bytes: Vec<u8>, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    let decoded = catch_unwind(AssertUnwindSafe(|| -> Result<Vec<Named>, hdf5_pure::Error> {
        let file = hdf5_pure::File::from_bytes(bytes)?;
        let mut arrays = Vec::new();
        look_through(&file.root(), "", DEEPEST_GROUP, &mut arrays)?;
        Ok(arrays)
    }));
    let arrays = decoded.map_or_else(|_| Err("the file is damaged".to_owned()), |r| r.map_err(|e| e.to_string()));
    let arrays = shortened(arrays.map_err(|what| refuse(source, "an HDF5 file", what))?);
    admission::admit(table(arrays, naming, source)?, source)
}

fn refuse(source: &Path, kind: &'static str, what: String) -> ReadError {
    ReadError::Container { path: source.to_path_buf(), kind, what }
}

fn look_through(
    group: &hdf5_pure::Group,
    path: &str,
    depth: usize,
    arrays: &mut Vec<Named>,
) -> Result<(), hdf5_pure::Error> {
    for name in group.datasets()? {
        let dataset = group.dataset(&name)?;
        let size: Vec<usize> = dataset.shape()?.iter().map(|&n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
        // texts and compounds are no columns
        let values = dataset.read_f64().ok();
        push(arrays, &format!("{path}{name}"), &size, values, false);
    }
    for name in group.groups()?.into_iter().filter(|_| depth > 0) {
        // MATLAB keeps its own bookkeeping there
        if name != "#refs#" {
            look_through(&group.group(&name)?, &format!("{path}{name}/"), depth - 1, arrays)?;
        }
    }
    Ok(())
}

/// The last part of each path where it is no other's.
fn shortened(arrays: Vec<Named>) -> Vec<Named> {
    let last = |path: &str| path.rsplit('/').next().unwrap_or(path).to_owned();
    let ends: Vec<String> = arrays.iter().map(|(path, _)| last(path)).collect();
    arrays
        .into_iter()
        .map(|(path, values)| {
            let end = last(&path);
            let alone = ends.iter().filter(|e| **e == end).count() == 1;
            (if alone { end } else { path }, values)
        })
        .collect()
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

/// Adds an array: a vector as it is, a matrix column by column.
fn push(arrays: &mut Vec<Named>, name: &str, size: &[usize], values: Option<Vec<f64>>, by_columns: bool) {
    let Some(values) = values else {
        arrays.push((name.to_owned(), Err("holds no real numbers")));
        return;
    };
    let long: Vec<usize> = size.iter().copied().filter(|n| *n > 1).collect();
    match *long.as_slice() {
        [] | [_] => arrays.push((name.to_owned(), Ok(values))),
        [rows, columns] if columns <= MOST_COLUMNS && rows.checked_mul(columns) == Some(values.len()) => {
            for c in 0..columns {
                let column = if by_columns {
                    values[c * rows..(c + 1) * rows].to_vec()
                } else {
                    values[c..].iter().copied().step_by(columns).collect()
                };
                arrays.push((format!("{name}(:,{})", c + 1), Ok(column)));
            }
        }
        _ => arrays.push((name.to_owned(), Err("is neither a column nor a table of columns"))),
    }
}

fn table(arrays: Vec<Named>, naming: &Naming, source: &Path) -> Result<Table, ReadError> {
    let mut warnings = Vec::new();
    let time = arrays.iter().find(|(name, _)| naming.channel(name) == Some(Channel::Time));
    let rows = time.and_then(|(_, values)| values.as_ref().ok()).map(Vec::len);
    let mut kept: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, values) in arrays {
        match values {
            Ok(values) if rows.is_none_or(|rows| values.len() == rows) => kept.push((name, values)),
            Ok(values) => warnings.push(format!(
                "`{name}` has {} values, the time {}, and is left out",
                values.len(),
                rows.unwrap_or_default()
            )),
            Err(why) => warnings.push(format!("`{name}` {why} and is left out")),
        }
    }
    let names: Vec<&str> = kept.iter().map(|(name, _)| name.as_str()).collect();
    let layout = Layout::new(&names, naming, source)?;
    let mut table = Table::new(&layout, Place::Row(0), Places::Rows);
    table.warnings = warnings;
    table.rows = rows.unwrap_or_default();
    for ((_, mut values), field) in kept.into_iter().zip(&layout.fields) {
        match *field {
            Field::Number(at) => {
                let mut missing = Missing::default();
                for (row, value) in values.iter_mut().enumerate().filter(|(_, v)| !v.is_finite()) {
                    *value = f64::NAN;
                    missing.add(row);
                }
                (table.numbers[at].values, table.numbers[at].missing) = (values, missing);
            }
            Field::Text(at) => table.unknown[at].cells = values.iter().map(f64::to_string).collect::<Cells>(),
        }
    }
    Ok(table)
}
