//! Runs what is named and reads what the runners print.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;
use serde_json::Value;

use super::record::{Proof, Status, Tests};
use crate::{prove, source};

/// The engines' own tests: what they refuse, and what they assume of `libm`.
pub(crate) const ENGINES: [&str; 4] = ["exact", "exact_refusals", "rounding", "rounding_refusals"];

/// Runs the test files `files` and the engines' own tests, as far as `only` lets them.
pub(crate) fn tests(repository: &Path, files: &[String], only: Option<&str>) -> Result<Tests, String> {
    let all = files.iter().map(String::as_str).chain(ENGINES);
    let asked: Vec<&str> = all.filter(|name| only.is_none_or(|text| name.contains(text))).collect();
    let mut found = Tests::new();
    for (name, (binary, folder)) in build(repository, &asked)? {
        let mut command = Command::new(binary);
        command.current_dir(&folder).env("CARGO_MANIFEST_DIR", &folder).env("INSTA_UPDATE", "no");
        let output = command.stdin(Stdio::null()).output().map_err(|e| format!("{name}: {e}"))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let outcomes = parse(&text, output.status.success());
        let count = |status| outcomes.values().filter(|s| **s == status).count();
        println!("{name}: {} passed, {} failed", count(Status::Passed), count(Status::Failed));
        if count(Status::Failed) > 0 || outcomes.is_empty() {
            println!("{text}{}", String::from_utf8_lossy(&output.stderr));
        }
        found.insert(name, outcomes);
    }
    Ok(found)
}

/// The binaries of the test files `asked`, by name, each with the folder in which cargo would run it.
fn build(repository: &Path, asked: &[&str]) -> Result<BTreeMap<String, (PathBuf, PathBuf)>, String> {
    if asked.is_empty() {
        return Ok(BTreeMap::new());
    }
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // of all packages: what they depend on then has the features of `cargo test --workspace`, and nothing is built again
    command.args(["test", "--no-run", "--message-format=json", "--workspace"]);
    command.args(asked.iter().flat_map(|name| ["--test", name]));
    let output =
        command.current_dir(repository).stderr(Stdio::inherit()).output().map_err(|e| format!("cargo: {e}"))?;
    if !output.status.success() {
        return Err("the tests do not build".to_owned());
    }
    let messages = String::from_utf8_lossy(&output.stdout);
    let mut found = BTreeMap::new();
    for message in messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
        let text = |pointer: &str| message.pointer(pointer).and_then(Value::as_str);
        if let (Some(name), Some(binary), Some(manifest)) =
            (text("/target/name"), text("/executable"), text("/manifest_path"))
            && asked.contains(&name)
            && let Some(folder) = Path::new(manifest).parent()
            // other packages have tests of the same names
            && ["tests", "crates/prover"].iter().any(|own| folder == repository.join(own))
        {
            found.insert(name.to_owned(), (PathBuf::from(binary), folder.to_owned()));
        }
    }
    Ok(found)
}

/// What a test binary printed. Nothing is taken from a run that did not end regularly or whose lines are not as many as
/// its own summary counts.
fn parse(text: &str, succeeded: bool) -> BTreeMap<String, Status> {
    let mut found = BTreeMap::new();
    let mut lines = 0;
    for line in text.lines() {
        let Some((name, ending)) = line.strip_prefix("test ").and_then(|rest| rest.rsplit_once(" ... ")) else {
            continue;
        };
        let status = match ending {
            "ok" => Status::Passed,
            "FAILED" => Status::Failed,
            _ => Status::NotRun,
        };
        lines += 1;
        found.insert(name.trim_end_matches(" - should panic").to_owned(), status);
    }
    let counted = |status| found.values().filter(|s| **s == status).count();
    let summary = text.lines().filter_map(|l| l.strip_prefix("test result: ")).next_back().unwrap_or_default();
    let count = |label: &str| {
        let part = summary.split([';', '.']).find_map(|p| p.trim().strip_suffix(label)?.trim().parse::<usize>().ok());
        part.unwrap_or(usize::MAX)
    };
    let agree = count("passed") == counted(Status::Passed)
        && count("failed") == counted(Status::Failed)
        && count("ignored") == counted(Status::NotRun)
        && lines == found.len()
        && succeeded == (counted(Status::Failed) == 0);
    if agree { found } else { BTreeMap::new() }
}

/// One entry of `target/prove/results.json`, as `crates/xtask/README.md` tells it. What is missing is empty, and what is
/// empty is not passed.
#[derive(Debug, Deserialize)]
#[serde(default)]
#[derive(Default)]
struct Entry {
    name: String,
    claim: String,
    functions: Vec<String>,
    solver: String,
    assumptions: Vec<BTreeMap<String, String>>,
    status: String,
    twin: String,
    cover: String,
    details: String,
    recorded: bool,
}

