//! One harness through CBMC, and what its answer is worth.
//!
//! A claim is believed only if CBMC ended in one of its two regular ways, every property that has to be there is there,
//! each has a verdict, and every cover was reached. Anything else is an error, never a proof.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::root::Root;

/// What has to be among the properties of every harness, or the model was not what it should be.
const ALWAYS: [&str; 3] = ["panic", BEYOND, "cover: the end"];
/// The property that every load and every store is within the memory: of the stack, that it does not run over.
const BEYOND: &str = "access out of bounds";
/// Loops without `#[kani::unwind]` run at most so often.
pub(crate) const UNWIND: &str = "16";
/// The solver of harnesses without `#[kani::solver]`: on products of floats far quicker than the other.
pub(crate) const SOLVER: &str = "bitwuzla";
/// Both solvers: the guards are asked of each.
pub(crate) const SOLVERS: [&str; 2] = ["bitwuzla", "minisat"];
/// KiB of address space for one solver.
const MEMORY_KIB: u64 = 6_000_000;
/// By the clock a harness may take so many times as long as on the processor: a machine that is busy changes no answer.
const PATIENCE: u32 = 20;

/// What a harness asks of the engine.
#[derive(Clone, Debug)]
pub(crate) struct Query<'a> {
    pub(crate) name: &'a str,
    /// texts of its covers
    pub(crate) covers: Vec<&'a str>,
    pub(crate) unwind: &'a str,
    /// `bitwuzla`, or `minisat`, which is CBMC's own
    pub(crate) solver: &'a str,
    /// on the processor
    pub(crate) limit: Duration,
}

/// The verdict on one property.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Property {
    pub(crate) text: String,
    pub(crate) holds: bool,
}

/// What CBMC answered.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    pub(crate) properties: Result<Vec<Property>, String>,
    /// on the processor
    pub(crate) seconds: f64,
}

/// What an answer says of a claim.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// the claim holds for all inputs, and every cover is reachable
    Proved,
    /// the claim is wrong: a panic can be reached, and nothing else is amiss
    Refuted,
    /// the claim holds, but these covers cannot be reached: it may hold of nothing
    Vacuous(Vec<String>),
    /// loops were cut short
    Unwound,
    /// memory that is not there is written or read: the claim is not even about what happens
    Beyond,
    /// neither, and why
    Unknown(String),
}

impl Answer {
    /// The verdict, given the texts of the covers.
    pub(crate) fn verdict(&self, covers: &[&str]) -> Verdict {
        let properties = match &self.properties {
            Ok(properties) => properties,
            Err(reason) => return Verdict::Unknown(reason.clone()),
        };
        let wanted = ALWAYS.iter().map(|text| (*text).to_owned()).chain(covers.iter().map(|text| cover(text)));
        for text in wanted {
            if !properties.iter().any(|p| p.text == text) {
                return Verdict::Unknown(format!("no verdict on \"{text}\""));
            }
        }
        let failed: Vec<_> =
            properties.iter().filter(|p| !p.holds && !p.text.starts_with("cover: ")).map(|p| &p.text).collect();
        let panics = failed.iter().any(|text| *text == "panic");
        let unwound = failed.iter().any(|text| text.contains("unwinding assertion"));
        if unwound {
            return Verdict::Unwound;
        }
        if !failed.is_empty() && failed.iter().all(|text| *text == BEYOND) {
            return Verdict::Beyond;
        }
        if failed.len() > usize::from(panics) {
            return Verdict::Unknown(format!("{failed:?}"));
        }
        if panics {
            return Verdict::Refuted;
        }
        let missed: Vec<_> =
            properties.iter().filter(|p| p.holds && p.text.starts_with("cover: ")).map(|p| p.text.clone()).collect();
        if missed.is_empty() { Verdict::Proved } else { Verdict::Vacuous(missed) }
    }
}

fn cover(text: &str) -> String {
    format!("cover: {text}")
}

