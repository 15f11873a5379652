//! Equation 4: the pattern angle is the orientation of the ellipse, and has period 180°.

use core::f64::consts::{FRAC_PI_2, PI};

use cvg_estimator::{AngleState, PatternAngle, Period};
use cvg_model::{Envelope, Orbit, Pendulum, Real};
use cvg_tests::domain::{angles, envelope_patterns, envelopes, orbits, patterns, wrapped};
use cvg_tests::scalar::{rounded, rounded_envelope};
use cvg_tests::tolerances::ANGLE;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

/// E/√(R²+S²): by how much rounding in the envelope is magnified in the angle; infinite for a circle.
fn condition<T: Scalar>(p: &Pendulum<T>) -> f64 {
    p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64())
}

for_each_scalar! {
    //= specs/equation-04.md#orientation-of-the-orbit
    //= type=test
    //# The angle of an orbit MUST be its orientation up to a multiple of 180°.
    #[test]
    fn prop_the_angle_is_the_orientation_of_the_orbit(o in orbits()) {
        let (theta, theta64) = rounded::<T>(o.theta);
        let orbit = Orbit { a: rounded(o.a).0, q: rounded(o.q).0, theta, delta: rounded(o.delta).0 };
        let p = orbit.envelope().pendulum();
        prop_assert_near!(wrapped(p.angle().to_f64() - theta64, PI), 0.0, T::tolerance(&ANGLE) * condition(&p));
    }

    //= specs/equation-04.md#arctangent-of-the-paper
    //= type=test
    //# The angle MUST equal half the arctangent of S over R where R is positive.
    /// The paper writes ½ arctan(S/R), which is right for R > 0 only; ½ atan2(S, R) agrees with it there.
    #[test]
    fn prop_the_angle_is_half_the_arctangent_of_s_over_r_where_r_is_positive(e in envelopes()) {
        let p = rounded_envelope::<T>(&e).0.pendulum();
        prop_assume!(p.r > 0.0);
        let ratio = p.s.to_f64() / p.r.to_f64();
        prop_assert_near!(p.angle().to_f64(), 0.5 * ratio.atan(), T::tolerance(&ANGLE));
    }

    //= specs/equation-04.md#rotation-turns-the-angle
    //= type=test
    //# Turning the pattern by an angle MUST change the angle by as much, up to a multiple of 180°.
    #[test]
    fn prop_turning_the_pattern_turns_the_angle(e in envelopes(), turn in angles()) {
        let (e, _) = rounded_envelope::<T>(&e);
        let (turn, turn64) = rounded::<T>(turn);
        let (sin, cos) = Real::sin_cos(turn);
        let p = e.pendulum();
        prop_assume!(condition(&p) < 1e3);
        let turned = e.turned(sin, cos).pendulum().angle();
        let off = wrapped(turned.to_f64() - p.angle().to_f64() - turn64, PI);
        prop_assert_near!(off, 0.0, T::tolerance(&ANGLE) * 2.0 * condition(&p));
    }

    //= specs/equation-04.md#independence-of-amplitude
    //= type=test
    //# Scaling the envelope by a power of two MUST leave the angle as it was, bit for bit.
    #[test]
    fn prop_the_angle_does_not_depend_on_the_amplitude(e in envelopes(), exponent in -20..20_i32) {
        let (e, _) = rounded_envelope::<T>(&e);
        let doubled = (e * T::from_f64(2_f64.powi(exponent))).pendulum().angle();
        prop_assert_eq!(doubled.pattern(), e.pendulum().angle().pattern());
    }

    //= specs/equation-04.md#independence-of-phase
    //= type=test
    //# Shifting the phase of the reference MUST leave the angle as it was.
    #[test]
    fn prop_the_angle_does_not_depend_on_the_phase_of_the_reference(e in envelopes(), phase in angles()) {
        let (e, _) = rounded_envelope::<T>(&e);
        let (sin, cos) = Real::sin_cos(rounded::<T>(phase).0);
        let p = e.pendulum();
        prop_assume!(condition(&p) < 1e3);
        let shifted = (e * cos + e.quarter_ahead() * sin).pendulum().angle();
        let off = wrapped(shifted.to_f64() - p.angle().to_f64(), PI);
        prop_assert_near!(off, 0.0, T::tolerance(&ANGLE) * 2.0 * condition(&p));
    }

    //= specs/equation-04.md#half-a-turn-is-the-same-angle
    //= type=test
    //# The angle of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
    #[test]
    fn prop_half_a_turn_is_the_same_angle_bit_for_bit(e in envelope_patterns::<T>()) {
        prop_assert_eq!(e.pendulum().angle().pattern(), (-e).pendulum().angle().pattern());
    }

    //= specs/equation-04.md#unwrapping
    //= type=test
    //# The unwrapped angle MUST follow the pattern over any number of turns as long as it turns less than 90° from one sample to the next.
    /// Any walk with steps below 90° is followed over any number of turns, in either precision.
    #[test]
    fn prop_the_unwrapped_angle_follows_the_pattern(
        start in -1.5..1.5_f64, steps in proptest::collection::vec(-1.5..1.5_f64, 1..200),
    ) {
        let tracker = PatternAngle::<T>::new(Period::Pattern, T::from_f64(0.0)).expect("a least amplitude of 0");
        let mut state = AngleState::default();
        let mut theta = start;
        for step in [0.0].into_iter().chain(steps) {
            theta += step;
            let e = rounded_envelope::<T>(&Envelope::new(theta.cos(), 0.0, theta.sin(), 0.0)).0;
            let reading = tracker.step(&mut state, &e);
            let off = reading.degrees(Period::Pattern).to_radians() - theta;
            prop_assert_near!(off, 0.0, T::tolerance(&ANGLE) + 1e-15 * theta.abs());
        }
    }

    //= specs/equation-04.md#range
    //= type=test
    //# The angle MUST lie within 90° of zero, or be NaN where R or S is NaN.
    #[test]
    fn prop_the_angle_of_any_bits_is_within_a_quarter_turn_or_nan(r in patterns::<T>(), s in patterns::<T>()) {
        let zero = T::from_f64(0.0);
        let angle = Pendulum { e: zero, q: zero, r, s, l: zero }.angle();
        prop_assert_eq!(angle.is_nan(), r.is_nan() || s.is_nan());
        prop_assert!(angle.is_nan() || angle.magnitude() <= T::from_f64(FRAC_PI_2));
    }
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    /// The rate of the angle of an orbit that turns and decays, against the difference of two angles.
    #[test]
    fn prop_the_precession_is_the_rate_of_the_angle(o in orbits(), turning in -2.0..2.0_f64, decay in -0.5..0.5_f64) {
        prop_assume!(o.q.abs() < 0.8 * o.a);
        let e = o.envelope();
        let rate = Envelope::new(-turning * e.y_c, -turning * e.y_s, turning * e.x_c, turning * e.x_s) + e * decay;
        prop_assert_near!(e.precession(&rate), turning, 1e-12 * condition(&e.pendulum()));
        let step = 1e-5;
        let later = (e + rate * step).pendulum().angle() - (e + rate * -step).pendulum().angle();
        prop_assert_near!(wrapped(later, PI) / (2.0 * step), turning, 1e-7);
    }
}

