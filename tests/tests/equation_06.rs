//! Equation 6: unequal detection gains make the measured energy swing with the pattern angle.

use core::f64::consts::{FRAC_PI_2, PI};

use cvg_model::{DetectionGains, Envelope};
use cvg_tests::domain::{angles, detection_gains, sizes};
use cvg_tests::scalar::rounded;
use cvg_tests::tolerances::ENERGY;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

fn gains<T: Scalar>(g: &DetectionGains<f64>) -> DetectionGains<T> {
    DetectionGains { x: T::from_f64(g.x), y: T::from_f64(g.y) }
}

/// max(G_Dx², G_Dy²): what the measured energy is large against.
fn largest<T: Scalar>(g: &DetectionGains<T>) -> f64 {
    g.x.to_f64().powi(2).max(g.y.to_f64().powi(2))
}

for_each_scalar! {
    //= specs/equation-06.md#energy-of-the-measured-orbit
    //= type=test
    //# The measured energy MUST be the energy of the measured envelope.
    #[test]
    fn prop_the_measured_energy_is_that_of_the_measured_line_orbit(
        a in sizes(), theta in angles(), g in detection_gains(),
    ) {
        let ((a, a64), (theta, theta64), g) = (rounded::<T>(a), rounded::<T>(theta), gains::<T>(&g));
        let seen = g.measured_energy(a * a, theta).to_f64();
        // The orbit is measured in double precision: the reference is not to add roundings of its own.
        let g64 = DetectionGains { x: g.x.to_f64(), y: g.y.to_f64() };
        let line = Envelope::new(a64 * theta64.cos(), 0.0, a64 * theta64.sin(), 0.0);
        prop_assert_near!(seen, g64.measure(&line).pendulum().e, T::tolerance(&ENERGY) * largest(&g) * a64 * a64);
    }

    //= specs/equation-06.md#extremes
    //= type=test
    //# The measured energy MUST lie between the energy times the smaller and the energy times the larger squared gain.
    #[test]
    fn prop_the_measured_energy_lies_between_the_squares_of_the_gains(
        a in sizes(), theta in angles(), g in detection_gains(),
    ) {
        let ((a, _), (theta, _), g) = (rounded::<T>(a), rounded::<T>(theta), gains::<T>(&g));
        let energy = a * a;
        let seen = g.measured_energy(energy, theta).to_f64();
        let (x2, y2) = (g.x.to_f64().powi(2), g.y.to_f64().powi(2));
        let slack = T::tolerance(&ENERGY) * largest(&g) * energy.to_f64();
        prop_assert!(seen >= x2.min(y2) * energy.to_f64() - slack);
        prop_assert!(seen <= x2.max(y2) * energy.to_f64() + slack);
    }

    //= specs/equation-06.md#where-the-extremes-are
    //= type=test
    //# The measured energy MUST be the energy times the squared gain of X at 0° and of Y at 90°.
    #[test]
    fn prop_the_extremes_are_at_0_and_90_degrees(a in sizes(), g in detection_gains(), turns in -8..8_i32) {
        let ((a, _), g) = (rounded::<T>(a), gains::<T>(&g));
        let energy = a * a;
        let along = |theta: f64| g.measured_energy(energy, T::from_f64(theta)).to_f64() / energy.to_f64();
        let half_turns = f64::from(turns) * PI;
        prop_assert_near!(along(half_turns), g.x.to_f64().powi(2), T::tolerance(&ENERGY) * largest(&g));
        prop_assert_near!(along(half_turns + FRAC_PI_2), g.y.to_f64().powi(2), T::tolerance(&ENERGY) * largest(&g));
    }

    //= specs/equation-06.md#equal-gains
    //= type=test
    //# Equal gains MUST make the measured energy independent of the angle.
    #[test]
    fn prop_equal_gains_see_the_same_energy_at_every_angle(a in sizes(), theta in angles(), gain in sizes()) {
        let ((a, _), (theta, _), (gain, _)) = (rounded::<T>(a), rounded::<T>(theta), rounded::<T>(gain));
        let seen = DetectionGains { x: gain, y: gain }.measured_energy(a * a, theta);
        prop_assert_eq!(seen, gain * gain * (a * a));
    }

    //= specs/equation-06.md#even-in-the-angle
    //= type=test
    //# The measured energy MUST be the same at opposite angles.
    #[test]
    fn prop_the_measured_energy_is_even_in_the_angle(a in sizes(), theta in angles(), g in detection_gains()) {
        let ((a, _), (theta, _), g) = (rounded::<T>(a), rounded::<T>(theta), gains::<T>(&g));
        prop_assert_eq!(g.measured_energy(a * a, theta), g.measured_energy(a * a, -theta));
    }

    //= specs/equation-06.md#sign-of-a-channel
    //= type=test
    //# Reversing one channel MUST leave the measured energy as it was.
    #[test]
    fn prop_the_sign_of_a_channel_does_not_matter_to_the_energy(e in sizes(), theta in angles(), g in detection_gains()) {
        let ((e, _), (theta, _), g) = (rounded::<T>(e), rounded::<T>(theta), gains::<T>(&g));
        let reversed = DetectionGains { x: g.x, y: -g.y };
        prop_assert_eq!(reversed.measured_energy(e, theta), g.measured_energy(e, theta));
    }

    //= specs/equation-06.md#mean-over-a-turn
    //= type=test
    //# The mean of the measured energy over a turn MUST be the energy times the mean of the squared gains.
    /// The energy loop holds E_d; the mean of what it sees over a turn is the mean of the squared gains.
    #[test]
    fn prop_the_mean_over_a_turn_is_the_mean_of_the_squared_gains(g in detection_gains(), start in angles()) {
        let g = gains::<T>(&g);
        let one = T::from_f64(1.0);
        let mean = (0..8_i32)
            .map(|n| g.measured_energy(one, T::from_f64(start + f64::from(n) * PI / 8.0)).to_f64())
            .sum::<f64>() / 8.0;
        let expected = 0.5 * (g.x.to_f64().powi(2) + g.y.to_f64().powi(2));
        prop_assert_near!(mean, expected, 4.0 * T::tolerance(&ENERGY) * largest(&g));
    }
}

