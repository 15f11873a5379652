//! The ellipse of an envelope: what was put in comes out, and the ends of the ranges are where they are said to be.

use core::f64::consts::{FRAC_PI_2, PI};

use approx::assert_abs_diff_eq;
use cvg_model::{Envelope, Orbit, Pendulum};

#[test]
fn an_orbit_is_found_again_in_its_envelope_at_every_orientation_and_phase() {
    for (a, q) in [(1.0, 0.0), (0.5, 0.2), (2.0, -0.7), (1e-3, 4e-4)] {
        // over the full turn, and over half a period
        for theta in (-17..=17).map(|k| 0.17 * f64::from(k)) {
            for delta in (-8..=8).map(|k| 0.19 * f64::from(k)) {
                let found = Orbit { a, q, theta, delta }.envelope().orbit();
                assert_abs_diff_eq!(found.a, a, epsilon = 1e-14);
                assert_abs_diff_eq!(found.q, q, epsilon = 1e-14);
                assert_abs_diff_eq!(found.theta, theta, epsilon = 1e-12);
                assert_abs_diff_eq!(found.delta, delta, epsilon = 1e-12);
            }
        }
    }
}

#[test]
fn the_envelope_of_an_orbit_is_its_phasors() {
    for (theta, delta) in [(0.3_f64, 0.9_f64), (-2.0, -0.4), (1.4, 0.0)] {
        let (a, q) = (1.5, -0.25);
        // X = e^{iδ}(a cos θ + i q sin θ) = x_c − i x_s, and Y = e^{iδ}(a sin θ − i q cos θ)
        let turned = |re: f64, im: f64| (re * delta.cos() - im * delta.sin(), re * delta.sin() + im * delta.cos());
        let (x_re, x_im) = turned(a * theta.cos(), q * theta.sin());
        let (y_re, y_im) = turned(a * theta.sin(), -q * theta.cos());
        let e = Orbit { a, q, theta, delta }.envelope();
        for (got, expected) in [(e.x_c, x_re), (e.x_s, -x_im), (e.y_c, y_re), (e.y_s, -y_im)] {
            assert_abs_diff_eq!(got, expected, epsilon = 1e-15);
        }
    }
}

#[test]
fn the_ends_of_the_turn_and_of_the_phase() {
    let orbit = |x_c, x_s| Envelope::new(x_c, x_s, 0.0, 0.0).orbit();
    assert_eq!(orbit(1.0, 0.0), Orbit { a: 1.0, q: 0.0, theta: 0.0, delta: 0.0 });
    assert_eq!(orbit(-1.0, 0.0), Orbit { a: 1.0, q: 0.0, theta: PI, delta: 0.0 });
    // a quarter of a period off, the in-phase part tells no sense of the axis
    assert_eq!(orbit(0.0, 1.0), Orbit { a: 1.0, q: 0.0, theta: 0.0, delta: -FRAC_PI_2 });
    assert_eq!(orbit(0.0, -1.0), Orbit { a: 1.0, q: 0.0, theta: 0.0, delta: FRAC_PI_2 });
}

#[test]
fn at_rest_and_on_a_circle_there_is_no_orientation() {
    assert_eq!(Envelope::zero().orbit(), Orbit::<f64>::default());
    let circle = Envelope::new(1.0, 0.0, 0.0, 1.0).orbit();
    assert_eq!((circle.a, circle.q, circle.theta), (1.0, 1.0, 0.0));
}

/// The variables are squares of the envelope: their difference between two envelopes is twice the rate at the middle.
#[test]
fn the_rates_of_the_variables_are_their_differences() {
    let parts = |p: Pendulum<f64>| [p.e, p.q, p.r, p.s, p.l];
    let z = Envelope::new(0.5, -0.25, 0.75, 1.0);
    for d in
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.5, -2.0, 1.5, 0.25]]
    {
        let d = Envelope::new(d[0], d[1], d[2], d[3]);
        let (there, here) = (parts((z + d).pendulum()), parts((z - d).pendulum()));
        let difference: Vec<f64> = there.iter().zip(here).map(|(a, b)| (a - b) / 2.0).collect();
        assert_eq!(parts(z.pendulum_rate(&d))[..], difference[..], "{d:?}");
    }
}

/// An ellipse that is turned as it is precesses at that rate, however round it is.
#[test]
fn an_ellipse_precesses_as_fast_as_it_is_turned() {
    for q in [0.0, 0.3, -0.8] {
        for theta in (-8..=8).map(|k| 0.19 * f64::from(k)) {
            let e = Orbit { a: 1.0, q, theta, delta: 0.4 }.envelope();
            let turning = Envelope::new(-e.y_c, -e.y_s, e.x_c, e.x_s) * 0.7;
            assert_abs_diff_eq!(e.precession(&turning), 0.7, epsilon = 1e-14);
        }
    }
}

/// A line is as thin in single precision as in double: what is left of the energy beside the line has no digits there.
#[test]
fn a_thin_orbit_is_thin_in_single_precision_too() {
    for q in [1e-3_f32, -1e-4, 1e-5] {
        for theta in (-8..=8).map(|k| 0.19 * k as f32) {
            let found = Orbit { a: 1.0, q, theta, delta: 0.4 }.envelope().orbit();
            assert_abs_diff_eq!(found.q, q, epsilon = 4.0 * f32::EPSILON);
        }
    }
}
