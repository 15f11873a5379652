//! Equation 2: the pendulum variables describe the ellipse and nothing but the ellipse.

use cvg_model::{Envelope, Orbit};
use cvg_tests::domain::{angles, envelope_patterns, envelopes, orbits};
use cvg_tests::scalar::{rounded, rounded_envelope};
use cvg_tests::tolerances::PENDULUM;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

for_each_scalar! {
    //= specs/equation-02.md#axes-and-orientation
    //= type=test
    //# The variables of an orbit MUST be E = a² + q², Q = 2aq, R = (a² − q²) cos 2θ, S = (a² − q²) sin 2θ and L = −(a² − q²) sin 2δ.
    /// E = a² + q², Q = 2aq, R = (a²−q²) cos 2θ, S = (a²−q²) sin 2θ, L = −(a²−q²) sin 2δ.
    #[test]
    fn prop_the_variables_are_the_axes_and_the_orientation_of_the_ellipse(o in orbits()) {
        let ((a, a64), (q, q64)) = (rounded::<T>(o.a), rounded::<T>(o.q));
        let ((theta, theta64), (delta, delta64)) = (rounded::<T>(o.theta), rounded::<T>(o.delta));
        let p = Orbit { a, q, theta, delta }.envelope().pendulum();
        let (sum, difference) = (a64 * a64 + q64 * q64, a64 * a64 - q64 * q64);
        let tolerance = T::tolerance(&PENDULUM) * sum;
        prop_assert_near!(p.e.to_f64(), sum, tolerance);
        prop_assert_near!(p.q.to_f64(), 2.0 * a64 * q64, tolerance);
        prop_assert_near!(p.r.to_f64(), difference * (2.0 * theta64).cos(), tolerance);
        prop_assert_near!(p.s.to_f64(), difference * (2.0 * theta64).sin(), tolerance);
        prop_assert_near!(p.l.to_f64(), -difference * (2.0 * delta64).sin(), tolerance);
    }

    //= specs/equation-02.md#energy-identity
    //= type=test
    //# The square of E MUST equal the sum of the squares of Q, R and S.
    #[test]
    fn prop_energy_squared_is_the_sum_of_the_squares_of_quadrature_and_both_orientations(e in envelopes()) {
        let p = rounded_envelope::<T>(&e).0.pendulum();
        let (e, q, r, s) = (p.e.to_f64(), p.q.to_f64(), p.r.to_f64(), p.s.to_f64());
        prop_assert_near!(q * q + r * r + s * s, e * e, T::tolerance(&PENDULUM) * e * e);
    }

    //= specs/equation-02.md#rotation-of-the-pattern
    //= type=test
    //# Turning the pattern by an angle MUST turn the point (R, S) by twice that angle and leave E and Q as they were.
    #[test]
    fn prop_turning_the_pattern_turns_r_and_s_by_twice_the_angle_and_leaves_energy_and_quadrature(
        e in envelopes(), turn in angles(),
    ) {
        let (e, _) = rounded_envelope::<T>(&e);
        let (turn, turn64) = rounded::<T>(turn);
        let (sin, cos) = cvg_model::Real::sin_cos(turn);
        let (before, after) = (e.pendulum(), e.turned(sin, cos).pendulum());
        let tolerance = T::tolerance(&PENDULUM) * before.e.to_f64();
        let (s2, c2) = (2.0 * turn64).sin_cos();
        prop_assert_near!(after.e.to_f64(), before.e.to_f64(), tolerance);
        prop_assert_near!(after.q.to_f64(), before.q.to_f64(), tolerance);
        prop_assert_near!(after.r.to_f64(), c2 * before.r.to_f64() - s2 * before.s.to_f64(), tolerance);
        prop_assert_near!(after.s.to_f64(), s2 * before.r.to_f64() + c2 * before.s.to_f64(), tolerance);
    }

    //= specs/equation-02.md#phase-of-the-reference
    //= type=test
    //# Shifting the phase of the reference MUST leave E, Q, R and S as they were.
    #[test]
    fn prop_only_l_sees_the_phase_of_the_reference(e in envelopes(), phase in angles()) {
        let (e, _) = rounded_envelope::<T>(&e);
        let (sin, cos) = cvg_model::Real::sin_cos(rounded::<T>(phase).0);
        let (before, after) = (e.pendulum(), (e * cos + e.quarter_ahead() * sin).pendulum());
        let tolerance = T::tolerance(&PENDULUM) * before.e.to_f64();
        prop_assert_near!(after.e.to_f64(), before.e.to_f64(), tolerance);
        prop_assert_near!(after.q.to_f64(), before.q.to_f64(), tolerance);
        prop_assert_near!(after.r.to_f64(), before.r.to_f64(), tolerance);
        prop_assert_near!(after.s.to_f64(), before.s.to_f64(), tolerance);
    }

    //= specs/equation-02.md#rates
    //= type=test
    //# The rates of the variables MUST be the derivatives of the variables along the rate of the envelope.
    #[test]
    fn prop_the_rates_are_the_derivatives(e in envelopes(), rate in envelopes()) {
        let ((e, _), (rate, _)) = (rounded_envelope::<T>(&e), rounded_envelope::<T>(&rate));
        let (ahead, behind, rates) = ((e + rate).pendulum(), (e - rate).pendulum(), e.pendulum_rate(&rate));
        // The central difference of a quadratic form is its derivative, exactly.
        let tolerance = T::tolerance(&PENDULUM) * (ahead.e.to_f64() + behind.e.to_f64());
        let half = |a: T, b: T| 0.5 * (a.to_f64() - b.to_f64());
        prop_assert_near!(rates.e.to_f64(), half(ahead.e, behind.e), tolerance);
        prop_assert_near!(rates.q.to_f64(), half(ahead.q, behind.q), tolerance);
        prop_assert_near!(rates.r.to_f64(), half(ahead.r, behind.r), tolerance);
        prop_assert_near!(rates.s.to_f64(), half(ahead.s, behind.s), tolerance);
        prop_assert_near!(rates.l.to_f64(), half(ahead.l, behind.l), tolerance);
    }

    //= specs/equation-02.md#half-a-turn
    //= type=test
    //# The variables of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
    #[test]
    fn prop_half_a_turn_of_the_pattern_is_the_same_state_bit_for_bit(e in envelope_patterns::<T>()) {
        let (here, opposite) = (e.pendulum(), (-e).pendulum());
        for (a, b) in [
            (here.e, opposite.e), (here.q, opposite.q), (here.r, opposite.r), (here.s, opposite.s), (here.l, opposite.l),
        ] {
            prop_assert_eq!(a.pattern(), b.pattern());
        }
    }

    //= specs/equation-02.md#energy-is-not-negative
    //= type=test
    //# The energy MUST be zero or more, or NaN where a component of the envelope is NaN.
    #[test]
    fn prop_energy_is_never_negative_and_nan_only_where_a_measurement_is(e in envelope_patterns::<T>()) {
        let energy = e.pendulum().e;
        prop_assert_eq!(energy.is_nan(), [e.x_c, e.x_s, e.y_c, e.y_s].into_iter().any(Scalar::is_nan));
        prop_assert!(energy.is_nan() || energy >= 0.0);
    }

    //= specs/equation-02.md#energy-bounds-the-orientation
    //= type=test
    //# The magnitude of R MUST NOT exceed E.
    #[test]
    fn prop_r_never_exceeds_the_energy_not_even_by_rounding(e in envelope_patterns::<T>()) {
        let p = e.pendulum();
        prop_assert!(p.r.is_nan() || (p.r <= p.e && -p.r <= p.e), "{p:?}");
    }
}

