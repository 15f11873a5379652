//! That what the constructors accept is what the proofs assume: a configuration that is accepted and not assumed would be one
//! of which nothing is proved.

use cvg_model::Float;

use super::{oscillator, precession};
use crate::{Oscillator, Precession};

/// Values from next to nothing to far too much, both sides of every bound of the constructors among them.
fn spread(bound: f64) -> impl Iterator<Item = f64> + Clone {
    [1e-9, 1e-3, 0.1, 0.5, 0.999, 1.0, 1.001, 2.0, 10.0].into_iter().map(move |share| share * bound)
}

fn oscillators_are_assumed<T: Float>() {
    let mut accepted = 0;
    for sample_hz in [1.1e3, 4.8e4, 1e5, 2e6, 9e8] {
        for carrier in spread(0.45) {
            for limit in spread(0.2) {
                let period_s = 1.0 / sample_hz;
                let Ok(built) = Oscillator::<T>::new(carrier * sample_hz, period_s, limit * sample_hz) else {
                    continue;
                };
                let assumed = oscillator::PERIODS.into_iter().any(|two_to| oscillator::assumed(&built, two_to));
                assert!(assumed, "{sample_hz} Hz, {carrier} of it, {limit} rad a sample");
                accepted += 1;
            }
        }
    }
    assert!(accepted > 50, "{accepted}");
}

fn trackers_are_assumed<T: Float>() {
    let mut accepted = 0;
    for window_s in [1e-6, 5e-4, 1.0] {
        for smoothing in spread(10.0) {
            for jump in spread(core::f64::consts::FRAC_PI_4) {
                for lead in spread(10.0) {
                    let (smoothing_s, lead_s) = (smoothing * window_s, lead * window_s);
                    for least_v in [1e-160, 1e-40, 1e-22, 1e-3, 1e3, 1e22, 1e160] {
                        let fastest_rad_s = 0.5 * jump / window_s;
                        let Ok(built) =
                            Precession::<T>::new(window_s, smoothing_s, fastest_rad_s, 0.5 * jump, lead_s, least_v)
                        else {
                            continue;
                        };
                        assert!(
                            precession::assumed(&built),
                            "{window_s} s: {smoothing}, {jump} rad, {lead}, {least_v}"
                        );
                        accepted += 1;
                    }
                }
            }
        }
    }
    assert!(accepted > 50, "{accepted}");
}

#[test]
fn the_proofs_are_about_every_oscillator_that_is_accepted() {
    oscillators_are_assumed::<f32>();
    oscillators_are_assumed::<f64>();
}

#[test]
fn the_proofs_are_about_every_tracker_that_is_accepted() {
    trackers_are_assumed::<f32>();
    trackers_are_assumed::<f64>();
}
