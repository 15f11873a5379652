//! Which bytes an answer rests on: the checksums of the files that were read.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::recording::Campaign;
use crate::report::Input;

/// Bytes that are read at once.
const PIECE: usize = 1 << 16;

/// A file and what the campaign calls it.
#[derive(Debug, Clone)]
pub(crate) struct Named {
    path: PathBuf,
    name: String,
}

/// The files of a campaign, each once, in the order in which the campaign names them.
pub(crate) fn files(campaign: &Campaign) -> Vec<Named> {
    let mut files: Vec<&Path> = Vec::new();
    for file in std::iter::once(campaign.source.as_path())
        .chain(campaign.runs.iter().map(|run| run.recording.source.as_path()))
        .filter(|file| !file.as_os_str().is_empty())
    {
        if !files.contains(&file) {
            files.push(file);
        }
    }
    files.into_iter().map(|file| Named { path: file.to_owned(), name: name(file, campaign) }).collect()
}

/// The checksums of files.
pub(crate) fn sums(files: &[Named]) -> Vec<Input> {
    files.iter().map(|f| Input { file: f.name.clone(), crc32: crc32(&f.path) }).collect()
}

/// A file as the campaign names it, so that a report does not depend on where the campaign lies.
fn name(file: &Path, campaign: &Campaign) -> String {
    let run = campaign.runs.iter().find(|run| run.recording.source == file);
    let named = run.map_or_else(|| file.file_name().map_or(file, Path::new), |run| run.file.as_path());
    named.display().to_string()
}

/// CRC-32 of a regular file's bytes; `None` of what is not there a second time, as standard input.
fn crc32(file: &Path) -> Option<String> {
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    let mut bytes = File::open(file).ok()?;
    let (mut sum, mut piece) = (crc32fast::Hasher::new(), vec![0; PIECE]);
    loop {
        match bytes.read(&mut piece).ok()? {
            0 => return Some(format!("{:08x}", sum.finalize())),
            n => sum.update(&piece[..n]),
        }
    }
}
