//! A Parquet file into a table: numbers of any common type as f64, nulls as missing, unknown columns as text.
//!
//! A time that is a time stamp is counted from the first, in s. Nested columns and times of day are refused where a number is
//! wanted, and left out with a warning where nothing is.

use std::fs::File;
use std::ops::Range;
use std::path::Path;

use parquet::basic::{Compression, LogicalType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescPtr;

use crate::Recording;
use crate::admission;
use crate::channel::Channel;
use crate::error::{Place, ReadError};
use crate::layout::{Field, Layout};
use crate::memory;
use crate::naming::Naming;
use crate::parquet::sizes;
use crate::stated;
use crate::table::{Missing, Places, Table};
use crate::unknown::Cells;

const BATCH_ROWS: usize = 64 << 10;

/// Reads a recording.
pub(crate) fn read(file: File, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    // The decoder asserts what a damaged file does not hold.
    let decoded = memory::guarded(|| decode(file, naming, source));
    let damaged = || ReadError::Parquet { path: source.to_path_buf(), what: "the file is damaged".to_owned() };
    admission::admit(decoded.ok_or_else(damaged)??, naming, source)
}

fn decode(file: File, naming: &Naming, source: &Path) -> Result<Table, ReadError> {
    let refuse = |what: String| ReadError::Parquet { path: source.to_path_buf(), what };
    let mut pages = file.try_clone().map_err(|error| ReadError::io(source, error))?;
    sizes::check_footer(&mut pages, source)?;
    let reader = SerializedFileReader::new(file).map_err(|error| refuse(error.to_string()))?;
    let descriptions = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut warnings, mut has_stamps) = (vec![], false);
    let mut kept: Vec<usize> = vec![];
    let mut names: Vec<&str> = vec![];
    for (at, description) in descriptions.columns().iter().enumerate() {
        let name = description.path().parts().first().map_or("", String::as_str);
        let is_channel = naming.channel(name).is_some();
        let is_stamp = naming.channel(name) == Some(Channel::Time) && tick_s(description).is_some();
        if is_stamp && naming.factor(Channel::Time).is_some_and(|factor| factor != 1.0) {
            return Err(refuse(format!(
                "column `{name}` is of time stamps, and the mapping of `t_s` has a factor; wanted none"
            )));
        }
        if is_stamp {
            has_stamps = true;
            warnings.push("times are time stamps: `t_s` is counted from the first, in s".to_owned());
        }
        match unreadable(description, is_channel).filter(|_| !is_stamp) {
            None => {
                kept.push(at);
                names.push(name);
            }
            Some(why) if is_channel => return Err(refuse(format!("column `{name}` {why}; wanted plain numbers"))),
            Some(why) => warnings.push(format!("column `{}` {why} and is left out", description.path().string())),
        }
    }
    let layout = Layout::new(&names, naming, source)?;
    let mut table = Table::new(&layout, Place::Row(0), Places::Rows);
    table.warnings = warnings;
    // time stamps have a unit of their own
    table.units = units(&reader, naming);
    table.units.retain(|(channel, _)| !(has_stamps && *channel == Channel::Time));
    refuse_codecs(&reader, &kept, source)?;
    let is_text: Vec<bool> = layout.fields.iter().map(|field| matches!(field, Field::Text(_))).collect();
    sizes::check(reader.metadata().row_groups(), &kept, &is_text, pages, source)?;

    // One after the other: readers of one file share its position.
    let columns: Vec<Column> = kept
        .iter()
        .zip(&layout.fields)
        .map(|(&at, field)| {
            let is_time = matches!(field, Field::Number(at) if layout.channels[*at] == Channel::Time);
            read_column(&reader, 0..reader.num_row_groups(), at, *field, is_time)
        })
        .collect::<Result<_, ParquetError>>()
        .map_err(|error| refuse(error.to_string()))?;
    table.rows = columns.first().map_or(0, Column::len);
    for (column, (field, name)) in columns.into_iter().zip(layout.fields.iter().zip(&layout.names)) {
        if column.len() != table.rows {
            let (found, rows) = (column.len(), table.rows);
            return Err(refuse(format!("column `{name}` has {found} rows, the first column has {rows}")));
        }
        match (column, *field) {
            (Column::Numbers(values, missing), Field::Number(at)) => {
                (table.numbers[at].values, table.numbers[at].missing) = (values, missing);
            }
            (Column::Texts(cells), Field::Text(at)) => table.unknown[at].cells = cells,
            _ => return Err(refuse(format!("column `{name}` changes its type"))),
        }
    }
    Ok(table)
}

