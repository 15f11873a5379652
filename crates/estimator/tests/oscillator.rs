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

proptest! {
    #[test]
    fn any_bit_pattern_gives_a_correction_within_the_limit(e: u64, l: u64, held: u64) {
        let p = Pendulum { e: f64::from_bits(e), l: f64::from_bits(l), ..Pendulum::default() };
        let mut state = LockState { detuning_rad_s: f64::from_bits(held) };
        let correction = lock().step(&mut state, &p);
        prop_assert!(correction.rad_s.abs() <= LIMIT_RAD_S && state.detuning_rad_s.abs() <= LIMIT_RAD_S);
    }
}
