//! The oscillator against sine and cosine of the phase that it stands for.

use core::f64::consts::TAU;

use approx::assert_abs_diff_eq;
use cvg_estimator::beat::phase_ahead;
use cvg_estimator::{Oscillator, Phasor};
use cvg_model::{Envelope, Orbit};

const PERIOD_S: f64 = 1e-5;
const FREQUENCY_HZ: f64 = 15_200.0;
/// 0.19 rad a sample
const LIMIT_RAD_S: f64 = 19_000.0;

fn oscillator() -> Oscillator<f64> {
    Oscillator::new(FREQUENCY_HZ, PERIOD_S, LIMIT_RAD_S).expect("valid")
}

fn at(phase: f64, step: f64) -> Phasor<f64> {
    Phasor { cos: phase.cos(), sin: phase.sin(), step_cos: step.cos(), step_sin: step.sin() }
}

fn assert_at(p: &Phasor<f64>, phase: f64, step: f64) {
    let expected = at(phase, step);
    assert_abs_diff_eq!(p.cos, expected.cos, epsilon = 1e-14);
    assert_abs_diff_eq!(p.sin, expected.sin, epsilon = 1e-14);
    assert_abs_diff_eq!(p.step_cos, expected.step_cos, epsilon = 1e-14);
    assert_abs_diff_eq!(p.step_sin, expected.step_sin, epsilon = 1e-14);
}

#[test]
fn a_sample_later_the_phase_is_a_step_ahead() {
    for (phase, step) in [(0.0, 0.7), (0.4, 0.955), (2.1, 1.3), (-1.9, 2.2), (3.0, 0.2)] {
        assert_at(&at(phase, step).advanced(), phase + step, step);
        let mut moving = at(phase, step);
        moving.advance();
        moving.advance();
        assert_at(&moving, phase + 2.0 * step, step);
    }
}

#[test]
fn a_turn_adds_its_angle_to_the_phase_and_leaves_the_step() {
    for (phase, turn) in [(0.3, 0.9), (1.9, -0.4), (-2.5, 2.9), (0.8, 0.8)] {
        assert_at(&at(phase, 0.955).turned(f64::cos(turn), f64::sin(turn)), phase + turn, 0.955);
    }
}

#[test]
fn it_starts_at_phase_zero_with_its_nominal_step() {
    assert_at(&oscillator().start(), 0.0, TAU * FREQUENCY_HZ * PERIOD_S);
    assert_eq!(oscillator().limit_rad_s(), LIMIT_RAD_S);
}

#[test]
fn a_correction_turns_the_step_by_as_much_as_documented_and_no_more_than_the_limit() {
    let nominal = TAU * FREQUENCY_HZ * PERIOD_S;
    let (sin_0, cos_0) = nominal.sin_cos();
    for k in -25..=25 {
        let asked = 1000.0 * f64::from(k);
        let u = asked.clamp(-LIMIT_RAD_S, LIMIT_RAD_S) * PERIOD_S;
        let p = oscillator().tune(&at(0.4, 0.1), asked);
        // the step less the nominal one
        let cos = p.step_cos * cos_0 + p.step_sin * sin_0;
        let sin = p.step_sin * cos_0 - p.step_cos * sin_0;
        // the first neglected terms of the series
        assert_abs_diff_eq!(sin, u.sin(), epsilon = u.abs().powi(7) / 5040.0 + 1e-15);
        assert_abs_diff_eq!(cos, u.cos(), epsilon = u.powi(8) / 40_320.0 + 1e-15);
        assert_abs_diff_eq!(p.cos, 0.4_f64.cos(), epsilon = 1e-15);
        assert_abs_diff_eq!(p.sin, 0.4_f64.sin(), epsilon = 1e-15);
    }
}

#[test]
fn a_correction_that_is_no_number_is_none() {
    assert_at(&oscillator().tune(&at(0.4, 0.1), f64::NAN), 0.4, TAU * FREQUENCY_HZ * PERIOD_S);
}

#[test]
fn a_length_near_one_is_set_right_and_any_other_starts_anew() {
    let tuned = |length: f64| {
        let p = at(0.7, 0.1);
        oscillator().tune(&Phasor { cos: length * p.cos, sin: length * p.sin, ..p }, 0.0)
    };
    let length = |p: &Phasor<f64>| p.cos.hypot(p.sin);
    for error in [-0.13, -0.01, 1e-4, 0.01, 0.11] {
        let p = tuned(1.0 + error);
        // Newton's step leaves 3/2 of the square of the error
        let left = 1.0 - length(&p);
        assert_abs_diff_eq!(left, 1.5 * error * error, epsilon = 0.51 * error.abs().powi(3) + 1e-15);
        assert_abs_diff_eq!(p.sin.atan2(p.cos), 0.7, epsilon = 1e-15);
    }
    // squared lengths below ¾ and above 5/4
    for no_length in [0.0, 0.5, 0.86, 1.12, 2.0, f64::NAN, f64::INFINITY] {
        let p = tuned(no_length);
        assert_eq!((p.cos, p.sin), (1.0, 0.0), "{no_length}");
    }
    // 5/4 and ¾ themselves are near
    for (cos, sin, length_2) in [(1.0, 0.5, 1.25), (0.003_906_25, 0.866_016_594_073_657_2, 0.75)] {
        assert_eq!(cos * cos + sin * sin, length_2);
        let bound = oscillator().tune(&Phasor { cos, sin, step_cos: 1.0, step_sin: 0.0 }, 0.0);
        assert_eq!(bound.cos, cos * (1.5 - 0.5 * length_2), "{length_2}");
    }
}

