//! `cargo xtask prove`: every harness of the crates for firmware, by CBMC on the compiled code.
//!
//! A harness `proof_x` counts only together with `twin_x`, the same body with a planted error, and with its covers; the
//! guards in `guards.rs` show in every run that the route itself does not lie.

mod compile;
mod engine;
mod root;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::source::{self, Function};
use engine::{Answer, Query, Verdict};

/// Seconds that one harness may take.
const TIMEOUT_S: u64 = 240;
/// The twin of this guard cuts its loop short, which is what has to be seen.
const CUT_SHORT: &str = "twin_guard_loops_are_counted";

/// A harness and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Harness {
    pub(crate) function: Function,
    /// `cvg_controller::proofs::pi::proof_x`
    pub(crate) path: String,
    /// texts of its covers
    pub(crate) covers: Vec<String>,
}

/// What a run says of one proof.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ProofResult {
    pub(crate) name: String,
    /// `passed` or `failed`
    pub(crate) status: String,
    /// `rejected` or `accepted`
    pub(crate) twin: String,
    /// how many covers there are; all are reached where the status is `passed`
    pub(crate) covers: usize,
    pub(crate) seconds: f64,
    pub(crate) twin_seconds: f64,
    /// what was found, in words
    pub(crate) details: String,
}

/// What a run leaves behind.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Results {
    pub(crate) engine: String,
    pub(crate) packages: Vec<String>,
    pub(crate) seconds: f64,
    pub(crate) proofs: Vec<ProofResult>,
}

/// Every harness of the sources.
pub(crate) fn harnesses(repository: &Path) -> Result<Vec<Harness>, String> {
    let mut found = Vec::new();
    for name in compile::CRATES {
        let folder = repository.join("crates").join(name).join("src");
        for file in source::rust_files(&folder) {
            let inside = file.strip_prefix(&folder).map_err(|e| e.to_string())?.with_extension("");
            if !inside.starts_with("proofs") {
                continue;
            }
            let modules: Vec<_> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            let path = format!("cvg_{name}::{}", modules.join("::"));
            found.extend(in_file(&source::read(repository, &file)?, path.trim_end_matches("::mod")));
        }
    }
    let guards = repository.join("crates/xtask/src/prove/guards.rs");
    found.extend(in_file(&source::read(repository, &guards)?, "guards"));
    paired(&found)?;
    Ok(found)
}

fn in_file(functions: &[Function], module: &str) -> Vec<Harness> {
    let marked = functions.iter().filter(|f| f.has("kani::proof"));
    marked
        .map(|f| Harness {
            function: f.clone(),
            path: format!("{module}::{}", f.name),
            covers: source::covers(f, functions).into_iter().collect(),
        })
        .collect()
}

/// Names are unique, say what they are, and each proof has its twin.
fn paired(harnesses: &[Harness]) -> Result<(), String> {
    let mut names: BTreeMap<&str, usize> = BTreeMap::new();
    for h in harnesses {
        let name = h.function.name.as_str();
        *names.entry(name).or_default() += 1;
        let twin = name.starts_with("twin_");
        if !twin && !name.starts_with("proof_") {
            return Err(format!("{name} is neither proof_ nor twin_"));
        }
        if twin != h.function.has("kani::should_panic") {
            return Err(format!("{name}: a twin, and only a twin, is marked #[kani::should_panic]"));
        }
        if !twin && h.covers.is_empty() {
            return Err(format!("{name} has no cover"));
        }
    }
    for (name, count) in &names {
        if *count > 1 {
            return Err(format!("{name} is there {count} times"));
        }
        let other = match name.strip_prefix("proof_") {
            Some(claim) => format!("twin_{claim}"),
            None => name.replacen("twin_", "proof_", 1),
        };
        if !names.contains_key(other.as_str()) {
            return Err(format!("{name} has no {other}"));
        }
    }
    Ok(())
}

/// Where the results of the last run are.
pub(crate) fn results_file(repository: &Path) -> std::path::PathBuf {
    repository.join("target/prove/results.json")
}

