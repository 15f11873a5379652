//! What is written is whole or as it was: no input, device, pipe or link is written onto, whoever is killed and whoever
//! writes at the same time.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use support::{contents, cvg, cvg_ok};
use tempfile::TempDir;

/// A scenario of two short runs, told from others by its number.
fn scenario(number: u32) -> String {
    let run = |rate: i32| {
        format!("[[run]]\nkind = \"rotation\"\nfile = \"rot{rate:+}.csv\"\nrate_dps = {rate}.0\nduration_s = 2.0\n")
    };
    format!(
        "device = \"device {number}\"\ncarrier_hz = 15200.0\ntau_s = 22.0\nangular_gain = 0.78\namplitude_v = 1.0\n\
         noise_v = 2e-5\ncontrol_hz = 500.0\nsample_hz = 100.0\nseed = {number}\n\n{}\n{}",
        run(500),
        run(-500)
    )
}

/// Begins the command of that number on what lies in a folder, which writes there.
type Begin = fn(&Path, u32, &Path) -> Child;

/// Two runs of a command that write the same files, and what each of them writes.
struct Rivals {
    folder: TempDir,
    begin: Begin,
    whole: [BTreeMap<PathBuf, Vec<u8>>; 2],
}

impl Rivals {
    /// Two simulations.
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        for number in [1, 2] {
            fs::write(folder.path().join(format!("{number}.toml")), scenario(number)).unwrap();
        }
        Self::of(folder, simulation)
    }

    /// Two campaigns identified, of one device under two names.
    fn identified() -> Self {
        let bench = support::Bench::small();
        let campaign = bench.read("campaign.toml");
        let device = campaign.lines().find(|line| line.starts_with("device")).unwrap().to_owned();
        for number in [1, 2] {
            let named = campaign.replace(&device, &format!("device = \"device {number}\""));
            bench.write(&format!("{number}.toml"), named);
        }
        Self::of(bench.folder, identification)
    }

    fn of(folder: TempDir, begin: Begin) -> Self {
        let whole = [1, 2].map(|number| {
            let out = folder.path().join(format!("alone {number}"));
            assert!(begin(folder.path(), number, &out).wait().unwrap().success());
            below(&out)
        });
        assert_ne!(whole[0], whole[1], "the two can be told apart");
        Self { folder, begin, whole }
    }

    fn begin(&self, number: u32) -> Child {
        (self.begin)(self.folder.path(), number, &self.out())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("bench")
    }

    /// Whether the folder holds one set or the other, besides what is not of a set.
    fn is_whole(&self, others: &BTreeMap<PathBuf, Vec<u8>>) -> bool {
        let found = below(&self.out());
        self.whole.iter().any(|set| {
            let all: BTreeMap<_, _> = set.iter().chain(others).map(|(k, v)| (k.clone(), v.clone())).collect();
            all == found
        })
    }

    /// Names of what is unfinished beside the folder that is written, while a program moves it.
    fn unfinished(&self) -> BTreeSet<OsString> {
        let names = fs::read_dir(self.folder.path()).unwrap().flatten().map(|entry| entry.file_name());
        names.filter(|name| name.to_string_lossy().contains(".cvg-")).collect()
    }

    /// Names of what is unfinished, wherever it lies.
    fn leftovers(&self) -> Vec<PathBuf> {
        let is_unfinished = |path: &PathBuf| path.to_string_lossy().contains(".cvg-");
        contents(self.folder.path()).into_keys().filter(is_unfinished).collect()
    }
}

fn simulation(folder: &Path, number: u32, out: &Path) -> Child {
    begun("simulate", &folder.join(format!("{number}.toml")), out)
}

fn identification(folder: &Path, number: u32, out: &Path) -> Child {
    begun("identify", &folder.join(format!("{number}.toml")), out)
}

