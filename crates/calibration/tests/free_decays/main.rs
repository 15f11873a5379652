//! Decays without any loop, at several starting angles: what they tell of a resonator, and how sure of it they are.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod broken;
mod foucault;
mod late;
mod readouts;
mod ring;

use cvg_calibration::recording::Campaign;
use cvg_calibration::report::{Estimate, Report, Status};
use cvg_calibration::{Options, Origin, identify};
use cvg_model::resonator::Anisotropy;
use foucault::{Camera, Pendulum, RATE_DPH};
use rayon::prelude::*;
use ring::Ring;

const ANGLES: [f64; 8] = [0.0, 22.5, 45.0, 67.5, 90.0, 112.5, 135.0, 157.5];

fn identified(ring: &Ring, angles: &[f64], of_each: &str, seed: u64) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let path = ring.campaign(folder.path(), angles, of_each, seed);
    identify(Campaign::open(&path).unwrap(), &Options::default()).unwrap().report
}

/// The same, of which one decay after the other turns this way and that, which tells what the readout does to the orbit
/// from mechanics.
fn identified_both_ways(ring: &Ring, seed: u64) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let path = ring.campaign_at(folder.path(), &ANGLES, &BOTH_WAYS, seed);
    identify(Campaign::open(&path).unwrap(), &Options::default()).unwrap().report
}

const BOTH_WAYS: [f64; 2] = [10.0, -10.0];

fn parameter(report: &Report, effect: &str, name: &str) -> Estimate {
    let effect = report.effects.iter().find(|e| e.id == effect).expect("the effect is there");
    let p = effect.parameters.iter().find(|p| p.name == name).expect("the parameter is there");
    Estimate { value: p.value, ci95: p.ci95.expect("an interval") }
}

fn is_within(set: f64, e: &Estimate) -> bool {
    (e.ci95[0]..=e.ci95[1]).contains(&set)
}

fn discovered(report: &Report) -> Vec<&str> {
    report.effects.iter().filter(|e| e.origin != Origin::Declared).map(|e| e.id.as_str()).collect()
}

/// What a usual ring is, with what was found of it.
fn set_values(report: &Report) -> [(f64, Estimate); 6] {
    [
        (1.0 / 22.0, report.decay.as_ref().unwrap().damping_per_s),
        (0.78, report.angular_gain),
        (4.7e-3, parameter(report, "anisodamping", "anisodamping")),
        (0.4f64.to_degrees(), parameter(report, "anisodamping", "theta_tau")),
        (SPLIT, parameter(report, "anisoelasticity", "anisoelasticity")),
        ((-0.7f64).to_degrees(), parameter(report, "anisoelasticity", "theta_omega")),
    ]
}

const SPLIT: f64 = std::f64::consts::TAU * 0.04;

#[test]
fn decays_at_eight_angles_tell_the_split_to_a_thousandth() {
    let report = identified(&Ring::usual(), &ANGLES, "rate_dps = 10.0", 1);
    let split = parameter(&report, "anisoelasticity", "anisoelasticity");
    assert!((split.value / SPLIT - 1.0).abs() < 1e-3, "{split:?}");
    for (set, e) in set_values(&report) {
        assert!((e.value - set).abs() < 2.0 * e.half_width(), "{set}: {e:?}");
    }
    assert!(report.residual.white);
    assert!(report.heldout.declared.rms_deg < 0.1 * report.heldout.raw.unwrap().rms_deg);
    assert_eq!(discovered(&report), [""; 0]);
}

/// How many of the set values lie within their intervals in so many campaigns, one count a parameter, and how many discoveries
/// were made of what is not there.
fn covered(ring: &Ring, campaigns: u64) -> ([u64; 6], usize) {
    let reports: Vec<Report> =
        (0..campaigns).into_par_iter().map(|seed| identified_both_ways(ring, 100 + seed)).collect();
    let mut counts = [0; 6];
    for report in &reports {
        for (count, (set, e)) in counts.iter_mut().zip(set_values(report)) {
            *count += u64::from(is_within(set, &e));
        }
    }
    (counts, reports.iter().map(|r| discovered(r).len()).sum())
}

