//! Text in UTF-16 with a byte-order mark, as Windows programs export it, read as UTF-8.

use std::io::{self, Read};

/// Bytes that are decoded at a time: whole code units.
const PIECE: usize = 64 << 10;

/// Whether bytes begin with a byte-order mark of UTF-16.
pub(super) fn is_one(head: &[u8]) -> bool {
    head.starts_with(&[0xff, 0xfe]) || head.starts_with(&[0xfe, 0xff])
}

/// A reader of the UTF-8 of a text in UTF-16. What is no character, as half of a pair or an odd last byte, is U+FFFD.
pub(super) struct Decoding<R> {
    inner: R,
    is_big_endian: Option<bool>,
    /// The first of two code units of a character whose second is in the next piece.
    high: Option<u16>,
    decoded: Vec<u8>,
    given: usize,
    is_done: bool,
}

impl<R: Read> Decoding<R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, is_big_endian: None, high: None, decoded: vec![], given: 0, is_done: false }
    }

    /// Decodes the next piece; nothing is decoded where the text has ended.
    fn go_on(&mut self) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(PIECE);
        self.inner.by_ref().take(PIECE as u64).read_to_end(&mut bytes)?;
        self.is_done = bytes.len() < PIECE;
        self.decoded.clear();
        self.given = 0;
        let (pairs, odd) = bytes.split_at(bytes.len() / 2 * 2);
        let mut units: Vec<u16> = self.high.take().into_iter().collect();
        let mut pairs = pairs.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
        let is_big_endian = match self.is_big_endian {
            Some(known) => known,
            None => *self.is_big_endian.insert(pairs.next() == Some([0xfe, 0xff])),
        };
        units.extend(pairs.map(|pair| if is_big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }));
        if self.is_done {
            units.extend(odd.iter().map(|_| 0xfffd));
        } else {
            self.high = units.pop_if(|unit| (0xd800..0xdc00).contains(unit));
        }
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        self.decoded.extend_from_slice(text.as_bytes());
        Ok(())
    }
}

impl<R: Read> Read for Decoding<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.decoded.len() && !self.is_done {
            self.go_on()?;
        }
        let count = buffer.len().min(self.decoded.len() - self.given);
        buffer[..count].copy_from_slice(&self.decoded[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> String {
        let mut text = String::new();
        Decoding::new(bytes).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn both_orders_are_read_across_the_edges_of_pieces() {
        for shift in 0..3 {
            let text = format!("{}{}", "x".repeat(shift), "°𝄞é;".repeat(PIECE / 3));
            let little: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
            assert!(read(&little) == text && read(&big) == text);
        }
    }

    #[test]
    fn what_is_no_character_is_marked() {
        assert_eq!(read(b"\xff\xfea\0\x00\xd8b\0c"), "a\u{fffd}b\u{fffd}");
        assert_eq!(read(b"\xff\xfe"), "");
    }
}
