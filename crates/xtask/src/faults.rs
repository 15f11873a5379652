//! `cargo xtask faults`: faults that an engineer makes, planted one by one; the tests that are named have to catch each.
//!
//! A fault is a patch of a few words, and the layer that has to see it: the tests of one package, by name. In a copy of
//! the repository each layer has to pass as it is, and to fail with the fault. A fault that does not build, or whose
//! place is not found exactly once, is an error: the library is to be kept as the code changes.

mod calibrator;
mod controller;
mod demodulation;
mod edges;
mod estimator;
mod instrument;
mod meaning;
mod model;
mod reading;
mod regression;
mod second_reading;
mod single;
mod third_reading;
mod unseen;
mod upkeep;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::source;

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
    [
        model::FAULTS,
        demodulation::FAULTS,
        estimator::FAULTS,
        controller::FAULTS,
        calibrator::FAULTS,
        regression::FAULTS,
        instrument::FAULTS,
        edges::FAULTS,
        unseen::FAULTS,
        &upkeep::faults(),
        &reading::faults(),
        single::FAULTS,
        meaning::FAULTS,
        second_reading::FAULTS,
        third_reading::FAULTS,
    ]
    .concat()
}

/// What came of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    Caught,
    Missed,
}

/// Which faults are planted.
#[derive(Debug, Default)]
pub(crate) struct Request<'a> {
    /// those whose name or file contains one of these; all where there is none
    pub(crate) only: Vec<&'a str>,
    /// every so many of them; all where it is 0
    pub(crate) every: usize,
    /// the first of them, counted from 0: what `every` leaves out is planted from elsewhere
    pub(crate) from: usize,
    /// as many as are begun in this time: those in files that the last commit changed, then those that it draws
    pub(crate) most_s: Option<u64>,
}

/// Faults that are planted however little time there is: of none nothing follows.
const FEWEST: usize = 4;

/// Plants faults, and asks the tests that have to catch each.
pub(crate) fn run(request: &Request<'_>) -> crate::Outcome {
    let started = Instant::now();
    let all = library();
    let mut chosen = chosen(&all, request);
    if request.most_s.is_some() {
        let commit = source::git(&["rev-parse", "HEAD"])?;
        let changed = source::git(&["diff", "--name-only", "HEAD^"]).or_else(|_| source::git(&["ls-files"]))?;
        draw(&mut chosen, commit.trim(), &changed.lines().collect());
    }
    let tree = crate::repository().join("target/faults/tree");
    copied(&crate::repository(), &tree)?;
    let mut sound = BTreeSet::new();
    let (mut planted_so_far, mut missed) = (0, Vec::new());
    for fault in &chosen {
        // another layer is built for half of the time at most
        let is_new = !sound.contains(&fault.layer);
        let share = if is_new { 2 } else { 1 };
        if request.most_s.is_some_and(|s| planted_so_far >= FEWEST && share * started.elapsed().as_secs() >= s) {
            break;
        }
        if is_new {
            sound.insert(fault.layer);
            built(&tree, fault.layer)?;
            if !passes(&tree, fault.layer)? {
                return Err(format!("{} {} fails without a fault", fault.layer.0, fault.layer.1));
            }
        }
        let ending = planted(&tree, fault)?;
        println!("{} {}: {} by {} {}", fault.file, fault.name, word(ending), fault.layer.0, fault.layer.1);
        planted_so_far += 1;
        if ending == Ending::Missed {
            missed.push(fault.name);
        }
    }
    println!(
        "{planted_so_far} of {} faults planted, {} caught, {} s",
        all.len(),
        planted_so_far - missed.len(),
        started.elapsed().as_secs()
    );
    for name in &missed {
        println!("missed: {name}");
    }
    Ok(missed.is_empty())
}

