//! A lake: the rows of many devices in one Parquet file or in a folder of them, told apart by a column `device`.
//!
//! Row groups are read one after the other, each once; a device is given away behind the last row group that it is in, so
//! that what is in memory is one row group and the devices that are not yet complete. Nothing is interpreted: what the
//! columns mean is said where they are made a recording.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

use parquet::basic::Type;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::read::{Column, read_column, refuse_codecs, unreadable};
use super::sizes;
use crate::error::ReadError;
use crate::layout::Field;
use crate::memory;
use crate::{Cells, Values};

/// The column that tells devices apart.
const DEVICE: &str = "device";

/// Columns by their names.
type Columns = Vec<(String, Values)>;

/// Many devices in Parquet.
#[derive(Debug)]
pub struct Lake {
    path: PathBuf,
    files: Vec<PathBuf>,
    /// file and row group in which each device ends
    ends: BTreeMap<String, (usize, usize)>,
}

impl Lake {
    /// Looks into a Parquet file, or a folder of them, for devices; none where no file has a column `device`.
    ///
    /// # Errors
    /// [`ReadError`]: a file cannot be read, or one of several has no such column.
    pub fn open(path: &Path) -> Result<Option<Self>, ReadError> {
        let is_parquet = |p: &Path| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
        let mut files = vec![path.to_path_buf()];
        if path.is_dir() {
            let entries = std::fs::read_dir(path).map_err(|error| ReadError::io(path, error))?;
            files = entries.flatten().map(|entry| entry.path()).filter(|p| is_parquet(p) && p.is_file()).collect();
            files.sort();
        } else if !is_parquet(path) {
            return Ok(None);
        }
        let mut ends = BTreeMap::new();
        let mut without = None;
        for (at, file) in files.iter().enumerate() {
            match guarded(file, |source| devices(source, at, &mut ends))? {
                true => {}
                false => without = without.or(Some(file)),
            }
        }
        match (ends.is_empty(), without) {
            (true, _) => Ok(None),
            (false, Some(file)) => {
                Err(refuse(file, "has no column `device`, as other files of the folder have".into()))
            }
            (false, None) => Ok(Some(Self { path: path.to_path_buf(), files, ends })),
        }
    }

    /// The file or the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the devices, in order.
    pub fn devices(&self) -> impl Iterator<Item = &str> {
        self.ends.keys().map(String::as_str)
    }

    /// Gives the columns of every device, all but `device`, as soon as it is complete.
    ///
    /// # Errors
    /// [`ReadError`] of a file, or what `take` says.
    pub fn each<E: From<ReadError>>(
        &self,
        mut take: impl FnMut(String, Vec<(String, Values)>) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut begun: BTreeMap<String, Columns> = BTreeMap::new();
        for (at, file) in self.files.iter().enumerate() {
            let groups = guarded(file, |source| Ok(open(source)?.num_row_groups()))?;
            for group in 0..groups {
                let read = guarded(file, |source| rows(source, group))?;
                let bytes: usize = begun.values().flatten().map(|(_, values)| size(values)).sum();
                memory::allow(bytes as u64, "devices that are not complete", file)?;
                split(read, &mut begun, file)?;
                let is_complete = |device: &String| self.ends.get(device) == Some(&(at, group));
                let complete: BTreeSet<String> = begun.keys().filter(|d| is_complete(d)).cloned().collect();
                for device in complete {
                    let columns = begun.remove(&device).unwrap_or_default();
                    take(device, columns)?;
                }
            }
        }
        Ok(())
    }
}

fn refuse(source: &Path, what: String) -> ReadError {
    ReadError::Parquet { path: source.to_path_buf(), what }
}

/// A decoder that panics has a damaged file before it.
fn guarded<T>(source: &Path, read: impl FnOnce(&Path) -> Result<T, ReadError>) -> Result<T, ReadError> {
    memory::guarded(|| read(source)).ok_or_else(|| refuse(source, "the file is damaged".to_owned()))?
}

fn open(source: &Path) -> Result<SerializedFileReader<File>, ReadError> {
    let mut file = File::open(source).map_err(|error| ReadError::io(source, error))?;
    sizes::check_footer(&mut file, source)?;
    SerializedFileReader::new(file).map_err(|error| refuse(source, error.to_string()))
}

/// Notes the devices of a file and the row groups in which they end; false where there is no column of them.
fn devices(source: &Path, file: usize, ends: &mut BTreeMap<String, (usize, usize)>) -> Result<bool, ReadError> {
    let reader = open(source)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let Some(at) = schema.columns().iter().position(|c| c.path().string() == DEVICE) else { return Ok(false) };
    for group in 0..reader.num_row_groups() {
        let (_, names) = columns(&reader, group, &[at], source)?.remove(0);
        for name in texts(names).iter() {
            if ends.get(name) != Some(&(file, group)) {
                ends.insert(name.to_owned(), (file, group));
            }
        }
    }
    Ok(true)
}

