//! Parquet in and out: the same columns as in CSV, under the same names.
//!
//! Uncompressed, Snappy, gzip, LZ4 and Brotli are understood; Zstandard and LZO are refused by name.

#[cfg(feature = "parquet")]
mod lake;
#[cfg(feature = "parquet")]
mod read;
#[cfg(feature = "parquet")]
mod sizes;
#[cfg(feature = "parquet")]
mod write;

#[cfg(feature = "parquet")]
pub use lake::Lake;
#[cfg(feature = "parquet")]
pub(super) use read::read;
#[cfg(feature = "parquet")]
pub use write::{write_parquet, write_parquet_numbers};

/// In the place of the reader where it is not built in.
#[cfg(not(feature = "parquet"))]
pub(super) fn read(
    _: std::fs::File,
    _: &super::Naming,
    source: &std::path::Path,
) -> Result<super::Recording, super::ReadError> {
    Err(super::ReadError::not_built_in(source, "is Parquet"))
}
