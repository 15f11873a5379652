//! Bad input and bad use: one or two lines that say what is wrong, where, and what would be right; exit status 2; and
//! whatever lies in the output folder stays as it is.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::Path;

use cvg_calibration::calibration::{Calibration, SCHEMA};

use crate::support::{Bench, Sheet, contents, cvg, cvg_ok};

/// Longest line of an error message that is still read.
const LONGEST_LINE: usize = 600;

/// Runs `cvg` with bad arguments: status 2, an error of one or two lines with all `parts` in it, and nothing on
/// standard output.
fn assert_refused<A: AsRef<OsStr> + std::fmt::Debug>(arguments: &[A], parts: &[&str]) {
    let outcome = cvg(arguments);
    let said = &outcome.stderr;
    assert_eq!(outcome.status, 2, "cvg {arguments:?}: {said}");
    assert_eq!(outcome.stdout, "", "cvg {arguments:?}");
    assert!(said.starts_with("error: "), "{said}");
    assert!((1..=2).contains(&said.lines().count()), "one or two lines: {said}");
    assert!(said.lines().all(|line| !line.trim().is_empty() && line.len() < LONGEST_LINE), "{said}");
    for part in parts {
        assert!(said.contains(part), "{part:?} is not in {said:?}");
    }
    assert!(!said.ends_with("wanted: \n") && !said.contains("error: : "), "an empty part: {said}");
}

/// Files of an earlier run in the output folder: a bad run must leave them, and add nothing.
fn earlier_results(bench: &Bench) -> std::path::PathBuf {
    let out = bench.path("out");
    fs::create_dir_all(&out).unwrap();
    for name in ["report.json", "report.html", "calibration.toml"] {
        fs::write(out.join(name), format!("{name} of an earlier run")).unwrap();
    }
    out
}

/// Identifies a bad campaign into a folder with results in it.
fn assert_identify_refuses(bench: &Bench, campaign: &Path, parts: &[&str]) {
    let out = earlier_results(bench);
    let before = contents(&out);
    assert_refused(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()], parts);
    assert_eq!(contents(&out), before, "the output folder was touched");
    assert_refused(
        &[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--json"), OsStr::new("--out"), out.as_os_str()],
        parts,
    );
    assert_eq!(contents(&out), before, "the output folder was touched");
}

fn assert_campaign_refused(bench: &Bench, parts: &[&str]) {
    assert_identify_refuses(bench, &bench.campaign(), parts);
}

fn change_sheet(bench: &Bench, name: &str, change: impl FnOnce(&mut Sheet)) {
    let mut sheet = Sheet::of(&bench.read(name));
    change(&mut sheet);
    bench.write(name, sheet.text());
}

// Recordings

#[test]
fn a_missing_column_is_named_with_what_is_there() {
    let bench = Bench::small();
    let kept = Sheet::of(&bench.read("rot+500.csv")).only(&["t_s", "xc_v", "yc_v", "vas_v"]);
    bench.write("rot+500.csv", kept.text());
    let parts = ["rot+500.csv", "a rotation needs", "`rate_dps`", "`table_deg`", "there are", "`vas_v`"];
    assert_campaign_refused(&bench, &parts);
    assert_identify_refuses(&bench, &bench.path("rot+500.csv"), &parts);
}

#[test]
fn a_missing_column_of_a_ring_down_is_named() {
    let bench = Bench::small();
    let kept = Sheet::of(&bench.read("ringdown-90.csv")).only(&["t_s", "rate_dps", "xc_v", "yc_v"]);
    bench.write("ringdown-90.csv", kept.text());
    assert_campaign_refused(&bench, &["ringdown-90.csv", "a ring-down needs", "`vas_v`"]);
}

#[test]
fn text_in_a_number_is_shown_with_line_and_column() {
    let bench = Bench::small();
    change_sheet(&bench, "rot-300.csv", |sheet| {
        let at = sheet.index("yc_v");
        sheet.rows[40][at] = "about 0.3".into();
    });
    // the header is line 1
    assert_campaign_refused(&bench, &["rot-300.csv", "line 42", "column 5", "`yc_v`", "about 0.3"]);
}