#[test]
fn intervals_of_a_hundred_campaigns_hold_what_they_say() {
    let ring = Ring { rows: 400, row_s: 0.1, ..Ring::usual() };
    let (counts, false_discoveries) = covered(&ring, 120);
    println!("{counts:?} of 120 each");
    // three binomial deviations of 120 at 95 %, and of six times as many
    assert!(counts.iter().all(|c| *c >= 107), "{counts:?}");
    let all: u64 = counts.iter().sum();
    assert!((667..=701).contains(&all), "{all} of 720");
    assert_eq!(false_discoveries, 0);
}

#[test]
fn intervals_hold_where_noise_remembers() {
    let ring = Ring { rows: 400, row_s: 0.1, memory: 0.7, ..Ring::usual() };
    let (counts, false_discoveries) = covered(&ring, 60);
    println!("{counts:?} of 60 each");
    let all: u64 = counts.iter().sum();
    assert!((322..=358).contains(&all), "{all} of 360");
    assert_eq!(false_discoveries, 0);
}

#[test]
fn a_spring_that_precesses_with_quadrature_is_found_and_named() {
    let ring = Ring { spring: 0.01, frequency_per_energy: -0.03, ..Ring::usual() };
    let report = identified(&ring, &ANGLES, "rate_dps = 10.0", 3);
    assert_eq!(discovered(&report), ["spring-isotropic"]);
    let c = parameter(&report, "spring-isotropic", "c");
    assert!((c.value - 0.01).abs() < 2.0 * c.half_width(), "{c:?}");
    let per_energy = parameter(&report, "spring-isotropic", "frequency_per_energy");
    assert!((per_energy.value + 0.03).abs() < 2.0 * per_energy.half_width(), "{per_energy:?}");
}

#[test]
fn unequal_gains_of_the_readout_are_told_from_anisodamping() {
    let ring = Ring { gain_ratio: 1.0132, ..Ring::usual() };
    let report = identified_both_ways(&ring, 4);
    let ratio = report.detection_gain_ratio.expect("the gain ratio is told");
    assert!((ratio.value - 1.0132).abs() < 2.0 * ratio.half_width(), "{ratio:?}");
    for (set, e) in set_values(&report) {
        assert!((e.value - set).abs() < 2.0 * e.half_width(), "{set}: {e:?}");
    }
}

#[test]
fn without_a_stated_rate_precession_is_told_and_the_angular_gain_is_not() {
    let report = identified(&Ring::usual(), &ANGLES, "", 5);
    assert!(!report.angular_gain.is_told());
    let written = serde_json::to_value(&report).unwrap();
    assert!(written["angular_gain"].is_null());
    let precession = report.decay.unwrap().precession_dph;
    let set = -0.78 * 10.0 * 3600.0;
    assert!((precession.value - set).abs() < 2.0 * precession.half_width(), "{precession:?}");
}

#[test]
fn precession_of_decays_at_several_rates_is_null() {
    let report = identified_both_ways(&Ring::usual(), 4);
    let written = serde_json::to_value(&report).unwrap();
    for name in ["precession_dph", "precession_dph_declared"] {
        assert!(written["decay"][name].is_null(), "{name}: {}", written["decay"]);
    }
    let read: Report = serde_json::from_value(written).unwrap();
    assert!(!read.decay.unwrap().precession_dph.is_told());
}

#[test]
fn an_angular_gain_that_no_resonator_has_is_no_answer_of_a_decay_either() {
    let folder = tempfile::tempdir().unwrap();
    // 10 deg/s, written in rad/s
    let path = Ring::usual().campaign(folder.path(), &ANGLES, "rate_dps = 0.174533", 7);
    let refusal =
        identify(Campaign::open(&path).unwrap(), &Options::default()).map(|i| i.report.angular_gain).unwrap_err();
    assert!(refusal.to_string().contains("as if in rad/s"), "{refusal}");
}

