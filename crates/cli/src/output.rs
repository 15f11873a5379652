//! Files are written whole or not at all: to a neighbour first, then moved into place.

use std::path::Path;

use crate::Failure;

/// Writes `bytes` to `path`, creating its folder; an existing file is replaced only by a complete one.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |e: std::io::Error| Failure::input(format!("{}: cannot be written: {e}", path.display()));
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    if path.is_dir() {
        return Err(Failure::input(format!("{}: is a directory; wanted a file name", path.display())));
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let part = path.with_file_name(name);
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path)).map_err(failed)
}
