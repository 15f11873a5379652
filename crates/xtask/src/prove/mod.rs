//! `cargo xtask prove`: every harness of the crates for firmware, by CBMC on the compiled code.
//!
//! A harness `proof_x` counts only together with `twin_x`, the same body with a planted error, and with its covers; the
//! guards in `guards.rs` show in every run that the route itself does not lie.

mod compile;
mod engine;
mod pins;
mod recorded;
mod root;
mod rules;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::source::{self, Function};
use engine::{Answer, Query, Verdict};

/// Seconds on the processor that one harness may take: twice what the slowest, a twin, took on a busy machine.
const LIMIT_S: u64 = 800;
/// What all of them may take on the processor, with their compilation, over what the guards take beside them: a fifth more than
/// 19.3 times (1,305 s over 67.7 s). A machine 1.6 times as slow was as slow with the guards as with the rest.
const MOST_GUARDS: f64 = 23.0;
/// The twin of this guard cuts its loop short, which is what has to be seen.
const CUT_SHORT: &str = "twin_guard_loops_are_counted";
/// The twin of this guard asks for more than the stack has, which is what has to be seen.
const RUN_OVER: &str = "twin_guard_a_stack_ends";

/// A harness and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Harness {
    pub(crate) function: Function,
    /// `cvg_controller::proofs::pi::proof_x`
    pub(crate) path: String,
    /// texts of its covers
    pub(crate) covers: Vec<String>,
    pub(crate) assumptions: Vec<Assumption>,
}

impl Harness {
    /// The name without `proof_` or `twin_`.
    fn claim(&self) -> &str {
        self.function.name.split_once('_').map_or("", |(_, claim)| claim)
    }

    /// `cvg_controller::proofs::pi::` and the claim: what a part of the harnesses is chosen by.
    fn address(&self) -> String {
        self.path.replace(&self.function.name, self.claim())
    }

    /// `cvg-controller`; the guards are this crate's
    pub(crate) fn package(&self) -> String {
        if self.is_guard() {
            return "xtask".to_owned();
        }
        self.path.split("::").next().unwrap_or_default().replace('_', "-")
    }

    fn is_guard(&self) -> bool {
        self.path.starts_with("guards::")
    }
}

/// A harness to be asked of a solver.
#[derive(Clone, Copy, Debug)]
struct Job<'a> {
    harness: &'a Harness,
    solver: &'a str,
}

impl<'a> Job<'a> {
    /// A guard is asked of every solver, anything else of its own.
    fn of(harness: &'a Harness) -> Vec<Self> {
        if harness.is_guard() {
            engine::SOLVERS.into_iter().map(|solver| Self { harness, solver }).collect()
        } else {
            vec![Self { harness, solver: harness.function.argument("kani::solver").unwrap_or(engine::SOLVER) }]
        }
    }

    fn key(&self) -> (&'a str, &'a str) {
        (&self.harness.function.name, self.solver)
    }
}

/// A proof with its twin, asked of one solver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claim<'a> {
    proof: Job<'a>,
    twin: Job<'a>,
}

/// What of the harnesses is proved.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Request<'a> {
    /// those whose path contains this, without the guards and without leaving a result; all where nothing is said
    pub(crate) only: Option<&'a str>,
    /// what has changed since it was recorded, and the guards; of the rest as much as so many seconds of the processor have room for
    pub(crate) most_s: Option<f64>,
    /// the verdicts are put into the repository
    pub(crate) record: bool,
}

/// Claims that are proved again however little time there is: of none nothing follows.
const FEWEST_AGAIN: usize = 4;

/// What a proof takes for granted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Assumption {
    /// `precondition` of the function, or `budget` of the solver
    pub(crate) kind: String,
    pub(crate) text: String,
}

/// What a run says of one proof. `README.md` of this crate tells the fields to readers of the file.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ProofResult {
    pub(crate) name: String,
    /// `cvg-controller`
    #[serde(rename = "crate")]
    pub(crate) package: String,
    /// `crates/controller/src/proofs/pi.rs:57`
    pub(crate) place: String,
    /// the claim, in words
    pub(crate) claim: String,
    /// the functions that it is about
    pub(crate) functions: Vec<String>,
    /// `specs/equation-03.md#bounded-output`
    pub(crate) requirements: Vec<String>,
    /// `f32`, `f64`, or nothing where no scalar is involved
    pub(crate) scalar: String,
    pub(crate) solver: String,
    pub(crate) assumptions: Vec<Assumption>,
    /// `passed` or `failed`
    pub(crate) status: String,
    /// `rejected` or `accepted`
    pub(crate) twin: String,
    /// what had to be reachable besides the end; all of it is where `cover` is `reached`
    pub(crate) covers: Vec<String>,
    /// `reached`, `missed`, or `unknown` where there is no verdict
    pub(crate) cover: String,
    pub(crate) seconds: f64,
    pub(crate) twin_seconds: f64,
    /// what was found, in words
    pub(crate) details: String,
    /// the name of the sources that it is about
    pub(crate) program: String,
    /// it was found by an earlier run, of the same sources
    pub(crate) recorded: bool,
}

