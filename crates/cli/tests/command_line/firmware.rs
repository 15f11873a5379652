//! The correction of a sensor in a controller: the C header and the table say what `cvg compensate` says.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::support::{Sheet, cvg, cvg_ok};

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

/// An encoder's position word against a table, with an error of `size` degrees four times a turn and an overtone of it: in the true
/// angle, or in the one that it says.
fn position_word(rows: u32, first: f64, size: f64, of_its_own: bool) -> String {
    let mut text = String::from("t_s,table_deg,theta_deg\n");
    for i in 0..rows {
        let t = f64::from(i) * 0.01;
        let at = first + 37.0 * t;
        let error = |a: f64| size * ((4.0 * a.to_radians() + 0.3).sin() + 0.2 * (8.0 * a.to_radians()).cos());
        let noise = 1e-3 * ((f64::from(i) * 12.9898).sin() * 43_758.545_3).fract();
        let (table, theta) = if of_its_own { (at - error(at), at) } else { (at, at + error(at)) };
        let _ = writeln!(text, "{t},{table},{}", (theta + noise).rem_euclid(360.0));
    }
    text
}

/// What a program that reads angles prints for these.
fn angles_of(program: &Path, theta: &[f64]) -> Vec<f64> {
    let rows = program.with_extension("rows");
    fs::write(&rows, theta.iter().map(|v| format!("{v}\n")).collect::<String>()).unwrap();
    let output = Command::new(program).stdin(fs::File::open(rows).unwrap()).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(|l| l.parse().unwrap()).collect()
}

const READS_AN_ANGLE: &str = "#include <stdio.h>\n#include \"cvg_correction.h\"\n\
    int main(void) { float t; while (scanf(\"%f\", &t) == 1) printf(\"%.6f\\n\", (double)cvg_compensate(t)); return 0; }\n";

/// A program in Rust that does the same; `more` is what stands behind the angle.
fn reads_an_angle(more: &str) -> String {
    format!(
        "mod correction;\nfn main() {{ for line in std::io::stdin().lines() {{ let theta: f32 = line.unwrap().parse().unwrap(); \
         println!(\"{{:.6}}\", correction::cvg_compensate(theta{more})); }} }}\n"
    )
}

#[test]
fn of_an_angle_c_rust_and_table_say_what_compensate_says() {
    let there = |tool: &str| Command::new(tool).arg("--version").output().is_ok();
    for (size, of_its_own) in [(0.4, false), (5.0, false), (3.0, true)] {
        let folder = TempDir::new().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("turn.csv"), position_word(2500, 0.0, size, of_its_own)).unwrap();
        fs::write(at("other.csv"), position_word(1500, 11.0, size, of_its_own)).unwrap();
        cvg_ok(&[
            "identify".as_ref(),
            at("turn.csv").as_os_str(),
            "--sensor".as_ref(),
            "--out".as_ref(),
            at("results").as_os_str(),
        ]);
        let calibration = at("results").join("calibration.toml");
        cvg_ok(&[
            "compensate".as_ref(),
            calibration.as_os_str(),
            at("other.csv").as_os_str(),
            "--out".as_ref(),
            at("clean.csv").as_os_str(),
        ]);
        let numbers = |name: &str| Sheet::of(&fs::read_to_string(at(name)).unwrap()).numbers("theta_deg");
        let (theta, wanted) = (numbers("other.csv"), numbers("clean.csv"));
        assert!(furthest(&theta, &wanted) > 0.9 * size, "something is corrected");
        let write = |name: &str, more: &[&str]| {
            let mut said: Vec<&OsStr> =
                vec!["firmware".as_ref(), calibration.as_os_str(), "--out".as_ref(), folder.path().as_os_str()];
            let out = at(name);
            said[3] = out.as_os_str();
            said.extend(more.iter().map(OsStr::new));
            cvg_ok(&said);
            fs::read_to_string(&out).unwrap()
        };
        for (points, within) in [(None, 2e-4), (Some("--points=2048"), 2e-3)] {
            let more: Vec<&str> = points.into_iter().collect();
            let header = write("cvg_correction.h", &more);
            assert!(header.contains("float cvg_compensate(float theta_deg)"), "{header}");
            assert!(
                !header.contains("readings") && !header.contains("channels") && !header.contains("(x, y)"),
                "{header}"
            );
            if there("cc") {
                fs::write(at("main.c"), READS_AN_ANGLE).unwrap();
                let built = Command::new("cc")
                    .args([
                        "-std=c99",
                        "-O2",
                        "-Wall",
                        "-Wextra",
                        "-Werror",
                        "-pedantic",
                        "main.c",
                        "-lm",
                        "-o",
                        "of_c",
                    ])
                    .current_dir(folder.path())
                    .output()
                    .unwrap();
                assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
                let off = furthest(&angles_of(&at("of_c"), &theta), &wanted);
                println!("C, {size}°, {points:?}: {off:.1e}°");
                assert!(off < within, "{size} {points:?}: {off}");
            }
            let module = write("correction.rs", &more);
            assert!(module.contains("pub fn cvg_compensate(theta_deg: f32"), "{module}");
            if there("rustc") {
                let more = if points.is_none() { ", f32::sin_cos" } else { "" };
                fs::write(at("main.rs"), reads_an_angle(more)).unwrap();
                let built = Command::new("rustc")
                    .args(["--edition=2021", "-O", "-D", "warnings", "main.rs", "-o", "of_rust"])
                    .current_dir(folder.path())
                    .output()
                    .unwrap();
                assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
                let off = furthest(&angles_of(&at("of_rust"), &theta), &wanted);
                println!("Rust, {size}°, {points:?}: {off:.1e}°");
                assert!(off < within, "{size} {points:?}: {off}");
            }
        }
        let table = write("table.csv", &["--points=2048"]);
        assert!(table.starts_with("# the angle that the sensor gives"), "{table}");
        let add: Vec<f64> = table.lines().skip(2).map(|l| l.split_once(',').unwrap().1.parse().unwrap()).collect();
        let looked_up = |theta: &f64| {
            let at = theta.rem_euclid(360.0) / 360.0 * 2048.0;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2047")]
            let i = (at as usize).min(2047);
            theta + add[i] + (at - i as f64) * (add[(i + 1) % 2048] - add[i])
        };
        let off = furthest(&theta.iter().map(looked_up).collect::<Vec<_>>(), &wanted);
        assert!(off < 2e-3, "{size}: {off}");
    }
}

