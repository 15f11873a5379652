//! Parquet in and out: the same columns as in CSV, under the same names.
//!
//! Uncompressed, Snappy, gzip, LZ4 and Brotli are understood; Zstandard and LZO are refused by name.

mod read;
mod write;

pub(super) use read::read;
