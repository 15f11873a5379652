//! The phase-locked loop: it finds the vibration's frequency, and nothing that comes in breaks it.

use approx::assert_abs_diff_eq;
use cvg_estimator::oscillator::LockState;
use cvg_estimator::{PhaseLock, Status};
use cvg_model::{Orbit, Pendulum};
use proptest::prelude::*;

const PERIOD_S: f64 = 5e-4;
const LIMIT_RAD_S: f64 = 600.0;

fn lock() -> PhaseLock<f64> {
    PhaseLock::new(60.0, 1.0, PERIOD_S, LIMIT_RAD_S).expect("valid")
}

#[test]
fn the_integral_becomes_the_detuning_and_the_phase_error_vanishes() {
    let (lock, detuning) = (lock(), 12.0);
    let mut state = LockState::default();
    let mut delta = 0.3;
    for _ in 0..2000 {
        let p = Orbit { a: 0.7, q: 0.01, theta: 0.4, delta }.envelope().pendulum();
        delta += (detuning - lock.step(&mut state, &p).rad_s) * PERIOD_S;
    }
    assert_abs_diff_eq!(delta, 0.0, epsilon = 1e-6);
    assert_abs_diff_eq!(state.detuning_rad_s, detuning, epsilon = 1e-4);
}

#[test]
fn at_rest_the_correction_holds() {
    let mut state = LockState { detuning_rad_s: 5.0 };
    let correction = lock().step(&mut state, &Pendulum::default());
    assert_eq!((correction.rad_s, correction.status), (5.0, Status::Undetermined));
}

#[test]
fn a_loop_that_the_period_cannot_realise_is_refused() {
    assert!(PhaseLock::new(2000.0, 1.0, PERIOD_S, LIMIT_RAD_S).is_err());
    assert!(PhaseLock::new(-1.0, 1.0, PERIOD_S, LIMIT_RAD_S).is_err());
    assert!(PhaseLock::new(60.0, f64::NAN, PERIOD_S, LIMIT_RAD_S).is_err());
    assert!(PhaseLock::new(60.0, 1.0, PERIOD_S, f64::INFINITY).is_err());
}

/// The pendulum variables of energy 1.6 V² with the error −L/(2E).
fn with_error(error: f64) -> Pendulum<f64> {
    Pendulum { e: 1.6, l: -2.0 * 1.6 * error, ..Pendulum::default() }
}

#[test]
fn a_step_is_the_gain_times_the_error_and_the_sum_of_the_errors() {
    // K = 2ζω = 90 1/s, and ω²T = 1.8 1/s a step
    let lock = PhaseLock::new(60.0, 0.75, PERIOD_S, LIMIT_RAD_S).expect("valid");
    let (mut state, mut sum) = (LockState { detuning_rad_s: 7.0 }, 7.0);
    for error in [0.1, -0.25, 0.4, 0.9, -1.0, 1.0] {
        sum += 1.8 * error;
        let correction = lock.step(&mut state, &with_error(error));
        assert_abs_diff_eq!(correction.rad_s, 90.0 * error + sum, epsilon = 1e-12);
        assert_abs_diff_eq!(state.detuning_rad_s, sum, epsilon = 1e-12);
        assert_eq!(correction.status, Status::Valid);
    }
}

#[test]
fn at_the_limit_the_correction_and_its_integral_part_are_the_limit_each() {
    let step = |held: f64, error: f64| {
        let mut state = LockState { detuning_rad_s: held };
        let correction = lock().step(&mut state, &with_error(error));
        assert_eq!(correction.status, Status::Valid);
        (correction.rad_s, state.detuning_rad_s)
    };
    for sign in [1.0, -1.0] {
        // K = 120 1/s, ω²T = 1.8 1/s a step: 590 + 48 is beyond 600
        let (rad_s, detuning) = step(sign * 590.0, sign * 0.4);
        assert_eq!(rad_s, sign * LIMIT_RAD_S);
        assert_abs_diff_eq!(detuning, sign * (590.0 + 1.8 * 0.4), epsilon = 1e-12);
        assert_eq!(step(sign * 599.9, sign * 0.5), (sign * LIMIT_RAD_S, sign * LIMIT_RAD_S));
        // rounding may carry |L| beyond E: a phase up to the error of one, at the limit as within it
        for error in [0.5_f64.next_up(), 1.0] {
            assert_eq!(step(sign * 599.9, sign * error), (sign * LIMIT_RAD_S, sign * LIMIT_RAD_S));
        }
        // a state beyond the limit counts as the limit
        let (rad_s, detuning) = step(sign * 700.0, sign * -0.1);
        assert_abs_diff_eq!(detuning, sign * (600.0 - 0.18), epsilon = 1e-12);
        assert_abs_diff_eq!(rad_s, sign * (600.0 - 0.18 - 12.0), epsilon = 1e-12);
    }
}