impl ProofResult {
    /// With what the sources say of the claim.
    fn said_of(self, claim: &Claim<'_>) -> Self {
        let (proof, f) = (claim.proof.harness, &claim.proof.harness.function);
        let scalar = ["f32", "f64"].into_iter().find(|scalar| f.name.ends_with(scalar)).unwrap_or_default();
        Self {
            name: f.name.clone(),
            package: proof.package(),
            place: format!("{}:{}", f.file.display(), f.line),
            claim: f.doc.clone(),
            functions: source::subjects(&f.doc),
            requirements: f.citations.iter().map(|c| c.target.clone()).collect(),
            scalar: scalar.to_owned(),
            solver: claim.proof.solver.to_owned(),
            assumptions: proof.assumptions.clone(),
            covers: proof.covers.clone(),
            ..self
        }
    }

    /// Proved, with its twin refuted and its covers reached.
    fn is_sound(&self) -> bool {
        self.status == "passed" && self.twin == "rejected" && self.cover == "reached"
    }
}

/// What a run leaves behind.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Results {
    pub(crate) engine: String,
    pub(crate) packages: Vec<String>,
    /// by the clock
    pub(crate) seconds: f64,
    /// on the processor, which is what is limited
    #[serde(default)]
    pub(crate) processor_seconds: f64,
    pub(crate) proofs: Vec<ProofResult>,
}

/// Every harness of the sources.
///
/// # Errors
/// Where one breaks a rule, all that do.
pub(crate) fn harnesses(repository: &Path) -> Result<Vec<Harness>, String> {
    let (mut found, mut faults) = (Vec::new(), Vec::new());
    for name in compile::CRATES {
        let folder = repository.join("crates").join(name).join("src");
        let mut files = Vec::new();
        for file in source::rust_files(&folder) {
            let inside = file.strip_prefix(&folder).map_err(|e| e.to_string())?.with_extension("");
            if !inside.starts_with("proofs") {
                faults.extend(rules::uncompiled(repository, &file)?);
                continue;
            }
            files.push((file, inside));
        }
        let mut of_crate = Vec::new();
        for (file, _) in &files {
            of_crate.extend(source::read(repository, file)?);
        }
        for (file, inside) in files {
            let modules: Vec<_> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            let path = format!("cvg_{name}::{}", modules.join("::"));
            let functions = source::read(repository, &file)?;
            // a name is looked up in its own file first
            let known = [functions.as_slice(), &of_crate].concat();
            faults.extend(rules::faults(&functions, &known));
            found.extend(in_file(&functions, &known, path.trim_end_matches("::mod"))?);
        }
    }
    let guards = repository.join("crates/xtask/src/prove/guards.rs");
    let functions = source::read(repository, &guards)?;
    found.extend(in_file(&functions, &functions, "guards")?);
    paired(&found)?;
    if faults.is_empty() { Ok(found) } else { Err(faults.join("\n")) }
}

