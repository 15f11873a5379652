//! HDF5, and MATLAB's `.mat` of version 7.3, which is HDF5.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::Recording;
use crate::admission;
use crate::arrays::columns::{Named, push, refuse, table};
use crate::error::ReadError;
use crate::naming::Naming;

/// Groups within groups that are looked into.
const DEEPEST_GROUP: usize = 8;

/// Reads a recording from the bytes of an HDF5 file.
pub(super) fn read(bytes: Vec<u8>, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
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