//= specs/equation-06.md#neglected-quadrature
//= type=test
//# The part of the measured energy that the equation neglects MUST be of second order in the semi-minor axis.
#[test]
fn a_line_orbit_with_quadrature_has_more_energy_than_the_equation_says() {
    // Equation 6 is for q = 0; the part that it leaves out is of the order of q², not of q.
    let g = DetectionGains { x: 1.0, y: 1.0132 };
    let off = |q: f64| {
        let orbit = cvg_model::Orbit { a: 1.0, q, theta: 0.6, delta: 0.0 };
        let e = orbit.envelope();
        g.measure(&e).pendulum().e - g.measured_energy(e.pendulum().e, 0.6)
    };
    assert!(off(0.01).abs() < 1e-5, "{}", off(0.01));
    approx::assert_relative_eq!(off(0.02) / off(0.01), 4.0, max_relative = 1e-3);
}

//= specs/equation-06.md#energy-of-the-measured-orbit
//= type=test
//# The measured energy MUST be the energy of the measured envelope.
/// Of a measured line, with which the equation agrees.
#[test]
fn snapshot_of_the_measured_over_the_true_energy() {
    let mismatches = [-1.32, 0.5, 1.32, 5.0];
    let mut table = format!("theta_deg{}\n", mismatches.map(|m| format!("{:>10}", format!("{m:+.2}%"))).concat());
    for theta_deg in (0..=180_i32).step_by(15) {
        let row = mismatches.map(|m| {
            let g = DetectionGains { x: 1.0, y: 1.0 + m / 100.0 };
            let theta = f64::from(theta_deg).to_radians();
            let energy: f64 = g.measure(&Envelope::new(theta.cos(), 0.0, theta.sin(), 0.0)).pendulum().e;
            approx::assert_relative_eq!(g.measured_energy(1.0, theta), energy, max_relative = 1e-13);
            format!("{energy:10.6}")
        });
        table += &format!("{theta_deg:9}{}\n", row.concat());
    }
    insta::assert_snapshot!(table);
}