fn begun(command: &str, of: &Path, out: &Path) -> Child {
    let mut program = Command::new(env!("CARGO_BIN_EXE_cvg"));
    program.arg(command).arg(of).arg("--out").arg(out);
    program.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// What is below a folder, by its path from there.
fn below(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let relative = |path: PathBuf| path.strip_prefix(folder).unwrap().to_owned();
    contents(folder).into_iter().map(|(path, bytes)| (relative(path), bytes)).collect()
}

/// How often what happens by chance is tried: `CVG_KILLS`, or a few times.
fn tries(few: u32) -> u32 {
    std::env::var("CVG_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

/// A share of a run: with each step another, evenly from all of it.
fn moment(step: u32) -> f64 {
    f64::from(step.wrapping_mul(2_654_435_769) >> 16) / 65536.0
}

/// Kills a program at the moment for which `wait` waits, of the step and how long a whole run takes, and looks at what it leaves beside
/// what is of no set.
fn killed(rivals: &Rivals, kills: u32, wait: impl Fn(&mut Child, u32, Duration)) {
    assert!(rivals.begin(1).wait().unwrap().success());
    fs::create_dir(rivals.out().join("results")).unwrap();
    fs::write(rivals.out().join("results/report.json"), "mine").unwrap();
    fs::write(rivals.out().join("notes.txt"), "mine too").unwrap();
    let others = BTreeMap::from([
        (PathBuf::from("notes.txt"), b"mine too".to_vec()),
        (PathBuf::from("results"), b"a folder".to_vec()),
        (PathBuf::from("results/report.json"), b"mine".to_vec()),
    ]);
    let begun = std::time::Instant::now();
    assert!(rivals.begin(2).wait().unwrap().success());
    let whole = begun.elapsed();
    let (mut begun_and_left, mut ended) = (0, 0);
    for step in 0..kills {
        let mut child = rivals.begin(1 + step % 2);
        wait(&mut child, step, whole);
        child.kill().unwrap();
        ended += usize::from(child.wait().unwrap().success());
        assert!(rivals.is_whole(&others), "try {step}: a mixture");
        begun_and_left += usize::from(!rivals.leftovers().is_empty());
    }
    println!("{begun_and_left} of {kills} left something unfinished behind, {ended} had ended");
    assert!(rivals.begin(1).wait().unwrap().success());
    assert!(rivals.is_whole(&others));
    assert_eq!(rivals.leftovers(), [] as [PathBuf; 0]);
}

#[test]
fn a_simulation_that_is_killed_leaves_one_set_whole_and_the_next_removes_what_it_began() {
    // every moment of a run has its turn
    killed(&Rivals::new(), tries(40), |_, step, whole| std::thread::sleep(whole.mul_f64(1.1 * moment(step))));
}

/// How long an identification writes, at the most.
const WRITING: Duration = Duration::from_millis(8);

#[test]
fn an_identification_that_is_killed_leaves_one_set_whole_and_the_next_removes_what_it_began() {
    let rivals = Rivals::identified();
    killed(&rivals, tries(12), |child, step, _| {
        // it writes at its end, and is killed anywhere from when it begins to until it is done; what others left is gone by then
        let before = rivals.unfinished();
        while child.try_wait().unwrap().is_none() && rivals.unfinished().is_subset(&before) {
            std::thread::sleep(Duration::from_micros(50));
        }
        std::thread::sleep(WRITING.mul_f64(moment(step)));
    });
}

#[test]
fn of_two_that_write_at_once_one_is_there_whole() {
    let rivals = Rivals::new();
    let (pairs, mut last) = (tries(10), [0; 2]);
    let begun = std::time::Instant::now();
    assert!(rivals.begin(1).wait().unwrap().success());
    let whole = begun.elapsed();
    for step in 0..pairs {
        // one begins while the other is anywhere in its run
        let first = rivals.begin(1 + step % 2);
        std::thread::sleep(whole.mul_f64(moment(step)));
        let mut both = [first, rivals.begin(2 - step % 2)];
        for child in &mut both {
            assert!(child.wait().unwrap().success());
        }
        assert!(rivals.is_whole(&BTreeMap::new()), "pair {step}: a mixture");
        assert_eq!(rivals.leftovers(), [] as [PathBuf; 0]);
        last[usize::from(below(&rivals.out()) == rivals.whole[1])] += 1;
    }
    println!("of {pairs} pairs {} and {} were there in the end", last[0], last[1]);
}

#[test]
fn the_folder_in_which_the_user_stands_remains_the_one_it_is() {
    use std::os::unix::fs::MetadataExt as _;
    let rivals = Rivals::new();
    fs::create_dir(rivals.out()).unwrap();
    fs::write(rivals.out().join("notes.txt"), "mine").unwrap();
    let folder = fs::metadata(rivals.out()).unwrap().ino();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cvg"));
    command.args(["simulate", "../1.toml", "--out", "."]).current_dir(rivals.out());
    assert!(command.output().unwrap().status.success());
    assert_eq!(fs::metadata(rivals.out()).unwrap().ino(), folder);
    assert!(rivals.is_whole(&BTreeMap::from([(PathBuf::from("notes.txt"), b"mine".to_vec())])));
    assert_eq!(rivals.leftovers(), [] as [PathBuf; 0]);
}

/// Refused with these words, and nothing below the folder is another than before.
fn assert_leaves(folder: &Path, arguments: &[OsString], words: &[&str]) {
    let kinds = || -> Vec<_> {
        let mut all: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap()).collect();
        all.sort_by_key(fs::DirEntry::file_name);
        all.iter().map(|e| (e.file_name(), e.file_type().unwrap(), e.metadata().unwrap().len())).collect()
    };
    let before = kinds();
    let outcome = cvg(arguments);
    assert_eq!(outcome.status, 2, "{}", outcome.stderr);
    for word in words {
        assert!(outcome.stderr.contains(word), "{word:?} is not in {}", outcome.stderr);
    }
    assert_eq!(kinds(), before);
}

#[test]
fn nothing_is_written_onto_an_input() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| -> OsString { folder.path().join(name).into() };
    // a scenario under the name of what a simulation writes
    fs::write(path("campaign.toml"), scenario(1)).unwrap();
    let arguments = ["simulate".into(), path("campaign.toml"), "--out".into(), folder.path().into()];
    assert_leaves(folder.path(), &arguments, &["campaign.toml", "is read by this command"]);
    assert_eq!(fs::read_to_string(path("campaign.toml")).unwrap(), scenario(1));
    // a recording, also under its other name
    fs::write(path("rot.csv"), "t_s,theta_deg,rate_dps\n0,0,0\n").unwrap();
    fs::write(path("calibration.toml"), "").unwrap();
    fs::hard_link(path("rot.csv"), path("same.csv")).unwrap();
    for out in ["rot.csv", "same.csv", "calibration.toml"] {
        let arguments = ["compensate".into(), path("calibration.toml"), path("rot.csv"), "--out".into(), path(out)];
        assert_leaves(folder.path(), &arguments, &[out, "is read by this command"]);
    }
}

#[test]
fn nothing_is_written_through_a_link_or_onto_a_pipe_or_a_device() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| -> OsString { folder.path().join(name).into() };
    fs::write(path("1.toml"), scenario(1)).unwrap();
    fs::write(path("precious"), "precious").unwrap();
    fs::create_dir(path("bench")).unwrap();
    symlink(path("precious"), folder.path().join("bench/campaign.toml")).unwrap();
    let arguments = ["simulate".into(), path("1.toml"), "--out".into(), path("bench")];
    assert_leaves(&folder.path().join("bench"), &arguments, &["campaign.toml", "is a link"]);
    symlink(path("bench"), folder.path().join("linked")).unwrap();
    assert_leaves(folder.path(), &["simulate".into(), path("1.toml"), "--out".into(), path("linked")], &["is a link"]);
    assert!(Command::new("mkfifo").arg(path("pipe")).status().unwrap().success());
    symlink(path("precious"), path("link.csv")).unwrap();
    for (out, what) in [
        (path("pipe"), "is a device or a pipe"),
        ("/dev/full".into(), "is a device or a pipe"),
        (path("link.csv"), "is a link"),
    ] {
        let arguments = ["compensate".into(), path("c.toml"), path("r.csv"), "--out".into(), out];
        assert_leaves(folder.path(), &arguments, &[what]);
    }
    assert_eq!(fs::read_to_string(path("precious")).unwrap(), "precious");
}