#[test]
fn a_time_that_goes_back_is_shown_with_its_line() {
    let bench = Bench::small();
    change_sheet(&bench, "rot+500.csv", |sheet| sheet.rows[100][0] = "0.5".into());
    assert_campaign_refused(&bench, &["rot+500.csv", "line 102", "goes back", "0.99", "0.5", "increasing"]);
}

#[test]
fn a_time_that_stands_still_is_refused() {
    let bench = Bench::small();
    change_sheet(&bench, "rot+500.csv", |sheet| sheet.set("t_s", |_, _| 1.0));
    assert_campaign_refused(&bench, &["rot+500.csv"]);
}

#[test]
fn a_rotation_run_at_rate_zero_is_refused() {
    let bench = Bench::small();
    change_sheet(&bench, "rot+500.csv", |sheet| sheet.set("rate_dps", |_, _| 0.0));
    assert_campaign_refused(&bench, &["rot+500.csv", "rate_dps", "does not turn", "other than zero"]);
}

#[test]
fn less_than_half_a_turn_of_the_pattern_is_left_out_and_alone_refused() {
    let bench = Bench::small();
    // 0.39 s at 500 deg/s · 0.78 turn the pattern by 150°
    let first_rows = |name: &str| change_sheet(&bench, name, |sheet| sheet.rows.truncate(39));
    first_rows("rot+500.csv");
    bench.replace("campaign.toml", "settle_s = 0.5", "settle_s = 0.0");
    let said = cvg_ok(&["identify", bench.path("campaign.toml").to_str().unwrap()]);
    assert!(said.contains("rot+500.csv") && said.contains("the pattern turns through"), "{said}");
    let outcome = cvg(&[OsStr::new("identify"), bench.path("rot+500.csv").as_os_str()]);
    assert_eq!(outcome.status, 1, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("rot+500.csv") && outcome.stderr.contains("half a turn"), "{}", outcome.stderr);
}

#[test]
fn a_ring_down_that_grows_is_refused() {
    let bench = Bench::small();
    change_sheet(&bench, "ringdown-0.csv", |sheet| {
        let t = sheet.numbers("t_s");
        // e^{−t/τ} becomes e^{+t/τ}
        for column in ["xc_v", "xs_v", "yc_v", "ys_v"] {
            sheet.set(column, |i, v| v * (2.0 * (t[i] - 3.0).max(0.0) / 10.0).exp());
        }
    });
    assert_campaign_refused(&bench, &["ringdown-0.csv", "does not decay", "energy loop off"]);
}

#[test]
fn ring_downs_of_0_and_90_degrees_swapped_are_refused() {
    let bench = Bench::small();
    let (at_0, at_90) = (bench.read("ringdown-0.csv"), bench.read("ringdown-90.csv"));
    bench.write("ringdown-0.csv", at_90);
    bench.write("ringdown-90.csv", at_0);
    assert_campaign_refused(&bench, &["ringdown-0.csv", "lies at", "angle_deg = 0", "swapped"]);
}

#[test]
fn a_rotation_named_as_a_ring_down_is_refused() {
    let bench = Bench::small();
    bench.write("ringdown-90.csv", bench.read("rot+500.csv"));
    assert_campaign_refused(&bench, &["ringdown-90.csv", "a rotation run"]);
}

#[test]
fn a_ring_down_named_as_a_rotation_is_refused() {
    let bench = Bench::small();
    bench.write("rot+500.csv", bench.read("ringdown-90.csv"));
    assert_campaign_refused(&bench, &["rot+500.csv", "does not turn"]);
}

#[test]
fn a_run_in_millivolts_among_runs_in_volts_is_named() {
    let bench = Bench::small();
    change_sheet(&bench, "rot-300.csv", |sheet| {
        for column in ["xc_v", "xs_v", "yc_v", "ys_v"] {
            sheet.set(column, |_, v| 1e3 * v);
        }
    });
    let outcome = cvg(&["identify".as_ref(), bench.campaign().as_os_str()]);
    assert_eq!(outcome.status, 1, "{}", outcome.stdout);
    assert!(outcome.stderr.contains("rot-300.csv: its readout's amplitude is 1.0"), "{}", outcome.stderr);
}