/// The faults that are asked for, in the order of the library.
fn chosen(all: &[Fault], request: &Request<'_>) -> Vec<Fault> {
    let only = |f: &&Fault| {
        request.only.is_empty() || request.only.iter().any(|text| f.name.contains(text) || f.file.contains(text))
    };
    all.iter().filter(only).skip(request.from).step_by(request.every.max(1)).copied().collect()
}

/// Puts faults in the order in which they are planted until time is up: those in changed files first; then layer by layer,
/// which are built once, in an order that the commit draws. The interface for C is last: it takes longest to build.
fn draw(faults: &mut [Fault], commit: &str, changed: &BTreeSet<&str>) {
    let drawn = |text: &str| source::drawn(commit, text);
    faults.sort_by_cached_key(|f| {
        let is_changed = changed.contains(format!("crates/{}", f.file).as_str());
        (!is_changed, f.layer.0 == "cvg-capi", drawn(&format!("{} {}", f.layer.0, f.layer.1)), f.layer, drawn(f.name))
    });
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
        let (mut names, mut without) = (BTreeSet::new(), Vec::new());
        for fault in library() {
            let path = crate::repository().join("crates").join(fault.file);
            let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            match patched(&text, &fault) {
                Ok(changed) => assert_ne!(changed, text, "{}", fault.name),
                Err(reason) => without.push(reason),
            }
            assert!(names.insert(fault.name), "{} is there twice", fault.name);
        }
        assert!(without.is_empty(), "{}", without.join("\n"));
        let page = fs::read_to_string(crate::repository().join("docs/src/audit.md")).expect("the page");
        let said = format!("{} faults, each of them caught when it was planted", names.len());
        assert!(page.contains(&said), "{said}");
    }

    #[test]
    fn every_so_many_from_each_of_the_first_are_all_of_them_once() {
        let all = library();
        let part = |from| chosen(&all, &Request { every: 3, from, ..Request::default() });
        let names = |faults: &[Fault]| faults.iter().map(|f| f.name).collect::<BTreeSet<_>>();
        let parts: Vec<_> = (0..3).map(part).collect();
        assert_eq!(parts.iter().map(Vec::len).sum::<usize>(), all.len());
        assert_eq!(names(&parts.concat()), names(&all));
        assert_eq!(names(&chosen(&all, &Request::default())), names(&all));
        // counted among those that are asked for, not among all
        let of_pi = |from| chosen(&all, &Request { only: vec!["controller/src/pi.rs"], from, ..Request::default() });
        assert_eq!(names(&of_pi(1)), names(&of_pi(0)[1..]));
    }

    #[test]
    fn a_commit_draws_its_own_order_after_what_it_changed() {
        let order = |commit: &str, changed: &[&str]| {
            let mut faults = library();
            draw(&mut faults, commit, &changed.iter().copied().collect());
            faults.iter().map(|f| (f.name, f.file, f.layer)).collect::<Vec<_>>()
        };
        let (one, other) = (order("1234", &[]), order("1235", &[]));
        assert_eq!(one, order("1234", &[]));
        assert_ne!(one[0].2, other[0].2, "another layer comes first");
        let changed = order("1234", &["crates/controller/src/pi.rs"]);
        let count = one.iter().filter(|f| f.1 == "controller/src/pi.rs").count();
        assert!(count > 0 && changed[..count].iter().all(|f| f.1 == "controller/src/pi.rs"));
        let layers = one.windows(2).filter(|w| w[0].2 != w[1].2).count() + 1;
        assert_eq!(layers, one.iter().map(|f| f.2).collect::<BTreeSet<_>>().len(), "a layer is built once");
    }

    #[test]
    fn a_place_that_is_not_there_or_there_twice_is_an_error() {
        let fault = Fault { name: "n", file: "f", patch: ("a", "b"), layer: ("p", "t") };
        assert_eq!(patched("xay", &fault).as_deref(), Ok("xby"));
        patched("xy", &fault).expect_err("not there");
        patched("aa", &fault).expect_err("there twice");
    }
}
