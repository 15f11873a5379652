//! How far an instrument wanders at rest: runs of `kind = "static"`, alone and beside rotations.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, estimate, report, run};

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

/// White noise of a rate, a walk of 6 deg/√h in so many rows of 10 ms, that went through a low-pass of first order.
fn low_passed(rows: u64, corner_hz: f64, seed: u64) -> String {
    let share = 1.0 - (-std::f64::consts::TAU * corner_hz * 0.01).exp();
    let (mut rate, mut theta) = (0.0, 20.0);
    let mut text = String::from("t_s,theta_deg\n");
    for i in 0..rows {
        rate += share * (6.0 / 60.0 / 0.01f64.sqrt() * normal(i, seed) - rate);
        theta += 0.01 * rate;
        let _ = writeln!(text, "{:.2},{theta}", i as f64 * 0.01);
    }
    text
}

/// A filter takes from the fast noise and leaves the walk; its smooth rate, 0.1 deg/s and more, is no motion.
#[test]
fn the_walk_of_filtered_noise_is_read_beyond_the_filter_and_the_filter_moves_nothing() {
    for (corner_hz, rows, beyond_s) in [(20.0, 20_000, 0.03), (5.0, 20_000, 0.12), (1.0, 60_000, 0.6)] {
        let folder = TempDir::new().unwrap();
        let r = report(&static_campaign(folder.path(), &[("rest.csv", low_passed(rows, corner_hz, 7))]));
        let [walk, low, high] = estimate(&r["allan"]["angle_random_walk_deg_sqrt_h"]);
        assert!(low < 6.0 && 6.0 < high && (walk / 6.0 - 1.0).abs() < 0.1, "{corner_hz} Hz: {walk} [{low} {high}]");
        assert!(r["allan"]["angle_random_walk_tau_s"].as_f64().unwrap() > beyond_s, "{}", r["allan"]);
        assert!(!r["warnings"].to_string().contains("moves"), "{}", r["warnings"]);
    }
    // a quarter of a minute does not tell one beyond 0.8 s of memory, and says so
    let folder = TempDir::new().unwrap();
    let r = report(&static_campaign(folder.path(), &[("rest.csv", low_passed(1500, 0.2, 7))]));
    assert!(r["allan"]["angle_random_walk_deg_sqrt_h"].is_null(), "{}", r["allan"]);
    assert!(r["warnings"].to_string().contains("angle_random_walk_deg_sqrt_h is null"), "{}", r["warnings"]);
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