fn in_file(functions: &[Function], known: &[Function], module: &str) -> Result<Vec<Harness>, String> {
    let marked = functions.iter().filter(|f| f.has("kani::proof"));
    marked
        .map(|f| {
            let guard = module == "guards";
            let assumptions = if guard { Vec::new() } else { source::assumptions(f, known)? };
            if !guard && f.name.starts_with("proof_") && source::subjects(&f.doc).is_empty() {
                return Err(format!("{}:{}: {} links to no function", f.file.display(), f.line, f.name));
            }
            let assumptions = assumptions.into_iter().map(|(kind, text)| Assumption { kind: kind.to_owned(), text });
            Ok(Harness {
                function: f.clone(),
                path: format!("{module}::{}", f.name),
                covers: source::covers(f, known).into_iter().collect(),
                assumptions: assumptions.collect(),
            })
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
pub(crate) fn results_file(repository: &Path) -> PathBuf {
    repository.join("target/prove/results.json")
}

/// Proves what is asked for.
pub(crate) fn run(request: Request<'_>) -> crate::Outcome {
    let started = Instant::now();
    let repository = crate::repository();
    let all = harnesses(&repository)?;
    let _ = fs::remove_file(results_file(&repository));
    let root = root::Root::ready()?;
    let folders = compile::compile(&repository, &root, &all)?;
    println!("compiled {} harnesses in {:.0} s", all.len(), started.elapsed().as_secs_f64());

    let programs: BTreeMap<&str, String> = folders
        .keys()
        .map(|package| Ok((package.as_str(), recorded::program(&repository, package)?)))
        .collect::<Result<_, String>>()?;
    let program = |h: &Harness| programs.get(h.package().as_str()).map_or("", String::as_str);
    let recorded =
        if request.most_s.is_some() { recorded::Recorded::read(&repository) } else { recorded::Recorded::default() };
    let known = |claim: &Claim<'_>| recorded.of(claim, program(claim.proof.harness));
    let claims = claims(&all, request.only)?;
    let (mut again, open): (Vec<Claim<'_>>, Vec<Claim<'_>>) =
        claims.iter().partition(|claim| !claim.proof.harness.is_guard() && known(claim).is_some());
    let commit = source::git(&["rev-parse", "HEAD"]).unwrap_or_default();
    again.sort_by_cached_key(|claim| source::drawn(commit.trim(), &claim.proof.harness.path));
    let mut answers = ask_all(&root, &folders, &open, None)?;
    answers.extend(ask_all(&root, &folders, &again, request.most_s)?);
    let mut proofs = Vec::new();
    for claim in &claims {
        let found = match (answer(&answers, &claim.proof), answer(&answers, &claim.twin), known(claim)) {
            (Some(proof), Some(twin), _) => result(claim, proof, twin),
            (_, _, Some(before)) => carried(claim, before),
            _ => return Err(format!("{} or its twin was not run", claim.proof.harness.function.name)),
        };
        proofs.push(ProofResult { program: program(claim.proof.harness).to_owned(), ..found });
    }
    proofs.sort_by(|a, b| a.name.cmp(&b.name));
    let results = Results {
        engine: "CBMC on the compiled wasm".to_owned(),
        packages: root.packages(),
        seconds: started.elapsed().as_secs_f64(),
        processor_seconds: processor_seconds()?,
        proofs,
    };
    print(&results);
    if request.only.is_none() && request.most_s.is_none() {
        let guards = claims.iter().filter(|claim| claim.proof.harness.is_guard());
        let guards: f64 = guards
            .flat_map(|claim| [&claim.proof, &claim.twin])
            .filter_map(|job| answer(&answers, job))
            .map(|a| a.seconds)
            .sum();
        let times = results.processor_seconds / guards;
        println!("{times:.1} times what the guards took, {guards:.1} s; {MOST_GUARDS} times are allowed");
        if times > MOST_GUARDS {
            return Err(format!("{:.0} s on the processor are too many", results.processor_seconds));
        }
    }
    let sound = !results.proofs.is_empty() && results.proofs.iter().all(ProofResult::is_sound);
    let file = results_file(&repository);
    // a part of the harnesses is no result for the audit
    if request.only.is_none() {
        let text = serde_json::to_string_pretty(&results).map_err(|e| e.to_string())?;
        fs::write(&file, text).map_err(|e| e.to_string())?;
        println!("{}", file.display());
    }
    if request.record && sound {
        println!("{}", recorded::write(&repository, &results)?.display());
    }
    Ok(sound)
}

/// What came of a harness, where it was asked about.
fn answer<'a, 'b>(answers: &'a BTreeMap<(&'b str, &'b str), Answer>, job: &Job<'b>) -> Option<&'a Answer> {
    answers.get(&job.key())
}

/// Every proof with its twin, once for each solver that is asked.
fn claims<'a>(all: &'a [Harness], only: Option<&str>) -> Result<Vec<Claim<'a>>, String> {
    let asked = all.iter().filter(|h| only.is_none_or(|text| h.address().contains(text)));
    let proofs = asked.filter(|h| h.function.name.starts_with("proof_")).flat_map(Job::of);
    let mut claims = Vec::new();
    for proof in proofs {
        let name = format!("twin_{}", proof.harness.claim());
        let twin = all.iter().filter(|h| h.function.name == name).flat_map(Job::of).find(|t| t.solver == proof.solver);
        claims.push(Claim {
            proof,
            twin: twin.ok_or_else(|| format!("{name} is asked of another solver than its proof"))?,
        });
    }
    Ok(claims)
}

/// What the children of this process have taken on the processor, user and system.
fn processor_seconds() -> Result<f64, String> {
    // after the name in brackets, from the third field on; the clock of these fields ticks 100 times a second
    let text = fs::read_to_string("/proc/self/stat").map_err(|e| e.to_string())?;
    let fields = text.rsplit_once(')').map(|(_, rest)| rest.split_whitespace().collect::<Vec<_>>());
    let ticks = |n: usize| fields.as_ref()?.get(n - 3)?.parse::<f64>().ok();
    match (ticks(16), ticks(17)) {
        (Some(user), Some(system)) => Ok((user + system) / 100.0),
        _ => Err("the system does not say what the processor did".to_owned()),
    }
}