//= specs/equation-04.md#circle
//= type=test
//# The angle of a circular orbit MUST be zero.
#[test]
fn a_circular_orbit_has_no_orientation_and_gives_zero() {
    assert_eq!(Envelope::new(1.0, 0.0, 0.0, 1.0).pendulum().angle(), 0.0);
    assert_eq!(Envelope::<f64>::zero().pendulum().angle(), 0.0);
}

#[test]
fn the_four_quadrants_of_s_and_r_are_told_apart() {
    for theta_deg in [-80.0, -50.0, -40.0, -10.0, 10.0, 40.0, 50.0, 80.0, 90.0_f64] {
        let orbit = Orbit { a: 1.0, q: 0.0, theta: theta_deg.to_radians(), delta: 0.0 };
        approx::assert_relative_eq!(orbit.envelope().pendulum().angle().to_degrees(), theta_deg, max_relative = 1e-14);
    }
}

#[test]
fn quadrature_does_not_tilt_the_angle() {
    for q in [-0.9, -0.1, 0.0, 0.5] {
        let orbit = Orbit { a: 1.0, q, theta: 0.4, delta: 0.0 };
        approx::assert_relative_eq!(orbit.envelope().pendulum().angle(), 0.4, max_relative = 1e-14);
    }
}

//= specs/equation-04.md#orientation-of-the-orbit
//= type=test
//# The angle of an orbit MUST be its orientation up to a multiple of 180°.
#[test]
fn snapshot_of_the_angle_over_orientation_and_quadrature() {
    let shares = [0.0, 0.3, -0.3, 0.9];
    let mut table = format!("theta_deg{}\n", shares.map(|q| format!("{:>12}", format!("q/a = {q}"))).concat());
    for theta_deg in (-180..=180_i32).step_by(30) {
        let row = shares.map(|q| {
            let orbit = Orbit { a: 1.0, q, theta: f64::from(theta_deg).to_radians(), delta: 0.2 };
            let angle = orbit.envelope().pendulum().angle().to_degrees();
            // the orientation, in whole degrees within a quarter turn: of the two ends of the range, which are one state, the upper
            let expected = f64::from(90 - (90 - theta_deg).rem_euclid(180));
            let off = (angle - expected + 90.0).rem_euclid(180.0) - 90.0;
            approx::assert_abs_diff_eq!(off, 0.0, epsilon = 1e-12);
            assert!(angle.abs() <= 90.0, "{angle}");
            let angle = expected;
            format!("{angle:12.3}").replace("-0.000", " 0.000")
        });
        table += &format!("{theta_deg:9}{}\n", row.concat());
    }
    insta::assert_snapshot!(table);
}