#[test]
fn an_empty_file_is_refused() {
    let bench = Bench::small();
    bench.write("rot-300.csv", "");
    assert_campaign_refused(&bench, &["rot-300.csv", "is empty"]);
    assert_identify_refuses(&bench, &bench.path("rot-300.csv"), &["rot-300.csv", "is empty"]);
    bench.write("campaign.toml", "");
    assert_campaign_refused(&bench, &["campaign.toml", "line 1"]);
}

#[test]
fn a_header_without_rows_is_refused() {
    let bench = Bench::small();
    change_sheet(&bench, "rot+500.csv", |sheet| sheet.rows.clear());
    assert_campaign_refused(&bench, &["rot+500.csv", "no rows"]);
}

#[test]
fn a_directory_in_the_place_of_a_file_is_refused() {
    let bench = Bench::small();
    // a folder is the campaign in it, where there is one
    fs::create_dir(bench.path("empty")).unwrap();
    assert_identify_refuses(&bench, &bench.path("empty"), &["is a directory", "campaign.toml"]);
    fs::remove_file(bench.path("rot+500.csv")).unwrap();
    fs::create_dir(bench.path("rot+500.csv")).unwrap();
    assert_campaign_refused(&bench, &["campaign.toml", "line", "rot+500.csv", "is a directory"]);
}

// Campaigns

#[test]
fn a_campaign_that_names_a_missing_file_says_where() {
    let bench = Bench::small();
    bench.replace("campaign.toml", "ringdown-90.csv", "ringdown-99.csv");
    let line = 1 + bench.read("campaign.toml").lines().position(|line| line.contains("ringdown-99.csv")).unwrap();
    assert_campaign_refused(
        &bench,
        &["campaign.toml", &format!("line {line}, column"), "ringdown-99.csv", "is not there"],
    );
}

#[test]
fn a_file_that_is_not_there_is_refused() {
    let bench = Bench::small();
    assert_identify_refuses(&bench, &bench.path("other.toml"), &["other.toml", "no such file"]);
    assert_identify_refuses(&bench, &bench.path("other.csv"), &["other.csv", "no such file"]);
}

#[test]
fn a_key_that_a_campaign_does_not_have_is_shown_with_line_and_column() {
    let bench = Bench::small();
    bench.replace("campaign.toml", "device = ", "amplitude_m = 1.0\ndevice = ");
    assert_campaign_refused(&bench, &["campaign.toml", "line 2, column 1", "`amplitude_m`", "`device`"]);
}

#[test]
fn a_scenario_that_cannot_be_read_is_shown_with_line_and_column() {
    let bench = Bench::small();
    let scenario = bench.path("scenario.toml");
    let out = earlier_results(&bench);
    let before = contents(&out);
    for (text, parts) in [
        ("device = \"a\"\nangular_gain = \"much\"\n", ["scenario.toml", "line 2, column 16"]),
        ("device = \"a\"\nangular_gain = \n", ["scenario.toml", "line 2"]),
        ("device = \"a\"\nangular_gain = 0.0\nrun = []\n", ["scenario.toml", "angular_gain"]),
    ] {
        fs::write(&scenario, text).unwrap();
        assert_refused(&[OsStr::new("simulate"), scenario.as_os_str(), OsStr::new("--out"), out.as_os_str()], &parts);
    }
    assert_eq!(contents(&out), before, "the output folder was touched");
}

// Calibrations

/// A calibration as it is written, and the folder of its campaign.
fn calibrated() -> (Bench, String) {
    let bench = Bench::small();
    let out = bench.path("identified");
    cvg_ok(&[OsStr::new("identify"), bench.campaign().as_os_str(), OsStr::new("--out"), out.as_os_str()]);
    let text = fs::read_to_string(out.join("calibration.toml")).unwrap();
    (bench, text)
}

