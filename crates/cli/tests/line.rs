//! What a test bench and a production line ask of the program: pass or fail, what moved, how far an instrument wanders at
//! rest, and files that can be corrected without harm.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use cvg_calibration::calibration::Calibration;
use cvg_calibration::{Member, Origin};
use cvg_model::effects::EffectId;
use serde_json::Value;
use support::{Bench, Outcome, Sheet, cvg, report};
use tempfile::TempDir;

fn run(arguments: &[&dyn AsRef<OsStr>]) -> Outcome {
    let arguments: Vec<&OsStr> = arguments.iter().map(|a| (*a).as_ref()).collect();
    cvg(&arguments)
}

/// Results of the small device in a folder of its own.
fn identified(bench: &Bench) -> PathBuf {
    let out = bench.path("results");
    assert_eq!(run(&[&"identify", &bench.campaign(), &"--out", &out]).status, 0);
    out
}

// Limits

#[test]
fn limits_are_judged_a_line_each_and_one_that_fails_is_told_by_the_exit_code() {
    let bench = Bench::small();
    let limits = bench.path("limits.toml");
    let judged = |text: &str| {
        bench.write("limits.toml", text);
        run(&[&"identify", &bench.campaign(), &"--limits", &limits])
    };
    let kept = judged(
        "\"heldout.discovered.rms_deg\" = { max = 0.01 }\n\"detection_gain_ratio.value\" = { min = 0.97, max = 1.03 }\n\
         heldout.noise_floor_deg = { max = 0.01 }\n\"effects.detection-gain-mismatch.parameters[0].value\" = { min = 1 }\n\
         \"runs.rot+500.csv.rows\" = { min = 100 }\n",
    );
    assert_eq!(kept.status, 0, "{}", kept.stderr);
    assert_eq!(kept.stderr.lines().filter(|l| l.starts_with("pass  small  ")).count(), 5, "{}", kept.stderr);
    let failed = judged("\"angular_gain.value\" = { max = 0.7 }\n\"detection_gain_ratio.value\" = { min = 0.97 }\n");
    assert_eq!(failed.status, 1);
    assert!(failed.stderr.contains("FAIL  small  angular_gain.value = 0.7"), "{}", failed.stderr);
    assert!(failed.stderr.contains("pass  small  detection_gain_ratio.value"), "{}", failed.stderr);
    let null = judged("\"allan.bias_instability_dph.value\" = { max = 1.0 }\n");
    assert_eq!(null.status, 1, "what was not told does not pass");
    assert!(null.stderr.contains("not told"), "{}", null.stderr);
    for nothing in ["\"heldout.discovered.rms\" = { max = 1 }\n", "\"device\" = { max = 1 }\n"] {
        let outcome = judged(nothing);
        assert_eq!(outcome.status, 2, "{nothing}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("names no number of the report"), "{}", outcome.stderr);
    }
    let absent = judged("\"runs.rot+501.csv.spikes\" = { max = 3 }\n");
    assert_eq!(absent.status, 2, "a run that is not there: {}", absent.stderr);
}

#[test]
fn a_limit_that_is_misspelt_is_told_before_anything_is_read_with_the_name_that_was_meant() {
    let folder = TempDir::new().unwrap();
    let limits = folder.path().join("limits.toml");
    for (written, meant) in [
        ("\"heldout.discoverd.rms_deg\" = { max = 1 }\n", "`heldout.discovered.rms_deg` is near"),
        ("\"effects.detection-cubic.parameters.kapa.value\" = { max = 1 }\n", "parameters.kappa.value` is near"),
        ("\"scale_factor.nonlinearity_ppm.vale\" = { max = 1 }\n", "`scale_factor.nonlinearity_ppm.value` is near"),
    ] {
        fs::write(&limits, written).unwrap();
        // the campaign is not even there
        let outcome = run(&[&"identify", &folder.path().join("none.toml"), &"--limits", &limits]);
        assert_eq!(outcome.status, 2);
        assert!(outcome.stderr.contains(meant), "{}", outcome.stderr);
    }
}

/// Every number of a report, keys joined by dots.
fn numbers(value: &Value, place: &str, found: &mut Vec<String>) {
    let below = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers(v, &below(key), found)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| numbers(v, &below(&i.to_string()), found)),
        Value::Number(_) => found.push(place.to_owned()),
        _ => {}
    }
}