/// All columns of a row group.
fn rows(source: &Path, group: usize) -> Result<Columns, ReadError> {
    let reader = open(source)?;
    let all = reader.metadata().file_metadata().schema_descr_ptr().num_columns();
    columns(&reader, group, &(0..all).collect::<Vec<_>>(), source)
}

/// Columns of a row group, with what each takes checked before.
fn columns(
    reader: &SerializedFileReader<File>,
    group: usize,
    kept: &[usize],
    source: &Path,
) -> Result<Columns, ReadError> {
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let why = |at: usize| unreadable(&schema.column(at), false);
    // what is no number or text may be of no concern: that is for the recording to say, and not read before
    let unread = kept.iter().filter_map(|&at| Some((schema.column(at).path().string(), why(at)?)));
    let rows = usize::try_from(reader.metadata().row_group(group).num_rows()).unwrap_or(0);
    let unread: Columns = unread.map(|(name, why)| (name, Values::Unreadable { rows, why })).collect();
    let kept: Vec<usize> = kept.iter().copied().filter(|&at| why(at).is_none()).collect();
    let kept = kept.as_slice();
    let mut fields = vec![];
    for at in kept {
        let is_text = matches!(schema.column(*at).physical_type(), Type::BYTE_ARRAY | Type::BOOLEAN);
        fields.push(if is_text { Field::Text(0) } else { Field::Number(0) });
    }
    refuse_codecs(reader, kept, source)?;
    let is_text: Vec<bool> = fields.iter().map(|field| matches!(field, Field::Text(_))).collect();
    let groups = reader.metadata().row_groups().get(group..=group).unwrap_or_default();
    let pages = File::open(source).map_err(|error| ReadError::io(source, error))?;
    sizes::check(groups, kept, &is_text, pages, source)?;
    let read = |(at, field): (&usize, &Field)| {
        let values = match read_column(reader, group..group + 1, *at, *field, false) {
            Ok(Column::Numbers(values, _)) => Values::Numbers(values),
            Ok(Column::Texts(cells)) => Values::Texts(cells),
            Err(error) => return Err(refuse(source, error.to_string())),
        };
        Ok((schema.column(*at).path().string(), values))
    };
    let read: Result<Columns, _> = kept.iter().zip(&fields).map(read).collect();
    Ok(read?.into_iter().chain(unread).collect())
}

/// Puts the rows of a row group to those of their devices.
fn split(mut read: Columns, begun: &mut BTreeMap<String, Columns>, source: &Path) -> Result<(), ReadError> {
    let at = read.iter().position(|(name, _)| name == DEVICE);
    let names = texts(at.map_or(Values::Numbers(vec![]), |at| read.remove(at).1));
    if let Some((name, _)) = read.iter().find(|(_, values)| values.len() != names.len()) {
        return Err(refuse(source, format!("column `{name}` has not as many rows as `{DEVICE}`")));
    }
    let mut row = 0;
    while let Some(device) = names.get(row) {
        let next = (row..names.len()).find(|at| names.get(*at) != Some(device)).unwrap_or(names.len());
        if !begun.contains_key(device) {
            begun.insert(device.to_owned(), read.iter().map(|(name, values)| (name.clone(), like(values))).collect());
        }
        let Some(own) = begun.get_mut(device) else { break };
        if !own.iter().map(|c| &c.0).eq(read.iter().map(|c| &c.0)) {
            return Err(refuse(
                source,
                format!("`{device}` goes on with other columns than it has in the file before"),
            ));
        }
        for ((name, to), (_, from)) in own.iter_mut().zip(&read) {
            match (to, from) {
                (Values::Numbers(to), Values::Numbers(from)) => to.extend_from_slice(&from[row..next]),
                (Values::Texts(to), Values::Texts(from)) => {
                    (row..next).for_each(|at| to.push(from.get(at).unwrap_or_default()));
                }
                (Values::Unreadable { rows, .. }, Values::Unreadable { .. }) => *rows += next - row,
                (_, _) => {
                    return Err(refuse(source, format!("column `{name}` is of another type than in the file before")));
                }
            }
        }
        row = next;
    }
    Ok(())
}

/// No values, of the kind of these.
fn like(values: &Values) -> Values {
    match values {
        Values::Numbers(_) => Values::Numbers(vec![]),
        Values::Texts(_) => Values::Texts(Cells::default()),
        Values::Unreadable { why, .. } => Values::Unreadable { rows: 0, why: why.clone() },
    }
}

fn texts(values: Values) -> Cells {
    match values {
        Values::Texts(cells) => cells,
        // what is not there has no name
        Values::Numbers(numbers) => {
            numbers.iter().map(|v| if v.is_nan() { String::new() } else { v.to_string() }).collect()
        }
        Values::Unreadable { rows, .. } => (0..rows).map(|_| "").collect(),
    }
}

fn size(values: &Values) -> usize {
    match values {
        Values::Numbers(numbers) => size_of_val(numbers.as_slice()),
        Values::Texts(cells) => cells.iter().map(|cell| cell.len() + size_of::<usize>()).sum(),
        Values::Unreadable { .. } => 0,
    }
}