#[test]
fn a_rate_gyroscope_is_told_its_two_numbers() {
    let folder = TempDir::new().unwrap();
    let mut text = String::from("t_s,table_deg,gyro\n");
    let mut table = 0.0;
    for i in 0..6000 {
        let t = f64::from(i) * 0.01;
        let rate = 90.0 * (0.7 * t).sin();
        let noise = 1e-2 * ((f64::from(i) * 12.9898).sin() * 43_758.545_3).fract();
        table += 0.01 * rate;
        let _ = writeln!(text, "{t},{table},{}", 0.98 * rate + 0.35 + noise);
    }
    fs::write(folder.path().join("gyro.csv"), text).unwrap();
    let campaign = folder.path().join("campaign.toml");
    fs::write(
        &campaign,
        "[campaign]\ndevice = \"g\"\nperiod_deg = 360.0\n[columns]\ntheta_deg = \"integral(gyro)\"\n[[run]]\nkind = \"rotation\"\nfile = \"gyro.csv\"\n",
    )
    .unwrap();
    let out = folder.path().join("results");
    cvg_ok(&["identify".as_ref(), campaign.as_os_str(), "--out".as_ref(), out.as_os_str()]);
    let (calibration, header) = (out.join("calibration.toml"), folder.path().join("c.h"));
    let refused = cvg(&["firmware".as_ref(), calibration.as_os_str(), OsStr::new("--out"), header.as_os_str()]);
    assert_eq!(refused.status, 2);
    assert!(
        refused.stderr.contains("take its bias, 0.3499") && refused.stderr.contains("factor, 0.9799"),
        "{}",
        refused.stderr
    );
}

#[test]
fn a_header_with_the_rails_of_one_channel_compiles_without_a_warning() {
    if Command::new("cc").arg("--version").output().is_err() {
        println!("skipped: there is no cc");
        return;
    }
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut text = String::from("t_s,table_deg,xc_v,yc_v\n");
    for row in recording(2500, 0.0).lines().skip(1) {
        let (rest, y) = row.rsplit_once(',').unwrap();
        let _ = writeln!(text, "{rest},{}", y.parse::<f64>().unwrap().clamp(-8000.0, 8000.0));
    }
    fs::write(at("clipped.csv"), text).unwrap();
    cvg_ok(&[
        "identify".as_ref(),
        at("clipped.csv").as_os_str(),
        "--sensor".as_ref(),
        "--out".as_ref(),
        at("r").as_os_str(),
    ]);
    let header = firmware(&at("r").join("calibration.toml"), &at("cvg_correction.h"), "64");
    assert!(header.contains("y_read = y") && !header.contains("x_read = x"), "{header}");
    fs::write(at("main.c"), PROGRAM).unwrap();
    let built = Command::new("cc")
        .args(["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "main.c", "-lm", "-o", "program"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
}

#[test]
fn a_gyroscope_becomes_settings_of_its_electronics() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    cvg_ok(&["demo".as_ref(), "--out".as_ref(), at("demo").as_os_str()]);
    let calibration = at("demo").join("calibration.toml");
    let written = |name: &str| {
        let out = at(name);
        cvg_ok(&["firmware".as_ref(), calibration.as_os_str(), "--out".as_ref(), out.as_os_str()]);
        fs::read_to_string(out).unwrap()
    };
    let module = written("device.rs");
    for effect in [
        "(EffectId::DetectionGainMismatch, [1.013",
        "(EffectId::DetectionCubic, [",
        "(EffectId::ActuationGainMismatch, [1.0",
    ] {
        assert!(module.contains(effect), "{effect}: {module}");
    }
    let header = written("cvg_device.h");
    assert!(header.contains("{\"detection-gain-mismatch\", {1.013") && header.contains("Not in it"), "{header}");
    let table = cvg(&["firmware".as_ref(), calibration.as_os_str(), OsStr::new("--out"), at("table.csv").as_os_str()]);
    assert!(table.status == 2 && table.stderr.contains(".h or .rs"), "{}", table.stderr);
    if Command::new("cc").arg("--version").output().is_err() {
        println!("skipped: there is no cc");
        return;
    }
    let main = "#include \"cvg_device.h\"\nint main(void) { cvg_settings s; cvg_device_undo(&s); return (int)s.readout_count; }\n";
    fs::write(at("main.c"), main).unwrap();
    let include = concat!("-I", env!("CARGO_MANIFEST_DIR"), "/../capi/include");
    let built = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", include, "main.c", "-o", "main"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    // as many as the calibration has of the readout
    assert_eq!(Command::new(at("main")).status().unwrap().code(), Some(2));
}