#[test]
fn what_does_not_help_the_decays_of_another_day_is_not_taken() {
    let folder = tempfile::tempdir().unwrap();
    // anisodamping lies across that of the decays that are fitted, and there is hardly a split
    let mut ring = Ring::usual();
    ring.resonator.anisoelasticity = Anisotropy::new(1e-3, 0.7);
    let path = ring.campaign(folder.path(), &ANGLES, "rate_dps = 10.0", 8);
    ring.resonator.anisodamping = Anisotropy::new(4.7e-3, 0.4 + std::f64::consts::FRAC_PI_2);
    let another_day = folder.path().join("another-day");
    std::fs::create_dir(&another_day).unwrap();
    ring.campaign(&another_day, &ANGLES, "", 9);
    let held = "kind = \"decay\"\nrate_dps = 10.0\nuse = \"holdout\"\n";
    let runs = (0..ANGLES.len()).map(|at| format!("\n[[run]]\nfile = \"another-day/decay-{at}.csv\"\n{held}"));
    let campaign = std::fs::read_to_string(&path).unwrap() + &runs.collect::<String>();
    std::fs::write(&path, campaign).unwrap();

    let identified = identify(Campaign::open(&path).unwrap(), &Options::default()).unwrap();
    let report = &identified.report;
    assert_eq!(report.status, Status::Neutral, "{:?}", report.heldout);
    assert!(report.reason.as_ref().unwrap().contains("nothing that was found helps"), "{:?}", report.reason);
    assert!(report.heldout.discovered.rms_deg > report.heldout.raw.unwrap().rms_deg, "{:?}", report.heldout);
    assert_eq!(identified.calibration.hypothesis.members, []);
}

#[test]
fn a_decay_near_one_angle_leaves_anisodamping_unsaid() {
    let mut ring = Ring { rate_dps: 0.0, noise_v: 1e-4, ..Ring::usual() };
    ring.resonator.anisoelasticity = Anisotropy::new(1e-3, 0.7);
    let report = identified(&ring, &[10.0], "", 6);
    assert!(report.effects.iter().all(|e| e.id != "anisodamping"));
    assert!(report.warnings.iter().any(|w| w.contains("near one angle")), "{:?}", report.warnings);
}

fn filmed(pendulum: &Pendulum, seed: u64) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let path = pendulum.filmed(folder.path(), seed);
    identify(Campaign::open(&path).unwrap(), &Options::default()).unwrap().report
}

#[test]
fn airys_precession_is_found_in_the_film_of_a_pendulum_and_the_rate_put_right() {
    let pendulum = Pendulum { spherical: true, split_rad_s: 2.5e-5, uneven: 0.0, noise_px: 0.3, camera: Camera::FAR };
    for seed in 1..=6 {
        let report = filmed(&pendulum, seed);
        let decay = report.decay.as_ref().unwrap();
        assert_eq!(discovered(&report), ["spring-isotropic"]);
        let c = parameter(&report, "spring-isotropic", "c");
        let l = Pendulum::length_m() * foucault::PIXELS_PER_M;
        let airy = 3.0 / 16.0 * std::f64::consts::TAU * foucault::HZ / (l * l);
        assert!((c.value - airy).abs() < 2.0 * c.half_width() && c.half_width() < 0.1 * airy, "{airy}: {c:?}");
        let (rate, without) = (decay.precession_dph, decay.precession_dph_declared);
        assert!((rate.value + RATE_DPH).abs() < 0.3, "{rate:?}");
        assert!((without.value + RATE_DPH).abs() > 3.0, "{without:?}");
        // a damping that differs between two axes by a tenth of itself would pass for half of the Earth's rate
        assert!((3.0..6.0).contains(&rate.half_width()), "{rate:?}");
        assert!(!report.angular_gain.is_told(), "{:?}", report.angular_gain);
        let [constant, _, after] = decay.rms_deg;
        println!("{constant:.4} {after:.4} {rate:?} {without:?}");
        assert!(after < 0.2 * constant, "{constant} {after}");
    }
}

