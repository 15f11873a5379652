//! HDF5, and MATLAB's `.mat` of version 7.3, which is HDF5.

use std::collections::HashMap;
use std::path::Path;

use crate::Recording;
use crate::admission;
use crate::arrays::columns::{Named, push, refuse, table, unneeded};
use crate::channel::Channel;
use crate::error::ReadError;
use crate::memory::{self, HELD, PER_NUMBER, PER_TEXT};
use crate::naming::Naming;
use crate::stamp::Stamp;

const KIND: &str = "an HDF5 file";
/// Groups within groups that are looked into.
const DEEPEST_GROUP: usize = 8;
/// Most bytes of a date with its time.
const LONGEST_DATE: usize = 64;

/// A data set that may be a column.
struct Listed {
    path: String,
    size: Vec<u64>,
}

/// Reads a recording from the bytes of an HDF5 file.
pub(super) fn read(bytes: Vec<u8>, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    let damaged = || refuse(source, KIND, "the file is damaged".to_owned());
    let (arrays, dated) = memory::guarded(|| decode(bytes, naming, source)).ok_or_else(damaged)??;
    let mut table = table(arrays, naming, source)?;
    table.warnings.extend(dated);
    admission::admit(table, naming, source)
}

/// The arrays of a file, and what there is to say where the time is one of dates.
fn decode(bytes: Vec<u8>, naming: &Naming, source: &Path) -> Result<(Vec<Named>, Option<String>), ReadError> {
    let say = |error: hdf5_pure::Error| refuse(source, KIND, error.to_string());
    let held = bytes.len() as u64;
    let file = hdf5_pure::File::from_bytes(bytes).map_err(say)?;
    let mut listed = Vec::new();
    look_through(&file.root(), "", DEEPEST_GROUP, &mut listed).map_err(say)?;
    let names = shortened(&listed);
    let time = names.iter().position(|name| naming.channel(name) == Some(Channel::Time));
    let rows = time.map(|at| listed[at].size.iter().copied().fold(1, u64::saturating_mul));
    let unneeded: Vec<Option<String>> =
        listed.iter().map(|array| rows.and_then(|rows| unneeded(&array.size, rows))).collect();
    let mut needed = held;
    for ((array, name), _) in listed.iter().zip(&names).zip(&unneeded).filter(|(_, unneeded)| unneeded.is_none()) {
        let dataset = file.dataset(&array.path).map_err(say)?;
        let element = dataset.element_size().map_err(say)?;
        let values = array.size.iter().copied().fold(1, u64::saturating_mul);
        // a part of an array is unfolded as a whole, whatever of it is used
        let part = dataset.chunk_shape().map_err(say)?.unwrap_or_default().into_iter().fold(1, u64::saturating_mul);
        let is_column = naming.channel(name).is_some() && is_number(&dataset);
        let each = if is_column { HELD } else { PER_NUMBER + PER_TEXT + element };
        needed = needed.saturating_add(values.saturating_mul(each));
        memory::allow(needed.saturating_add(part.saturating_mul(2 * element)), "its arrays", source)?;
    }
    let (mut arrays, mut dated) = (Vec::new(), None);
    for ((array, name), unneeded) in listed.iter().zip(&names).zip(unneeded) {
        if let Some(why) = unneeded {
            arrays.push((name.clone(), Err(why)));
            continue;
        }
        // texts that are no dates, and compounds, are no columns
        let dataset = file.dataset(&array.path).map_err(say)?;
        let mut values = dataset.read_f64().ok();
        if values.is_none() {
            let (seconds, said) = dates(&dataset).unzip();
            values = seconds;
            dated = said.filter(|_| naming.channel(name) == Some(Channel::Time)).or(dated);
        }
        if dated.is_some() && naming.factor(Channel::Time).is_some_and(|factor| factor != 1.0) {
            let what = format!("`{name}` is of dates, and the mapping of `t_s` has a factor; wanted none");
            return Err(refuse(source, KIND, what));
        }
        let size: Vec<usize> = array.size.iter().map(|&n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
        push(&mut arrays, name, &size, values, false);
    }
    Ok((arrays, dated))
}

/// Whether a data set is of plain numbers, which are decoded a part at a time.
fn is_number(dataset: &hdf5_pure::Dataset) -> bool {
    use hdf5_pure::DType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    matches!(dataset.dtype(), Ok(F32 | F64 | I8 | I16 | I32 | I64 | U8 | U16 | U32 | U64))
}

/// Texts that are all dates, as seconds from the first, and what there is to say of them.
fn dates(dataset: &hdf5_pure::Dataset) -> Option<(Vec<f64>, String)> {
    let count = usize::try_from(dataset.shape().ok()?.into_iter().fold(1, u64::saturating_mul)).ok()?;
    let most = count.checked_mul(LONGEST_DATE)?;
    // those of any length say it in what they refer to
    let texts = match dataset.vlen_string_payload_size() {
        Ok(bytes) if bytes > most as u64 => return None,
        Err(_) if dataset.element_size().ok()? > LONGEST_DATE as u64 => return None,
        _ => dataset.read_string().ok()?,
    };
    let first = Stamp::of(texts.first()?.as_bytes())?;
    let mut seconds: Vec<f64> = texts.iter().map(|text| first.seconds_to(text.as_bytes())).collect::<Option<_>>()?;
    let said = first.over_midnights(&mut seconds);
    Some((seconds, said))
}

fn look_through(
    group: &hdf5_pure::Group,
    path: &str,
    depth: usize,
    listed: &mut Vec<Listed>,
) -> Result<(), hdf5_pure::Error> {
    for name in group.datasets()? {
        let size = group.dataset(&name)?.shape()?;
        listed.push(Listed { path: format!("{path}{name}"), size });
    }
    for name in group.groups()?.into_iter().filter(|_| depth > 0) {
        // MATLAB keeps its own bookkeeping there
        if name != "#refs#" {
            look_through(&group.group(&name)?, &format!("{path}{name}/"), depth - 1, listed)?;
        }
    }
    Ok(())
}

/// The last part of each path where it is no other's.
fn shortened(listed: &[Listed]) -> Vec<String> {
    let last = |path: &str| path.rsplit('/').next().unwrap_or(path).to_owned();
    let mut times: HashMap<String, usize> = HashMap::new();
    for array in listed {
        *times.entry(last(&array.path)).or_default() += 1;
    }
    let name = |array: &Listed| {
        let end = last(&array.path);
        if times[&end] == 1 { end } else { array.path.clone() }
    };
    listed.iter().map(name).collect()
}
