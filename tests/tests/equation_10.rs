//! Equation 10: unequal actuation gains, seen along the orbit, turn part of each command onto the other axis.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use cvg_model::actuation::misaligned_forces;
use cvg_model::{ActuationGains, ControlOutputs};
use cvg_tests::domain::{actuation_gains, angles, outputs, sizes};
use cvg_tests::scalar::rounded;
use cvg_tests::tolerances::ORBIT_FORCES;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

fn rounded_outputs<T: Scalar>(v: &ControlOutputs<f64>) -> ControlOutputs<T> {
    ControlOutputs { v_as: T::from_f64(v.v_as), v_qc: T::from_f64(v.v_qc) }
}

fn rounded_gains<T: Scalar>(g: &ActuationGains<f64>) -> ActuationGains<T> {
    ActuationGains { x: T::from_f64(g.x), y: T::from_f64(g.y) }
}

/// max(G_Ax, G_Ay)(|v_as| + |v_qc|): what the forces are large against.
fn scale<T: Scalar>(g: &ActuationGains<T>, v: &ControlOutputs<T>) -> f64 {
    g.x.to_f64().max(g.y.to_f64()) * (v.v_as.to_f64().abs() + v.v_qc.to_f64().abs())
}

for_each_scalar! {
    //= specs/equation-10.md#equation-9-turned
    //= type=test
    //# The forces along the orbit MUST be those of Equation 9 turned back by the angle of the orbit.
    #[test]
    fn prop_it_is_equation_9_seen_along_the_orbit(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, theta) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta).0);
        let (direct, turned) = (g.orbit_forces(&v, theta), g.axis_forces(&v, theta).along_orbit(theta));
        let tolerance = T::tolerance(&ORBIT_FORCES) * scale(&g, &v);
        prop_assert_near!(direct.a_s.to_f64(), turned.a_s.to_f64(), tolerance);
        prop_assert_near!(direct.q_s.to_f64(), turned.q_s.to_f64(), tolerance);
        prop_assert_near!(direct.a_c.to_f64(), turned.a_c.to_f64(), tolerance);
        prop_assert_near!(direct.q_c.to_f64(), turned.q_c.to_f64(), tolerance);
    }

    //= specs/equation-10.md#mean-gain
    //= type=test
    //# The force of a command along its own axis MUST be the command times the gains weighted by the squared direction cosines of that axis.
    /// f_as = v_as (G_Ax cos²θ + G_Ay sin²θ), f_qs = v_as (G_Ay − G_Ax) sin θ cos θ, written without the double angle.
    #[test]
    fn prop_the_energy_force_is_the_mean_gain_along_the_orbit(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, (theta, theta64)) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta));
        let (f, tolerance) = (g.orbit_forces(&v, theta), T::tolerance(&ORBIT_FORCES) * scale(&g, &v));
        let (sin, cos) = theta64.sin_cos();
        let (x, y, v_as, v_qc) = (g.x.to_f64(), g.y.to_f64(), v.v_as.to_f64(), v.v_qc.to_f64());
        prop_assert_near!(f.a_s.to_f64(), v_as * (x * cos * cos + y * sin * sin), tolerance);
        prop_assert_near!(f.q_s.to_f64(), v_as * (y - x) * sin * cos, tolerance);
        prop_assert_near!(f.a_c.to_f64(), v_qc * (y - x) * sin * cos, tolerance);
        prop_assert_near!(f.q_c.to_f64(), v_qc * (x * sin * sin + y * cos * cos), tolerance);
    }

    //= specs/equation-10.md#equal-gains-leave-equation-8
    //= type=test
    //# Equal gains MUST give the forces of Equation 8 without an angle error, exactly.
    #[test]
    fn prop_equal_gains_leave_equation_8_without_an_angle_error(gain in sizes(), v in outputs(), theta in angles()) {
        let (gain, v, theta) = (rounded::<T>(gain).0, rounded_outputs::<T>(&v), rounded::<T>(theta).0);
        let f = ActuationGains { x: gain, y: gain }.orbit_forces(&v, theta);
        let aligned = misaligned_forces(gain, &v, T::from_f64(0.0));
        prop_assert_eq!((f.a_s, f.q_c), (aligned.a_s, aligned.q_c));
        prop_assert_eq!((f.q_s, f.a_c), (0.0, 0.0));
    }

    //= specs/equation-10.md#sum-and-product
    //= type=test
    //# The sum and the product of the principal values of the map from commands to forces MUST be those of the two gains.
    /// The two gains are the principal values of the map from commands to orbit forces, at every angle.
    #[test]
    fn prop_sum_and_product_of_the_gains_do_not_depend_on_the_angle(g in actuation_gains(), theta in angles()) {
        let (g, theta) = (rounded_gains::<T>(&g), rounded::<T>(theta).0);
        let one = T::from_f64(1.0);
        let f = g.orbit_forces(&ControlOutputs { v_as: one, v_qc: one }, theta);
        let (x, y) = (g.x.to_f64(), g.y.to_f64());
        let tolerance = 4.0 * T::tolerance(&ORBIT_FORCES) * x.max(y);
        prop_assert_near!(f.a_s.to_f64() + f.q_c.to_f64(), x + y, tolerance);
        let product = f.a_s.to_f64() * f.q_c.to_f64() - f.q_s.to_f64() * f.a_c.to_f64();
        prop_assert_near!(product, x * y, tolerance * x.max(y));
    }

    //= specs/equation-10.md#between-the-gains
    //= type=test
    //# The magnitude of the energy force MUST lie between the command times the smaller and the command times the larger gain.
    #[test]
    fn prop_the_energy_force_lies_between_the_two_gains(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, theta) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta).0);
        let force = g.orbit_forces(&v, theta).a_s.to_f64().abs();
        let (x, y, command) = (g.x.to_f64(), g.y.to_f64(), v.v_as.to_f64().abs());
        let slack = T::tolerance(&ORBIT_FORCES) * scale(&g, &v);
        prop_assert!(force >= x.min(y) * command - slack && force <= x.max(y) * command + slack);
    }

    //= specs/equation-10.md#exchange-of-the-axes
    //= type=test
    //# Exchanging the gains and taking the angle from 90° MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
    #[test]
    fn prop_exchanging_the_axes_mirrors_the_angle(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, (theta, theta64)) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta));
        let (mirror, mirror64) = rounded::<T>(FRAC_PI_2 - theta64);
        let (f, m) = (g.orbit_forces(&v, theta), ActuationGains { x: g.y, y: g.x }.orbit_forces(&v, mirror));
        let rounding = 2.0 * (mirror64 - FRAC_PI_2 + theta64).abs();
        let tolerance = (2.0 * T::tolerance(&ORBIT_FORCES) + rounding) * scale(&g, &v);
        prop_assert_near!(m.a_s.to_f64(), f.a_s.to_f64(), tolerance);
        prop_assert_near!(m.q_s.to_f64(), -f.q_s.to_f64(), tolerance);
        prop_assert_near!(m.a_c.to_f64(), -f.a_c.to_f64(), tolerance);
        prop_assert_near!(m.q_c.to_f64(), f.q_c.to_f64(), tolerance);
    }
}