#[test]
fn what_holds_no_phase_holds_the_integral_and_says_why() {
    let step = |p: Pendulum<f64>| {
        let mut state = LockState { detuning_rad_s: 5.0 };
        let correction = lock().step(&mut state, &p);
        assert_eq!((correction.rad_s, state.detuning_rad_s), (5.0, 5.0));
        correction.status
    };
    // |L| is E at most: twice that is no measurement, and neither is any at rest
    assert_eq!(step(with_error(1.01)), Status::Undetermined);
    assert_eq!(step(with_error(-1.01)), Status::Undetermined);
    assert_eq!(step(Pendulum { l: 1.0, ..Pendulum::default() }), Status::Undetermined);
    assert_eq!(step(Pendulum { l: f64::NAN, ..with_error(0.1) }), Status::Invalid);
    assert_eq!(step(Pendulum { e: f64::NAN, ..with_error(0.1) }), Status::Invalid);
}

#[test]
fn the_fastest_loop_that_a_period_realises_is_just_below_one() {
    let new = |bandwidth: f64, damping: f64| PhaseLock::new(bandwidth, damping, 1.0 / 2048.0, 1.0).map(|_| ());
    assert!(new(1023.9, 1.0).is_ok() && new(2047.9, 0.5).is_ok());
    assert_eq!(new(1024.0, 1.0).map_err(|e| e.parameter), Err("bandwidth_rad_s"));
    assert_eq!(new(2048.0, 0.5).map_err(|e| e.parameter), Err("bandwidth_rad_s"));
    // what is no number by itself is named by itself
    for bad in [0.0, -0.5, f64::INFINITY, f64::NAN] {
        assert_eq!(new(30.0, bad).map_err(|e| e.parameter), Err("damping"), "{bad}");
        assert_eq!(new(bad, 1.0).map_err(|e| e.parameter), Err("bandwidth_rad_s"), "{bad}");
    }
}

#[test]
fn the_short_way_is_the_loop_within_all_limits_and_nothing_elsewhere() {
    let short = |held: f64, p: &Pendulum<f64>| {
        let mut state = LockState { detuning_rad_s: held };
        (lock().step_within(&mut state, p), state.detuning_rad_s)
    };
    // K = 120 1/s, ω²T = 1.8 1/s a step
    for (held, error) in [(5.0, 0.25), (-7.0, -1.0), (100.0, 1.0)] {
        let (rad_s, detuning) = short(held, &with_error(error));
        assert_abs_diff_eq!(detuning, held + 1.8 * error, epsilon = 1e-12);
        assert_abs_diff_eq!(rad_s.expect("within"), held + 121.8 * error, epsilon = 1e-12);
    }
    // no measurement; the sum beyond the limit; the correction alone; the integral alone
    for (held, error) in [(5.0, 1.01), (5.0, -1.01), (599.0, 0.9), (590.0, 0.4), (-590.0, -0.4), (700.0, -0.9)] {
        assert_eq!(short(held, &with_error(error)), (None, held), "{held} {error}");
    }
    assert_eq!(short(5.0, &Pendulum::default()), (None, 5.0));
}

proptest! {
    #[test]
    fn any_bit_pattern_gives_a_correction_within_the_limit(e: u64, l: u64, held: u64) {
        let p = Pendulum { e: f64::from_bits(e), l: f64::from_bits(l), ..Pendulum::default() };
        let mut state = LockState { detuning_rad_s: f64::from_bits(held) };
        let correction = lock().step(&mut state, &p);
        prop_assert!(correction.rad_s.abs() <= LIMIT_RAD_S && state.detuning_rad_s.abs() <= LIMIT_RAD_S);
    }
}
