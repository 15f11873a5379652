//! What people do by mistake, and that the program says so: files in each other's place, names that end in nothing it writes,
//! options that mean nothing there.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use crate::support::{Bench, Outcome, foreign, run};

/// Refused as bad use, with these words.
fn refused(outcome: &Outcome, parts: &[&str]) {
    assert_eq!(outcome.status, 2, "{}{}", outcome.stdout, outcome.stderr);
    for part in parts {
        assert!(outcome.stderr.contains(part), "{part:?} is not in {:?}", outcome.stderr);
    }
}

/// A device with its results, which are made once.
fn identified() -> (Bench, std::path::PathBuf) {
    let bench = Bench::small();
    let results = bench.path("results");
    let outcome = run(&[&"identify", &bench.campaign(), &"--out", &results]);
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);
    (bench, results)
}

#[test]
fn what_compensate_and_firmware_cannot_mean_is_refused() {
    let (bench, results) = identified();
    let (calibration, recording) = (results.join("calibration.toml"), bench.path("check.csv"));
    let to = |name: &str| run(&[&"compensate", &calibration, &recording, &"--out", &bench.path(name)]);
    for name in ["clean.xlsx", "clean.mat", "clean", "clean.csv.gz"] {
        refused(&to(name), &[name, ".csv or .parquet"]);
        assert!(!bench.path(name).exists());
    }
    assert_eq!(to("clean.csv").status, 0);
    let swapped = run(&[&"compensate", &recording, &calibration, &"--out", &bench.path("clean.csv")]);
    refused(&swapped, &["check.csv", "calibration, which comes first", "calibration.toml"]);
    let stream = run(&[&"compensate", &calibration, &recording, &"--out", &"-"]);
    refused(&stream, &["standard output", "./-"]);
    let header = bench.path("device.h");
    refused(&run(&[&"firmware", &calibration, &"--out", &header, &"--points", &"64"]), &["--points 64", "gyroscope"]);
    assert!(!header.exists());
    // the results are as good as the calibration in them
    let outcome = run(&[&"firmware", &results, &"--out", &header]);
    assert!(outcome.status == 0 && header.exists(), "{}", outcome.stderr);
}

#[test]
fn results_are_no_recordings_and_do_not_go_to_a_dash() {
    let (bench, results) = identified();
    let [json, html] = ["report.json", "report.html"].map(|name| results.join(name));
    refused(&run(&[&"identify", &json]), &["report.json", "is JSON and no recording"]);
    refused(&run(&[&"inspect", &html]), &["report.html", "is HTML or XML and no recording"]);
    refused(&run(&[&"identify", &bench.campaign(), &"--out", &"-"]), &["standard output", "./-"]);
    assert!(!Path::new("-").exists());
}

#[test]
fn a_negative_time_to_settle_and_limits_that_are_not_there_are_told_as_such() {
    let bench = Bench::small();
    refused(
        &run(&[&"identify", &bench.path("check.csv"), &"--settle", &"-1"]),
        &["--settle -1", "zero or more seconds"],
    );
    let limits = run(&[&"identify", &bench.campaign(), &"--limits", &bench.path("nothere.toml")]);
    refused(&limits, &["--limits", "nothere.toml: cannot be read"]);
    assert!(!limits.stderr.contains("heldout"), "{}", limits.stderr);
}

#[test]
fn a_fleet_of_nothing_is_bad_use() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("fleet");
    refused(&run(&[&"fleet", &folder.path().join("nothing"), &"--out", &out]), &["nothing", "there is no such file"]);
    assert!(!out.exists());
}

#[test]
fn a_column_that_is_misspelt_is_told_with_the_one_that_is_near() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("ring.csv");
    fs::write(&file, "t_s,xc_v,yc_v,Angle 1\n0,1,0,0\n0.1,1,0.1,1\n").unwrap();
    let misspelt = run(&[&"identify", &file, &"--sensor", &"--map", &"table_deg=Angel 1"]);
    refused(&misspelt, &["`Angel 1`", "--map 'table_deg=Angle 1' is near"]);
    assert!(!misspelt.stderr.contains("--sensor"), "{}", misspelt.stderr);
    // of two channels the one that is not there
    fs::write(&file, "t_s,xc_v,Sin,table_deg\n0,1,0,0\n0.1,1,0.1,1\n").unwrap();
    refused(&run(&[&"identify", &file, &"--sensor"]), &["--map 'yc_v=Sin'"]);
}

#[test]
fn a_channel_whose_column_the_command_line_gives_to_another_is_warned_of() {
    let bench = Bench::small();
    bench.write("export.csv", foreign(&bench, "check.csv"));
    let columns = "[campaign]\ndevice = \"small\"\n[columns]\nt_s = \"Time (ms)\"\nrate_dps = \"Table\"\nxc_v = \"D1 X\"\nxs_v = \"D1 Y\"\n\
                   yc_v = \"D2 X\"\nys_v = \"D2 Y\"\nvas_v = \"PID1\"\nvqc_v = \"PID2\"\n[[run]]\nkind = \"rotation\"\nfile = \"export.csv\"\n";
    bench.write("columns.toml", columns);
    let mapped = |more: &[&str]| {
        let (file, columns) = (bench.path("export.csv"), bench.path("columns.toml"));
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"inspect", &file, &"--map", &columns];
        more.iter().for_each(|more| arguments.extend([&"--map" as &dyn AsRef<std::ffi::OsStr>, more]));
        run(&arguments)
    };
    assert!(!mapped(&[]).stderr.contains("not read"));
    let taken = mapped(&["vas_v=PID2"]);
    assert!(taken.stderr.contains("vqc_v is `PID2`") && taken.stderr.contains("not read"), "{}", taken.stderr);
}

#[test]
fn one_run_and_one_device_are_no_many() {
    let bench = Bench::small();
    let manifest =
        "[campaign]\ndevice = \"small\"\n[[run]]\nkind = \"rotation\"\nfile = \"check.csv\"\nsettle_s = 0.5\n";
    bench.write("one.toml", manifest);
    let inspected = run(&[&"inspect", &bench.path("one.toml")]);
    assert!(inspected.stdout.contains("small, 1 run\n"), "{}", inspected.stdout);
    let fleet = run(&[&"fleet", &bench.path("one.toml"), &"--out", &bench.path("fleet")]);
    assert!(fleet.stdout.starts_with("1 device, "), "{}{}", fleet.stdout, fleet.stderr);
}
