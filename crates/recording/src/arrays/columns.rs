//! Arrays into a table: which of them are columns, and of how many rows.

use std::path::Path;

use crate::channel::Channel;
use crate::error::{Place, ReadError};
use crate::layout::{Field, Layout};
use crate::naming::Naming;
use crate::table::{Missing, Places, Table};
use crate::unknown::Cells;

/// What an array is that is of another form.
const NEITHER: &str = "is neither a column nor a table of columns";
/// Columns that a matrix may have: one with more is no list of channels.
const MOST_COLUMNS: usize = 64;

/// A named array of numbers, or why it is none.
pub(super) type Named = (String, Result<Vec<f64>, String>);

pub(super) fn refuse(source: &Path, kind: &'static str, what: String) -> ReadError {
    ReadError::Container { path: source.to_path_buf(), kind, what }
}

/// Why an array of this size is not read, given how many values the time has.
#[cfg(feature = "hdf5")]
pub(super) fn unneeded(size: &[u64], rows: u64) -> Option<String> {
    let long: Vec<u64> = size.iter().copied().filter(|n| *n > 1).collect();
    let values = match *long.as_slice() {
        // none of a dimension, or one
        [] => size.iter().copied().min().unwrap_or(1),
        [values] => values * u64::from(!size.contains(&0)),
        [values, columns] if columns <= MOST_COLUMNS as u64 => values,
        _ => return Some(NEITHER.into()),
    };
    (values != rows).then(|| format!("has {values} values, the time {rows},"))
}

/// Adds an array: a vector as it is, a matrix column by column.
pub(super) fn push(arrays: &mut Vec<Named>, name: &str, size: &[usize], values: Option<Vec<f64>>, by_columns: bool) {
    let Some(values) = values else {
        arrays.push((name.to_owned(), Err("holds no real numbers".into())));
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
        _ => arrays.push((name.to_owned(), Err(NEITHER.into()))),
    }
}

pub(super) fn table(arrays: Vec<Named>, naming: &Naming, source: &Path) -> Result<Table, ReadError> {
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
