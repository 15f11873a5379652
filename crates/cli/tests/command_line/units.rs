//! Angles that are not in degrees, and angles without an error.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Outcome, cvg};

/// A sensor turned by hand: its angle and that of its table, each in a unit of so many degrees, over and over or at a stretch.
fn turned(folder: &TempDir, [table, angle]: [f64; 2], wrap: bool, error_deg: f64) -> PathBuf {
    let mut text = String::from("t_s,table_deg,theta_deg\n");
    for i in 0..3000 {
        let t = 0.01 * f64::from(i);
        let shaft = 36.0 * t + 20.0 * (0.5 * t).sin();
        let read = shaft + error_deg * (shaft.to_radians().sin() + 0.03 * (1e4 * t).sin());
        let [shaft, read] = [shaft, read].map(|v: f64| if wrap { v.rem_euclid(360.0) } else { v });
        let _ = writeln!(text, "{t:.2},{:.9},{:.9}", shaft / table, read / angle);
    }
    let path = folder.path().join("turned.csv");
    fs::write(&path, text).unwrap();
    path
}

fn identified(file: &Path, more: &[&OsStr]) -> Outcome {
    let mut arguments = vec![OsStr::new("identify"), file.as_os_str(), OsStr::new("--sensor")];
    arguments.extend(more);
    cvg(&arguments)
}

/// The unit that fits is named, whichever it is, with a factor that a mapping takes.
#[test]
fn an_angle_in_another_unit_is_told_the_factor_that_takes_it_to_degrees() {
    let folder = TempDir::new().unwrap();
    let units = [
        ("turns", 360.0, "*360"),
        ("rad", 1f64.to_degrees(), "*57.29578"),
        ("gon", 0.9, "*0.9"),
        ("mrad", 1e-3f64.to_degrees(), "*0.05729578"),
        ("arc seconds", 1.0 / 3600.0, "/3600"),
        ("mdeg", 1e-3, "/1000"),
        ("arc minutes", 1.0 / 60.0, "/60"),
        ("mils of 6400 a turn", 0.05625, "*0.05625"),
    ];
    for (name, degrees, by) in units {
        for (column, scales) in [("table_deg", [degrees, 1.0]), ("theta_deg", [1.0, degrees])] {
            for wrap in [false, true] {
                let file = turned(&folder, scales, wrap, 0.3);
                let Outcome { stdout, stderr, .. } = identified(&file, &[]);
                let said = stdout + &stderr;
                assert!(said.contains(&format!("…{by}\"")), "{column} in {name}, wrapping {wrap}: {said}");
                let wrong = units.iter().find(|(other, ..)| *other != name && said.contains(&format!(" {other} (")));
                assert_eq!(wrong, None, "{column} in {name}, wrapping {wrap}: {said}");
                let map = format!("{column}={column}{by}");
                let mapped = identified(&file, &[OsStr::new("--map"), OsStr::new(&map)]);
                assert_eq!(mapped.status, 0, "{map}: {}", mapped.stderr);
                assert!(!mapped.stdout.contains("whole number"), "{map}: {}", mapped.stdout);
            }
        }
    }
}

/// A position word is whole turns of a power of two: as a unit it is its counts, whatever number of periods another would make.
#[test]
fn counts_of_a_converter_are_named_with_the_divisor_that_makes_degrees() {
    let folder = TempDir::new().unwrap();
    for (bits, by) in [(12, "/11.377778"), (17, "/364.088889"), (20, "/2912.711111")] {
        let file = turned(&folder, [1.0, 360.0 / f64::from(1 << bits)], true, 0.3);
        // wrapped at a turn, in whole counts
        let text = fs::read_to_string(&file).unwrap();
        let counted = text.lines().enumerate().map(|(at, line)| {
            let (beside, angle) = line.rsplit_once(',').unwrap();
            let count = |v: f64| v.rem_euclid(f64::from(1 << bits)).floor();
            if at == 0 { line.to_owned() } else { format!("{beside},{}", count(angle.parse().unwrap())) }
        });
        fs::write(&file, counted.collect::<Vec<_>>().join("\n") + "\n").unwrap();
        let refused = identified(&file, &[]);
        assert!(
            refused.status == 1 && refused.stderr.contains(&format!("counts of {bits} bits")),
            "{}",
            refused.stderr
        );
        assert!(refused.stderr.contains(&format!("…{by}\"")), "{}", refused.stderr);
        let map = format!("theta_deg=theta_deg{by}");
        let mapped = identified(&file, &[OsStr::new("--map"), OsStr::new(&map)]);
        assert_eq!(mapped.status, 0, "{map}: {}", mapped.stderr);
        assert!(mapped.stdout.contains("1 period a turn"), "{map}: {}", mapped.stdout);
    }
}

/// What rounding leaves of no error is no before and after, and no axis shows it.
#[test]
fn an_angle_without_an_error_leaves_nothing_to_correct() {
    let folder = TempDir::new().unwrap();
    let file = turned(&folder, [1.0, 1.0], false, 0.0);
    let out = folder.path().join("out");
    let told = identified(&file, &[OsStr::new("--out"), out.as_os_str()]);
    assert_eq!(told.status, 1, "{}", told.stderr);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("<p class=\"headline\">nothing to correct: below 0.000001° rms angle error</p>"));
    let figures = page.split_once("id=\"figures\">").unwrap().1.split_once("</script>").unwrap().0;
    let figures: Vec<Value> = serde_json::from_str(figures).unwrap();
    for (id, axis) in [("bias", "yaxis"), ("residual", "yaxis")] {
        let figure = figures.iter().find(|f| f["id"] == id).unwrap();
        assert_eq!(figure["layout"][axis]["range"], serde_json::json!([-1e-6, 1e-6]), "{id}");
    }
}

/// No gain makes one channel span a thousand times as much as the other: 28° were left of it with exit code 0.
#[test]
fn millivolts_beside_volts_are_named_with_the_factor() {
    let folder = TempDir::new().unwrap();
    let mut text = String::from("t_s,table_deg,xc_v,yc_v\n");
    for i in 0..3000 {
        let (t, table) = (0.01 * f64::from(i), 0.5 * f64::from(i));
        let (sin, cos) = table.to_radians().sin_cos();
        let _ = writeln!(text, "{t:.2},{table:.4},{:.3},{:.6}", 1000.0 * cos + 10.0 * sin, 1.02 * sin);
    }
    let file = folder.path().join("millivolts.csv");
    fs::write(&file, text).unwrap();
    let refused = identified(&file, &[]);
    let named = refused.stderr.contains("xc_v spans") && refused.stderr.contains("--map 'xc_v=xc_v/1000'");
    assert!((refused.status, named) == (1, true), "{}", refused.stderr);
    let mapped = identified(&file, &[OsStr::new("--map"), OsStr::new("xc_v=xc_v/1000")]);
    assert_eq!(mapped.status, 0, "{}", mapped.stderr);
}