#[test]
fn every_number_of_a_report_can_have_a_limit() {
    let bench = over_temperature(|_, rate| rate);
    let mut found = Vec::new();
    numbers(&report(&bench.campaign()), "", &mut found);
    assert!(found.len() > 100, "{}", found.len());
    let text: String = found.iter().map(|place| format!("\"{place}\" = {{ min = -1e300 }}\n")).collect();
    bench.write("limits.toml", text);
    let outcome = run(&[&"identify", &bench.campaign(), &"--limits", &bench.path("limits.toml")]);
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);
}

#[test]
fn limits_that_cannot_be_meant_are_refused_before_anything_is_identified() {
    let bench = Bench::small();
    for (text, part) in [
        ("\"angular_gain.value\" = { min = 1, max = 0 }\n", "min is above max"),
        ("\"angular_gain.value\" = 0.78\n", "is no table"),
        ("\"angular_gain.value\" = { max = \"1\" }\n", "`max` is no number"),
        ("\"angular_gain.value\" = {}\n", "neither min nor max"),
        ("", "there is no limit"),
        ("=\n", "limits.toml"),
    ] {
        bench.write("limits.toml", text);
        let outcome = run(&[&"identify", &bench.campaign(), &"--limits", &bench.path("limits.toml")]);
        assert_eq!((outcome.status, outcome.stdout.as_str()), (2, ""), "{text}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(part), "{part}: {}", outcome.stderr);
    }
}

// Compare

#[test]
fn what_moved_between_two_answers_is_told_and_what_did_not_is_not() {
    let bench = Bench::small();
    let out = identified(&bench);
    let (before, after) = (out.join("report.json"), bench.path("after.json"));
    let mut moved: Value = serde_json::from_slice(&fs::read(&before).unwrap()).unwrap();
    for at in ["value", "ci95"] {
        let shifted = |v: &Value| Value::from(v.as_f64().unwrap() * 1.002);
        let ratio = &mut moved["detection_gain_ratio"][at];
        *ratio = ratio.as_array().map_or_else(|| shifted(ratio), |ends| ends.iter().map(shifted).collect());
    }
    fs::write(&after, moved.to_string()).unwrap();
    let same = run(&[&"compare", &out, &before]);
    assert_eq!(same.status, 0, "{}", same.stderr);
    assert!(same.stdout.contains("nothing moved") && same.stdout.contains("angular_gain"), "{}", same.stdout);
    let other = run(&[&"compare", &out, &after]);
    assert_eq!(other.status, 0);
    let last = other.stdout.lines().last().unwrap();
    assert_eq!(last, "moved beyond the combined 95 % intervals: detection_gain_ratio");
    let facts: Value = serde_json::from_str(&run(&[&"compare", &out, &after, &"--json"]).stdout).unwrap();
    assert_eq!(facts["moved"], 1);
    let ratio = facts["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "detection_gain_ratio").unwrap();
    let [a, b, d, c] = [&ratio["a"]["value"], &ratio["b"]["value"], &ratio["difference"], &ratio["combined95"]]
        .map(|v| v.as_f64().unwrap());
    assert!((b - a - d).abs() < 1e-12 && d > c, "{ratio}");
}

#[test]
fn two_calibrations_are_compared_by_value() {
    let bench = Bench::small();
    let calibration = identified(&bench).join("calibration.toml");
    let said = run(&[&"compare", &calibration, &calibration]);
    assert_eq!(said.status, 0, "{}", said.stderr);
    assert!(said.stdout.contains("detection-gain-mismatch.detection_gain_ratio"), "{}", said.stdout);
}

#[test]
fn what_is_no_answer_cannot_be_compared() {
    let bench = Bench::small();
    for name in ["check.csv", "nothing.json"] {
        let outcome = run(&[&"compare", &bench.path(name), &bench.path(name)]);
        assert_eq!(outcome.status, 2, "{}", outcome.stderr);
        assert!(outcome.stderr.contains(name) && outcome.stderr.contains("wanted"), "{}", outcome.stderr);
    }
}

/// Their parameters bear the same names and are other quantities.
#[test]
fn a_gyroscope_and_a_sensor_are_not_compared_and_another_device_is_named() {
    let bench = Bench::small();
    let before = identified(&bench).join("report.json");
    let changed = |key: &str, value: &str| {
        let mut other: Value = serde_json::from_slice(&fs::read(&before).unwrap()).unwrap();
        other[key] = value.into();
        let path = bench.path(&format!("{key}.json"));
        fs::write(&path, other.to_string()).unwrap();
        run(&[&"compare", &before, &path])
    };
    let kinds = changed("instrument", "sensor");
    assert_eq!(kinds.status, 2, "{}", kinds.stdout);
    assert!(kinds.stderr.contains("of a gyroscope") && kinds.stderr.contains("of a sensor"), "{}", kinds.stderr);
    let devices = changed("device", "another");
    assert_eq!(devices.status, 0, "{}", devices.stderr);
    assert!(devices.stderr.contains("B of another"), "{}", devices.stderr);
}

// At rest

/// Normal noise of variance 1 from a counter (Box–Muller).
fn normal(i: u64, seed: u64) -> f64 {
    let even = |k: u64| {
        let mut x = (2 * i + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    (-2.0 * even(0).max(1e-300).ln()).sqrt() * (std::f64::consts::TAU * even(1)).cos()
}

/// An angle random walk, deg/√h, in this many rows of 0.1 s, about a steady drift of 2 deg/h.
const WALK: f64 = 0.3;

fn at_rest(rows: u64, seed: u64, iq: bool) -> String {
    let mut text = String::from(if iq { "t_s,xc_v,xs_v,yc_v,ys_v\n" } else { "t_s,theta_deg\n" });
    let mut theta = 170.0;
    for i in 0..rows {
        let t = i as f64 * 0.1;
        theta += WALK / 60.0 * 0.1f64.sqrt() * normal(i, seed) + 2.0 / 3600.0 * 0.1;
        let (sin, cos) = theta.to_radians().sin_cos();
        let _ =
            if iq { writeln!(text, "{t},{cos},0,{sin},0") } else { writeln!(text, "{t},{}", theta.rem_euclid(180.0)) };
    }
    text
}

fn static_campaign(folder: &Path, files: &[(&str, String)]) -> PathBuf {
    let mut campaign = String::from("[campaign]\ndevice = \"still\"\n");
    for (name, text) in files {
        fs::write(folder.join(name), text).unwrap();
        let _ = write!(campaign, "\n[[run]]\nkind = \"static\"\nfile = \"{name}\"\n");
    }
    let path = folder.join("campaign.toml");
    fs::write(&path, campaign).unwrap();
    path
}

fn estimate(v: &Value) -> [f64; 3] {
    [&v["value"], &v["ci95"][0], &v["ci95"][1]].map(|v| v.as_f64().unwrap())
}

#[test]
fn a_run_at_rest_alone_is_answered_with_its_allan_deviation() {
    let folder = TempDir::new().unwrap();
    let campaign = static_campaign(folder.path(), &[("rest.csv", at_rest(40_000, 1, false))]);
    let r = report(&campaign);
    assert_eq!((r["status"].as_str(), r["angular_gain"].is_null()), (Some("answered"), true));
    let [walk, low, high] = estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
    assert!((walk / WALK - 1.0).abs() < 0.05 && low < WALK * 1.03 && high > WALK * 0.97, "{walk} {low} {high}");
    // σ(τ) of a walk is N/√τ at every averaging time
    for p in r["allan"]["points"].as_array().unwrap() {
        let [tau, sigma, low, high] =
            [&p["tau_s"], &p["deviation_dph"], &p["ci95"][0], &p["ci95"][1]].map(|v| v.as_f64().unwrap());
        let wanted = WALK * 60.0 / tau.sqrt();
        assert!(low < sigma && sigma < high && wanted > low / 1.3 && wanted < high * 1.3, "{p}");
    }
    let [bias, ..] = estimate(&r["runs"][0]["bias_dps"]);
    assert_eq!((r["runs"][0]["kind"].as_str(), (bias * 3600.0 - 2.0).abs() < 2.0), (Some("static"), true), "{bias}");
    let out = folder.path().join("out");
    assert_eq!(run(&[&"identify", &campaign, &"--out", &out]).status, 0);
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("Allan deviation"));
    assert!(!out.join("calibration.toml").exists(), "nothing to compensate with");
}

/// The walk told of a recording at rest whose rows `change` makes anew from time, s, and angle, deg.
fn walk_of(change: impl Fn(usize, f64) -> f64, column: &str, extra: &str) -> Value {
    let folder = TempDir::new().unwrap();
    let text = at_rest(40_000, 1, false);
    let mut followed = Vec::new();
    for line in text.lines().skip(1) {
        let angle: f64 = line.split_once(',').unwrap().1.parse().unwrap();
        let last = followed.last().copied().unwrap_or(angle);
        followed.push(last + (angle - last + 90.0).rem_euclid(180.0) - 90.0);
    }
    let mut out = format!("t_s,{column}\n");
    for i in 0..followed.len() {
        let step = (followed[i] - followed[i.saturating_sub(1)]) / 0.1;
        let _ = writeln!(out, "{},{}", i as f64 * 0.1, change(i, if column == "gz" { step } else { followed[i] }));
    }
    let campaign = static_campaign(folder.path(), &[("rest.csv", out)]);
    let text = fs::read_to_string(&campaign).unwrap();
    fs::write(&campaign, format!("{text}{extra}")).unwrap();
    report(&campaign)
}

#[test]
fn the_walk_of_recorded_rates_is_that_of_their_sum() {
    let r = walk_of(|_, rate| rate, "gz", "\n[columns]\ntheta_deg = \"integral(gz)\"\n");
    let [walk, low, high] = estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
    assert!(low < 1.02 * WALK && WALK < 1.02 * high && (walk / WALK - 1.0).abs() < 0.03, "{walk} [{low} {high}]");
}

#[test]
fn an_angle_at_rest_with_too_few_digits_tells_no_walk_and_says_so() {
    let r = walk_of(|_, angle| (10.0 * angle).round() / 10.0, "theta_deg", "");
    assert!(r["allan"]["angle_random_walk_deg_sqrt_h"].is_null(), "{}", r["allan"]["angle_random_walk_deg_sqrt_h"]);
    assert!(r["warnings"].to_string().contains("in steps of 1.00e-1°"), "{}", r["warnings"]);
}

#[test]
fn rows_at_rest_that_stand_still_are_left_out_and_named() {
    let stuck = std::cell::Cell::new(0.0);
    let r = walk_of(
        |i, angle| {
            if i == 10_000 {
                stuck.set(angle);
            }
            if (10_000..20_000).contains(&i) { stuck.get() } else { angle }
        },
        "theta_deg",
        "",
    );
    let [walk, ..] = estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
    assert!((walk / WALK - 1.0).abs() < 0.03, "{walk}");
    assert!(r["warnings"].to_string().contains("10000 of 40000 rows at rest repeat one value"), "{}", r["warnings"]);
}

#[test]
fn the_angle_of_two_channels_at_rest_wanders_as_the_angle_itself_does() {
    let folder = TempDir::new().unwrap();
    let of = |iq: bool| {
        let r = report(&static_campaign(folder.path(), &[("rest.csv", at_rest(5000, 3, iq))]));
        estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"])
    };
    let (angle, channels) = (of(false), of(true));
    assert!((angle[0] / channels[0] - 1.0).abs() < 1e-6, "{angle:?} {channels:?}");
}

#[test]
fn intervals_of_the_walk_hold_over_repeated_recordings() {
    let folder = TempDir::new().unwrap();
    let held = (0..40).filter(|seed| {
        let r = report(&static_campaign(folder.path(), &[("rest.csv", at_rest(4000, 100 + seed, false))]));
        let [_, low, high] = estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
        low <= WALK && WALK <= high
    });
    let held = held.count();
    assert!(held >= 33, "{held} of 40 intervals hold the walk");
}

#[test]
fn runs_at_rest_stand_beside_rotations() {
    let bench = Bench::small();
    let wanted = report(&bench.campaign());
    bench.write("rest.csv", at_rest(3000, 5, true));
    bench.change("campaign.toml", |text| format!("{text}\n[[run]]\nkind = \"static\"\nfile = \"rest.csv\"\n"));
    let found = report(&bench.campaign());
    assert_eq!(found["angular_gain"], wanted["angular_gain"]);
    assert!(found["allan"]["points"].as_array().unwrap().len() > 10 && wanted["allan"].is_null());
    assert!(found["inputs"].to_string().contains("rest.csv"));
}

/// Somebody walks by, or the table is turned: what then moves is no noise of the instrument.
#[test]
fn motion_at_rest_is_left_out_and_named_and_a_run_that_moves_is_no_answer() {
    let folder = TempDir::new().unwrap();
    let moved = |by: &dyn Fn(usize) -> f64| {
        let text = at_rest(20_000, 1, false);
        let mut lines = text.lines();
        let mut out = format!("{}\n", lines.next().unwrap());
        for (i, line) in lines.enumerate() {
            let (t, theta) = line.split_once(',').unwrap();
            let _ = writeln!(out, "{t},{}", (theta.parse::<f64>().unwrap() + by(i)).rem_euclid(180.0));
        }
        static_campaign(folder.path(), &[("rest.csv", out)])
    };
    let walk = |r: &Value| estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
    let still = report(&moved(&|_| 0.0));
    assert!(!still["warnings"].to_string().contains("moves"), "{}", still["warnings"]);
    // three degrees to and fro in two seconds, and a turn to another angle
    let bump = |i: usize| 3.0 * f64::from(u8::from((5000..5020).contains(&i))) + 20.0 * f64::from(u8::from(i > 9000));
    let bumped = report(&moved(&bump));
    let [[a, low, high], [b, ..]] = [walk(&still), walk(&bumped)];
    assert!(low < b && b < high, "{b} of {a}");
    let said = bumped["warnings"].to_string();
    assert!(said.contains("rest.csv: the instrument moves") && said.contains("first 499."), "{said}");
    let walking = run(&[&"identify", &moved(&|i| 5.0 * f64::from(u8::from(i % 40 < 4)))]);
    assert_eq!(walking.status, 1, "{}", walking.stdout);
    assert!(walking.stderr.contains("rest.csv") && walking.stderr.contains("moves"), "{}", walking.stderr);
}

/// A table that sways, or that turns: what is smooth from row to row is motion, however the rows scatter.
#[test]
fn a_run_at_rest_that_moves_all_the_time_is_not_read_as_noise() {
    let folder = TempDir::new().unwrap();
    let moved = |by: &dyn Fn(f64) -> f64| {
        let text = at_rest(20_000, 1, false);
        let mut lines = text.lines();
        let mut out = format!("{}\n", lines.next().unwrap());
        for line in lines {
            let (t, theta) = line.split_once(',').unwrap();
            let moved = theta.parse::<f64>().unwrap() + by(t.parse().unwrap());
            let _ = writeln!(out, "{t},{}", moved.rem_euclid(180.0));
        }
        static_campaign(folder.path(), &[("rest.csv", out)])
    };
    for by in [&|t: f64| 3.0 * f64::sin(0.7 * t), &|t: f64| 45.0 * t] as [&dyn Fn(f64) -> f64; 2] {
        let outcome = run(&[&"identify", &moved(by)]);
        assert_eq!(outcome.status, 1, "{}", outcome.stdout);
        assert!(
            outcome.stderr.contains("rest.csv") && outcome.stderr.contains("kind = \"rotation\""),
            "{}",
            outcome.stderr
        );
    }
    let slow = report(&moved(&|t| 0.5 * (0.3 * t).sin()));
    assert!(slow["allan"]["angle_random_walk_deg_sqrt_h"].is_null(), "{}", slow["allan"]);
    assert!(slow["warnings"].to_string().contains("rest.csv: the instrument moves throughout"), "{}", slow["warnings"]);
    // a bias is no motion, and drifts slowly
    let still = report(&moved(&|t| 0.01 * t + 1e-6 * t * t));
    assert!(still["allan"]["angle_random_walk_deg_sqrt_h"].is_object(), "{}", still["allan"]);
    assert!(!still["warnings"].to_string().contains("moves"), "{}", still["warnings"]);
}

#[test]
fn a_run_at_rest_that_is_too_short_is_no_answer() {
    let folder = TempDir::new().unwrap();
    let outcome = run(&[&"identify", &static_campaign(folder.path(), &[("rest.csv", at_rest(40, 1, false))])]);
    assert_eq!(outcome.status, 1);
    assert!(outcome.stderr.contains("rest.csv") && outcome.stderr.contains("too few"), "{}", outcome.stderr);
}

// Scale factor

#[test]
fn a_planted_nonlinearity_of_200_ppm_is_found_within_a_tenth() {
    let mut scenario = String::from(
        "device = \"six\"\nangular_gain = 0.78\nnoise_v = 2e-5\ntau_s = 10.0\nseed = 3\n\
         effects = [{ id = \"detection-gain-mismatch\", detection_gain_ratio = 1.0132 }]\n",
    );
    let rates = [500.0, -500.0, 300.0, -300.0, 100.0, -100.0];
    for rate in rates {
        let _ = write!(
            scenario,
            "\n[[run]]\nkind = \"rotation\"\nfile = \"rot{rate:+}.csv\"\nrate_dps = {rate:.1}\nduration_s = 12.0\nsettle_s = 0.5\n"
        );
    }
    let settings = cvg_simulator::Scenario::parse(&scenario).unwrap().settings().clone();
    let bench = Bench::simulated(settings);
    let clean = report(&bench.campaign());
    let [value, low, high] = estimate(&clean["scale_factor"]["nonlinearity_ppm"]);
    assert!(low < 0.0 && high > 0.0 && value.abs() < 5.0, "nothing planted: {value} {low} {high}");
    for rate in rates {
        // the table turns by less than it says: the instrument's gain seems larger by as much
        let ppm = 200.0 * (f64::abs(rate) - 100.0) / 400.0;
        bench.change(&format!("rot{rate:+}.csv"), |text| {
            let mut sheet = Sheet::of(&text);
            sheet.set("rate_dps", |_, v| v * (1.0 - 1e-6 * ppm));
            sheet.text()
        });
    }
    let planted = report(&bench.campaign());
    let [value, low, high] = estimate(&planted["scale_factor"]["nonlinearity_ppm"]);
    println!("planted 200 ppm, found {value} ({low} to {high}); clean {}", clean["scale_factor"]);
    assert!((value / 200.0 - 1.0).abs() < 0.1, "{value} ({low} to {high})");
    let [value, low, high] = estimate(&planted["scale_factor"]["asymmetry_ppm"]);
    assert!(low < 0.0 && high > 0.0 && value.abs() < 5.0, "no asymmetry was planted: {value} ({low} to {high})");
}

// Temperature

/// Two rates both ways at three temperatures; each run's rows have its temperature.
fn over_temperature(change: impl Fn(f64, f64) -> f64) -> Bench {
    let mut scenario = String::from(
        "device = \"oven\"\nangular_gain = 0.78\nnoise_v = 2e-5\ntau_s = 10.0\nseed = 5\n\
         effects = [{ id = \"detection-gain-mismatch\", detection_gain_ratio = 1.0132 }]\n",
    );
    let points: Vec<(f64, f64)> =
        [-20.0, 20.0, 60.0].into_iter().flat_map(|t| [400.0, -400.0, 200.0].map(|rate| (t, rate))).collect();
    for (t, rate) in &points {
        let _ = write!(
            scenario,
            "\n[[run]]\nkind = \"rotation\"\nfile = \"{t:+}{rate:+}.csv\"\nrate_dps = {rate:.1}\nduration_s = 4.0\nsettle_s = 0.5\n"
        );
    }
    let bench = Bench::simulated(cvg_simulator::Scenario::parse(&scenario).unwrap().settings().clone());
    for (t, rate) in points {
        bench.change(&format!("{t:+}{rate:+}.csv"), |text| {
            let mut sheet = Sheet::of(&text);
            sheet.set("rate_dps", |_, v| change(t, v));
            sheet.header.push("temp_c".into());
            sheet.rows.iter_mut().for_each(|row| row.push(t.to_string()));
            sheet.text()
        });
    }
    bench
}

#[test]
fn gain_and_bias_are_told_over_the_temperature_of_the_runs() {
    // the instrument turns by k (1 + 2e-5 τ) Ω and drifts by 1e-4 τ deg/s more: as if the table turned otherwise than it says
    let bench = over_temperature(|t, v| (v - 1e-4 * t / 0.78) / (1.0 + 2e-5 * t));
    let out = identified(&bench);
    let r: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    let t = &r["temperature"];
    println!("{t:#}");
    assert_eq!(
        (t["runs"].as_u64(), t["range_c"][0].as_f64(), t["range_c"][1].as_f64()),
        (Some(9), Some(-20.0), Some(60.0))
    );
    let [gain, low, high] = estimate(&t["angular_gain_per_k"]);
    assert!((gain / (0.78 * 2e-5) - 1.0).abs() < 0.05 && low < gain && gain < high, "{t}");
    // θ̇ = −k Ω: what the table turns more, the pattern goes back
    let [bias, ..] = estimate(&t["bias_dps_per_k"]);
    assert!((bias.abs() / 1e-4 - 1.0).abs() < 0.1, "{t}");
    let [ratio, low, high] = estimate(&t["detection_gain_ratio_per_k"]);
    assert!(low < 0.0 && high > 0.0 && ratio.abs() < 1e-6, "no slope of the ratio was planted: {t}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Slopes over the temperature") && page.contains("plot-temperature"));
    let (effects, figures) = (page.find("id=\"effects\"").unwrap(), page.find("id=\"look\"").unwrap());
    assert!(effects < page.find("id=\"parameters\"").unwrap() && page.find("id=\"parameters\"").unwrap() < figures);
}

// Compensation

#[test]
fn a_recording_in_millivolts_is_not_compensated_with_a_calibration_in_volts() {
    let bench = Bench::small();
    let calibration = identified(&bench).join("calibration.toml");
    let mut sheet = Sheet::of(&bench.read("check.csv"));
    for column in ["xc_v", "xs_v", "yc_v", "ys_v"] {
        sheet.set(column, |_, v| 1e3 * v);
    }
    bench.write("milli.csv", sheet.text());
    let out = bench.path("clean.csv");
    let refused = run(&[&"compensate", &calibration, &bench.path("milli.csv"), &"--out", &out]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("millivolts") && refused.stderr.contains("--map"), "{}", refused.stderr);
    assert!(!out.exists());
}

#[test]
fn the_angle_is_written_where_only_the_readout_was_recorded() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean.csv"));
    assert_eq!(run(&[&"compensate", &calibration, &bench.path("check.csv"), &"--out", &out]).status, 0);
    let sheet = Sheet::of(&fs::read_to_string(&out).unwrap());
    let (theta, t) = (sheet.numbers("theta_deg"), sheet.numbers("t_s"));
    let rate = (theta[theta.len() - 1] - theta[0]) / (t[t.len() - 1] - t[0]);
    assert!((rate + 0.78 * 400.0).abs() < 1.0, "{rate} deg/s, unwrapped");
}

#[test]
fn several_recordings_go_into_a_folder_and_never_onto_themselves() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean"));
    let said = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &out, &"--device", &"small"]);
    assert_eq!(said.status, 0, "{}", said.stderr);
    assert!(out.join("rot+500.csv").exists() && out.join("rot-300.csv").exists());
    let one = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &bench.path("one.csv")]);
    assert!(one.status == 2 && one.stderr.contains("2 recordings do not go into one file"), "{}", one.stderr);
    let before = bench.read("rot+500.csv");
    let onto = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &bench.path(".")]);
    assert_eq!(onto.status, 2, "{}", onto.stderr);
    assert_eq!(bench.read("rot+500.csv"), before);
    let other = run(&[
        &"compensate",
        &calibration,
        &bench.path("check.csv"),
        &"--out",
        &out.join("x.csv"),
        &"--device",
        &"dfp-8",
    ]);
    assert_eq!(other.status, 2);
    assert!(other.stderr.contains("calibration of small"), "{}", other.stderr);
}