/// Asks about claims, about at least some of them until so many seconds of the processor are used.
fn ask_all<'a>(
    root: &root::Root,
    folders: &BTreeMap<String, PathBuf>,
    claims: &[Claim<'a>],
    most_s: Option<f64>,
) -> Result<BTreeMap<(&'a str, &'a str), Answer>, String> {
    let next = AtomicUsize::new(0);
    let answers = Mutex::new(BTreeMap::new());
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let before = processor_seconds()?;
    let is_over = |at: usize| {
        let used = || processor_seconds().map_or(f64::INFINITY, |now| now - before);
        at >= FEWEST_AGAIN && most_s.is_some_and(|most| used() >= most)
    };
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(claim) = claims.get(at).filter(|_| !is_over(at)) else { break };
                    for job in [claim.proof, claim.twin] {
                        let Some(answer) = ask(root, folders, &job) else { continue };
                        if let Ok(mut answers) = answers.lock() {
                            answers.insert(job.key(), answer);
                        }
                    }
                }
            });
        }
    });
    Ok(answers.into_inner().unwrap_or_default())
}

/// Asks about one harness, and prints what came of it.
fn ask(root: &root::Root, folders: &BTreeMap<String, PathBuf>, job: &Job<'_>) -> Option<Answer> {
    let h = job.harness;
    let query = Query {
        name: &h.function.name,
        covers: h.covers.iter().map(String::as_str).collect(),
        unwind: h.function.argument("kani::unwind").unwrap_or(engine::UNWIND),
        solver: job.solver,
        limit: Duration::from_secs(LIMIT_S),
    };
    let answer = engine::ask(root, folders.get(&h.package())?, &query);
    let verdict = answer.verdict(&query.covers);
    println!("{:>7.1} s  {} ({}): {verdict:?}", answer.seconds, h.function.name, job.solver);
    Some(answer)
}

/// What an earlier run found, of a claim as the sources have it.
fn carried(claim: &Claim<'_>, before: &ProofResult) -> ProofResult {
    ProofResult { recorded: true, ..before.clone() }.said_of(claim)
}

fn result(claim: &Claim<'_>, answer: &Answer, twin: &Answer) -> ProofResult {
    let proof = claim.proof.harness;
    let covers: Vec<_> = proof.covers.iter().map(String::as_str).collect();
    let verdict = answer.verdict(&covers);
    let twin_verdict = twin.verdict(&covers);
    let rejected = match claim.twin.key().0 {
        CUT_SHORT => Verdict::Unwound,
        RUN_OVER => Verdict::Beyond,
        _ => Verdict::Refuted,
    };
    let mut details = Vec::new();
    if verdict != Verdict::Proved {
        details.push(format!("{verdict:?}"));
    }
    if twin_verdict != rejected {
        details.push(format!("twin: {twin_verdict:?}"));
    }
    let found = ProofResult {
        status: if verdict == Verdict::Proved { "passed" } else { "failed" }.to_owned(),
        twin: if twin_verdict == rejected { "rejected" } else { "accepted" }.to_owned(),
        cover: match &verdict {
            Verdict::Proved => "reached",
            Verdict::Vacuous(_) => "missed",
            _ => "unknown",
        }
        .to_owned(),
        seconds: answer.seconds,
        twin_seconds: twin.seconds,
        details: details.join("; "),
        ..ProofResult::default()
    };
    found.said_of(claim)
}

fn print(results: &Results) {
    println!("\n{:<58} {:>7} {:>9} {:>9} {:>7}", "proof", "result", "twin", "cover", "s");
    for p in &results.proofs {
        println!(
            "{:<58} {:>7} {:>9} {:>9} {:>7.1}{}",
            if p.name.starts_with("proof_guard_") { format!("{} ({})", p.name, p.solver) } else { p.name.clone() },
            p.status,
            p.twin,
            p.cover,
            p.seconds + p.twin_seconds,
            if p.recorded { "  recorded".to_owned() } else { format!("  {}", p.details) }
        );
    }
    let passed = results.proofs.iter().filter(|p| p.status == "passed" && p.twin == "rejected").count();
    let recorded = results.proofs.iter().filter(|p| p.recorded).count();
    println!(
        "{passed} of {} proved with their twins rejected, {recorded} of them by an earlier run on the same sources; {:.0} s on the processor, \
         {:.0} s by the clock",
        results.proofs.len(),
        results.processor_seconds,
        results.seconds
    );
}
