//! A text in blocks of whole lines, so that a file never lies in memory as a whole.
//!
//! Finds line ends and quotes; knows no fields. A line that does not end within a mebibyte is refused: no row is as long.

use std::io::{self, Read};

/// Bytes within which a line must end.
pub(super) const LONGEST_LINE: usize = 1 << 20;
/// Zeros behind the lines of a block, so that a reader may look ahead.
const PADDING: usize = 32;

/// Whole lines of a text.
#[derive(Debug, Default)]
pub(super) struct Block {
    bytes: Vec<u8>,
    /// Bytes of whole lines at the start of `bytes`.
    lines_end: usize,
    /// The last line has no line end in the file; one was put behind it.
    pub(super) unterminated: bool,
}

impl Block {
    /// The lines, and behind them bytes of no meaning to look ahead into.
    pub(super) fn padded(&self) -> &[u8] {
        &self.bytes
    }

    /// The lines.
    pub(super) fn lines(&self) -> &[u8] {
        &self.bytes[..self.lines_end]
    }

    /// The lines as they are in the file: without the line end that was put behind the last.
    pub(super) fn lines_as_read(&self) -> &[u8] {
        &self.bytes[..self.lines_end - usize::from(self.unterminated)]
    }

    /// Whether a quote is among the lines, so that a line end need not end a row.
    pub(super) fn has_quotes(&self) -> bool {
        memchr::memchr(b'"', self.lines()).is_some()
    }
}

/// Why there is no next block.
#[derive(Debug)]
pub(super) enum BlockError {
    Io(io::Error),
    /// The line that comes after the last block does not end.
    EndlessLine,
}

/// Cuts what it reads into blocks.
#[derive(Debug)]
pub(super) struct Blocks<R> {
    reader: R,
    carry: Vec<u8>,
    block_bytes: usize,
    is_done: bool,
}

impl<R: Read> Blocks<R> {
    pub(super) fn new(reader: R, block_bytes: usize) -> Self {
        Self { reader, carry: vec![], block_bytes: block_bytes.max(1), is_done: false }
    }

    /// Fills the block with the next whole lines; false where there are none.
    pub(super) fn fill(&mut self, block: &mut Block) -> Result<bool, BlockError> {
        (block.lines_end, block.unterminated) = (0, false);
        if self.is_done {
            return Ok(false);
        }
        let mut filled = self.carry.len();
        let mut wanted = filled + self.block_bytes;
        grow(&mut block.bytes, wanted);
        block.bytes[..filled].copy_from_slice(&self.carry);
        self.carry.clear();
        loop {
            while filled < wanted && !self.is_done {
                match self.reader.read(&mut block.bytes[filled..wanted]) {
                    Ok(0) => self.is_done = true,
                    Ok(count) => filled += count,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(BlockError::Io(error)),
                }
            }
            let last_end = memchr::memrchr(b'\n', &block.bytes[..filled]).map(|at| at + 1);
            if last_end.is_none() && filled > LONGEST_LINE {
                return Err(BlockError::EndlessLine);
            }
            if self.is_done {
                block.unterminated = filled > last_end.unwrap_or(0);
                if block.unterminated {
                    block.bytes[filled] = b'\n';
                    filled += 1;
                }
                block.lines_end = filled;
                break;
            }
            if let Some(end) = last_end {
                self.carry.extend_from_slice(&block.bytes[end..filled]);
                block.lines_end = end;
                break;
            }
            wanted += self.block_bytes.max(filled);
            grow(&mut block.bytes, wanted);
        }
        Ok(block.lines_end > 0)
    }

    /// What has been read and not yet been given in a block, and the reader of the rest.
    pub(super) fn into_rest(self) -> (Vec<u8>, R) {
        (self.carry, self.reader)
    }
}

fn grow(bytes: &mut Vec<u8>, wanted: usize) {
    if bytes.len() < wanted + PADDING {
        bytes.resize(wanted + PADDING, 0);
    }
}

/// Where to cut whole lines into pieces of whole lines of about `piece_bytes`: the ends of the pieces.
pub(super) fn cuts(lines: &[u8], piece_bytes: usize) -> Vec<usize> {
    let mut ends = vec![];
    let mut start = 0;
    while start < lines.len() {
        let from = (start + piece_bytes.max(1) - 1).min(lines.len() - 1);
        let end = memchr::memchr(b'\n', &lines[from..]).map_or(lines.len(), |at| from + at + 1);
        ends.push(end);
        start = end;
    }
    ends
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_endless_line_is_refused() {
        let text = vec![b'x'; LONGEST_LINE + 2];
        let mut blocks = Blocks::new(&text[..], 1000);
        assert!(matches!(blocks.fill(&mut Block::default()), Err(BlockError::EndlessLine)));
    }

    proptest! {
        #[test]
        fn blocks_and_pieces_put_together_are_the_text(text in "[a\n]{0,60}", block_bytes in 1_usize..20, piece in 1_usize..9) {
            let mut blocks = Blocks::new(text.as_bytes(), block_bytes);
            let mut block = Block::default();
            let mut together = vec![];
            while blocks.fill(&mut block).unwrap() {
                prop_assert!(block.lines().ends_with(b"\n"));
                let mut start = 0;
                for end in cuts(block.lines(), piece) {
                    prop_assert!(block.lines()[start..end].ends_with(b"\n"));
                    start = end;
                }
                prop_assert_eq!(start, block.lines().len());
                together.extend_from_slice(block.lines_as_read());
            }
            prop_assert_eq!(together, text.as_bytes());
        }
    }
}