/// The units of channels that the metadata of the file states, as a recording that was written does where it has to.
fn units(reader: &SerializedFileReader<File>, naming: &Naming) -> Vec<(Channel, String)> {
    let stated = reader.metadata().file_metadata().key_value_metadata().into_iter().flatten();
    let of_channel = |entry: &KeyValue| {
        let channel = naming.channel(stated::column(&entry.key)?)?;
        let unit = entry.value.as_deref().filter(|unit| *unit != "-")?;
        Some((channel, unit.to_owned()))
    };
    stated.filter_map(of_channel).collect()
}

/// The unit of a column of time stamps, s.
fn tick_s(description: &ColumnDescPtr) -> Option<f64> {
    use parquet::basic::{ConvertedType, TimeUnit, Type};
    if description.physical_type() != Type::INT64 || description.max_rep_level() > 0 {
        return None;
    }
    match (description.logical_type_ref(), description.converted_type()) {
        (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
            TimeUnit::MILLIS => 1e-3,
            TimeUnit::MICROS => 1e-6,
            TimeUnit::NANOS => 1e-9,
        }),
        (None, ConvertedType::TIMESTAMP_MILLIS) => Some(1e-3),
        (None, ConvertedType::TIMESTAMP_MICROS) => Some(1e-6),
        _ => None,
    }
}

/// Why a column cannot be read, if it cannot.
pub(super) fn unreadable(description: &ColumnDescPtr, is_channel: bool) -> Option<String> {
    use parquet::basic::Type;
    if description.path().parts().len() > 1 || description.max_rep_level() > 0 {
        return Some("is nested or repeated".to_owned());
    }
    let physical = description.physical_type();
    let is_number = matches!(physical, Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE);
    match description.logical_type_ref() {
        None | Some(LogicalType::Integer(_) | LogicalType::String) => {}
        Some(other) => return Some(format!("is of the logical type {other:?}")),
    }
    let is_text = matches!(physical, Type::BYTE_ARRAY | Type::BOOLEAN);
    let is_readable = is_number || (!is_channel && is_text);
    (!is_readable).then(|| format!("is of the type {physical}"))
}

pub(super) fn refuse_codecs(
    reader: &SerializedFileReader<File>,
    kept: &[usize],
    source: &Path,
) -> Result<(), ReadError> {
    for group in reader.metadata().row_groups() {
        for chunk in kept.iter().filter_map(|&at| group.columns().get(at)) {
            let codec = chunk.compression();
            if matches!(codec, Compression::ZSTD(_) | Compression::LZO) {
                let name = chunk.column_path().string();
                let what = format!(
                    "column `{name}` is compressed with {codec}, which is not supported; \
                     wanted no compression, SNAPPY, GZIP, LZ4, LZ4_RAW or BROTLI"
                );
                return Err(ReadError::Parquet { path: source.to_path_buf(), what });
            }
        }
    }
    Ok(())
}

pub(super) enum Column {
    Numbers(Vec<f64>, Missing),
    Texts(Cells),
}

impl Column {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values, _) => values.len(),
            Self::Texts(cells) => cells.len(),
        }
    }

    fn push_number(&mut self, value: Option<f64>) {
        if let Self::Numbers(values, missing) = self {
            let value = value.filter(|value| value.is_finite());
            if value.is_none() {
                missing.add(values.len());
            }
            values.push(value.unwrap_or(f64::NAN));
        }
    }
}