//= specs/equation-02.md#sense-of-circulation
//= type=test
//# The quadrature MUST be positive where Y follows X by a quarter of a period.
#[test]
fn the_sense_of_circulation_is_the_sign_of_the_quadrature() {
    // x = cos φ, y = ½ sin φ runs counter-clockwise: y is positive a quarter period after x.
    assert_eq!(Envelope::new(1.0, 0.0, 0.0, 0.5).pendulum().q, 1.0);
    assert_eq!(Envelope::new(1.0, 0.0, 0.0, -0.5).pendulum().q, -1.0);
}

#[test]
fn a_vibration_ahead_of_the_reference_has_negative_l() {
    // x = cos(φ + δ) = cos δ cos φ − sin δ sin φ
    let delta = 0.1_f64;
    let p = Envelope::new(delta.cos(), -delta.sin(), 0.0, 0.0).pendulum();
    approx::assert_relative_eq!(p.l, -(2.0 * delta).sin(), max_relative = 1e-14);
}

//= specs/equation-02.md#axes-and-orientation
//= type=test
//# The variables of an orbit MUST be E = a² + q², Q = 2aq, R = (a² − q²) cos 2θ, S = (a² − q²) sin 2θ and L = −(a² − q²) sin 2δ.
#[test]
fn snapshot_of_the_variables_around_a_turn() {
    let mut table = String::from("theta_deg      E      Q      R      S      L\n");
    for theta_deg in [-90.0, -60.0, -45.0, 0.0, 30.0, 45.0, 90.0, 135.0, 180.0_f64] {
        let (a, q, theta, delta): (f64, f64, f64, f64) = (1.0, 0.2, theta_deg.to_radians(), 0.1);
        let p = Orbit { a, q, theta, delta }.envelope().pendulum();
        // of the axes and the angles of the ellipse
        let along = a * a - q * q;
        let (sin_2, cos_2) = (2.0 * theta).sin_cos();
        let expected = [a * a + q * q, 2.0 * a * q, along * cos_2, along * sin_2, -along * (2.0 * delta).sin()];
        for (variable, expected) in [p.e, p.q, p.r, p.s, p.l].into_iter().zip(expected) {
            approx::assert_abs_diff_eq!(variable, expected, epsilon = 1e-14);
        }
        let row = expected.map(|v| format!("{v:7.3}").replace("-0.000", " 0.000"));
        table += &format!("{theta_deg:9}{}\n", row.concat());
    }
    insta::assert_snapshot!(table);
}
