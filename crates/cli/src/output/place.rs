//! Where files may be written, and who may write there now.
//!
//! Nothing is written onto an input, a device, a pipe or through a link. One program at a time puts files into a folder:
//! the folder itself is locked, so that no lock is left behind by a program that was killed. What such a one began has
//! a name that tells, and goes with the next that writes the same.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::Failure;

/// What the name of a file or folder that is not complete begins with.
const UNFINISHED: &str = ".cvg-new.";
/// How long another program may take to write what it has.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// `-` is standard input where something is read; results have a name.
fn no_stream(path: &Path) -> Result<(), Failure> {
    let is_stream = path.as_os_str() == "-";
    let what = "-: results do not go to standard output; wanted a name, or ./- for one of that name";
    if is_stream { Err(Failure::input(what)) } else { Ok(()) }
}

/// A folder for results is one, or can become one: asked before the work is done.
pub(crate) fn check_folder(folder: &Path) -> Result<(), Failure> {
    no_stream(folder)?;
    // a bar at the end would be a way through a link
    let named: PathBuf = folder.components().collect();
    let Ok(metadata) = fs::symlink_metadata(named) else { return Ok(()) };
    if metadata.is_dir() {
        return Ok(());
    }
    let what = kind(&metadata);
    Err(Failure::input(format!("{}: is {what}; wanted a folder for the results", folder.display())))
}

/// [`check_folder`], and none of the files that will be written is an input or anything but a file.
pub(crate) fn check_folder_for(folder: &Path, names: &[&str], inputs: &[PathBuf]) -> Result<(), Failure> {
    check_folder(folder)?;
    names.iter().try_for_each(|name| check_file(&folder.join(name), inputs))
}

/// A file may be written where none is, or where a plain file is that is no input.
pub(crate) fn check_file(path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    no_stream(path)?;
    let Ok(metadata) = fs::symlink_metadata(path) else { return Ok(()) };
    if !metadata.is_file() {
        let what = kind(&metadata);
        return Err(Failure::input(format!("{}: is {what}; wanted the name of a file", path.display())));
    }
    if inputs.iter().any(|input| is_same(input, path)) {
        return Err(Failure::input(format!(
            "{}: is read by this command and is not written over; wanted another name",
            path.display()
        )));
    }
    Ok(())
}

fn kind(metadata: &fs::Metadata) -> &'static str {
    let kind = metadata.file_type();
    if kind.is_dir() {
        "a directory"
    } else if kind.is_symlink() {
        "a link, which is not written through"
    } else if kind.is_file() {
        "a file"
    } else {
        "a device or a pipe"
    }
}

/// Whether two names are of one file.
#[cfg(unix)]
fn is_same(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let identity = |path: &Path| fs::metadata(path).ok().map(|m| (m.dev(), m.ino()));
    identity(one).is_some_and(|it| Some(it) == identity(other))
}

#[cfg(not(unix))]
fn is_same(one: &Path, other: &Path) -> bool {
    one.canonicalize().is_ok_and(|it| other.canonicalize().is_ok_and(|other| it == other))
}

/// The folder of a path, and its name in it.
pub(super) fn split(path: &Path) -> (PathBuf, String) {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder.to_owned(), path.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

/// What a file or folder is called while it is written.
pub(super) fn neighbour(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{UNFINISHED}{}.{name}", std::process::id()))
}

/// Waits until this program alone writes into a folder; `None` where the system has no such locks.
pub(super) fn lock(folder: &Path) -> io::Result<Option<File>> {
    let begun = Instant::now();
    loop {
        let Ok(file) = File::open(folder) else { return Ok(None) };
        match file.try_lock() {
            Ok(()) if is_at(&file, folder) => return Ok(Some(file)),
            // another program has put its own in the place of the one that was opened
            Ok(()) => {}
            Err(TryLockError::Error(_)) => return Ok(None),
            Err(TryLockError::WouldBlock) if begun.elapsed() > LONGEST_WAIT => {
                return Err(io::Error::new(io::ErrorKind::WouldBlock, "another program is writing there"));
            }
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(2)),
        }
    }
}

/// Whether an open folder is the one that has this name.
#[cfg(unix)]
fn is_at(file: &File, folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let identity = |metadata: io::Result<fs::Metadata>| metadata.ok().map(|m| (m.dev(), m.ino()));
    identity(file.metadata()) == identity(fs::metadata(folder))
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Whether a program that lives writes a set of files within a folder. Only who has the folder locked is told for long.
pub(super) fn is_written_into(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return false };
    let is_alive =
        |path: PathBuf| File::open(path).is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)));
    entries
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(UNFINISHED))
        .any(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()) && is_alive(entry.path()))
}

/// Removes what programs began under this name and did not live to end: one that lives has its own locked. Only who has
/// the folder locked may.
pub(super) fn remove_leftovers(folder: &Path, name: &str) {
    let is_one = |entry: &str| {
        let told = entry.strip_prefix(UNFINISHED).and_then(|rest| rest.split_once('.'));
        told.is_some_and(|(id, of)| of == name && !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit()))
    };
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| entry.file_name().to_str().is_some_and(is_one)) {
        let path = entry.path();
        // what cannot be removed is in nobody's way
        let _ = match entry.file_type() {
            Ok(kind) if kind.is_dir() => match File::open(&path).map(|file| file.try_lock().map(|()| file)) {
                Ok(Ok(_dead)) => fs::remove_dir_all(path),
                _ => Ok(()),
            },
            // files are written while the folder is locked
            _ => fs::remove_file(path),
        };
    }
}

/// Sees to it that names last as the files do. A system that cannot has its own way.
pub(super) fn settle(folder: &Path) {
    let _ = File::open(folder).and_then(|file| file.sync_all());
}
