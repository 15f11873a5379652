//! Files are written whole or not at all, and so are files that belong together: to neighbours first, then moved into
//! place.

use std::fmt;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::Failure;

/// Prints a result to standard output. A reader that has gone away has read what it wanted.
pub(crate) fn answer(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::input(format!("standard output: cannot be written: {e}")))
        }
        _ => Ok(()),
    }
}

/// Says something on standard error. Where that is closed, nobody listens.
pub(crate) fn tell(text: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// A folder for results is one, or can become one: asked before the work is done.
pub(crate) fn check_folder(folder: &Path) -> Result<(), Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::input(format!("{}: is a file; wanted a folder for the results", folder.display())));
    }
    Ok(())
}

/// Writes `bytes` to `path`, creating its folder; an existing file is replaced only by a complete one.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_all(&[(path.to_owned(), bytes)])
}

/// Removes a file, if it is there.
pub(crate) fn remove(path: &Path) -> Result<(), Failure> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            Err(Failure::input(format!("{}: cannot be removed: {e}", path.display())))
        }
        _ => Ok(()),
    }
}

/// Writes all files, or leaves what was there: none is put into its place before every one is complete.
pub(crate) fn write_all(files: &[(PathBuf, &[u8])]) -> Result<(), Failure> {
    if let Some((path, _)) = files.iter().find(|(path, _)| path.is_dir()) {
        return Err(Failure::input(format!("{}: is a directory; wanted the name of a file", path.display())));
    }
    let written = files.iter().try_for_each(|(path, bytes)| {
        let whole = || -> io::Result<()> {
            if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
                fs::create_dir_all(folder)?;
            }
            fs::write(part(path), bytes)
        };
        whole().map_err(|e| failed(path, &e))
    });
    if written.is_err() {
        for (path, _) in files {
            // one that was not begun is not there to be removed
            let _ = fs::remove_file(part(path));
        }
        return written;
    }
    files.iter().try_for_each(|(path, _)| fs::rename(part(path), path).map_err(|e| failed(path, &e)))
}

/// The neighbour that a file is written to before it is complete.
fn part(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    path.with_file_name(name)
}

fn failed(path: &Path, error: &io::Error) -> Failure {
    Failure::input(format!("{}: cannot be written: {error}", path.display()))
}
