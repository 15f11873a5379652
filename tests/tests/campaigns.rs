//! Campaigns that were made elsewhere: `CVG_CAMPAIGNS` names the folder that holds bench-1 to bench-4.
//!
//! The truth, where there is one, is read after the answer.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;

use cvg_calibration::report::Estimate;
use cvg_calibration::{Identification, Origin};
use cvg_tests::bench::{folder, found, identify_folder, over_floor};
use serde_json::json;

/// Detection ratio and actuation ratio: how far they may be from the truth.
const DETECTION_TOLERANCE: f64 = 1.5e-4;
const ACTUATION_TOLERANCE: f64 = 3e-3;
/// Half width of an interval that still says something.
const NARROW: f64 = 1e-3;
/// Held-out rms over the noise floor.
const NEAR_FLOOR: f64 = 1.3;

fn answer(name: &str) -> Option<Identification> {
    let campaign = folder("CVG_CAMPAIGNS")?.join(name);
    Some(identify_folder(&campaign).unwrap_or_else(|e| panic!("{name}: {e}")))
}

fn ratios(identified: &Identification) -> [Estimate; 2] {
    [identified.report.detection_gain_ratio.unwrap(), identified.report.actuation_gain_ratio.unwrap()]
}

fn assert_near_floor(name: &str, identified: &Identification) {
    let ratio = over_floor(identified);
    assert!(ratio <= NEAR_FLOOR, "{name}: the held-out error is {ratio:.3} times the noise floor");
}

fn assert_like_truth(name: &str) {
    let Some(identified) = answer(name) else { return };
    let [detection, actuation] = ratios(&identified);
    assert_near_floor(name, &identified);
    let discovered = found(&identified, Origin::Discovered);
    let empirical = found(&identified, Origin::Empirical);
    // from here on, the truth
    let path = folder("CVG_CAMPAIGNS").unwrap().join(name).join("truth.toml");
    let truth: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
    let number = |key: &str| truth[key].as_float().unwrap();
    let undeclared: Vec<&str> = truth["undeclared"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
    println!(
        "{name}: detection ratio {:+.1e}, actuation ratio {:+.1e} from the truth; found {discovered:?} {empirical:?}",
        detection.value - number("detection_gain_ratio"),
        actuation.value - number("actuation_gain_ratio")
    );
    assert!((detection.value - number("detection_gain_ratio")).abs() <= DETECTION_TOLERANCE, "{name}: {detection:?}");
    assert!((actuation.value - number("actuation_gain_ratio")).abs() <= ACTUATION_TOLERANCE, "{name}: {actuation:?}");
    assert_eq!(json!([discovered, empirical]), json!([undeclared, []]), "{name}");
}

fn assert_sure_of_itself(name: &str) {
    let Some(identified) = answer(name) else { return };
    for estimate in ratios(&identified) {
        let [low, high] = estimate.ci95;
        assert!(low.is_finite() && high.is_finite() && low < high, "{name}: {estimate:?}");
        assert!(estimate.half_width() < NARROW, "{name}: {estimate:?}");
    }
    assert_near_floor(name, &identified);
    let [detection, actuation] = ratios(&identified);
    println!(
        "{name}: detection {:.6} ± {:.1e}, actuation {:.6} ± {:.1e}; found {:?} {:?}; {:.3} × floor",
        detection.value,
        detection.half_width(),
        actuation.value,
        actuation.half_width(),
        found(&identified, Origin::Discovered),
        found(&identified, Origin::Empirical),
        over_floor(&identified)
    );
}

#[test]
fn bench_1_is_identified_as_it_was_set() {
    assert_like_truth("bench-1");
}

#[test]
fn bench_2_is_identified_as_it_was_set() {
    assert_like_truth("bench-2");
}

#[test]
fn bench_3_without_a_truth_gets_narrow_intervals_and_a_held_out_error_at_the_floor() {
    assert_sure_of_itself("bench-3");
}

#[test]
fn bench_4_without_a_truth_gets_narrow_intervals_and_a_held_out_error_at_the_floor() {
    assert_sure_of_itself("bench-4");
}