#[test]
fn the_short_way_is_taken_within_the_limit_and_near_length_one() {
    let p = at(0.7, 0.1);
    let sized = |length: f64| Phasor { cos: length * p.cos, sin: length * p.sin, ..p };
    for correction in [-LIMIT_RAD_S, -300.0, 0.0, 4000.0, LIMIT_RAD_S] {
        for length in [0.87, 1.0, 1.11] {
            let short = oscillator().tune_within(&sized(length), correction);
            assert_eq!(short, Some(oscillator().tune(&sized(length), correction)));
        }
    }
    for (length, correction) in
        [(1.0, 19_001.0), (1.0, -19_001.0), (1.0, f64::NAN), (0.86, 0.0), (1.12, 0.0), (0.0, 0.0), (f64::NAN, 0.0)]
    {
        assert_eq!(oscillator().tune_within(&sized(length), correction), None, "{length} {correction}");
    }
    // beyond the limit the length is set right all the same, and a length far off starts anew at the correction
    let beyond = oscillator().tune(&sized(1.1), 1e9);
    assert_eq!(Some(beyond), oscillator().tune_within(&sized(1.1), LIMIT_RAD_S));
    let anew = oscillator().tune(&sized(3.0), 4000.0);
    let right = oscillator().tune(&p, 4000.0);
    assert_eq!(anew, Phasor { cos: 1.0, sin: 0.0, ..right });
}

#[test]
fn parameters_outside_their_domain_are_refused_by_name() {
    let new = |frequency_hz, period_s, limit_rad_s| {
        Oscillator::<f64>::new(frequency_hz, period_s, limit_rad_s).map(|_| ()).map_err(|e| e.parameter)
    };
    for bad in [0.0, -1e-5, f64::NAN, f64::INFINITY] {
        assert_eq!(new(FREQUENCY_HZ, bad, 1.0), Err("period_s"), "{bad}");
    }
    // 0.2 rad a sample at 1024 Hz
    for bad in [0.0, -1.0, f64::NAN, 204.8, 205.0] {
        assert_eq!(new(200.0, 1.0 / 1024.0, bad), Err("limit_rad_s"), "{bad}");
    }
    assert_eq!(new(200.0, 1.0 / 1024.0, 204.7), Ok(()));
    // 64 samples a period are too many, 2.2 too few, whatever the correction
    for (bad, good) in [(16.0, 16.001), (465.46, 465.45)] {
        assert_eq!(new(bad, 1.0 / 1024.0, 1e-20), Err("frequency_hz"), "{bad}");
        assert_eq!(new(good, 1.0 / 1024.0, 1e-20), Ok(()), "{good}");
    }
    // the correction of 100 rad/s is 15.9 Hz
    for (bad, good) in [(31.8, 32.0), (449.6, 449.5)] {
        assert_eq!(new(bad, 1.0 / 1024.0, 100.0), Err("frequency_hz"), "{bad}");
        assert_eq!(new(good, 1.0 / 1024.0, 100.0), Ok(()), "{good}");
    }
}

#[test]
fn the_phase_of_any_orbit_is_told_within_its_half_turn() {
    for k in -17..=18 {
        let delta = f64::from(k) * 5.0_f64.to_radians();
        for (a, q, theta) in [(1.0, 0.0, 0.0), (0.7, 0.2, 0.5), (1.3, -0.6, 1.2), (2.0, 0.1, -1.4)] {
            let (cos, sin) = phase_ahead(&Orbit { a, q, theta, delta }.envelope());
            assert_abs_diff_eq!(cos, delta.cos(), epsilon = 1e-14);
            // at ±90° the two ends are one state
            let expected = if k == 18 { sin.signum() } else { delta.sin() };
            assert_abs_diff_eq!(sin, expected, epsilon = 1e-14);
        }
    }
}

#[test]
fn a_quarter_period_is_on_the_positive_end() {
    assert_eq!(phase_ahead(&Envelope::new(0.0, 2.0, 0.0, 0.0)), (0.0, 1.0));
    assert_eq!(phase_ahead(&Envelope::new(0.0, 0.0, 0.0, -3.0)), (0.0, 1.0));
}

#[test]
fn a_circle_and_no_number_have_no_phase() {
    for e in [Envelope::zero(), Envelope::new(1.0, 0.0, 0.0, 1.0), Envelope::new(f64::NAN, 0.0, 1.0, 0.0)] {
        assert_eq!(phase_ahead(&e), (1.0, 0.0));
    }
    // too large for its square
    assert_eq!(phase_ahead(&Envelope::new(1e200, 0.0, 0.0, 0.0)), (1.0, 0.0));
}