//= specs/equation-10.md#where-the-leak-is
//= type=test
//# The force on the wrong axis MUST be largest at 45°, where it is half the difference of the gains times the command, and zero at every multiple of 90°.
#[test]
fn what_leaks_is_largest_at_45_degrees_and_nothing_at_multiples_of_90_degrees() {
    let gains = ActuationGains { x: 1.0113, y: 1.0 };
    let leak = |theta: f64| gains.orbit_forces(&ControlOutputs { v_as: 1.0, v_qc: 0.0 }, theta).q_s;
    approx::assert_relative_eq!(leak(FRAC_PI_4), -0.5 * 0.0113, max_relative = 1e-12);
    for quarters in -4..=4_i32 {
        assert!(leak(f64::from(quarters) * FRAC_PI_2).abs() < 1e-16);
    }
}

//= specs/equation-10.md#where-the-leak-is
//= type=test
//# The force on the wrong axis MUST be largest at 45°, where it is half the difference of the gains times the command, and zero at every multiple of 90°.
#[test]
fn snapshot_of_the_energy_force_and_what_leaks() {
    let mut table = String::from("G_Ax/G_Ay  theta_deg  f_as/(G_Ay v_as)  f_qs/(G_Ay v_as)\n");
    for ratio in [0.98, 1.0113, 1.18] {
        for theta_deg in (0..=180_i32).step_by(45) {
            let gains = ActuationGains { x: ratio, y: 1.0 };
            let theta = f64::from(theta_deg).to_radians();
            let v = ControlOutputs { v_as: 1.0, v_qc: 0.0 };
            let f = gains.axis_forces(&v, theta).along_orbit(theta);
            let short = gains.orbit_forces(&v, theta);
            approx::assert_abs_diff_eq!(short.a_s, f.a_s, epsilon = 1e-15);
            approx::assert_abs_diff_eq!(short.q_s, f.q_s, epsilon = 1e-15);
            let leak = format!("{:18.5}", f.q_s).replace("-0.00000", " 0.00000");
            table += &format!("{ratio:9.4}{theta_deg:11}{:18.5}{leak}\n", f.a_s);
        }
    }
    insta::assert_snapshot!(table);
}
