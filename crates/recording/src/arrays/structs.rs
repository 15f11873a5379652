//! Structs of a MATLAB file of version 5, one level deep: their fields as arrays of their own, which the decoder knows.
//!
//! Works on the bytes of a file with nothing compressed. A field is called by its own name where no other array is, else
//! `struct.field`. What is no struct, or damaged, stays as it is. Copies at most what is there.

use std::collections::HashMap;
use std::ops::Range;

/// Bytes before the first array.
const HEADER: usize = 128;
/// Type of an element that is an array.
const MATRIX: u32 = 14;
/// Types of elements of signed words and of letters.
const WORDS: u32 = 5;
const LETTERS: u32 = 1;
/// Class of an array that is a struct.
pub(super) const STRUCT: u32 = 2;

/// An element: its type, where its data are and where the next one begins.
struct Element {
    kind: u32,
    data: Range<usize>,
    next: usize,
}

struct Bytes<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

/// An array: its class, where its name's data are, and where what follows the name begins.
struct Array {
    class: u32,
    /// Where the element of the name begins.
    name_at: usize,
    name: Element,
    values: usize,
}

impl Bytes<'_> {
    fn word(&self, at: usize) -> Option<u32> {
        let word: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) })
    }

    /// The element at a place; small ones have their data in the tag.
    fn element(&self, at: usize, end: usize) -> Option<Element> {
        let tag = self.word(at)?;
        let small = (tag >> 16) as usize;
        let (kind, data, next) = if small > 0 {
            (tag & 0xffff, at + 4..at + 4 + small.min(4), at + 8)
        } else {
            let length = self.word(at + 4)? as usize;
            (tag, at + 8..(at + 8).checked_add(length)?, (at + 8).checked_add(length.next_multiple_of(8))?)
        };
        (data.end <= end).then_some(Element { kind, data, next: next.min(end) })
    }

    /// The array in an element.
    fn array(&self, element: &Element) -> Option<Array> {
        let end = element.data.end;
        let flags = self.element(element.data.start, end)?;
        let size = self.element(flags.next, end)?;
        let name = self.element(size.next, end)?;
        let class = self.word(flags.data.start)? & 0xff;
        Some(Array { class, name_at: size.next, values: name.next, name })
    }

    fn text(&self, range: Range<usize>) -> String {
        let letters = self.bytes.get(range).unwrap_or_default();
        let used = letters.split(|&byte| byte == 0).next().unwrap_or_default();
        String::from_utf8_lossy(used).into_owned()
    }

    /// The fields of a struct of one entry: names, and the elements of their arrays.
    fn fields(&self, of: &Element, array: &Array) -> Option<Vec<(String, Element)>> {
        let end = of.data.end;
        let length = self.element(array.values, end).filter(|length| length.kind == WORDS)?;
        let width = self.word(length.data.start)? as usize;
        let names = self.element(length.next, end).filter(|names| names.kind == LETTERS && width > 0)?;
        let mut at = names.next;
        let mut fields = vec![];
        for start in names.data.clone().step_by(width) {
            let field = self.element(at, end).filter(|field| field.kind == MATRIX)?;
            at = field.next;
            fields.push((self.text(start..(start + width).min(names.data.end)), field));
        }
        // more arrays than names: a struct of several entries
        (at >= end).then_some(fields)
    }

    /// An array under another name.
    fn renamed(&self, field: &Element, name: &str) -> Option<Vec<u8>> {
        let array = self.array(field)?;
        let word = |word: u32| if self.is_big { word.to_be_bytes() } else { word.to_le_bytes() };
        let mut letters = [word(LETTERS), word(u32::try_from(name.len()).ok()?)].concat();
        letters.extend_from_slice(name.as_bytes());
        letters.resize(letters.len().next_multiple_of(8), 0);
        let before = self.bytes.get(field.data.start..array.name_at)?;
        let behind = self.bytes.get(array.values..field.data.end)?;
        let length = u32::try_from(before.len() + letters.len() + behind.len()).ok()?;
        Some([&word(MATRIX)[..], &word(length)[..], before, &letters[..], behind].concat())
    }
}

/// The same file with the fields of its structs in their place.
pub(super) fn flattened(file: Vec<u8>) -> Vec<u8> {
    let bytes = Bytes { bytes: &file, is_big: file.get(..HEADER).is_some_and(|head| head.ends_with(b"MI")) };
    let mut elements = vec![];
    let mut at = HEADER;
    while let Some(element) = bytes.element(at, file.len()) {
        let start = std::mem::replace(&mut at, element.next);
        let array = bytes.array(&element).filter(|_| element.kind == MATRIX);
        elements.push((start, element, array));
        if at <= start {
            break;
        }
    }
    let mut times: HashMap<String, usize> = HashMap::new();
    let mut parts = vec![];
    for (start, element, array) in elements {
        let name = array.as_ref().map(|array| bytes.text(array.name.data.clone())).unwrap_or_default();
        let is_struct = |array: &&Array| array.class == STRUCT;
        let fields = array.as_ref().filter(is_struct).and_then(|array| bytes.fields(&element, array));
        match &fields {
            Some(fields) => fields.iter().for_each(|(field, _)| *times.entry(field.clone()).or_default() += 1),
            None => *times.entry(name.clone()).or_default() += 1,
        }
        parts.push((start..element.next, name, fields));
    }
    if parts.iter().all(|(_, _, fields)| fields.is_none()) {
        return file;
    }
    let mut out = file[..HEADER].to_vec();
    for (range, name, fields) in parts {
        let Some(fields) = fields else {
            out.extend_from_slice(&file[range]);
            continue;
        };
        for (field, element) in fields {
            let whole = if times[&field] == 1 { field } else { format!("{name}.{field}") };
            out.extend(bytes.renamed(&element, &whole).unwrap_or_default());
        }
    }
    out
}