#[test]
fn a_calibration_carries_the_program_and_the_checksums_of_what_it_was_made_of() {
    let bench = Bench::small();
    let text = fs::read_to_string(identified(&bench).join("calibration.toml")).unwrap();
    let file: toml::Table = text.parse().unwrap();
    assert_eq!(file["tool"]["version"].as_str(), Some(env!("CARGO_PKG_VERSION")));
    let inputs = file["input"].as_array().unwrap();
    assert!(
        inputs.iter().any(|i| i["file"].as_str() == Some("rot+500.csv") && i["crc32"].as_str().unwrap().len() == 8)
    );
    let [low, high] = [0, 1].map(|i| file["amplitude_v"][i].as_float().unwrap());
    assert!(low <= high && low > 0.0);
}

#[test]
fn a_reference_is_kept_as_it_was_recorded() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean.csv"));
    assert_eq!(run(&[&"compensate", &calibration, &bench.path("check.csv"), &"--out", &out]).status, 0);
    let of = |text: String| Sheet::of(&text).numbers("rate_dps");
    assert_eq!(of(bench.read("check.csv")), of(fs::read_to_string(out).unwrap()));
}

#[test]
fn what_belongs_to_the_table_or_to_the_hours_of_a_recording_is_not_replayed() {
    let bench = Bench::small();
    let path = identified(&bench).join("calibration.toml");
    let mut calibration = Calibration::read(&path).unwrap();
    let compensated = |calibration: &Calibration, name: &str| {
        let (file, out) = (bench.path(&format!("{name}.toml")), bench.path(&format!("{name}.csv")));
        fs::write(&file, calibration.to_text()).unwrap();
        let outcome = run(&[&"compensate", &file, &bench.path("check.csv"), &"--out", &out]);
        assert_eq!(outcome.status, 0, "{}", outcome.stderr);
        (fs::read_to_string(out).unwrap(), outcome.stderr)
    };
    let (without, _) = compensated(&calibration, "without");
    for (id, value) in [(EffectId::TableHarmonic, 3.0), (EffectId::TimePeriodic, 7.0), (EffectId::GainDrift, 1e-3)] {
        let mut values = id.neutral();
        (values[0], values[1]) = (value, 2e-3);
        calibration.hypothesis.members.push(Member { id, values, origin: Origin::Empirical, refined: true });
    }
    let (with, said) = compensated(&calibration, "with");
    assert_eq!(with, without);
    for id in ["table-harmonic", "time-periodic", "gain-drift"] {
        assert!(said.contains("not undone") && said.contains(id), "{said}");
    }
}
