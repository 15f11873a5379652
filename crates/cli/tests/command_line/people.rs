//! The command line as people expect it: foreign files, patterns, standard input, several recordings, inspection, the
//! library, completion, manual pages.

use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::process::{Command, Stdio};

use cvg_calibration::report::named::{self, BESIDE_THE_LIBRARY};
use cvg_model::effects::EffectId;
use cvg_simulator::Scenario;
use cvg_simulator::scenario::EffectSetting;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, cvg, cvg_ok, foreign};

const MAPPING: [&str; 16] = [
    "--map",
    "t_s=Time (ms)*0.001",
    "--map",
    "rate_dps=Table",
    "--map",
    "xc_v=D1 X",
    "--map",
    "xs_v=D1 Y",
    "--map",
    "yc_v=D2 X",
    "--map",
    "ys_v=D2 Y",
    "--map",
    "vas_v=PID1",
    "--map",
    "vqc_v=PID2",
];

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn ratio(report: &Value) -> f64 {
    report["detection_gain_ratio"]["value"].as_f64().unwrap()
}

#[test]
fn a_foreign_export_gives_the_same_answer_as_the_file_in_our_names() {
    let bench = Bench::small();
    let name = &bench.recordings("rot")[0];
    bench.write("export.csv", foreign(&bench, name));
    let (own, export) = (bench.path(name), bench.path("export.csv"));
    let wanted = json(&cvg_ok(&[OsStr::new("identify"), own.as_os_str(), OsStr::new("--json")]));
    let mut arguments = vec![OsStr::new("identify"), export.as_os_str(), OsStr::new("--json")];
    arguments.extend(MAPPING.map(OsStr::new));
    let found = json(&cvg_ok(&arguments));
    assert!((ratio(&found) - ratio(&wanted)).abs() < 1e-9, "{} {}", ratio(&found), ratio(&wanted));
    // without the mapping it says what is there and how to name it
    let refused = cvg(&[OsStr::new("identify"), export.as_os_str()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("`D1 X`") && refused.stderr.contains("--map"), "{}", refused.stderr);
}

#[test]
fn standard_input_is_a_recording() {
    let bench = Bench::small();
    let name = &bench.recordings("rot")[0];
    let mut child = Command::new(env!("CARGO_BIN_EXE_cvg"))
        .args(["identify", "-", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(bench.read(name).as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let (piped, path) = (json(std::str::from_utf8(&output.stdout).unwrap()), bench.path(name));
    assert_eq!(ratio(&piped), ratio(&json(&cvg_ok(&[OsStr::new("identify"), path.as_os_str(), OsStr::new("--json")]))));
}

#[test]
fn a_pattern_stands_for_its_recordings_and_one_can_be_held_out() {
    let bench = Bench::small();
    let pattern = bench.path("rot*.csv");
    let all =
        json(&cvg_ok(&[OsStr::new("identify"), pattern.as_os_str(), OsStr::new("--settle=1"), OsStr::new("--json")]));
    let names = bench.recordings("rot");
    assert_eq!(all["runs"].as_array().unwrap().len(), names.len());
    let check = bench.path("check.csv");
    let held = json(&cvg_ok(&[
        OsStr::new("identify"),
        pattern.as_os_str(),
        OsStr::new("--holdout"),
        check.as_os_str(),
        OsStr::new("--json"),
    ]));
    let uses: Vec<&str> = held["runs"].as_array().unwrap().iter().map(|r| r["use"].as_str().unwrap()).collect();
    assert_eq!(uses.iter().filter(|u| **u == "holdout").count(), 1, "{uses:?}");
    for (arguments, part) in [
        (vec![bench.path("none*.csv")], "no file has a name like this"),
        (vec![check.clone(), check.clone()], "named twice"),
        (vec![bench.campaign(), check], "stands alone"),
    ] {
        let mut all = vec![OsStr::new("identify")];
        all.extend(arguments.iter().map(|a| a.as_os_str()));
        let refused = cvg(&all);
        assert_eq!(refused.status, 2);
        assert!(refused.stderr.contains(part), "{}", refused.stderr);
    }
}

#[test]
fn a_mapping_that_cannot_be_meant_is_refused() {
    let refused = cvg(&["identify", "rot.csv", "--map", "angle=Ch3"]);
    assert_eq!((refused.status, refused.stdout.as_str()), (2, ""));
    assert!(
        refused.stderr.contains("`angle` is no channel") && refused.stderr.contains("`theta_deg`"),
        "{}",
        refused.stderr
    );
}

#[test]
fn inspect_says_what_is_in_a_file_and_what_is_wrong_with_it() {
    let bench = Bench::small();
    let name = &bench.recordings("rot")[0];
    bench.write("dirty.csv", bench.read(name) + "1e9,NaN,,,,,,\n");
    let (file, plot) = (bench.path("dirty.csv"), bench.path("dirty.svg"));
    let said = cvg_ok(&[OsStr::new("inspect"), file.as_os_str(), OsStr::new("--plot"), plot.as_os_str()]);
    for part in ["rows over", "xc_v", "serves as a rotation", "1 rows dropped", "warning: "] {
        assert!(said.contains(part), "{part:?} is not in {said}");
    }
    // a panel for each column, over one axis
    let svg = fs::read_to_string(plot).unwrap();
    let columns = ["rate_dps", "xc_v", "xs_v", "yc_v", "ys_v", "vas_v", "vqc_v"];
    for column in columns {
        assert_eq!(svg.matches(&format!("\n{column}\n")).count(), 1, "{column}: {svg}");
    }
    assert_eq!((svg.matches("<polyline").count() >= columns.len(), svg.matches("time [s]").count()), (true, 1));
    let facts = json(&cvg_ok(&[OsStr::new("inspect"), file.as_os_str(), OsStr::new("--json")]));
    assert_eq!((facts[0]["rotation"].as_bool(), facts[0]["rows_dropped"].as_u64()), (Some(true), Some(1)));
    let campaign = bench.campaign();
    assert!(cvg_ok(&[OsStr::new("inspect"), campaign.as_os_str()]).contains("runs"));
    let still = bench.path("ringdown-0.csv");
    let said = cvg_ok(&[OsStr::new("inspect"), still.as_os_str()]);
    assert!(said.contains("the table does not turn") && said.contains("serves as a ring-down"), "{said}");
}

#[test]
fn the_library_is_listed_as_its_descriptions_tell_it() {
    let list = cvg_ok(&["effects"]);
    let library = json(&cvg_ok(&["effects", "--json"]));
    let (of_the_library, of_reports) = list.split_once("\nIn reports alone, of no file of the library:\n").unwrap();
    assert_eq!(
        (of_the_library.lines().count(), of_reports.lines().count()),
        (EffectId::ALL.len(), BESIDE_THE_LIBRARY.len())
    );
    for (effect, facts) in EffectId::ALL.iter().zip(library.as_array().unwrap()) {
        let d = effect.description();
        assert!(list.contains(d.id) && list.contains(d.title));
        assert_eq!((facts["id"].as_str(), facts["signature"].as_str()), (Some(d.id), Some(d.signature)));
        let full = cvg_ok(&["effects", d.id]);
        assert!(d.parameters.iter().all(|p| full.contains(p.name)), "{full}");
        // a pair is a magnitude and an angle in reports
        assert!(named::of_effect(d).iter().all(|(name, unit)| full.contains(&format!("{name} [{unit}]"))), "{full}");
    }
    for e in BESIDE_THE_LIBRARY {
        assert!(of_reports.contains(e.id) && of_reports.contains(e.title), "{of_reports}");
        let full = cvg_ok(&["effects", e.id]);
        assert!(full.contains(e.stage) && full.contains(&e.parameters[0].0.replace('#', "N")), "{full}");
        let facts = json(&cvg_ok(&["effects", e.id, "--json"]));
        assert_eq!(facts[0]["reported"].as_array().map(Vec::len), Some(e.parameters.len()), "{facts}");
    }
    let refused = cvg(&["effects", "gremlins"]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("gremlins") && refused.stderr.contains("detection-cubic"), "{}", refused.stderr);
}

#[test]
fn an_effect_of_the_library_is_written_as_text_and_competes_under_another_name() {
    let text = cvg_ok(&["effects", "--export", "detection-skew"]);
    assert!(text.contains("\"y_c'\" = \"y_c + skew * x_c\""), "{text}");
    assert_eq!(cvg(&["effects", "--export", "gremlins"]).status, 2);
    let bench = Bench::small();
    bench.write("my-effect.toml", &text);
    let (campaign, effect) = (bench.campaign(), bench.path("my-effect.toml"));
    let identify: Vec<&OsStr> =
        ["identify".as_ref(), campaign.as_os_str(), "--effect".as_ref(), effect.as_os_str()].to_vec();
    let refused = cvg(&identify);
    assert_eq!(refused.status, 2);
    assert!(
        refused.stderr.contains("my-effect.toml: `detection-skew` is an effect of the library"),
        "{}",
        refused.stderr
    );
    bench.replace("my-effect.toml", "\"detection-skew\"", "\"my-skew\"");
    assert_eq!(cvg(&identify).status, 0);
    let twice = cvg(&[&identify[..], &identify[2..]].concat());
    assert!(twice.status == 2 && twice.stderr.contains("two effects `my-skew`"), "{}", twice.stderr);
}

#[test]
fn what_has_no_name_is_proposed_as_text_and_found_by_it_when_it_is_fed_back() {
    let mut settings = Scenario::paper().settings().clone();
    settings.effects.retain(|e| e.id != EffectId::DetectionCubic);
    settings.effects.push(EffectSetting::new(EffectId::HarmonicN, [6.0, 5e-4, 0.0, 0.0]).unwrap());
    let bench = Bench::simulated(settings);
    let (campaign, results) = (bench.campaign(), bench.path("results"));
    let identify = |more: &[&OsStr]| {
        cvg(&[&["identify".as_ref(), campaign.as_os_str(), "--out".as_ref(), results.as_os_str()], more].concat())
    };
    assert_eq!(identify(&[]).status, 0);
    let report = json(&bench.read("results/report.json"));
    assert_eq!(
        (report["proposals"][0]["id"].as_str(), report["proposals"][0]["law"]["n"].as_f64()),
        (Some("proposal-1"), Some(6.0))
    );
    assert!(bench.read("results/report.html").contains("harmonic 6 of the pattern angle, without a known cause"));
    let proposal = bench.path("results/proposal-1.toml");
    // what is read is not written over, nor taken away
    let refused = identify(&["--effect".as_ref(), proposal.as_os_str()]);
    assert!(refused.status == 2 && refused.stderr.contains("is read by this command"), "{}", refused.stderr);
    let mine = bench.path("mine.toml");
    fs::rename(&proposal, &mine).unwrap();
    bench.write("results/proposal-2.toml", "of another day");
    assert_eq!(identify(&["--effect".as_ref(), mine.as_os_str()]).status, 0);
    let report = json(&bench.read("results/report.json"));
    let ids: Vec<&str> = report["effects"].as_array().unwrap().iter().filter_map(|e| e["id"].as_str()).collect();
    assert!(ids.contains(&"proposal-1") && report["proposals"].as_array().unwrap().is_empty(), "{ids:?}");
    assert!(!proposal.exists() && !bench.path("results/proposal-2.toml").exists());
}

#[test]
fn shells_complete_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = cvg_ok(&["completions", shell]);
        for command in ["identify", "inspect", "compensate", "effects", "paper"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
}

#[test]
fn every_command_has_a_manual_page_and_help_with_examples() {
    let folder = TempDir::new().unwrap();
    cvg_ok(&[OsStr::new("man"), OsStr::new("--out"), folder.path().as_os_str()]);
    for command in ["identify", "inspect", "compensate", "completions"] {
        let page = fs::read_to_string(folder.path().join(format!("cvg-{command}.1"))).unwrap();
        assert!(page.contains(".TH") && page.contains("Examples"), "{command}");
        assert!(cvg_ok(&[command, "--help"]).contains("Examples:\n  cvg"), "{command}");
    }
    assert!(fs::read_to_string(folder.path().join("cvg.1")).unwrap().contains("identify"));
}

#[test]
fn no_colour_and_no_progress_reach_what_is_not_a_terminal() {
    let bench = Bench::small();
    let campaign = bench.campaign();
    for arguments in
        [vec![OsStr::new("identify"), campaign.as_os_str()], vec![OsStr::new("identify"), OsStr::new("no.csv")]]
    {
        let outcome = cvg(&arguments);
        let said = outcome.stdout + &outcome.stderr;
        assert!(!said.contains('\u{1b}') && !said.contains('\r'), "{said:?}");
    }
}

/// What `cvg identify -` shows on a terminal of its own when its input comes after `delay` seconds.
#[cfg(target_os = "linux")]
fn on_a_terminal(bench: &Bench, delay: &str, environment: &str) -> String {
    let recording = bench.path(&bench.recordings("rot")[0]);
    let line = format!(
        "(sleep {delay}; cat '{}') | {environment} '{}' identify - > /dev/null",
        recording.display(),
        env!("CARGO_BIN_EXE_cvg")
    );
    let output = Command::new("script").args(["-qec", &line, "/dev/null"]).stdin(Stdio::null()).output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn progress_is_shown_on_a_terminal_to_who_has_to_wait() {
    let bench = Bench::small();
    let waited = on_a_terminal(&bench, "1.5", "");
    assert!(waited.contains("reading"), "{waited:?}");
    let quick = on_a_terminal(&bench, "0", "");
    assert!(!quick.contains("reading"), "{quick:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn errors_are_coloured_on_a_terminal_unless_no_colour_is_wanted() {
    let said = |environment: &str| {
        let line = format!("{environment} '{}' identify no-such-file.csv; true", env!("CARGO_BIN_EXE_cvg"));
        let output = Command::new("script")
            .args(["-qec", &line, "/dev/null"])
            .env_remove("NO_COLOR")
            .stdin(Stdio::null())
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(said("").contains("\u{1b}[1;31merror:"), "{:?}", said(""));
    let plain = said("NO_COLOR=1");
    assert!(plain.contains("error:") && !plain.contains('\u{1b}'), "{plain:?}");
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_cvg"))
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.as_str()), (Some(0), ""));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_output_is_said() {
    for arguments in [["effects", "--json"], ["completions", "zsh"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_cvg")).args(arguments).stdout(full).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: standard output: cannot be written"), "{said}");
    }
}
