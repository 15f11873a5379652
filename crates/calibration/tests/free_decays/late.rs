//! A channel that is sampled late: decays at one rate hardly tell its phase from unequal gains or an oblique axis, so that
//! the intervals hold it; decays at two rates tell it.
//!
//! `CVG_TRIALS` says how many campaigns are drawn of each kind.

use cvg_calibration::report::{Estimate, Report};
use rayon::prelude::*;

use crate::ring::Ring;
use crate::{ANGLES, SPLIT, identified, identified_both_ways, is_within, parameter};

/// 2.5 µs at 15.2 kHz.
const LATE_RAD: f64 = 0.24;

fn short(phase_rad: f64, gain_ratio: f64) -> Ring {
    Ring { rows: 400, row_s: 0.1, phase_rad, gain_ratio, ..Ring::usual() }
}

/// θ̇, 1/τ and Δω, and the ratio of the gains where it is told, with what was set.
fn told(report: &Report, ratio: f64) -> Vec<(f64, Estimate)> {
    let decay = report.decay.as_ref().unwrap();
    let split = parameter(report, "anisoelasticity", "anisoelasticity");
    let mut out =
        vec![(-0.78 * 10.0 * 3600.0, decay.precession_dph), (1.0 / 22.0, decay.damping_per_s), (SPLIT, split)];
    out.extend(report.detection_gain_ratio.map(|e| (ratio, e)));
    out.extend(report.angular_gain.is_told().then_some((0.78, report.angular_gain)));
    out
}

#[test]
fn at_one_rate_the_intervals_hold_a_phase_that_is_seen_and_one_that_is_not() {
    let campaigns = std::env::var("CVG_TRIALS").ok().and_then(|n| n.parse().ok()).unwrap_or(10u64);
    for (phase, ratio) in [(0.0, 1.0), (1e-3, 1.0), (0.01, 1.0), (0.01, 1.0132), (LATE_RAD, 1.0), (LATE_RAD, 1.0132)] {
        let ring = short(phase, ratio);
        let reports: Vec<Report> = (0..campaigns)
            .into_par_iter()
            .map(|seed| identified(&ring, &ANGLES, "rate_dps = 10.0", 100 + seed))
            .collect();
        let all: Vec<(f64, Estimate)> = reports.iter().flat_map(|r| told(r, ratio)).collect();
        let mut held = [0; 3];
        for report in &reports {
            for (count, (set, e)) in held.iter_mut().zip(told(report, ratio)) {
                *count += u64::from(is_within(set, &e));
            }
        }
        let count = all.iter().filter(|(set, e)| is_within(*set, e)).count();
        let widths = told(&reports[0], ratio).iter().map(|(_, e)| e.half_width() / e.value.abs()).collect::<Vec<_>>();
        println!(
            "{phase} rad, {ratio}: {count} of {} in their intervals, {held:?} of {campaigns}, {widths:?}",
            all.len()
        );
        // three binomial deviations at 95 %
        let n = all.len() as f64;
        assert!(count as f64 >= 0.95 * n - 3.0 * (0.95 * 0.05 * n).sqrt(), "{phase} {ratio}: {count} of {n}");
        let fewest = 0.95 * campaigns as f64 - 3.0 * (0.95 * 0.05 * campaigns as f64).sqrt();
        assert!(held.iter().all(|c| *c as f64 >= fewest), "{phase} {ratio}: {held:?} of {campaigns}");
        for report in &reports {
            let is_said = |w: &String| w.contains("decays at another rate would tell");
            assert!(report.warnings.iter().any(is_said), "{:?}", report.warnings);
        }
    }
}

#[test]
fn what_explains_the_decays_as_well_is_named() {
    let report = identified(&short(LATE_RAD, 1.0), &ANGLES, "rate_dps = 10.0", 1);
    let ratio = report.effects.iter().find(|e| e.id == "detection-gain-mismatch").expect("the trace is seen");
    assert!(ratio.confounded_with.iter().any(|id| id == "detection-phase"), "{ratio:?}");
    assert_eq!(ratio.separated_by.as_deref(), Some("decays at another rate"));
    let is_said =
        |w: &String| w.starts_with("detection-phase of 2.") && w.contains("as well as detection-gain-mismatch");
    assert!(report.warnings.iter().any(is_said), "{:?}", report.warnings);
}

#[test]
fn decays_at_two_rates_tell_the_phase_and_their_intervals_are_narrow() {
    let report = identified_both_ways(&short(LATE_RAD, 1.0132), 1);
    let phase = parameter(&report, "detection-phase", "phase_difference");
    assert!((phase.value - LATE_RAD).abs() < 2.0 * phase.half_width() && phase.half_width() < 1e-3, "{phase:?}");
    for (set, e) in [(0.78, report.angular_gain), (1.0132, report.detection_gain_ratio.unwrap())] {
        assert!((e.value - set).abs() < 2.0 * e.half_width() && e.half_width() < 1e-3 * set, "{set}: {e:?}");
    }
    let alike = identified_both_ways(&short(0.0, 1.0), 1);
    assert!(alike.angular_gain.half_width() < 3e-4, "{:?}", alike.angular_gain);
    assert!(alike.warnings.iter().all(|w| !w.contains("decays at another rate")), "{:?}", alike.warnings);
}