#[test]
fn a_name_out_of_a_file_does_not_steer_the_terminal() {
    let folder = TempDir::new().unwrap();
    let name = folder.path().join("a\u{1b}[2J\u{9b}31m\u{202e}vsc.csv");
    let outcome = cvg(&[std::ffi::OsStr::new("inspect"), name.as_os_str()]);
    assert_eq!(outcome.status, 2);
    assert!(outcome.stderr.contains("a\\u001b[2J\\u009b31m\\u202evsc.csv"), "{}", outcome.stderr);
    fs::write(&name, "t_s,theta_deg,rate_dps\n0,0,1\n1,1,1\n").unwrap();
    let said = cvg_ok(&[std::ffi::OsStr::new("inspect"), name.as_os_str()]);
    assert!(!said.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{said:?}");
    // what a program reads is still JSON, with the name in it as it is
    let said = cvg_ok(&["inspect".as_ref(), name.as_os_str(), "--json".as_ref()]);
    assert!(!said.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{said:?}");
    let read: serde_json::Value = serde_json::from_str(&said).unwrap();
    let is_there = read.to_string().contains("\u{9b}31m\u{202e}vsc.csv");
    assert!(is_there, "{read}");
}

#[test]
fn a_name_out_of_a_file_is_no_part_of_the_page() {
    let bench = support::Bench::small();
    let evil = "<!--<script>'\"&\u{202e}</title>";
    bench.change("campaign.toml", |text| {
        let device = text.lines().find(|line| line.starts_with("device")).unwrap().to_owned();
        text.replace(&device, &format!("device = '''{evil}'''"))
    });
    let run = fs::read_dir(bench.path("")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let run = run.filter(|name| name.ends_with(".csv")).min().unwrap();
    let renamed = "<!--<script>'&.csv";
    fs::rename(bench.path(&run), bench.path(renamed)).unwrap();
    bench.change("campaign.toml", |text| text.replace(&run, renamed));
    let (campaign, out) = (bench.campaign(), bench.path("out"));
    cvg_ok(&[OsString::from("identify"), campaign.into(), "--out".into(), out.clone().into()]);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!page.contains("<!--<script>") && !page.contains('\u{202e}'));
    let data = page.split("id=\"figures\">").nth(1).unwrap().split("</script>").next().unwrap();
    assert!(!data.contains('<') && data.contains("\\u003c!--\\u003cscript>"), "the names are there, as data");
}

#[test]
fn a_hundred_thousand_threads_are_as_many_as_the_machine_has_processors() {
    let rivals = Rivals::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cvg"));
    command.env("RAYON_NUM_THREADS", "100000").arg("inspect").arg(rivals.folder.path().join("alone 1/campaign.toml"));
    let begun = std::time::Instant::now();
    assert!(command.output().unwrap().status.success());
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
}

#[test]
fn a_recording_that_takes_more_than_is_allowed_is_refused_in_one_line() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("long.csv");
    let rows: String = (0..20_000).map(|n| format!("{n},0,1\n")).collect();
    fs::write(&path, format!("t_s,theta_deg,rate_dps\n{rows}")).unwrap();
    let file = path.clone().into_os_string();
    let refused = cvg(&["inspect".into(), file.clone(), "--max-memory".into(), OsString::from("100K")]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("would take up to") && refused.stderr.lines().count() == 1, "{}", refused.stderr);
    cvg_ok(&["inspect".into(), file, "--max-memory".into(), OsString::from("100M")]);
}

/// Swaps the sense of the angle in every recording of a campaign, which no gyroscope has.
fn turn_over(bench: &support::Bench) {
    for name in bench.recordings("rot").into_iter().chain(["check.csv".to_owned()]) {
        bench.change(&name, |text| {
            let mut sheet = support::Sheet::of(&text);
            sheet.set("yc_v", |_, volts| -volts);
            sheet.text()
        });
    }
}

#[test]
fn a_refusal_takes_the_place_of_an_older_answer_wherever_the_user_stands() {
    for is_inside in [false, true] {
        let bench = support::Bench::small();
        let out = bench.path("out");
        let identify = || {
            let mut command = Command::new(env!("CARGO_BIN_EXE_cvg"));
            command.arg("identify").arg(bench.campaign()).arg("--out");
            if is_inside {
                command.arg(".").current_dir(&out)
            } else {
                command.arg(&out)
            };
            command.output().unwrap().status.code()
        };
        fs::create_dir(&out).unwrap();
        fs::write(out.join("notes.txt"), "mine").unwrap();
        assert_eq!(identify(), Some(0));
        let names = || below(&out).into_keys().map(|name| name.display().to_string()).collect::<Vec<_>>();
        assert_eq!(names(), ["calibration.toml", "notes.txt", "report.html", "report.json"]);
        turn_over(&bench);
        assert_eq!(identify(), Some(1));
        assert_eq!(names(), ["notes.txt", "report.json"], "inside: {is_inside}");
        assert!(fs::read_to_string(out.join("report.json")).unwrap().contains("\"status\": \"refused\""));
    }
}

#[test]
fn what_lies_there_as_a_set_half_moved_in_is_not_moved_through_a_link_or_out_of_the_folder() {
    let rivals = Rivals::new();
    let precious = rivals.folder.path().join("precious");
    fs::create_dir(&precious).unwrap();
    fs::write(precious.join("file"), "precious").unwrap();
    for planted in ["linked/file", ".cvg-gone.linked/file", ".cvg-gone.../precious/file"] {
        let planted = rivals.out().join(".cvg-complete").join(planted);
        fs::create_dir_all(planted.parent().unwrap()).unwrap();
        fs::write(planted, "another's").unwrap();
        let _ = symlink(&precious, rivals.out().join("linked"));
        let _ = rivals.begin(1).wait().unwrap();
        assert_eq!(fs::read_to_string(precious.join("file")).unwrap(), "precious");
        fs::remove_dir_all(rivals.out()).unwrap();
    }
}
