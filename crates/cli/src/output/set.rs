//! Files that belong together: the old ones or the new ones, never some of each.
//!
//! The new ones are written into a folder of their own beside the one they are for. Where that is not there yet, one move
//! puts it there. Where it is, what else is in it is linked into the new one, and the two are exchanged in one step of the
//! system. Where the system has no such step, or the folder is where the user stands, it stays what it is: the set is
//! first made complete and then moved in file by file; a program killed in between leaves the rest to the next one.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::{failed, place};
use crate::Failure;

/// Files beside the set that are linked; a folder with more is not one for results.
const MOST_LINKED: usize = 1000;
/// Name of a complete set within the folder, while its files are moved to their places.
const COMPLETE: &str = ".cvg-complete";
/// What stands there before the name of a file that is to go.
const GONE: &str = ".cvg-gone.";

/// A set that is being written.
pub(crate) struct Set {
    out: PathBuf,
    folder: PathBuf,
    /// The folder that both are in.
    beside: PathBuf,
    inputs: Vec<PathBuf>,
    /// Names of an older set's files that this one has not.
    gone: Vec<String>,
    /// Says to others that this program lives.
    _alive: Option<File>,
}

impl Set {
    /// Begins a set for the folder `out`.
    pub(crate) fn begin(out: &Path, inputs: &[PathBuf]) -> Result<Self, Failure> {
        place::check_folder(out)?;
        // `.` and `..` have names of their own to the system only; a bar at the end would be a way through a link
        let named = if out.file_name().is_some() { Ok(out.components().collect()) } else { out.canonicalize() };
        let named = named.map_err(|e| failed(out, &e))?;
        Self::make(named, inputs).map_err(|e| failed(out, &e))
    }

    fn make(out: PathBuf, inputs: &[PathBuf]) -> io::Result<Self> {
        let (beside, name) = place::split(&out);
        fs::create_dir_all(&beside)?;
        let beside = if is_on_one_disk(&beside, &out) { beside } else { out.clone() };
        let lock = place::lock(&beside)?;
        if lock.is_some() {
            place::remove_leftovers(&beside, &name);
        }
        let mut folder = place::neighbour(&beside, &name);
        let mut made = fs::create_dir(&folder);
        let mut beside = beside;
        if made.as_ref().is_err_and(|e| e.kind() == io::ErrorKind::PermissionDenied) && out.is_dir() {
            // where nothing may be put beside the folder, within it
            beside.clone_from(&out);
            folder = place::neighbour(&beside, &name);
            place::remove_leftovers(&beside, &name);
            made = fs::create_dir(&folder);
        }
        made?;
        let alive = place::lock(&folder)?;
        drop(lock);
        Ok(Self { out, folder, beside, inputs: inputs.to_vec(), gone: Vec::new(), _alive: alive })
    }

    /// Where its files are written.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes a file of the set.
    pub(crate) fn add(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        fs::write(self.folder.join(name), bytes).map_err(|e| failed(&self.out.join(name), &e))
    }

    /// Names files that an older set may have and that are not to be beside this one.
    pub(crate) fn take_away(&mut self, names: &[&str]) {
        self.gone.extend(names.iter().map(|name| (*name).to_owned()));
    }

    /// Puts the set into its place.
    pub(crate) fn commit(self) -> Result<(), Failure> {
        let _lock = place::lock(&self.beside).map_err(|e| failed(&self.out, &e))?;
        complete(&self.out, &self.inputs)?;
        let files = tree(&self.folder).map_err(|e| failed(&self.out, &e))?;
        check(&self.out, &files, &self.inputs)?;
        check(&self.out, &self.gone.iter().map(PathBuf::from).collect::<Vec<_>>(), &self.inputs)?;
        self.put(&files).map_err(|e| failed(&self.out, &e))
    }

    fn put(&self, files: &[PathBuf]) -> io::Result<()> {
        for file in files {
            let path = self.folder.join(file);
            File::open(&path)?.sync_all()?;
            place::settle(path.parent().unwrap_or(&self.folder));
        }
        place::settle(&self.folder);
        // who would begin a set within the folder waits, and looks for the new one then
        let _within = if self.beside == self.out { None } else { place::lock(&self.out)? };
        if !self.out.exists() {
            fs::rename(&self.folder, &self.out)?;
        } else if !self.is_to_stay() && link_others(&self.out, &self.folder, &mut { MOST_LINKED }).unwrap_or(false) {
            self.leave_out()?;
            fs::set_permissions(&self.folder, fs::metadata(&self.out)?.permissions())?;
            place::settle(&self.folder);
            if exchange(&self.folder, &self.out).is_ok() {
                place::settle(&self.beside);
                // the old ones are under the other name now
                self.leave_out()?;
                return retire(&self.folder, &self.out);
            }
            self.move_in(files)?;
        } else {
            self.move_in(files)?;
        }
        place::settle(&self.beside);
        Ok(())
    }

    /// Removes what is to go from what is under the name of the new folder.
    fn leave_out(&self) -> io::Result<()> {
        self.gone.iter().try_for_each(|name| remove(&self.folder.join(name)))
    }

