//! A recording as Parquet: numbers as nullable f64, NaN as null, unknown columns as text.
//!
//! One row group, Snappy. It has no options. Units are in the metadata of the file where a column would otherwise be taken for
//! one in another (`stated.rs`).

use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use crate::{Cells, Outlet, Recording, Values, stated};

impl Recording {
    /// Writes the recording as Parquet, in the order of its columns.
    ///
    /// # Errors
    /// What the writer says, or [`io::ErrorKind::InvalidInput`] for a column without one value a row.
    pub fn write_parquet(&self, writer: impl Write + Send) -> io::Result<()> {
        let outlets = self.even_outlets()?;
        let units = self.stated_units(&outlets).unwrap_or_default();
        let stated =
            outlets.iter().zip(units).map(|((name, _), unit)| KeyValue::new(stated::key(name), unit.to_owned()));
        write(&outlets, stated.collect(), writer).map_err(io::Error::other)
    }
}

/// Writes columns of one length as Parquet, in their order: of results, say.
///
/// # Errors
/// What the writer says, or [`io::ErrorKind::InvalidInput`] for columns that differ in length or cannot be
/// read.
pub fn write_parquet(columns: &[(String, Values)], writer: impl Write + Send) -> io::Result<()> {
    let outlets: Vec<(&str, Outlet<'_>)> = columns
        .iter()
        .map(|(name, values)| match values {
            Values::Numbers(numbers) => Ok((name.as_str(), Outlet::Numbers(numbers))),
            Values::Texts(cells) => Ok((name.as_str(), Outlet::Texts(cells))),
            Values::Unreadable { why, .. } => {
                Err(io::Error::new(io::ErrorKind::InvalidInput, format!("column `{name}` {why}")))
            }
        })
        .collect::<Result<_, _>>()?;
    even(&outlets)?;
    write(&outlets, Vec::new(), writer).map_err(io::Error::other)
}

/// Writes columns of numbers, borrowed, as Parquet, in their order.
///
/// # Errors
/// As [`write_parquet`].
pub fn write_parquet_numbers(columns: &[(&str, &[f64])], writer: impl Write + Send) -> io::Result<()> {
    let outlets: Vec<(&str, Outlet<'_>)> = columns.iter().map(|(name, v)| (*name, Outlet::Numbers(v))).collect();
    even(&outlets)?;
    write(&outlets, Vec::new(), writer).map_err(io::Error::other)
}

fn even(outlets: &[(&str, Outlet<'_>)]) -> io::Result<()> {
    if outlets.windows(2).any(|w| w[0].1.len() != w[1].1.len()) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the columns differ in length"));
    }
    Ok(())
}

fn write(outlets: &[(&str, Outlet<'_>)], units: Vec<KeyValue>, writer: impl Write + Send) -> Result<(), ParquetError> {
    let fields = outlets.iter().map(|(name, outlet)| field(name, outlet).map(Arc::new)).collect::<Result<_, _>>()?;
    let schema = Arc::new(Type::group_type_builder("recording").with_fields(fields).build()?);
    let units = Some(units).filter(|units| !units.is_empty());
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).set_key_value_metadata(units);
    let properties = Arc::new(properties.build());
    let mut file = SerializedFileWriter::new(writer, schema, properties)?;
    let mut group = file.next_row_group()?;
    for (_, outlet) in outlets {
        match outlet {
            Outlet::Numbers(values) => write_numbers(&mut group, values)?,
            Outlet::Texts(cells) => write_texts(&mut group, cells)?,
        }
    }
    group.close()?;
    file.close()?;
    Ok(())
}

fn field(name: &str, outlet: &Outlet<'_>) -> Result<Type, ParquetError> {
    match outlet {
        Outlet::Numbers(_) => {
            Type::primitive_type_builder(name, PhysicalType::DOUBLE).with_repetition(Repetition::OPTIONAL).build()
        }
        Outlet::Texts(_) => Type::primitive_type_builder(name, PhysicalType::BYTE_ARRAY)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(Some(LogicalType::String))
            .build(),
    }
}

fn write_numbers<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &[f64],
) -> Result<(), ParquetError> {
    let present: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_finite())).collect();
    if let Some(mut column) = group.next_column()? {
        column.typed::<DoubleType>().write_batch(&present, Some(&levels), None)?;
        column.close()?;
    }
    Ok(())
}

fn write_texts<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    cells: &Cells,
) -> Result<(), ParquetError> {
    let texts: Vec<ByteArray> = cells.iter().map(ByteArray::from).collect();
    if let Some(mut column) = group.next_column()? {
        column.typed::<ByteArrayType>().write_batch(&texts, None, None)?;
        column.close()?;
    }
    Ok(())
}