/// The bit-precise proofs that ran, and why others did not.
pub(crate) fn proofs(repository: &Path, keep: bool) -> Result<(Vec<Proof>, Vec<String>), String> {
    let file = prove::results_file(repository);
    let mut notes = Vec::new();
    if keep {
        if !is_younger(&file, repository) {
            notes.push("the results of `cargo xtask prove` are missing or older than the sources".to_owned());
            return Ok((Vec::new(), notes));
        }
    } else if let Err(reason) = prove::run(prove::Request::default()) {
        notes.push(format!("the bit-precise proofs did not run: {reason}"));
        return Ok((Vec::new(), notes));
    }
    let text = fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    Ok((entries(&text)?, notes))
}

fn entries(text: &str) -> Result<Vec<Proof>, String> {
    let results: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let engine = results["engine"].as_str().unwrap_or_default().to_owned();
    let entries: Vec<Entry> = serde_json::from_value(results["proofs"].clone()).map_err(|e| e.to_string())?;
    let proof = |e: Entry| Proof {
        engine: format!("{engine}, {}{}", e.solver, if e.recorded { ", recorded on the same sources" } else { "" }),
        status: match (e.status.as_str(), e.cover.as_str()) {
            ("passed", "reached") => Status::Passed,
            ("", _) => Status::NotRun,
            _ => Status::Failed,
        },
        twin_rejected: e.twin == "rejected",
        assumptions: e
            .assumptions
            .iter()
            .map(|a| ["kind", "text"].map(|k| a.get(k).map_or("", String::as_str)).join(": "))
            .collect(),
        claim: e.claim,
        functions: e.functions,
        details: e.details,
        name: e.name,
    };
    Ok(entries.into_iter().map(proof).collect())
}

/// Whether `file` is younger than every source that a bit-precise proof depends on.
fn is_younger(file: &Path, repository: &Path) -> bool {
    let modified = |path: &Path| fs::metadata(path).and_then(|m| m.modified()).ok();
    let Some(written) = modified(file) else { return false };
    let folders = ["model", "estimator", "controller", "calibrator", "instrument", "kani-shim", "xtask/src/prove"];
    let sources = folders.iter().flat_map(|f| source::rust_files(&repository.join("crates").join(f)));
    sources.filter_map(|path| modified(&path)).all(|source| source < written)
}

#[cfg(test)]
mod tests {
    use super::{Status, entries, parse};

    const GOOD: &str = "\nrunning 3 tests\ntest in_f32::prop_a ... ok\ntest b - should panic ... ok\ntest c ... ignored\n\n\
        test result: ok. 2 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s\n";

    #[test]
    fn what_a_test_binary_prints_is_read() {
        let found = parse(GOOD, true);
        let found: Vec<_> = found.iter().map(|(name, status)| (name.as_str(), *status)).collect();
        assert_eq!(found, [("b", Status::Passed), ("c", Status::NotRun), ("in_f32::prop_a", Status::Passed)]);
        let failed = GOOD.replace("c ... ignored", "c ... FAILED").replace("ok. 2", "FAILED. 2");
        let failed = failed.replace("0 failed; 1 ignored", "1 failed; 0 ignored");
        assert_eq!(parse(&failed, false)["c"], Status::Failed);
    }

    #[test]
    fn nothing_is_taken_from_a_run_that_contradicts_itself() {
        assert!(parse(GOOD, false).is_empty(), "it failed after saying that all is well");
        assert!(parse(&GOOD.replace("test c ... ignored\n", ""), true).is_empty(), "a line is missing");
        assert!(parse(&GOOD.replace("2 passed", "3 passed"), true).is_empty(), "a test left no line");
        let (cut_short, _) = GOOD.split_once("test result").expect("a summary");
        assert!(parse(cut_short, true).is_empty(), "no summary");
        assert!(parse("", true).is_empty());
    }

    #[test]
    fn a_proof_passes_with_its_cover_reached_only() {
        let text = r#"{"engine": "E", "proofs": [
            {"name": "proof_a", "solver": "s", "status": "passed", "twin": "rejected", "cover": "reached",
             "assumptions": [{"kind": "budget", "text": "small"}]},
            {"name": "proof_b", "status": "passed", "twin": "accepted", "cover": "missed"},
            {"name": "proof_c"}]}"#;
        let found = entries(text).expect("well-formed");
        let status: Vec<_> = found.iter().map(|p| p.status).collect();
        assert_eq!(status, [Status::Passed, Status::Failed, Status::NotRun]);
        assert_eq!((found[0].twin_rejected, found[1].twin_rejected), (true, false));
        assert_eq!((found[0].engine.as_str(), &found[0].assumptions[..]), ("E, s", &["budget: small".to_owned()][..]));
    }
}
