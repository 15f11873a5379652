//! `cargo xtask faults`: faults that an engineer makes, planted one by one; the tests that are named have to catch each.
//!
//! A fault is a patch of a few words, and the layer that has to see it: the tests of one package, by name. In a copy of
//! the repository each layer has to pass as it is, and to fail with the fault. A fault that does not build, or whose
//! place is not found exactly once, is an error: the library is to be kept as the code changes.

mod calibrator;
mod controller;
mod edges;
mod estimator;
mod instrument;
mod model;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Seconds after which a build or a test does not end any more.
const MOST_S: &str = "600";

/// A fault, planted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fault {
    /// what is wrong, in words
    name: &'static str,
    /// the file, below `crates`
    file: &'static str,
    /// what stands there once, and what is put in its place
    patch: (&'static str, &'static str),
    /// package and test that have to catch it
    layer: (&'static str, &'static str),
}

/// A fault by its words.
const fn fault(
    name: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
    layer: (&'static str, &'static str),
) -> Fault {
    Fault { name, file, patch: (from, to), layer }
}

/// Every fault of the library.
fn library() -> Vec<Fault> {
    [model::FAULTS, estimator::FAULTS, controller::FAULTS, calibrator::FAULTS, instrument::FAULTS, edges::FAULTS]
        .concat()
}

/// What came of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    Caught,
    Missed,
}

/// Plants the faults whose name or file contains one of `only`, all where there is none; every `nth` of them, from the first.
pub(crate) fn run(only: &[&str], nth: usize) -> crate::Outcome {
    let started = Instant::now();
    let all = library();
    let chosen: Vec<Fault> = all
        .iter()
        .filter(|f| only.is_empty() || only.iter().any(|text| f.name.contains(text) || f.file.contains(text)))
        .step_by(nth.max(1))
        .copied()
        .collect();
    let tree = crate::repository().join("target/faults/tree");
    copied(&crate::repository(), &tree)?;
    for layer in chosen.iter().map(|f| f.layer).collect::<BTreeSet<_>>() {
        built(&tree, layer)?;
        if !passes(&tree, layer)? {
            return Err(format!("{} {} fails without a fault", layer.0, layer.1));
        }
    }
    let mut missed = Vec::new();
    for fault in &chosen {
        let ending = planted(&tree, fault)?;
        println!("{} {}: {} by {} {}", fault.file, fault.name, word(ending), fault.layer.0, fault.layer.1);
        if ending == Ending::Missed {
            missed.push(fault.name);
        }
    }
    println!(
        "{} of {} faults planted, {} caught, {} s",
        chosen.len(),
        all.len(),
        chosen.len() - missed.len(),
        started.elapsed().as_secs()
    );
    for name in &missed {
        println!("missed: {name}");
    }
    Ok(missed.is_empty())
}

fn word(ending: Ending) -> &'static str {
    if ending == Ending::Caught { "caught" } else { "MISSED" }
}

/// The text with the fault, if its place is there exactly once.
fn patched(text: &str, fault: &Fault) -> Result<String, String> {
    let (from, to) = fault.patch;
    match text.matches(from).count() {
        1 => Ok(text.replacen(from, to, 1)),
        n => Err(format!("{}: the place of \"{}\" is there {n} times", fault.file, fault.name)),
    }
}

/// The layer with the fault; the file is as it was afterwards.
fn planted(tree: &Path, fault: &Fault) -> Result<Ending, String> {
    let path = tree.join("crates").join(fault.file);
    let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    fs::write(&path, patched(&text, fault)?).map_err(|e| e.to_string())?;
    let caught = built(tree, fault.layer).and_then(|()| passes(tree, fault.layer)).map(|passes| !passes);
    fs::write(&path, text).map_err(|e| e.to_string())?;
    let caught = caught.map_err(|e| format!("{}: {e}", fault.name))?;
    Ok(if caught { Ending::Caught } else { Ending::Missed })
}

fn cargo(tree: &Path, (package, test): (&str, &str)) -> Command {
    // a fault may make what never ends: that is a test that does not pass
    let mut command = Command::new("timeout");
    command.args([MOST_S, env!("CARGO"), "test", "--quiet", "--locked", "-p", package]);
    if test == "--lib" {
        command.arg(test)
    } else {
        command.args(["--test", test])
    };
    command
        .current_dir(tree)
        .env("CARGO_TARGET_DIR", tree.with_file_name("target"))
        // a fault is built more often than it is run
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        // what one fault was caught by must not help to catch the next
        .env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1")
        .env("INSTA_UPDATE", "no")
        .env_remove("RUSTFLAGS")
        .stdin(Stdio::null());
    command
}

/// Builds the tests; an error where they do not build.
fn built(tree: &Path, layer: (&str, &str)) -> Result<(), String> {
    let output = cargo(tree, layer).arg("--no-run").output().map_err(|e| e.to_string())?;
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{} {} does not build\n{}", layer.0, layer.1, String::from_utf8_lossy(&output.stderr)))
    }
}

fn passes(tree: &Path, layer: (&str, &str)) -> Result<bool, String> {
    let status = cargo(tree, layer).stdout(Stdio::null()).stderr(Stdio::null()).status().map_err(|e| e.to_string())?;
    Ok(status.success())
}

/// What git knows of the repository, or would, copied where it has changed; what is there no more is removed.
fn copied(repository: &Path, tree: &Path) -> Result<(), String> {
    let listed = Command::new("git")
        .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        .current_dir(repository)
        .output()
        .map_err(|e| e.to_string())?;
    let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
    let names: BTreeSet<&Path> =
        listed.split('\0').filter(|n| !n.is_empty()).map(Path::new).filter(|n| repository.join(n).is_file()).collect();
    for name in &names {
        let (from, to) = (repository.join(name), tree.join(name));
        let content = fs::read(&from).map_err(|e| format!("{}: {e}", from.display()))?;
        if fs::read(&to).is_ok_and(|there| there == content) {
            continue;
        }
        fs::create_dir_all(to.parent().unwrap_or(tree)).map_err(|e| e.to_string())?;
        fs::write(&to, content).map_err(|e| format!("{}: {e}", to.display()))?;
    }
    for file in crate::source::rust_files(&tree.join("crates")) {
        if file.strip_prefix(tree).is_ok_and(|name| !names.contains(name)) {
            fs::remove_file(&file).map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_its_place_once_and_a_name_of_its_own() {
        let mut names = BTreeSet::new();
        for fault in library() {
            let path = crate::repository().join("crates").join(fault.file);
            let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let changed = patched(&text, &fault).unwrap_or_else(|e| panic!("{e}"));
            assert_ne!(changed, text, "{}", fault.name);
            assert!(names.insert(fault.name), "{} is there twice", fault.name);
        }
        assert!(names.len() >= 60, "{} faults", names.len());
    }

    #[test]
    fn a_place_that_is_not_there_or_there_twice_is_an_error() {
        let fault = Fault { name: "n", file: "f", patch: ("a", "b"), layer: ("p", "t") };
        assert_eq!(patched("xay", &fault).as_deref(), Ok("xby"));
        patched("xy", &fault).expect_err("not there");
        patched("aa", &fault).expect_err("there twice");
    }
}
