//! Recordings in containers of arrays: MATLAB's `.mat` (version 5, and 7.3 as HDF5) and HDF5.
//!
//! A column is an array of one value a row; of a matrix, each column is one, named `name(:,1)` as MATLAB does. Arrays of
//! another length than the time's are left out with a warning. Groups of an HDF5 file and fields of a MATLAB
//! struct are looked through; a column keeps the last part of its path as its name where no other has it.

#[cfg(any(feature = "hdf5", feature = "matlab"))]
mod columns;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "matlab")]
mod mat_5;
#[cfg(feature = "matlab")]
mod structs;

use std::path::Path;

use super::Recording;
use super::error::ReadError;
use super::naming::Naming;

/// What bytes begin with that are one of these.
pub(super) fn is_one(head: &[u8]) -> bool {
    is_mat_5(head) || is_hdf5(head)
}

fn is_mat_5(head: &[u8]) -> bool {
    head.starts_with(b"MATLAB 5.0")
}

/// Whether bytes are HDF5, with or without MATLAB's header before it.
fn is_hdf5(head: &[u8]) -> bool {
    head.starts_with(b"\x89HDF\r\n\x1a\n") || head.starts_with(b"MATLAB 7.3")
}

/// Reads a recording from the bytes of one of these files.
pub(super) fn read(bytes: Vec<u8>, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    if is_mat_5(&bytes) { mat_5::read(&bytes, naming, source) } else { hdf5::read(bytes, naming, source) }
}

#[cfg(not(feature = "matlab"))]
mod mat_5 {
    //! In the place of the reader where it is not built in.

    use super::{Naming, Path, ReadError, Recording};

    pub(super) fn read(_: &[u8], _: &Naming, source: &Path) -> Result<Recording, ReadError> {
        Err(ReadError::not_built_in(source, "is a `.mat` file of MATLAB's version 5"))
    }
}

#[cfg(not(feature = "hdf5"))]
mod hdf5 {
    //! In the place of the reader where it is not built in.

    use super::{Naming, Path, ReadError, Recording};

    pub(super) fn read(_: Vec<u8>, _: &Naming, source: &Path) -> Result<Recording, ReadError> {
        Err(ReadError::not_built_in(source, "is HDF5"))
    }
}
