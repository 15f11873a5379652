//! Texts that people write and programs answer with: campaigns, scenarios, limits, effects, calibrations, reports. No more of them
//! is read than such a text ever holds, so that a device or a file of terabytes in its place ends as an error.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

use crate::memory::memory_limit;

/// A text is no larger than this, bytes.
pub const LARGEST_TEXT: u64 = 64 << 20;

/// The bytes of a text.
pub(crate) fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    let most = LARGEST_TEXT.min(memory_limit());
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("larger than {most} bytes")));
    }
    Ok(bytes)
}

/// Reads a text of at most [`LARGEST_TEXT`] bytes, or of what [`crate::limit_memory`] allows.
///
/// # Errors
/// Where it cannot be read, is larger ([`ErrorKind::FileTooLarge`]), or is not UTF-8 ([`ErrorKind::InvalidData`]).
pub fn read_text(path: &Path) -> Result<String> {
    String::from_utf8(bytes_of(path)?)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "stream did not contain valid UTF-8"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn no_more_than_a_text_holds_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.toml");
        std::fs::write(&path, "a text").unwrap();
        assert_eq!(read_text(&path).unwrap(), "a text");
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert_eq!(read_text(&path).unwrap_err().kind(), ErrorKind::InvalidData);
        // a terabyte that takes no room, and a device that never ends
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read_text(&path).unwrap_err().kind(), ErrorKind::FileTooLarge);
        #[cfg(unix)]
        assert_eq!(read_text(Path::new("/dev/zero")).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }
}
