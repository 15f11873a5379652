//! Columns that are in memory already: frames, arrays, what another program has read.
//!
//! They pass the same admission as the rows of a file, so that an answer does not depend on where the numbers lay.

use std::path::Path;

use super::Recording;
use super::admission;
use super::error::{Place, ReadError};
use super::layout::{Field, Layout};
use super::memory;
use super::naming::Naming;
use super::table::{Missing, Places, Table};
use super::unknown::Cells;

/// A column by its name, one value a row.
#[derive(Debug, Clone)]
pub enum Values {
    /// Numbers; what is not finite counts as missing.
    Numbers(Vec<f64>),
    /// Texts; they are kept, and serve as no channel.
    Texts(Cells),
}

impl Values {
    /// How many values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(cells) => cells.len(),
        }
    }

    /// There is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Recording {
    /// Makes a recording of columns; `source` is the name that errors and warnings give it, and need not be of a file.
    ///
    /// # Errors
    /// As [`Recording::read_named`], and where columns differ in length or a channel is text. Rows count from 1.
    pub fn of_columns(columns: Vec<(String, Values)>, naming: &Naming, source: &Path) -> Result<Self, ReadError> {
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let layout = Layout::new(&names, naming, source)?;
        let rows = columns.first().map_or(0, |(_, values)| values.len());
        let bytes = rows.saturating_mul(columns.len()).saturating_mul(size_of::<f64>());
        memory::allow(bytes as u64, "the columns", source)?;
        let mut table = Table::new(&layout, Place::Row(0), Places::Rows);
        table.rows = rows;
        for (number, ((name, values), field)) in columns.into_iter().zip(&layout.fields).enumerate() {
            if values.len() != rows {
                let what = format!("column `{name}` has {} values, the first column has {rows}", values.len());
                let path = source.to_path_buf();
                return Err(ReadError::Format { path, what, wanted: "one value a row in every column" });
            }
            match (values, *field) {
                (Values::Numbers(mut values), Field::Number(at)) => {
                    let mut missing = Missing::default();
                    for (row, value) in values.iter_mut().enumerate().filter(|(_, v)| !v.is_finite()) {
                        *value = f64::NAN;
                        missing.add(row);
                    }
                    (table.numbers[at].values, table.numbers[at].missing) = (values, missing);
                }
                (Values::Texts(cells), Field::Text(at)) => table.unknown[at].cells = cells,
                (Values::Numbers(values), Field::Text(at)) => {
                    table.unknown[at].cells = values.iter().map(f64::to_string).collect();
                }
                (Values::Texts(cells), Field::Number(_)) => {
                    let text = cells.iter().next().unwrap_or_default().chars().take(40).collect();
                    let (path, place) = (source.to_path_buf(), Place::Row(1));
                    return Err(ReadError::Cell {
                        path,
                        place,
                        number: number + 1,
                        column: name,
                        text,
                        wanted: "a number",
                    });
                }
            }
        }
        let mut recording = admission::admit(table, naming, source)?;
        recording.in_memory = true;
        Ok(recording)
    }
}
