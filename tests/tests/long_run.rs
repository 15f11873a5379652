//! One long run at one rate, without ring-downs: written out in closed form and not simulated. What the commands do to
//! the pattern has to be told by the energy balance.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Recording, Role, Run, RunKind};
use cvg_calibration::{Cause, Identification, Options, Refusal, identify};
use cvg_simulator::noise::Noise;
use cvg_tests::bench::{holds, over_floor};

const ANGULAR_GAIN: f64 = 0.78;
const RATIO: f64 = 1.0132;
const TAU_S: f64 = 22.0;
const RATE_DPS: f64 = 500.0;
const READOUT_NOISE_V: f64 = 2e-5;
/// Noise of a logger, which did not act.
const LOGGED_NOISE_V: f64 = 1e-4;

/// tan of the readout's angle error (Equation 7), and d(ln a)/dθ where the loop holds the energy that it measures
/// (Equation 6).
fn readout_error(theta: f64) -> (f64, f64) {
    let (sin2, cos2) = (2.0 * theta).sin_cos();
    let tangent = (RATIO - 1.0) * sin2 / ((RATIO + 1.0) - (RATIO - 1.0) * cos2);
    let measured = theta.cos().powi(2) + (RATIO * theta.sin()).powi(2);
    (tangent, -0.5 * (RATIO * RATIO - 1.0) * sin2 / measured)
}

/// θ̇ = −kΩ + (1/τ + ȧ/a) tan θ_error: the energy command acts along the measured angle.
fn theta_rate(theta: f64) -> f64 {
    let (tangent, growth) = readout_error(theta);
    (-ANGULAR_GAIN * RATE_DPS.to_radians() + tangent / TAU_S) / (1.0 - growth * tangent)
}

/// The run: forces of unit gain replace what the damping takes and move the true energy under the measured one.
fn recorded(duration_s: f64, sample_hz: f64, command_noise_v: f64) -> Recording {
    let mut noise = Noise::new(1, 0);
    let (mut t_s, mut columns) = (Vec::new(), vec![Vec::new(); 6]);
    let mut theta = 0.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
    for i in 0..(duration_s * sample_hz) as usize {
        let (tangent, growth) = readout_error(theta);
        let (x, y) = (theta.cos(), RATIO * theta.sin());
        let a = 1.0 / x.hypot(y);
        let v_as = -a * (1.0 / TAU_S + growth * theta_rate(theta)) * tangent.hypot(1.0);
        t_s.push(i as f64 / sample_hz);
        let sample = [a * x, 0.0, a * y, 0.0, v_as, 0.0];
        for (n, (column, value)) in columns.iter_mut().zip(sample).enumerate() {
            column.push(value + noise.normal(if n < 4 { READOUT_NOISE_V } else { command_noise_v }));
        }
        theta = stepped(theta, 1.0 / sample_hz);
    }
    let rate_dps = Some(vec![RATE_DPS; t_s.len()]);
    let mut columns = columns.into_iter();
    let [xc_v, xs_v, yc_v, ys_v, vas_v, vqc_v] = std::array::from_fn(|_| columns.next());
    Recording { t_s, rate_dps, xc_v, xs_v, yc_v, ys_v, vas_v, vqc_v, ..Recording::default() }
}

/// A step of Runge and Kutta.
fn stepped(theta: f64, h: f64) -> f64 {
    let k1 = theta_rate(theta);
    let k2 = theta_rate(theta + 0.5 * h * k1);
    let k3 = theta_rate(theta + 0.5 * h * k2);
    let k4 = theta_rate(theta + h * k3);
    theta + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
}

fn identified(recording: Recording) -> Identification {
    asked(recording).unwrap()
}

fn asked(recording: Recording) -> Result<Identification, Refusal> {
    let run = Run {
        kind: RunKind::Rotation,
        file: "long.csv".into(),
        settle_s: 0.0,
        role: Role::Fit,
        amplitude: None,
        recording,
    };
    let campaign = Campaign { device: "long".into(), runs: vec![run], ..Campaign::default() };
    identify(campaign, &Options::default())
}

#[test]
fn half_an_hour_is_followed_to_its_end() {
    let (as_a_campaign, thinned) = ((1800.0, 100.0), (600.0, 1000.0));
    for ((duration_s, sample_hz), noise) in
        [(as_a_campaign, LOGGED_NOISE_V), (as_a_campaign, 0.0), (thinned, LOGGED_NOISE_V), (thinned, 0.0)]
    {
        let identified = identified(recorded(duration_s, sample_hz, noise));
        let report = &identified.report;
        let (k, ratio) = (&report.angular_gain, report.detection_gain_ratio.unwrap());
        let force_scale = identified.calibration.hypothesis.force_scale;
        let left = over_floor(&identified);
        println!("{duration_s} s, {noise} V: k {k:?}, ratio {ratio:?}, force scale {force_scale}, {left} floors");
        // what the commands do to the pattern is 3.4e-5 of k; recorded as they were given, they tell to a twentieth how
        // strong they are
        let told = if noise > 0.0 { 1.0 } else { 0.05 };
        assert!((k.value - ANGULAR_GAIN).abs() < 3.5e-5 * told, "{k:?}");
        assert!((force_scale - 1.0).abs() <= told, "{force_scale}");
        assert!((ratio.value - RATIO).abs() < 1e-5, "{ratio:?}");
        assert!(holds(k, ANGULAR_GAIN) && holds(&ratio, RATIO));
        assert!(identified.steps.is_empty());
        // the noise of commands that did not act walks
        assert!(left < if noise > 0.0 { 1.2 } else { 1.05 }, "{left}");
    }
}

#[test]
fn an_angle_that_is_lost_is_no_answer() {
    let mut recording = recorded(200.0, 100.0, 0.0);
    let held_out = recording.t_s.len() * 4 / 5;
    for rate in recording.rate_dps.iter_mut().flatten().skip(held_out) {
        *rate = -*rate;
    }
    let refusal = asked(recording).unwrap_err();
    assert_eq!(refusal.cause, Cause::NoAnswer, "{refusal}");
    assert!(refusal.problem.contains("does not follow the input"), "{refusal}");
}
