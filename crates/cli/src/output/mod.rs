//! What leaves the program: results on standard output, words on standard error, files that are whole or not there.

mod place;
mod set;
mod words;

use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::Failure;

pub(crate) use self::place::{check_file, check_folder, check_folder_for};
pub(crate) use self::set::Set;
pub(crate) use self::words::{counted, plain};

/// Prints a result to standard output. A reader that has gone away has read what it wanted.
pub(crate) fn answer(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(plain(text).as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::input(format!("standard output: cannot be written: {e}")))
        }
        _ => Ok(()),
    }
}

/// Says something on standard error. Where that is closed, nobody listens.
pub(crate) fn tell(text: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{}", plain(&text.to_string()));
}

/// [`tell`], with this much in red before it.
pub(crate) fn tell_in_red(red: &str, rest: &str) {
    let _ = writeln!(io::stderr(), "\u{1b}[1;31m{red}\u{1b}[0m{}", plain(rest));
}

/// Writes `bytes` to `path`; see [`write_with`].
pub(crate) fn write(path: &Path, bytes: &[u8], inputs: &[PathBuf]) -> Result<(), Failure> {
    write_with(path, inputs, |part| fs::write(part, bytes).map_err(|e| failed(path, &e)))
}

/// Writes to `path`, creating its folder; an existing file is replaced only by a complete one, an input never. What is
/// to be written goes into the file that the writer is given, whose name ends as that of `path`.
pub(crate) fn write_with(
    path: &Path,
    inputs: &[PathBuf],
    fill: impl FnOnce(&Path) -> Result<(), Failure>,
) -> Result<(), Failure> {
    place::check_file(path, inputs)?;
    let say = |e: io::Error| failed(path, &e);
    let (folder, name) = place::split(path);
    fs::create_dir_all(&folder).map_err(say)?;
    let lock = place::lock(&folder).map_err(say)?;
    if lock.is_some() {
        place::remove_leftovers(&folder, &name);
    }
    let part = place::neighbour(&folder, &name);
    OpenOptions::new().write(true).create_new(true).open(&part).map_err(say)?;
    let written = fill(&part).and_then(|()| {
        let put = || File::open(&part)?.sync_all().and_then(|()| fs::rename(&part, path));
        put().map_err(say)
    });
    if written.is_err() {
        // where it cannot be removed either, the next one tries again
        let _ = fs::remove_file(&part);
    }
    place::settle(&folder);
    written
}

/// Writes files that belong together into a folder: all of them, or none.
pub(crate) fn write_all(folder: &Path, files: &[(&str, &[u8])], inputs: &[PathBuf]) -> Result<(), Failure> {
    let set = Set::begin(folder, inputs)?;
    files.iter().try_for_each(|(name, bytes)| set.add(name, bytes))?;
    set.commit()
}

fn failed(path: &Path, error: &io::Error) -> Failure {
    Failure::input(format!("{}: cannot be written: {error}", path.display()))
}
