//! What is read, of which files, and what is refused. A file is one kind of file or of trouble; the files are one program, which
//! links the readers once.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[cfg(all(feature = "hdf5", feature = "matlab", feature = "parquet"))]
mod campaign;
mod columns;
mod dirt;
#[cfg(feature = "parquet")]
mod files;
#[cfg(all(feature = "hdf5", feature = "matlab"))]
mod foreign;
#[cfg(feature = "hdf5")]
mod gzip;
mod instruments;