/// Compensates with a bad calibration: refused, and the file that is there stays.
fn assert_compensate_refuses(bench: &Bench, calibration: &str, parts: &[&str]) {
    let (path, out) = (bench.path("bad.toml"), bench.path("compensated.csv"));
    fs::write(&path, calibration).unwrap();
    fs::write(&out, "an earlier result").unwrap();
    let before = contents(bench.campaign().parent().unwrap());
    let arguments: [OsString; 5] =
        ["compensate".into(), path.into(), bench.path("check.csv").into(), "--out".into(), out.into()];
    assert_refused(&arguments, parts);
    assert_eq!(contents(bench.campaign().parent().unwrap()), before, "a file was touched");
}

/// The calibration with a checksum that is right for its text.
fn closed_anew(calibration: &str) -> String {
    let at = calibration.rfind("\n# checksum").unwrap();
    let body = &calibration[..at];
    format!("{body}\n# checksum = \"crc32:{:08x}\"\n", crc32fast::hash(body.as_bytes()))
}

#[test]
fn a_calibration_of_another_version_is_refused() {
    let (bench, text) = calibrated();
    assert_eq!(closed_anew(&text), text, "this test computes the checksum as the program does");
    let other = closed_anew(&text.replace(SCHEMA, "cvg.calibration/2"));
    assert_compensate_refuses(&bench, &other, &["bad.toml", "\"cvg.calibration/2\"", "cvg.calibration/1"]);
}

#[test]
fn a_calibration_that_says_what_it_cannot_mean_is_refused() {
    let (bench, text) = calibrated();
    for (from, to, parts) in [
        ("\"detection-gain-mismatch\"", "\"detection-gain-error\"", ["bad.toml", "detection-gain-error"]),
        ("detection_gain_ratio = 1.", "detection_gain_ratio = 7.", ["bad.toml", "detection_gain_ratio"]),
        ("angular_gain", "angular_again", ["bad.toml", "angular_again"]),
    ] {
        assert!(text.contains(from), "{from} is not in the calibration");
        assert_compensate_refuses(&bench, &closed_anew(&text.replace(from, to)), &parts);
    }
}

#[test]
fn a_changed_calibration_is_refused() {
    let (bench, text) = calibrated();
    let at = text.find("angular_gain = 0.").unwrap() + "angular_gain = 0.".len();
    let mut changed = text.clone();
    changed.replace_range(at..=at, if &text[at..=at] == "7" { "8" } else { "7" });
    assert_compensate_refuses(&bench, &changed, &["bad.toml", "was changed", "unedited"]);
    assert_compensate_refuses(&bench, "", &["bad.toml", "checksum is missing"]);
}

#[test]
fn a_calibration_with_any_one_byte_changed_is_refused() {
    let (_, text) = calibrated();
    assert!(Calibration::from_text(&text, "whole").is_ok());
    let mut accepted = Vec::new();
    for at in 0..text.len() {
        for byte in 0..=127_u8 {
            let mut bytes = text.clone().into_bytes();
            if std::mem::replace(&mut bytes[at], byte) == byte {
                continue;
            }
            let changed = String::from_utf8(bytes).unwrap();
            if Calibration::from_text(&changed, "changed").is_ok() {
                accepted.push(format!("byte {at}: {:?} for {:?}", char::from(byte), &text[at..=at]));
            }
        }
    }
    assert!(accepted.is_empty(), "{} changes accepted: {accepted:?}", accepted.len());
}

#[test]
fn a_calibration_cut_off_anywhere_is_refused() {
    let (_, text) = calibrated();
    for end in 0..text.len() {
        assert!(Calibration::from_text(&text[..end], "cut").is_err(), "cut off at byte {end} of {}", text.len());
    }
}

#[test]
fn a_recording_in_the_place_of_a_calibration_is_refused() {
    let (bench, _) = calibrated();
    assert_compensate_refuses(&bench, &bench.read("check.csv"), &["bad.toml", "checksum is missing"]);
}

