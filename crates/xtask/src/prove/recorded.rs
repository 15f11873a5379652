//! Verdicts of an earlier run, of sources that have not changed since: the same program has the same verdict. They stand in
//! `crates/xtask/proved.json`, which `cargo xtask prove --record` writes. With `--seconds` what has changed is proved, the guards, and of the
//! rest as much as there is time for, with each commit others: a file that does not tell the truth is found out.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Claim, ProofResult, Results, compile};
use crate::source;

/// What was proved.
#[derive(Debug, Default)]
pub(crate) struct Recorded {
    proofs: Vec<ProofResult>,
}

impl Recorded {
    /// The file in the repository; nothing where there is none.
    pub(crate) fn read(repository: &Path) -> Self {
        let text = fs::read_to_string(file(repository)).unwrap_or_default();
        let results: Option<Results> = serde_json::from_str(&text).ok();
        results.map(|r| Self { proofs: r.proofs }).unwrap_or_default()
    }

    /// What was found of a claim, where it held, of the same program.
    pub(crate) fn of(&self, claim: &Claim<'_>, program: &str) -> Option<&ProofResult> {
        let (name, solver) = claim.proof.key();
        let is_it = |p: &&ProofResult| p.name == name && p.solver == solver && p.program == program;
        self.proofs.iter().find(is_it).filter(|p| p.is_sound())
    }
}

/// Writes what was proved as the repository has it.
pub(crate) fn write(repository: &Path, results: &Results) -> Result<PathBuf, String> {
    let text = serde_json::to_string_pretty(results).map_err(|e| e.to_string())?;
    let file = file(repository);
    fs::write(&file, text + "\n").map_err(|e| format!("{}: {e}", file.display()))?;
    Ok(file)
}

fn file(repository: &Path) -> PathBuf {
    repository.join("crates/xtask/proved.json")
}

/// The name, by git, of all that a verdict about a package's harnesses comes from: its sources and those of what it depends on, how
/// they are compiled and asked about, and by which tools: `pins.rs` has their versions, and with others nothing is proved.
pub(crate) fn program(repository: &Path, package: &str) -> Result<String, String> {
    let mut folders: BTreeSet<String> = ["kani-shim".to_owned(), "xtask/src/prove".to_owned()].into();
    if let Some(name) = package.strip_prefix("cvg-") {
        with_dependencies(repository, name, &mut folders)?;
    }
    let mut text = libm(&read(&repository.join("Cargo.lock"))?);
    for folder in folders {
        let folder = repository.join("crates").join(folder);
        let more = ["Cargo.toml", "host.c"].into_iter().map(|name| folder.join(name)).filter(|path| path.exists());
        for path in source::rust_files(&folder).into_iter().chain(more) {
            let name = path.strip_prefix(repository).map_err(|e| e.to_string())?.display().to_string();
            let _ = writeln!(text, "{name}\n{}", read(&path)?);
        }
    }
    named_by_git(&text)
}

/// A crate that is proved, and those of ours that it depends on.
fn with_dependencies(repository: &Path, name: &str, found: &mut BTreeSet<String>) -> Result<(), String> {
    if !compile::CRATES.contains(&name) || !found.insert(name.to_owned()) {
        return Ok(());
    }
    let manifest = read(&repository.join("crates").join(name).join("Cargo.toml"))?;
    let ours = manifest.lines().filter_map(|line| line.strip_prefix("cvg-"));
    ours.filter_map(|rest| rest.split(['.', ' ', '=']).next())
        .try_for_each(|other| with_dependencies(repository, other, found))
}

/// What the lock file says of the one crate of others that is compiled into a harness.
fn libm(lock: &str) -> String {
    lock.split("[[package]]").find(|package| package.contains("name = \"libm\"")).unwrap_or_default().to_owned()
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn named_by_git(text: &str) -> Result<String, String> {
    let mut git = Command::new("git")
        .args(["hash-object", "--stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|e| format!("git: {e}"))?;
    git.stdin.take().ok_or("git takes no text")?.write_all(text.as_bytes()).map_err(|e| format!("git: {e}"))?;
    let output = git.wait_with_output().map_err(|e| format!("git: {e}"))?;
    let name = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    if name.len() >= 40 { Ok(name) } else { Err("git does not name a text".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prove::{Job, harnesses};

    #[test]
    fn a_program_is_what_it_was_until_a_source_of_it_changes() {
        let repository = crate::repository();
        let copy = tempfile::tempdir().expect("a folder");
        for name in ["model", "estimator", "kani-shim", "xtask/src/prove"] {
            let from = repository.join("crates").join(name);
            let manifest = Some(from.join("Cargo.toml")).filter(|path| path.exists());
            for path in source::rust_files(&from).into_iter().chain(manifest) {
                let to = copy.path().join(path.strip_prefix(&repository).expect("it is below"));
                fs::create_dir_all(to.parent().expect("a folder")).expect("made");
                fs::copy(path, to).expect("copied");
            }
        }
        fs::copy(repository.join("Cargo.lock"), copy.path().join("Cargo.lock")).expect("copied");
        let named = || ["cvg-model", "cvg-estimator"].map(|package| program(copy.path(), package).expect("named"));
        let before = named();
        assert_eq!(before, named());
        let changed = |path: &str| {
            let path = copy.path().join(path);
            let text = fs::read_to_string(&path).expect("read");
            fs::write(path, text + "\n").expect("written");
            named()
        };
        let after = changed("crates/estimator/src/lib.rs");
        assert!(after[0] == before[0] && after[1] != before[1]);
        let later = changed("crates/model/src/lib.rs");
        assert!(later[0] != after[0] && later[1] != after[1]);
        let last = changed("crates/xtask/src/prove/engine.rs");
        assert!(last[0] != later[0] && last[1] != later[1]);
    }

    #[test]
    fn a_verdict_is_of_the_same_program_and_was_sound() {
        let all = harnesses(&crate::repository()).expect("harnesses");
        let twin = all.iter().find(|h| h.function.name.starts_with("twin_") && !h.is_guard()).expect("a twin");
        let proof = all.iter().find(|h| h.function.name == twin.function.name.replacen("twin_", "proof_", 1));
        let claim = Claim {
            proof: Job { harness: proof.expect("its proof"), solver: "s" },
            twin: Job { harness: twin, solver: "s" },
        };
        let sound = ProofResult {
            name: claim.proof.key().0.to_owned(),
            solver: "s".to_owned(),
            program: "p".to_owned(),
            status: "passed".to_owned(),
            twin: "rejected".to_owned(),
            cover: "reached".to_owned(),
            ..ProofResult::default()
        };
        let known = |proof: ProofResult, program: &str| Recorded { proofs: vec![proof] }.of(&claim, program).is_some();
        assert!(known(sound.clone(), "p") && !known(sound.clone(), "q"));
        assert!(!known(ProofResult { twin: "accepted".to_owned(), ..sound.clone() }, "p"));
        assert!(!known(ProofResult { cover: "missed".to_owned(), ..sound.clone() }, "p"));
        assert!(!known(ProofResult { solver: "t".to_owned(), ..sound }, "p"));
    }
}