/// Reads a column of these row groups.
pub(super) fn read_column(
    reader: &SerializedFileReader<File>,
    groups: Range<usize>,
    at: usize,
    field: Field,
    is_time: bool,
) -> Result<Column, ParquetError> {
    // the first of time stamps: what is left of them has few enough digits for a number
    let mut first_stamp = None;
    let mut column = match field {
        Field::Number(_) => Column::Numbers(room_for(reader, groups.clone()), Missing::default()),
        Field::Text(_) => Column::Texts(Cells::default()),
    };
    for group in groups {
        let group = reader.get_row_group(group)?;
        let most = column.len() + usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let description = group.metadata().column(at).column_descr_ptr();
        let tick = tick_s(&description);
        let is_unsigned = matches!(description.logical_type_ref(), Some(LogicalType::Integer(kind)) if !kind.is_signed);
        // Unsigned integers are stored in the bits of signed ones.
        match group.get_column_reader(at)? {
            ColumnReader::DoubleColumnReader(values) => each(values, &description, |v| add(&mut column, v.copied()))?,
            ColumnReader::FloatColumnReader(values) => each(values, &description, |v| match &mut column {
                Column::Numbers(..) => column.push_number(v.map(|&v| f64::from(v))),
                Column::Texts(cells) => cells.push(&v.map(f32::to_string).unwrap_or_default()),
            })?,
            ColumnReader::Int32ColumnReader(values) => each(values, &description, |v| {
                let value = v.map(|&v| if is_unsigned { i64::from(v.cast_unsigned()) } else { i64::from(v) });
                add_integer(&mut column, value.map(i128::from));
            })?,
            ColumnReader::Int64ColumnReader(values) => each(values, &description, |v| {
                if let Some(tick) = tick.filter(|_| is_time) {
                    let mut from = |v: i64| i128::from(v) - i128::from(*first_stamp.get_or_insert(v));
                    column.push_number(v.map(|&v| from(v) as f64 * tick));
                    return;
                }
                let value = v.map(|&v| if is_unsigned { i128::from(v.cast_unsigned()) } else { i128::from(v) });
                add_integer(&mut column, value);
            })?,
            ColumnReader::BoolColumnReader(values) => each(values, &description, |v| match &mut column {
                Column::Texts(cells) => cells.push(&v.map(bool::to_string).unwrap_or_default()),
                Column::Numbers(..) => column.push_number(None),
            })?,
            ColumnReader::ByteArrayColumnReader(values) => {
                let mut refused = None;
                each(values, &description, |v| match (&mut column, v.map(|v| std::str::from_utf8(v.data()))) {
                    (Column::Texts(cells), None) => cells.push(""),
                    (Column::Texts(cells), Some(Ok(text))) => cells.push(text),
                    (Column::Texts(cells), Some(Err(_))) => {
                        refused.get_or_insert(cells.len() + 1);
                        cells.push("");
                    }
                    (Column::Numbers(..), _) => column.push_number(None),
                })?;
                if let Some(row) = refused {
                    let name = description.name();
                    return Err(ParquetError::General(format!("row {row}, column `{name}`: not text in UTF-8")));
                }
            }
            _ => return Err(ParquetError::General(format!("column `{}` changes its type", description.name()))),
        }
        if column.len() > most {
            return Err(ParquetError::General(format!("column `{}` has more rows than it says", description.name())));
        }
    }
    Ok(column)
}

/// Room for the rows of these row groups; without it now, a column grows as it needs it.
fn room_for(reader: &SerializedFileReader<File>, groups: Range<usize>) -> Vec<f64> {
    let rows = groups.map(|group| reader.metadata().row_group(group).num_rows()).fold(0, i64::saturating_add);
    let mut values = Vec::new();
    let _ = values.try_reserve_exact(usize::try_from(rows).unwrap_or_default());
    values
}

fn add(column: &mut Column, value: Option<f64>) {
    match column {
        Column::Numbers(..) => column.push_number(value),
        Column::Texts(cells) => cells.push(&value.as_ref().map(f64::to_string).unwrap_or_default()),
    }
}

fn add_integer(column: &mut Column, value: Option<i128>) {
    match column {
        Column::Numbers(..) => column.push_number(value.map(|value| value as f64)),
        Column::Texts(cells) => cells.push(&value.as_ref().map(i128::to_string).unwrap_or_default()),
    }
}

/// Gives each value of a column, nulls as `None`.
fn each<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    description: &ColumnDescPtr,
    mut take: impl FnMut(Option<&T::T>),
) -> Result<(), ParquetError> {
    let present = description.max_def_level();
    let (mut values, mut levels) = (vec![], vec![]);
    loop {
        values.clear();
        levels.clear();
        let (records, found, _) = reader.read_records(BATCH_ROWS, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Ok(());
        }
        if present == 0 {
            values.iter().take(found).for_each(|value| take(Some(value)));
            continue;
        }
        let mut values = values.iter().take(found);
        for &level in &levels {
            take(if level == present { values.next() } else { None });
        }
    }
}