    /// Whether the folder has to remain the one it is: the user stands in it, it is another's, or another program has begun a set
    /// within it.
    fn is_to_stay(&self) -> bool {
        let is_within = std::env::current_dir()
            .and_then(|here| Ok(here.canonicalize()?.starts_with(self.out.canonicalize()?)))
            .unwrap_or(true);
        is_within
            || self.beside == self.out
            || !has_one_owner(&self.out, &self.folder)
            || place::is_written_into(&self.out)
    }

    /// Moves the files in one by one, after a mark that they are complete.
    fn move_in(&self, files: &[PathBuf]) -> io::Result<()> {
        // what was linked is there already
        let linked = tree(&self.folder)?;
        for file in linked.iter().filter(|file| !files.contains(file)) {
            fs::remove_file(self.folder.join(file))?;
        }
        for name in &self.gone {
            fs::write(self.folder.join(format!("{GONE}{name}")), "")?;
        }
        place::settle(&self.folder);
        fs::rename(&self.folder, self.out.join(COMPLETE))?;
        place::settle(&self.out);
        move_all(&self.out)
    }
}

impl Drop for Set {
    fn drop(&mut self) {
        // put into its place, it is no longer there
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Files may be put below a folder where none of them would be an input or go through a link.
fn check(out: &Path, files: &[PathBuf], inputs: &[PathBuf]) -> Result<(), Failure> {
    for file in files {
        for folder in file.ancestors().skip(1).filter(|f| !f.as_os_str().is_empty()) {
            place::check_folder(&out.join(folder))?;
        }
        place::check_file(&out.join(file), inputs)?;
    }
    Ok(())
}

/// Ends what a program that was killed had begun to move in. It is believed no more than anything else that lies there.
fn complete(out: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let set = out.join(COMPLETE);
    if !fs::symlink_metadata(&set).is_ok_and(|m| m.is_dir()) {
        return Ok(());
    }
    let files = tree(&set).map_err(|e| failed(&set, &e))?;
    let files: Vec<_> = files.into_iter().map(|file| to_go(&file).unwrap_or(file)).collect();
    check(out, &files, inputs)?;
    move_all(out).map_err(|e| failed(&set, &e))
}

/// The file that a mark says is to go.
fn to_go(mark: &Path) -> Option<PathBuf> {
    let name = mark.to_str().and_then(|name| name.strip_prefix(GONE))?;
    // right in the folder, and nowhere else
    Path::new(name).file_name().filter(|last| *last == name).map(PathBuf::from)
}

/// Removes a file, if it is there.
fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Moves the files of a complete set to their places.
fn move_all(out: &Path) -> io::Result<()> {
    let set = out.join(COMPLETE);
    for file in tree(&set)? {
        if let Some(gone) = to_go(&file) {
            // the mark goes with the folder
            remove(&out.join(gone))?;
            continue;
        }
        let place = out.join(&file);
        place.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::rename(set.join(&file), place)?;
    }
    fs::remove_dir_all(&set)?;
    place::settle(out);
    Ok(())
}

/// The files below a folder, as paths from it.
fn tree(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![PathBuf::new()];
    while let Some(within) = open.pop() {
        for entry in fs::read_dir(folder.join(&within))? {
            let entry = entry?;
            let path = within.join(entry.file_name());
            if entry.file_type()?.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    Ok(files)
}

/// Links what is in the old folder and not in the new one; `false` where that is more than `left`.
fn link_others(old: &Path, new: &Path, left: &mut usize) -> io::Result<bool> {
    for entry in fs::read_dir(old)? {
        let entry = entry?;
        let (from, to) = (entry.path(), new.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            // another disk is mounted there, and would go with the old folder
            if !is_on_one_disk(old, &from) {
                return Ok(false);
            }
            if !to.exists() {
                fs::create_dir(&to)?;
                fs::set_permissions(&to, entry.metadata()?.permissions())?;
            }
            if !link_others(&from, &to, left)? {
                return Ok(false);
            }
        } else if fs::symlink_metadata(&to).is_err() {
            if *left == 0 || fs::hard_link(&from, &to).is_err() {
                return Ok(false);
            }
            *left -= 1;
        }
    }
    Ok(true)
}

/// Removes the old folder; what came into it since it was looked through moves on.
fn retire(old: &Path, new: &Path) -> io::Result<()> {
    for entry in fs::read_dir(old)? {
        let entry = entry?;
        let (from, to) = (entry.path(), new.join(entry.file_name()));
        match (fs::symlink_metadata(&to), entry.file_type()?.is_dir()) {
            (Err(_), _) => fs::rename(from, to)?,
            (Ok(_), true) => retire(&from, &to)?,
            (Ok(_), false) => fs::remove_file(from)?,
        }
    }
    fs::remove_dir(old)
}

#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
fn exchange(one: &Path, other: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE)?)
}

#[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
fn exchange(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Whether a folder can be moved between the two; one that is not there yet will be on its parent's disk.
#[cfg(unix)]
fn is_on_one_disk(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let disk = |path: &Path| fs::metadata(path).ok().map(|m| m.dev());
    disk(other).is_none_or(|it| Some(it) == disk(one))
}

#[cfg(not(unix))]
fn is_on_one_disk(_: &Path, _: &Path) -> bool {
    true
}

#[cfg(unix)]
fn has_one_owner(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let owner = |path: &Path| fs::metadata(path).ok().map(|m| (m.uid(), m.gid()));
    owner(one) == owner(other)
}

#[cfg(not(unix))]
fn has_one_owner(_: &Path, _: &Path) -> bool {
    true
}
