//! Columns that are in memory already: frames, arrays, what another program has read.
//!
//! They pass the same admission as the rows of a file, so that an answer does not depend on where the numbers lay.

use std::path::Path;

use super::Recording;
use super::admission;
use super::channel::Channel;
use super::csv::cell::{self, Cell, Decimal};
use super::error::{Place, ReadError};
use super::layout::{Field, Layout};
use super::memory;
use super::naming::Naming;
use super::stamp::Stamp;
use super::table::{Missing, Places, Table};
use super::unknown::Cells;

/// Columns by their names.
type Columns = Vec<(String, Values)>;

/// A column by its name, one value a row.
#[derive(Debug, Clone)]
pub enum Values {
    /// Numbers; what is not finite counts as missing.
    Numbers(Vec<f64>),
    /// Texts. Those of a channel are read as in CSV with a decimal point: numbers, words for none, and dates in the place of
    /// times; others are kept.
    Texts(Cells),
    /// Neither, such as lists: refused where a channel is wanted, else left out with a warning.
    Unreadable {
        /// how many values
        rows: usize,
        /// why, as what follows the column's name: "is of the type …"
        why: String,
    },
}

impl Values {
    /// How many values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(cells) => cells.len(),
            Self::Unreadable { rows, .. } => *rows,
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
    /// As [`Recording::read_named`], and where columns differ in length or a channel is neither numbers nor their text. Rows count
    /// from 1.
    pub fn of_columns(columns: Vec<(String, Values)>, naming: &Naming, source: &Path) -> Result<Self, ReadError> {
        let (columns, warnings) = readable(columns, naming, source)?;
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let layout = Layout::new(&names, naming, source)?;
        let rows = columns.first().map_or(0, |(_, values)| values.len());
        memory::allow_columns(columns.len(), rows, "the columns", source)?;
        let mut table = Table::new(&layout, Place::Row(0), Places::Rows);
        table.warnings = warnings;
        table.rows = rows;
        for (number, ((name, values), field)) in columns.into_iter().zip(&layout.fields).enumerate() {
            if values.len() != rows {
                let what = format!("column `{name}` has {} values, the first column has {rows}", values.len());
                let path = source.to_path_buf();
                return Err(ReadError::Format { path, what, wanted: "one value a row in every column" });
            }
            let values = match (values, *field) {
                (Values::Texts(cells), Field::Number(at)) => {
                    let is_time = layout.channels[at] == Channel::Time;
                    let read = numbers(&cells, is_time, naming).map_err(|(row, wanted)| ReadError::Cell {
                        path: source.to_path_buf(),
                        place: Place::Row(row as u64 + 1),
                        number: number + 1,
                        column: name.clone(),
                        text: cells.get(row).unwrap_or_default().chars().take(40).collect(),
                        wanted,
                    })?;
                    if let Some(said) = read.dated {
                        table.units.push((Channel::Time, "s".to_owned()));
                        table.warnings.push(said);
                    }
                    Values::Numbers(read.values)
                }
                (values, _) => values,
            };
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
                // made numbers, or not kept
                (Values::Texts(_), Field::Number(_)) | (Values::Unreadable { .. }, _) => {}
            }
        }
        let mut recording = admission::admit(table, naming, source)?;
        recording.in_memory = true;
        Ok(recording)
    }
}

/// The columns but for those that cannot be read, which are warnings where they are no channel.
fn readable(columns: Columns, naming: &Naming, source: &Path) -> Result<(Columns, Vec<String>), ReadError> {
    let (mut kept, mut warnings) = (Vec::new(), Vec::new());
    for (name, values) in columns {
        match values {
            Values::Unreadable { why, .. } if naming.channel(name.trim()).is_some() => {
                let (path, what) = (source.to_path_buf(), format!("column `{name}` {why}"));
                return Err(ReadError::Format { path, what, wanted: "numbers" });
            }
            Values::Unreadable { why, .. } => warnings.push(format!("column `{name}` {why} and is left out")),
            Values::Numbers(_) | Values::Texts(_) => kept.push((name, values)),
        }
    }
    Ok((kept, warnings))
}

/// What the texts of a channel say.
struct Said {
    values: Vec<f64>,
    /// what there is to say where they are dates or times of day, counted from the first
    dated: Option<String>,
}

/// Reads the texts of a channel; else the row of a cell that cannot be read, and what was wanted.
fn numbers(cells: &Cells, is_time: bool, naming: &Naming) -> Result<Said, (usize, &'static str)> {
    let read = |text: &str| cell::read(text.as_bytes(), Decimal::Point);
    let at = cells.iter().position(|text| read(text) != Cell::Missing);
    let first = at.filter(|_| is_time).and_then(|at| Stamp::of(cells.get(at)?.as_bytes()));
    if first.is_some() && naming.factor(Channel::Time).is_some_and(|factor| factor != 1.0) {
        return Err((at.unwrap_or_default(), "a number, as the mapping of `t_s` has a factor"));
    }
    let number = |(row, text): (usize, &str)| match (first, read(text)) {
        (_, Cell::Missing) => Ok(f64::NAN),
        (Some(first), _) => first.seconds_to(text.as_bytes()).ok_or((row, first.wanted())),
        (None, Cell::Number(value)) => Ok(value),
        (None, Cell::Text) => Err((row, "a number")),
    };
    let mut values = cells.iter().enumerate().map(number).collect::<Result<Vec<f64>, _>>()?;
    let dated = first.map(|first| first.over_midnights(&mut values));
    Ok(Said { values, dated })
}