#[test]
fn a_recording_that_cannot_be_compensated_is_refused() {
    let (bench, _) = calibrated();
    let calibration = bench.path("identified").join("calibration.toml");
    let out = bench.path("compensated.csv");
    fs::write(&out, "an earlier result").unwrap();
    let kept = Sheet::of(&bench.read("check.csv")).only(&["t_s", "rate_dps", "xc_v"]);
    bench.write("half.csv", kept.text());
    for (recording, parts) in [("half.csv", ["half.csv", "`yc_v`"]), ("none.csv", ["none.csv", "no such file"])] {
        let arguments: [OsString; 5] = [
            "compensate".into(),
            calibration.clone().into(),
            bench.path(recording).into(),
            "--out".into(),
            out.clone().into(),
        ];
        assert_refused(&arguments, &parts);
    }
    assert_eq!(fs::read_to_string(&out).unwrap(), "an earlier result");
}

// Use

#[test]
fn an_unknown_flag_is_refused() {
    assert_refused(&["identify", "campaign.toml", "--fast"], &["--fast", "cvg identify", "--help"]);
    assert_refused(&["demo", "--jsn"], &["--jsn", "cvg demo"]);
}

#[test]
fn no_arguments_are_refused_with_the_commands_there_are() {
    let none: [&str; 0] = [];
    assert_refused(&none, &["demo", "simulate", "identify", "compensate", "--help"]);
}

#[test]
fn a_missing_argument_is_named() {
    assert_refused(&["identify"], &["<CAMPAIGN>"]);
    assert_refused(&["compensate", "calibration.toml", "rot.csv"], &["--out <OUT>"]);
}

#[test]
fn an_unknown_command_is_named() {
    assert_refused(&["identfy", "campaign.toml"], &["identfy"]);
}

#[test]
fn an_output_file_that_is_a_directory_is_refused() {
    let (bench, _) = calibrated();
    let calibration = bench.path("identified").join("calibration.toml");
    let out = earlier_results(&bench);
    let before = contents(&out);
    let arguments: [OsString; 5] =
        ["compensate".into(), calibration.into(), bench.path("check.csv").into(), "--out".into(), out.clone().into()];
    assert_refused(&arguments, &["is a directory", "file"]);
    assert_eq!(contents(&out), before, "the output folder was touched");
}

#[test]
fn a_result_that_is_a_directory_keeps_the_others_from_being_written() {
    let bench = Bench::small();
    let out = earlier_results(&bench);
    fs::remove_file(out.join("calibration.toml")).unwrap();
    fs::create_dir(out.join("calibration.toml")).unwrap();
    let before = contents(&out);
    let campaign = bench.campaign();
    let arguments = [OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()];
    assert_refused(&arguments, &["calibration.toml", "is a directory"]);
    assert_eq!(contents(&out), before, "the output folder was touched");
}

#[test]
fn an_output_folder_that_is_a_file_is_refused() {
    let bench = Bench::small();
    bench.write("taken", "a file");
    let (campaign, out) = (bench.campaign(), bench.path("taken"));
    let arguments = [OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()];
    assert_refused(&arguments, &["taken", "is a file", "folder"]);
    assert_refused(&[OsStr::new("demo"), OsStr::new("--out"), out.as_os_str()], &["taken", "is a file", "folder"]);
    assert_eq!(bench.read("taken"), "a file");
}

#[test]
fn a_text_that_never_ends_is_refused() {
    let bench = Bench::small();
    let endless = bench.path("endless.toml");
    fs::File::create(&endless).unwrap().set_len(1 << 40).unwrap();
    let (campaign, out) = (bench.campaign(), bench.path("out"));
    let [endless, campaign, out] = [&endless, &campaign, &out].map(|path| path.as_os_str());
    let [identify, to] = ["identify", "--out"].map(OsStr::new);
    assert_refused(&[identify, endless, to, out], &["endless.toml", "larger than"]);
    assert_refused(&[identify, campaign, OsStr::new("--effect"), endless, to, out], &["endless.toml", "larger than"]);
    assert_refused(&[identify, campaign, OsStr::new("--limits"), endless, to, out], &["endless.toml", "larger than"]);
    assert_refused(&[OsStr::new("simulate"), endless, to, out], &["endless.toml", "larger than"]);
    assert_refused(&[OsStr::new("compare"), endless, endless], &["endless.toml", "larger than"]);
    let clean = bench.path("clean.csv");
    let compensate = [OsStr::new("compensate"), endless, campaign, to, clean.as_os_str()];
    assert_refused(&compensate, &["endless.toml", "larger than"]);
}
