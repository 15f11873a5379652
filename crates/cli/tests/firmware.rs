//! The correction of a sensor in a controller: the C header and the table say what `cvg compensate` says.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use support::{Bench, Sheet, cvg, cvg_ok};
use tempfile::TempDir;

/// An encoder in counts with offset, gain, skew and cubic, and a fourth harmonic of the angle of 0.4° beside a reference.
fn recording(rows: u32, first: f64) -> String {
    let mut text = String::from("t_s,table_deg,xc_v,yc_v\n");
    for i in 0..rows {
        let t = f64::from(i) * 0.01;
        let table = first + 37.0 * t;
        let angle = (table + 0.4 * (4.0 * table.to_radians() + 0.3).sin()).to_radians();
        let noise = |k: f64| 2e-4 * ((f64::from(i) * 12.9898 + k).sin() * 43_758.545_3).fract();
        let cubed = |u: f64| u * (1.0 + 0.015 * u * u);
        let x = 9000.0 * (cubed(angle.cos()) + 0.05 + noise(0.0));
        let y = 9000.0 * (1.06 * cubed(angle.sin() + 0.02 * angle.cos()) - 0.03 + noise(1.0));
        let _ = writeln!(text, "{t},{table},{x},{y}");
    }
    text
}

/// A folder with results of the encoder, and a recording of it with what `cvg compensate` makes of that.
fn identified(folder: &Path) -> (PathBuf, Sheet, Vec<f64>) {
    let [file, other, clean, out] = ["turn.csv", "other.csv", "clean.csv", "results"].map(|name| folder.join(name));
    fs::write(&file, recording(2500, 0.0)).unwrap();
    fs::write(&other, recording(1500, 11.0)).unwrap();
    cvg_ok(&["identify".as_ref(), file.as_os_str(), "--sensor".as_ref(), "--out".as_ref(), out.as_os_str()]);
    let calibration = out.join("calibration.toml");
    let said = ["compensate".as_ref(), calibration.as_os_str(), other.as_os_str(), "--out".as_ref(), clean.as_os_str()];
    cvg_ok(&said);
    let angle = Sheet::of(&fs::read_to_string(clean).unwrap()).numbers("theta_deg");
    (calibration, Sheet::of(&fs::read_to_string(other).unwrap()), angle)
}

fn firmware(calibration: &Path, out: &Path, points: &str) -> String {
    let points = format!("--points={points}");
    let said: [&OsStr; 5] =
        ["firmware".as_ref(), calibration.as_os_str(), "--out".as_ref(), out.as_os_str(), points.as_ref()];
    cvg_ok(&said);
    fs::read_to_string(out).unwrap()
}

/// The largest difference of angles on the circle, deg.
fn furthest(a: &[f64], b: &[f64]) -> f64 {
    assert!(a.len() == b.len() && !a.is_empty());
    a.iter().zip(b).map(|(a, b)| ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs()).fold(0.0, f64::max)
}

const PROGRAM: &str = "#include <stdio.h>\n#include \"cvg_correction.h\"\n\
    int main(void) { float x, y; while (scanf(\"%f %f\", &x, &y) == 2) printf(\"%.6f\\n\", (double)cvg_compensate(x, y)); return 0; }\n";

#[test]
fn the_c_header_says_the_angle_that_compensate_says() {
    if Command::new("cc").arg("--version").output().is_err() {
        println!("skipped: there is no cc");
        return;
    }
    let folder = TempDir::new().unwrap();
    let (calibration, sheet, wanted) = identified(folder.path());
    let header = firmware(&calibration, &folder.path().join("cvg_correction.h"), "512");
    assert!(header.contains("float cvg_compensate(float x, float y)") && header.contains("CRC-32"), "{header}");
    fs::write(folder.path().join("main.c"), PROGRAM).unwrap();
    let program = folder.path().join("program");
    let built = Command::new("cc")
        .args(["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "main.c", "-lm", "-o", "program"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let (x, y) = (sheet.numbers("xc_v"), sheet.numbers("yc_v"));
    let rows: String = x.iter().zip(&y).map(|(x, y)| format!("{x} {y}\n")).collect();
    fs::write(folder.path().join("rows"), rows).unwrap();
    let rows = fs::File::open(folder.path().join("rows")).unwrap();
    let output = Command::new(program).stdin(rows).output().unwrap();
    let said: Vec<f64> = String::from_utf8(output.stdout).unwrap().lines().map(|l| l.parse().unwrap()).collect();
    let raw: Vec<f64> = x.iter().zip(&y).map(|(x, y)| y.atan2(*x).to_degrees()).collect();
    let (off, before) = (furthest(&said, &wanted), furthest(&raw, &wanted));
    println!("C and compensate differ by {off:.2e}°, what is corrected is {before:.2}°");
    assert!(off < 5e-4 && before > 3.0 && said.iter().all(|a| (0.0..=360.0).contains(a)), "{off} {before}");
}

#[test]
fn the_table_of_the_angle_holds_at_the_calibrated_amplitude() {
    let folder = TempDir::new().unwrap();
    let (calibration, sheet, wanted) = identified(folder.path());
    let table = firmware(&calibration, &folder.path().join("table.csv"), "256");
    let rows: Vec<Vec<f64>> =
        table.lines().skip(2).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 256);
    let looked_up = |theta: f64| {
        let at = theta.rem_euclid(360.0) / 360.0 * 256.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let i = (at as usize).min(255);
        theta + rows[i][1] + (at - i as f64) * (rows[(i + 1) % 256][1] - rows[i][1])
    };
    let raw = sheet.numbers("xc_v").into_iter().zip(sheet.numbers("yc_v")).map(|(x, y)| y.atan2(x).to_degrees());
    let off = furthest(&raw.map(looked_up).collect::<Vec<_>>(), &wanted);
    assert!(off < 0.02, "{off}");
}

#[test]
fn a_gyroscope_is_sent_to_the_electronics_that_take_its_four_components() {
    let bench = Bench::small();
    let (campaign, out) = (bench.campaign(), bench.path("results"));
    cvg_ok(&["identify".as_ref(), campaign.as_os_str(), "--out".as_ref(), out.as_os_str()]);
    let (calibration, header) = (out.join("calibration.toml"), bench.path("c.h"));
    let refused = cvg(&["firmware".as_ref(), calibration.as_os_str(), OsStr::new("--out"), header.as_os_str()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("cvg.h") && !header.exists(), "{}", refused.stderr);
}