/// Proves all harnesses, or those whose name contains `only` together with the guards.
pub(crate) fn run(only: Option<&str>) -> crate::Outcome {
    let started = Instant::now();
    let repository = crate::repository();
    let all = harnesses(&repository)?;
    let _ = fs::remove_file(results_file(&repository));
    let root = root::Root::ready()?;
    let folder = compile::compile(&repository, &root, &all)?;
    println!("compiled {} harnesses in {:.0} s", all.len(), started.elapsed().as_secs_f64());

    let claim = |h: &Harness| h.function.name.split_once('_').map_or_else(String::new, |(_, claim)| claim.to_owned());
    let asked: Vec<&Harness> = all
        .iter()
        .filter(|h| only.is_none_or(|text| claim(h).contains(text) || claim(h).starts_with("guard_")))
        .collect();
    let answers = ask_all(&root, &folder, &asked);
    let mut proofs = Vec::new();
    for proof in asked.iter().filter(|h| h.function.name.starts_with("proof_")) {
        let twin_name = format!("twin_{}", claim(proof));
        let (Some(answer), Some(twin)) = (answers.get(&proof.function.name), answers.get(&twin_name)) else {
            return Err(format!("{} or its twin was not run", proof.function.name));
        };
        proofs.push(result(proof, answer, &twin_name, twin));
    }
    proofs.sort_by(|a, b| a.name.cmp(&b.name));
    let results = Results {
        engine: "CBMC on the compiled wasm".to_owned(),
        packages: root.packages(),
        seconds: started.elapsed().as_secs_f64(),
        proofs,
    };
    print(&results);
    let sound = results.proofs.iter().all(|p| p.status == "passed" && p.twin == "rejected");
    let file = results_file(&repository);
    // a part of the harnesses is no result for the audit
    if only.is_none() {
        let text = serde_json::to_string_pretty(&results).map_err(|e| e.to_string())?;
        fs::write(&file, text).map_err(|e| e.to_string())?;
        println!("{}", file.display());
    }
    Ok(sound && !results.proofs.is_empty())
}

fn ask_all(root: &root::Root, folder: &Path, asked: &[&Harness]) -> BTreeMap<String, Answer> {
    let next = AtomicUsize::new(0);
    let answers = Mutex::new(BTreeMap::new());
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(h) = asked.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let query = Query {
                        name: &h.function.name,
                        covers: h.covers.iter().map(String::as_str).collect(),
                        unwind: h.function.argument("kani::unwind").unwrap_or(engine::UNWIND),
                        solver: h.function.argument("kani::solver").unwrap_or("minisat"),
                        timeout: Duration::from_secs(TIMEOUT_S),
                    };
                    let answer = engine::ask(root, folder, &query);
                    println!("{:>7.1} s  {}", answer.seconds, h.function.name);
                    if let Ok(mut answers) = answers.lock() {
                        answers.insert(h.function.name.clone(), answer);
                    }
                }
            });
        }
    });
    answers.into_inner().unwrap_or_default()
}

fn result(proof: &Harness, answer: &Answer, twin_name: &str, twin: &Answer) -> ProofResult {
    let covers: Vec<_> = proof.covers.iter().map(String::as_str).collect();
    let verdict = answer.verdict(&covers);
    let twin_verdict = twin.verdict(&covers);
    let rejected = if twin_name == CUT_SHORT { Verdict::Unwound } else { Verdict::Refuted };
    let mut details = Vec::new();
    if verdict != Verdict::Proved {
        details.push(format!("{verdict:?}"));
    }
    if twin_verdict != rejected {
        details.push(format!("twin: {twin_verdict:?}"));
    }
    ProofResult {
        name: proof.function.name.clone(),
        status: if verdict == Verdict::Proved { "passed" } else { "failed" }.to_owned(),
        twin: if twin_verdict == rejected { "rejected" } else { "accepted" }.to_owned(),
        covers: covers.len() + 1,
        seconds: answer.seconds,
        twin_seconds: twin.seconds,
        details: details.join("; "),
    }
}

fn print(results: &Results) {
    println!("\n{:<58} {:>7} {:>9} {:>9} {:>7}", "proof", "result", "twin", "covers", "s");
    for p in &results.proofs {
        println!(
            "{:<58} {:>7} {:>9} {:>9} {:>7.1}{}",
            p.name,
            p.status,
            p.twin,
            p.covers,
            p.seconds + p.twin_seconds,
            if p.details.is_empty() { String::new() } else { format!("  {}", p.details) }
        );
    }
    let passed = results.proofs.iter().filter(|p| p.status == "passed" && p.twin == "rejected").count();
    println!("{passed} of {} proved with their twins rejected, {:.0} s in all", results.proofs.len(), results.seconds);
}
