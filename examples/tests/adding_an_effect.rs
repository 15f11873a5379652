//! "Add an effect" of the book, followed to the letter: its blocks are put into a copy of the repository, and the tests that
//! it names are run there.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const PAGE: &str = "docs/src/adding-an-effect.md";

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(1).map(Path::to_owned).unwrap_or_default()
}

/// What a block of the page is for.
#[derive(Debug, PartialEq)]
enum Block {
    /// a new file
    File(PathBuf, String),
    /// lines for a file that is there: what follows a line that must be found once, or stands in its place
    Insert(PathBuf, String),
}

/// The blocks that follow a remark `<!-- file: … -->` or `<!-- insert: … -->`.
fn blocks(page: &str) -> Vec<Block> {
    let mut found = Vec::new();
    for part in page.split("<!-- ").skip(1) {
        let Some((remark, rest)) = part.split_once(" -->\n```") else { continue };
        let body = rest.split_once('\n').and_then(|(_, rest)| rest.split_once("\n```"));
        let (Some((kind, path)), Some((body, _))) = (remark.split_once(": "), body) else { continue };
        match kind {
            "file" => found.push(Block::File(path.into(), format!("{body}\n"))),
            "insert" => found.push(Block::Insert(path.into(), body.to_owned())),
            _ => {}
        }
    }
    found
}

/// `text` with a difference applied: its ` ` and `-` lines have to be found, once and together.
fn patched(text: &str, difference: &str) -> Result<String> {
    let side = |other: char| -> String {
        difference
            .lines()
            .filter(|l| !l.starts_with(other))
            .map(|l| format!("{}\n", l.get(1..).unwrap_or("")))
            .collect()
    };
    let (before, after) = (side('+'), side('-'));
    match text.matches(&before).count() {
        1 => Ok(text.replace(&before, &after)),
        n => Err(format!("found {n} times: {before}").into()),
    }
}

/// A text of the repository, whatever ends its lines here.
fn text(path: &Path) -> Result<String> {
    Ok(fs::read_to_string(path)?.replace("\r\n", "\n"))
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            if !["target", "node_modules"].iter().any(|name| entry.file_name() == *name) {
                copy(&entry.path(), &target)?;
            }
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

/// Gives the builds of `to` what those of `from` have of other people's crates, so that these are not built twice. They are
/// the same files: cargo knows a crate from a registry by its version, features and profile, and builds what does not fit.
fn shared(from: &Path, to: &Path) -> Result<()> {
    let Ok(units) = fs::read_dir(from.join(".fingerprint")) else { return Ok(()) };
    let units = units.map(|unit| Ok(unit?.file_name().to_string_lossy().into_owned()));
    let theirs = |name: &String| !["cvg", "kani", "xtask"].iter().any(|ours| name.starts_with(ours));
    let units: Vec<String> =
        units.filter(|name: &Result<String>| name.as_ref().is_ok_and(theirs)).collect::<Result<_>>()?;
    for unit in &units {
        for folder in [".fingerprint", "build"] {
            linked(&from.join(folder).join(unit), &to.join(folder).join(unit))?;
        }
    }
    let hashes: BTreeSet<&str> = units.iter().filter_map(|unit| Some(unit.rsplit_once('-')?.1)).collect();
    for entry in fs::read_dir(from.join("deps"))? {
        let name = entry?.file_name();
        let text = name.to_string_lossy();
        let hash = text.split_once('.').map_or(text.as_ref(), |(stem, _)| stem).rsplit_once('-').map(|(_, hash)| hash);
        if hash.is_some_and(|hash| hashes.contains(hash)) {
            linked(&from.join("deps").join(&name), &to.join("deps").join(&name))?;
        }
    }
    Ok(())
}

/// Puts what is at `from` at `to` where nothing is yet, with its times: by them cargo sees what is out of date.
fn linked(from: &Path, to: &Path) -> Result<()> {
    if from.is_dir() {
        for entry in fs::read_dir(from)? {
            let entry = entry?;
            linked(&entry.path(), &to.join(entry.file_name()))?;
        }
    } else if from.is_file() && !to.exists() {
        fs::create_dir_all(to.parent().ok_or("no folder")?)?;
        let library = ["rlib", "rmeta", "so", "dylib", "dll"].iter().any(|e| from.extension().is_some_and(|x| x == *e));
        // what is never written in place may be one file, anything else is a copy
        if !library || fs::hard_link(from, to).is_err() {
            fs::copy(from, to)?;
            fs::File::options().write(true).open(to)?.set_modified(fs::metadata(from)?.modified()?)?;
        }
    }
    Ok(())
}

#[test]
fn the_page_adds_an_effect_that_is_then_found() -> Result<()> {
    let (root, folder) = (repository(), tempfile::tempdir()?);
    for name in ["crates", "examples", "tests"] {
        copy(&root.join(name), &folder.path().join(name))?;
    }
    for name in ["Cargo.toml", "Cargo.lock"] {
        fs::copy(root.join(name), folder.path().join(name))?;
    }
    let blocks = blocks(&text(&root.join(PAGE))?);
    assert_eq!(blocks.len(), 6, "{PAGE} has lost a block: {blocks:?}");
    for block in blocks {
        match block {
            Block::File(path, text) => fs::write(folder.path().join(path), text)?,
            Block::Insert(path, difference) => {
                let path = folder.path().join(path);
                fs::write(&path, patched(&text(&path)?, &difference)?)?;
            }
        }
    }
    // builds of its own: cargo names crates by their place within the workspace, and would take the copy's for ours
    let target = std::env::current_exe()?.ancestors().nth(3).map(Path::to_owned).ok_or("no folder of builds")?;
    let own = target.join("adding-an-effect");
    shared(&target.join("debug"), &own.join("debug"))?;
    // what is run there takes seconds, and its optimisation takes more
    let unoptimised = ["calibration", "simulator"].map(|name| format!("profile.dev.package.cvg-{name}.opt-level=1"));
    let output = Command::new(env!("CARGO"))
        .args(unoptimised.iter().flat_map(|setting| ["--config", setting]))
        .args([
            "test",
            "--workspace",
            "--locked",
            "--test",
            "effects",
            "--test",
            "effect_signatures",
            "--test",
            "cross_cubic",
        ])
        .current_dir(folder.path())
        .env("CARGO_TARGET_DIR", own)
        .env("INSTA_UPDATE", "always")
        .output()?;
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}");
    for test in ["a_cubic_of_x_in_y_is_discovered ... ok", "prop_a_cubic_of_x_in_y_shows_at_2theta_and_4theta ... ok"] {
        assert!(said.contains(test), "{test} is not in {said}");
    }
    Ok(())
}

#[test]
fn a_block_that_does_not_fit_is_noticed() {
    assert!(patched("a\nb\n", " c\n+d").is_err(), "its place is not there");
    assert!(patched("a\na\n", " a\n+d").is_err(), "its place is there twice");
    assert_eq!(patched("a\nb\nc\n", " a\n-b\n+d").ok().as_deref(), Some("a\nd\nc\n"));
}
