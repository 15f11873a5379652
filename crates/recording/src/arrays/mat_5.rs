//! MATLAB's `.mat` of version 5.

use std::io::Read as _;
use std::path::Path;

use flate2::read::ZlibDecoder;
use matfile::{MatFile, NumericData};

use crate::Recording;
use crate::admission;
use crate::arrays::columns::{push, refuse, table};
use crate::arrays::structs;
use crate::error::ReadError;
use crate::memory::{self, PER_NUMBER};
use crate::naming::Naming;

/// Reads a recording from the bytes of a `.mat` file of version 5.
pub(super) fn read(bytes: &[u8], naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    let unfolded = structs::flattened(unfolded(bytes, source)?);
    // the decoder is not proof against every damaged file
    let decoded = memory::guarded(|| MatFile::parse(unfolded.as_slice()).map_err(|e| e.to_string()));
    let file = decoded.unwrap_or_else(|| Err("the file is damaged".into()));
    drop(unfolded);
    let file = file.map_err(|what| refuse(source, KIND, what))?;
    let mut arrays = Vec::new();
    for array in file.arrays() {
        push(&mut arrays, array.name(), array.size(), real(array.data()), true);
    }
    admission::admit(table(arrays, naming, source)?, naming, source)
}

const KIND: &str = "a MATLAB file";
/// Bytes before the first array.
const HEADER: usize = 128;
/// Type of an element that is compressed.
const COMPRESSED: u32 = 15;
/// Where an array's flags stand in it: after its own tag and theirs.
const FLAGS_AT: usize = 8 + 8;
/// Where an array's size stands in it: after its own tag, its flags and the tag of the size.
const SIZE_AT: usize = 8 + 16;
/// Bytes at the beginning of a compressed array that say how much it is: a size of some sixty dimensions is in them.
const TOLD_BY: u64 = 288;

/// The same file with nothing compressed. Deflate unfolds a byte to a thousand, and MATLAB stores numbers in as few
/// bytes as they need: what all that takes is asked before it is there.
fn unfolded(bytes: &[u8], source: &Path) -> Result<Vec<u8>, ReadError> {
    let head = bytes.get(..HEADER).ok_or_else(|| refuse(source, KIND, "the file is damaged".into()))?;
    let is_big = head.ends_with(b"MI");
    let word = |bytes: &[u8], at: usize| -> Option<u32> {
        let word: [u8; 4] = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if is_big { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) })
    };
    // numbers that an array of so many bytes says it has, by its beginning
    let values = |array: &[u8], length: u64| -> u64 {
        let dimensions = word(array, SIZE_AT + 4).unwrap_or(0) as usize / 4;
        let size = |d: usize| word(array, SIZE_AT + 8 + 4 * d).map_or(u64::MAX, u64::from);
        let sizes = (0..dimensions.min(array.len() / 4)).map(size);
        // a struct says how many structs it is; of the numbers in it, a byte each is the least
        let is_struct = word(array, FLAGS_AT).is_some_and(|flags| flags & 0xff == structs::STRUCT);
        let values = if is_struct { u64::MAX } else { sizes.fold(1_u64, u64::saturating_mul) };
        values.min(length)
    };
    // the array is held twice while it is decoded
    let held = |array: &[u8], length: u64| {
        length.saturating_mul(2).saturating_add(values(array, length).saturating_mul(PER_NUMBER))
    };
    let mut out = head.to_vec();
    let mut needed = 0_u64;
    let mut at = HEADER;
    while let (Some(kind), Some(length)) = (word(bytes, at), word(bytes, at + 4)) {
        let body = &bytes[at + 8..];
        let length = usize::try_from(length).unwrap_or(usize::MAX).min(body.len());
        let begins = out.len();
        if kind == COMPRESSED {
            let say = |error: std::io::Error| refuse(source, KIND, error.to_string());
            let folded = ZlibDecoder::new(&body[..length]);
            let mut head = Vec::new();
            let mut folded = folded.take(TOLD_BY);
            folded.read_to_end(&mut head).map_err(say)?;
            let stated = word(&head, 4).map_or(0, |length| 8 + u64::from(length));
            // before it is unfolded, by what its beginning says
            memory::allow(needed.saturating_add(held(&head, stated)), "its arrays", source)?;
            head.truncate(usize::try_from(stated).unwrap_or(usize::MAX));
            folded.set_limit(stated - head.len() as u64);
            out.append(&mut head);
            folded.read_to_end(&mut out).map_err(say)?;
            at += 8 + length;
        } else {
            let padded = length.next_multiple_of(8).min(body.len());
            out.extend_from_slice(&bytes[at..at + 8 + padded]);
            at += 8 + padded;
        }
        let array = &out[begins..];
        needed = needed.saturating_add(held(array, array.len() as u64));
        memory::allow(needed, "its arrays", source)?;
    }
    Ok(out)
}

fn real(data: &NumericData) -> Option<Vec<f64>> {
    fn all<T: Copy + Into<f64>>(values: &[T]) -> Option<Vec<f64>> {
        Some(values.iter().map(|v| (*v).into()).collect())
    }
    match data {
        NumericData::Int8 { real, imag: None } => all(real),
        NumericData::UInt8 { real, imag: None } => all(real),
        NumericData::Int16 { real, imag: None } => all(real),
        NumericData::UInt16 { real, imag: None } => all(real),
        NumericData::Int32 { real, imag: None } => all(real),
        NumericData::UInt32 { real, imag: None } => all(real),
        NumericData::Int64 { real, imag: None } => Some(real.iter().map(|v| *v as f64).collect()),
        NumericData::UInt64 { real, imag: None } => Some(real.iter().map(|v| *v as f64).collect()),
        NumericData::Single { real, imag: None } => all(real),
        NumericData::Double { real, imag: None } => all(real),
        _ => None,
    }
}