/// FNV-1a, as `kani::cover!` computes it.
fn fingerprint(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |hash: u32, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// Asks CBMC about the harness in the C of `folder`.
pub(crate) fn ask(root: &Root, folder: &Path, query: &Query) -> Answer {
    let times = folder.join(format!("{}.{}.times", query.name, query.solver));
    let _ = std::fs::remove_file(&times);
    let properties = answer(root, folder, query, &times);
    let seconds = std::fs::read_to_string(&times).map_or(0.0, |text| processor_seconds(&text));
    Answer { properties, seconds }
}

/// The seconds that a shell's `times` says its children took: the second line, user and system.
fn processor_seconds(times: &str) -> f64 {
    let one = |time: &str| -> Option<f64> {
        let (minutes, seconds) = time.trim_end_matches('s').split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    times.lines().nth(1).map_or(0.0, |line| line.split_whitespace().filter_map(one).sum())
}

fn answer(root: &Root, folder: &Path, query: &Query, times: &Path) -> Result<Vec<Property>, String> {
    let cases: Vec<_> = query
        .covers
        .iter()
        .map(|text| format!("case {}u: __CPROVER_assert(0, \"{}\"); break;", fingerprint(text), cover(text)))
        .collect();
    let log = folder.join(format!("{}.{}.txt", query.name, query.solver));
    let file = File::create(&log).map_err(|e| e.to_string())?;
    let mut command = Command::new("sh");
    command
        // a solver that asks for more than its share, of memory or of the processor, ends with an error
        .args(["-c", &limited(query.limit.as_secs())])
        .env("TIMES", times)
        .arg(root.tool("cbmc"))
        .args(["host.c", "--no-standard-checks", "--unwinding-assertions", "--unwind", query.unwind])
        .args(["--object-bits", "12", "--slice-formula"])
        .arg("-I")
        .arg(root.headers())
        .arg(format!("-DHARNESS=w2c_harness_{}", query.name))
        .arg(format!("-DCOVERS={}", cases.join(" ")))
        .current_dir(folder)
        .env("TMPDIR", folder)
        .stdin(Stdio::null())
        .stdout(file)
        .stderr(Stdio::null());
    match query.solver {
        // without `--fpa`: CBMC makes bits of the floats itself, the same as for its own solver, so that there is only one
        // meaning of a float and NaN keeps its bits
        "bitwuzla" => {
            let path = std::env::var_os("PATH").unwrap_or_default();
            let path = std::iter::once(root.tools()).chain(std::env::split_paths(&path));
            command.arg("--bitwuzla").env("PATH", std::env::join_paths(path).map_err(|e| e.to_string())?);
        }
        "minisat" => {}
        other => return Err(format!("there is no solver {other}")),
    }
    let code = wait(&mut command, query.limit * PATIENCE)?;
    let text = std::fs::read_to_string(&log).map_err(|e| e.to_string())?;
    parse(&text, code)
}

/// Runs the command in the arguments within its share, and writes the times that it took to `$TIMES`.
fn limited(seconds: u64) -> String {
    format!("ulimit -v {MEMORY_KIB}; ulimit -t {seconds}; \"$0\" \"$@\"; code=$?; times >\"$TIMES\"; exit $code")
}

/// The exit code, or why there is none.
fn wait(command: &mut Command, timeout: Duration) -> Result<i32, String> {
    use std::os::unix::process::CommandExt as _;
    // a group of its own, so that an external solver ends with it
    let mut child = command.process_group(0).spawn().map_err(|e| e.to_string())?;
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            return status.code().ok_or_else(|| format!("CBMC was ended: {status}"));
        }
        if started.elapsed() > timeout {
            let _ = Command::new("kill").args(["-9", "--"]).arg(format!("-{}", child.id())).status();
            let _ = child.wait();
            return Err(format!("no answer within {} s by the clock", timeout.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// CBMC's answer from its output and its exit code: 0 is "all hold", 10 is "some fail", anything else is an error.
fn parse(text: &str, code: i32) -> Result<Vec<Property>, String> {
    let last_lines = || text.lines().rev().take(4).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join(" ");
    if code != 0 && code != 10 {
        return Err(format!("CBMC ended with {code}: {}", last_lines()));
    }
    // [w2c_k_cover.assertion.1] line 103 panic: SUCCESS
    let mut properties = Vec::new();
    for line in text.lines().filter(|line| line.starts_with('[')) {
        let (rest, status) = line.rsplit_once(": ").ok_or_else(|| format!("not a property: {line}"))?;
        let text = rest.split_once("] ").map_or(rest, |(_, text)| text);
        let text = match text.strip_prefix("line ").and_then(|t| t.split_once(' ')) {
            Some((_, text)) => text,
            None => text,
        };
        let holds = match status {
            "SUCCESS" => true,
            "FAILURE" => false,
            other => return Err(format!("\"{text}\" is {other}")),
        };
        properties.push(Property { text: text.to_owned(), holds });
    }
    // ** 2 of 12 failed (3 iterations)
    let failed = properties.iter().filter(|p| !p.holds).count();
    let summary = format!("** {failed} of {} failed", properties.len());
    let verdict = if failed == 0 { "VERIFICATION SUCCESSFUL" } else { "VERIFICATION FAILED" };
    let whole = text.lines().any(|line| line.starts_with(&summary)) && text.lines().any(|line| line == verdict);
    if !whole || code != (if failed == 0 { 0 } else { 10 }) {
        return Err(format!("CBMC's output is not whole or denies itself: {}", last_lines()));
    }
    Ok(properties)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(properties: &[(&str, bool)]) -> Answer {
        let properties = properties.iter().map(|(text, holds)| Property { text: (*text).to_owned(), holds: *holds });
        Answer { properties: Ok(properties.collect()), seconds: 0.0 }
    }

    const SOUND: [(&str, bool); 4] =
        [("panic", true), ("access out of bounds", true), ("cover: the end", false), ("cover: here", false)];

    fn changed(text: &str, holds: bool) -> Answer {
        let mut properties = SOUND.to_vec();
        properties.retain(|(t, _)| *t != text);
        properties.push((text, holds));
        answer(&properties)
    }

    #[test]
    fn what_holds_and_is_reached_is_proved() {
        assert_eq!(answer(&SOUND).verdict(&["here"]), Verdict::Proved);
    }

    #[test]
    fn a_reachable_panic_refutes() {
        assert_eq!(changed("panic", false).verdict(&["here"]), Verdict::Refuted);
    }

    #[test]
    fn a_cover_that_is_not_reached_is_no_proof() {
        assert_eq!(changed("cover: here", true).verdict(&["here"]), Verdict::Vacuous(vec!["cover: here".to_owned()]));
        assert_eq!(
            changed("cover: the end", true).verdict(&["here"]),
            Verdict::Vacuous(vec!["cover: the end".to_owned()])
        );
    }

    #[test]
    fn a_cover_or_a_check_that_is_not_there_is_no_proof() {
        assert!(matches!(answer(&SOUND).verdict(&["elsewhere"]), Verdict::Unknown(_)));
        assert!(matches!(answer(&SOUND[1..]).verdict(&["here"]), Verdict::Unknown(_)));
    }

    #[test]
    fn an_unwound_loop_is_neither_proof_nor_refutation() {
        assert_eq!(changed("unwinding assertion loop 0", false).verdict(&["here"]), Verdict::Unwound);
    }

    #[test]
    fn a_twin_that_fails_for_another_reason_is_not_refuted() {
        let mut properties = SOUND.to_vec();
        properties[0].1 = false;
        properties[1].1 = false;
        assert!(matches!(answer(&properties).verdict(&["here"]), Verdict::Unknown(_)));
    }

    #[test]
    fn memory_that_is_not_there_is_neither_proof_nor_refutation() {
        assert_eq!(changed("access out of bounds", false).verdict(&["here"]), Verdict::Beyond);
    }

    const OUTPUT: &str = "CBMC version 6.6.0\n\n** Results:\nhost.c function wasm_rt_trap\n\
        [wasm_rt_trap.assertion.1] line 79 panic: SUCCESS\n\
        [w2c_k_cover.assertion.1] line 103 cover: here: FAILURE\n\n\
        ** 1 of 2 failed (2 iterations)\nVERIFICATION FAILED\n";

    #[test]
    fn an_answer_is_its_properties() {
        let properties = parse(OUTPUT, 10).expect("a whole answer");
        assert_eq!(properties[0], Property { text: "panic".to_owned(), holds: true });
        assert_eq!(properties[1], Property { text: "cover: here".to_owned(), holds: false });
    }

    #[test]
    fn an_irregular_end_is_an_error_whatever_the_output_says() {
        for code in [0, 1, 6, 134, 137] {
            parse(OUTPUT, code).expect_err("not the code of this answer");
        }
        let all_hold = OUTPUT.replace("FAILURE", "SUCCESS").replace("** 1", "** 0").replace("FAILED", "SUCCESSFUL");
        parse(&all_hold, 0).expect("a whole answer");
        parse(&all_hold, 10).expect_err("not the code of this answer");
    }

    #[test]
    fn a_cut_output_is_an_error() {
        for length in 0..OUTPUT.len() - 1 {
            parse(&OUTPUT[..length], 10).expect_err("cut");
        }
        parse(&OUTPUT.replace("[w2c", "w2c"), 10).expect_err("a property is missing");
    }

    #[test]
    fn a_property_without_a_verdict_is_an_error() {
        parse(&OUTPUT.replace("SUCCESS", "UNKNOWN"), 10).expect_err("unknown");
        parse(&OUTPUT.replace("SUCCESS", "ERROR"), 10).expect_err("an error");
    }

    #[test]
    fn a_tool_that_fails_or_hangs_is_an_error() {
        assert_eq!(wait(Command::new("sh").args(["-c", "exit 6"]), Duration::from_secs(10)), Ok(6));
        assert!(wait(Command::new("sh").args(["-c", "kill -9 $$"]), Duration::from_secs(10)).is_err());
        assert!(wait(Command::new("sleep").arg("60"), Duration::from_millis(50)).is_err());
    }

    #[test]
    fn a_tool_has_its_time_on_the_processor_and_not_by_the_clock() {
        let folder = std::env::temp_dir().join(format!("cvg-xtask-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let times = folder.join("times");
        let run = |limit: u64, script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", &limited(limit), "sh", "-c", script]).env("TIMES", &times);
            wait(&mut command, Duration::from_secs(3600))
                .map(|code| (code, processor_seconds(&std::fs::read_to_string(&times).expect("times were written"))))
        };
        let busy = "i=0; while [ $i -lt 100000000 ]; do i=$((i+1)); done";
        let (code, seconds) = run(1, busy).expect("it ends");
        assert!(code != 0 && code != 10 && seconds > 0.5, "{code}: {seconds} s");
        // waiting costs nothing
        let (code, seconds) = run(1, "sleep 1.5; exit 10").expect("it ends");
        assert!(code == 10 && seconds < 0.5, "{code}: {seconds} s");
        std::fs::remove_dir_all(&folder).expect("a folder");
        assert!((processor_seconds("0m0.01s 0m0.02s\n1m2.5s 0m0.25s\n") - 62.75).abs() < 1e-9);
    }

    #[test]
    fn fingerprints_are_those_of_the_harness() {
        assert_eq!(fingerprint(""), 0x811c_9dc5);
        assert_eq!(fingerprint("a"), 0xe40c_292c);
    }
}