/// A camera that is not upright, not over the middle, and counts y downwards: lines stay lines, and what is nonlinear in it is
/// an overtone of the swing. The pattern turns the other way.
#[test]
fn the_rate_of_a_filmed_pendulum_is_right_through_a_tilted_camera_beside_it() {
    let degree = 1.0_f64.to_radians();
    let cameras = [
        Camera { tilt_rad: [degree, 0.0], ..Camera::NEAR },
        Camera { tilt_rad: [0.0, degree], ..Camera::NEAR },
        Camera { tilt_rad: [degree, -degree], aside_m: [0.1, -0.05], aspect: -1.0, ..Camera::NEAR },
        Camera { tilt_rad: [3.0 * degree, 2.0 * degree], aside_m: [0.1, 0.1], ..Camera::NEAR },
        Camera { aspect: 1.02, ..Camera::NEAR },
    ];
    for (seed, camera) in (1..).zip(cameras) {
        let report =
            filmed(&Pendulum { spherical: true, split_rad_s: 2.5e-5, uneven: 0.0, noise_px: 0.3, camera }, seed);
        let decay = report.decay.as_ref().unwrap();
        let rate = decay.precession_dph;
        println!(
            "{:?} {rate:?} {:?} {:?} {:?}",
            discovered(&report),
            report.angular_gain,
            decay.rms_deg,
            report.warnings
        );
        // what rises is nearer to the pinhole: large swings look larger, which is what a damping that follows the energy does
        let caused = report.effects.iter().filter(|e| e.origin == Origin::Discovered).map(|e| e.id.as_str());
        assert_eq!(caused.collect::<Vec<_>>(), ["spring-isotropic"], "{:?}", discovered(&report));
        // near one angle nothing tells a scale of y from the precession: the report says how much of it there is
        assert!(report.warnings.iter().any(|w| w.contains("a scale of y that is 1 % larger")), "{:?}", report.warnings);
        assert!((rate.value + RATE_DPH * camera.aspect).abs() < 0.5, "{rate:?}");
    }
}

/// Near one angle a damping that differs between two axes is a precession, and nothing in the film tells it from the Earth's.
#[test]
fn the_interval_of_a_filmed_pendulums_rate_holds_an_uneven_damping() {
    for (seed, uneven) in [(1, 0.05), (2, -0.08), (3, 0.1)] {
        let pendulum = Pendulum { spherical: true, split_rad_s: 2.5e-5, uneven, noise_px: 0.3, camera: Camera::FAR };
        let report = filmed(&pendulum, seed);
        let rate = report.decay.as_ref().unwrap().precession_dph;
        assert!((rate.value + RATE_DPH).abs() > 1.0, "{rate:?}");
        assert!(is_within(-RATE_DPH, &rate), "{rate:?}");
        let said = report.warnings.iter().find(|w| w.contains("near one angle")).unwrap();
        assert!(said.contains("an anisodamping of a tenth of 1/τ"), "{said}");
    }
}

/// Quadrature so small that Airy's precession is below what is claimed is held by the interval, as far as the frequency says
/// that there is such a spring.
#[test]
fn the_interval_of_a_filmed_pendulums_rate_holds_a_precession_that_is_too_small_to_be_named() {
    let pendulum = Pendulum { spherical: true, split_rad_s: 1e-6, uneven: 0.0, noise_px: 1.0, camera: Camera::FAR };
    let report = filmed(&pendulum, 5);
    assert_eq!(discovered(&report), [""; 0]);
    let rate = report.decay.as_ref().unwrap().precession_dph;
    assert!(is_within(-RATE_DPH, &rate), "{rate:?}");
}

#[test]
fn a_bowl_without_airys_precession_is_not_said_to_have_it() {
    let bowl = Pendulum { spherical: false, split_rad_s: 2.5e-5, uneven: 0.0, noise_px: 0.3, camera: Camera::FAR };
    for seed in 1..=12 {
        let report = filmed(&bowl, seed);
        assert_eq!(discovered(&report), [""; 0], "{:?}", report.effects);
        let rate = report.decay.unwrap().precession_dph;
        assert!((rate.value + RATE_DPH).abs() < 0.3, "{rate:?}");
    }
}
