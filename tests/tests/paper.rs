//! The paper's device, simulated and identified from its files: the numbers that the paper states, and what it could
//! not tell.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::f64::consts::{PI, TAU};

use cvg_calibration::{Identification, Origin};
use cvg_model::Envelope;
use cvg_model::effects::EffectId;
use cvg_simulator::scenario::Run;
use cvg_simulator::{Scenario, Settings};
use cvg_tests::bench::{found, identify, over_floor, plain_paper, scenario};
use cvg_tests::domain::wrapped;

/// What the paper's device is set to.
const DETECTION_RATIO: f64 = 1.0132;
const ACTUATION_RATIO: f64 = 1.0113;
/// "On the order of 4.7 mHz", read as 1/s and without 2π: only so it makes the 10 mdeg that the paper states.
const ANISODAMPING_PER_S: f64 = 4.7e-3;
/// Ours: the paper gives no number for the nonlinearity of its readout. It makes what is left after the declared model.
const KAPPA_PER_V2: f64 = 0.004;

fn paper() -> Identification {
    identify(Scenario::paper().settings().clone()).unwrap()
}

fn parameter(identified: &Identification, effect: &str, name: &str) -> (f64, [f64; 2]) {
    let effect = identified.report.effects.iter().find(|e| e.id == effect).unwrap();
    let parameter = effect.parameters.iter().find(|p| p.name == name).unwrap();
    (parameter.value, parameter.ci95.unwrap())
}

#[test]
fn paper_the_gain_mismatches_are_found() {
    let r = paper().report;
    let (detection, actuation) = (r.detection_gain_ratio.unwrap(), r.actuation_gain_ratio.unwrap());
    println!(
        "detection {:+.1e} ± {:.1e}, actuation {:+.1e} ± {:.1e} from the truth",
        detection.value - DETECTION_RATIO,
        detection.half_width(),
        actuation.value - ACTUATION_RATIO,
        actuation.half_width()
    );
    assert!((detection.value - DETECTION_RATIO).abs() <= 1e-4, "{detection:?}");
    assert!((actuation.value - ACTUATION_RATIO).abs() <= 1e-4, "{actuation:?}");
}

#[test]
fn paper_the_anisodamping_is_found() {
    let (value, interval) = parameter(&paper(), "anisodamping", "anisodamping");
    println!("anisodamping {value:.5e} {interval:?} 1/s");
    assert!((value - ANISODAMPING_PER_S).abs() <= 1e-4, "{value}");
}

/// What the paper compares: the bias as it is measured, and as its own two mismatches leave it. That it is nine times and
/// 0.05° here, where the paper has ten times and 0.06°, is the doing of our κ.
#[test]
fn paper_the_declared_model_reduces_the_bias_nine_times_where_the_paper_says_ten() {
    let h = paper().report.heldout;
    let raw = h.raw.unwrap();
    println!(
        "rms {:.5}° → {:.5}° → {:.5}°, declared peak {:.4}°",
        raw.rms_deg, h.declared.rms_deg, h.discovered.rms_deg, h.declared.peak_deg
    );
    let reduced = raw.rms_deg / h.declared.rms_deg;
    assert!((8.5..10.5).contains(&reduced), "{reduced} times: {raw:?} to {:?}", h.declared);
    assert!((0.03..=0.06).contains(&h.declared.peak_deg), "{:?}", h.declared);
    // and with the cubic readout, of which the paper says nothing, far beyond that
    assert!(raw.rms_deg >= 200.0 * h.discovered.rms_deg, "{raw:?} to {:?}", h.discovered);
}

/// Δ(1/τ)/(4kΩ) at 500 deg/s: 10 mdeg for 4.7e-3 1/s; for 2π · 4.7e-3 1/s it would be 62 mdeg.
#[test]
fn paper_the_anisodamping_in_mhz_is_a_rate_without_two_pi() {
    let k = Scenario::paper().settings().angular_gain;
    let mdeg = |per_s: f64| 1e3 * (per_s / (4.0 * k * 500_f64.to_radians())).to_degrees();
    assert!((9.0..11.0).contains(&mdeg(ANISODAMPING_PER_S)), "{}", mdeg(ANISODAMPING_PER_S));
    assert!((61.0..63.0).contains(&mdeg(TAU * ANISODAMPING_PER_S)), "{}", mdeg(TAU * ANISODAMPING_PER_S));
}

#[test]
fn paper_the_fourth_harmonic_that_is_left_is_the_cubic_readout() {
    let identified = paper();
    assert_eq!(found(&identified, Origin::Discovered), ["detection-cubic"]);
    assert_eq!(found(&identified, Origin::Empirical), [""; 0]);
    let (value, [low, high]) = parameter(&identified, "detection-cubic", "kappa");
    assert!(low <= KAPPA_PER_V2 && KAPPA_PER_V2 <= high, "{value} in [{low}, {high}]");
}

#[test]
fn without_the_cubic_readout_nothing_is_discovered_and_noise_is_left() {
    let identified = identify(plain_paper()).unwrap();
    assert_eq!(found(&identified, Origin::Discovered), [""; 0]);
    assert_eq!(found(&identified, Origin::Empirical), [""; 0]);
    assert!(over_floor(&identified) <= 1.3, "{} times the floor", over_floor(&identified));
}

/// The paper's first run, 500 deg/s, with no effect but its anisodamping, and without noise.
fn anisodamping_alone() -> Settings {
    let mut settings = Settings { noise_v: 0.0, warm_up_s: 3.0, ..Scenario::paper().settings().clone() };
    settings.effects.retain(|e| e.id == EffectId::Anisodamping);
    settings.runs.truncate(1);
    settings
}

/// Amplitude of the second harmonic of the pattern in the angle of a run, beside its best line, rad.
///
/// Over whole turns of the pattern the harmonic, the line and the constant are as good as orthogonal, so that the line
/// is fitted first; a second pass takes the line out of what the harmonic has left, and again.
fn second_harmonic(t: &[f64], theta: &[f64]) -> f64 {
    let n = t.len() as f64;
    let mean = |v: &dyn Fn(usize) -> f64| (0..t.len()).map(v).sum::<f64>() / n;
    let (mut cos2, mut sin2) = (0.0, 0.0);
    for _ in 0..20 {
        let rest = |i: usize| theta[i] - cos2 * (2.0 * theta[i]).cos() - sin2 * (2.0 * theta[i]).sin();
        let (mt, mr) = (mean(&|i| t[i]), mean(&rest));
        let slope = mean(&|i| (t[i] - mt) * (rest(i) - mr)) / mean(&|i| (t[i] - mt).powi(2));
        let bias = |i: usize| theta[i] - mr - slope * (t[i] - mt);
        (cos2, sin2) =
            (2.0 * mean(&|i| bias(i) * (2.0 * theta[i]).cos()), 2.0 * mean(&|i| bias(i) * (2.0 * theta[i]).sin()));
    }
    cos2.hypot(sin2)
}

#[test]
fn paper_anisodamping_alone_makes_a_bias_of_10_mdeg_at_500_dps() {
    let settings = anisodamping_alone();
    let Run::Rotation { rate_dps, settle_s, .. } = settings.runs[0] else { panic!("a rotation") };
    assert_eq!(rate_dps, 500.0);
    let precession = settings.angular_gain * rate_dps.to_radians();
    let simulated = scenario(settings).simulate();
    let column = |name| simulated.runs[0].column(name).unwrap();
    let [t, xc, xs, yc, ys] = ["t_s", "xc_v", "xs_v", "yc_v", "ys_v"].map(column);
    let (mut last, mut turned, mut times, mut angles) = (None, 0.0, Vec::new(), Vec::new());
    for i in (0..t.len()).filter(|&i| t[i] >= settle_s) {
        let angle = Envelope::new(xc[i], xs[i], yc[i], ys[i]).pendulum().angle();
        turned += last.map_or(angle, |last| wrapped(angle - last, PI));
        last = Some(angle);
        times.push(t[i]);
        angles.push(turned);
    }
    // as many samples as whole turns of the pattern take
    let interval = times[1] - times[0];
    let turns = (precession * (times[times.len() - 1] - times[0]) / TAU).floor();
    let whole = (turns * TAU / precession / interval).round();
    let kept = times.iter().take_while(|t| **t < times[0] + whole * interval).count();
    let bias_mdeg = 1e3 * second_harmonic(&times[..kept], &angles[..kept]).to_degrees();
    println!(
        "bias {bias_mdeg:.3} mdeg; Δ(1/τ)/(4kΩ) = {:.3}",
        1e3 * (ANISODAMPING_PER_S / (4.0 * precession)).to_degrees()
    );
    assert!((9.0..=11.0).contains(&bias_mdeg), "{bias_mdeg} mdeg");
}
