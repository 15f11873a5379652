//! Equation 9: the commands of the orbit's axes are projected onto X and Y, each with the gain of its own channel.

use core::f64::consts::{FRAC_PI_2, PI};

use cvg_controller::{ActuationCompensation, Allocation, OrbitCommands, Status};
use cvg_model::effects::{EffectId, Moment};
use cvg_model::{ActuationGains, ControlOutputs, Orbit};
use cvg_tests::domain::{actuation_gains, angles, outputs, ratios, sizes};
use cvg_tests::scalar::rounded;
use cvg_tests::tolerances::{ALLOCATION, AXIS_FORCES};
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
    //= specs/equation-09.md#projection
    //= type=test
    //# Each channel MUST make its gain times the projection of both commands onto its axis.
    #[test]
    fn prop_each_channel_gets_its_share_of_both_commands_times_its_gain(
        g in actuation_gains(), v in outputs(), theta in angles(),
    ) {
        let (g, v, (theta, theta64)) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta));
        let (f, tolerance) = (g.axis_forces(&v, theta), T::tolerance(&AXIS_FORCES) * scale(&g, &v));
        let (v_as, v_qc) = (v.v_as.to_f64(), v.v_qc.to_f64());
        // v_as along the major axis (cos θ, sin θ), v_qc along the minor axis (−sin θ, cos θ)
        let (sin, cos) = theta64.sin_cos();
        prop_assert_near!(f.x_s.to_f64(), g.x.to_f64() * v_as * cos, tolerance);
        prop_assert_near!(f.y_s.to_f64(), g.y.to_f64() * v_as * sin, tolerance);
        prop_assert_near!(f.x_c.to_f64(), g.x.to_f64() * v_qc * -sin, tolerance);
        prop_assert_near!(f.y_c.to_f64(), g.y.to_f64() * v_qc * cos, tolerance);
    }

    //= specs/equation-09.md#half-a-turn-reverses-the-forces
    //= type=test
    //# Turning the orientation by 180° MUST reverse every force.
    #[test]
    fn prop_half_a_turn_of_the_pattern_reverses_every_force(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, (theta, theta64)) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta));
        let (later, later64) = rounded::<T>(theta64 + PI);
        let tolerance = (2.0 * T::tolerance(&AXIS_FORCES) + (later64 - theta64 - PI).abs()) * scale(&g, &v);
        let (here, there) = (g.axis_forces(&v, theta), g.axis_forces(&v, later));
        prop_assert_near!(there.x_c.to_f64(), -here.x_c.to_f64(), tolerance);
        prop_assert_near!(there.x_s.to_f64(), -here.x_s.to_f64(), tolerance);
        prop_assert_near!(there.y_c.to_f64(), -here.y_c.to_f64(), tolerance);
        prop_assert_near!(there.y_s.to_f64(), -here.y_s.to_f64(), tolerance);
    }

    //= specs/equation-09.md#linear
    //= type=test
    //# Doubling the commands MUST double every force exactly.
    #[test]
    fn prop_the_forces_are_linear_in_the_commands(g in actuation_gains(), v in outputs(), theta in angles()) {
        let (g, v, theta) = (rounded_gains::<T>(&g), rounded_outputs::<T>(&v), rounded::<T>(theta).0);
        let two = T::from_f64(2.0);
        let double = g.axis_forces(&ControlOutputs { v_as: two * v.v_as, v_qc: two * v.v_qc }, theta);
        let f = g.axis_forces(&v, theta);
        prop_assert_eq!(
            (double.x_c, double.x_s, double.y_c, double.y_s),
            (two * f.x_c, two * f.x_s, two * f.y_c, two * f.y_s)
        );
    }

    //= specs/equation-09.md#inverse
    //= type=test
    //# The compensated allocation MUST make the forces along the orbit that were commanded.
    #[test]
    fn prop_the_compensated_allocation_makes_what_was_commanded(
        v in proptest::array::uniform4(-1.0..1.0_f64), theta in angles(), ratio in ratios(), skew in -0.5..0.5_f64,
        phase in -0.5..0.5_f64,
    ) {
        let [zero, limit] = [0.0, 1e3].map(T::from_f64);
        // the drives act in the library's order: gains, skew, phase
        let effects = [
            (EffectId::ActuationGainMismatch, [T::from_f64(ratio), zero, zero, zero]),
            (EffectId::ActuationSkew, [T::from_f64(skew), zero, zero, zero]),
            (EffectId::ActuationPhase, [T::from_f64(phase), zero, zero, zero]),
        ];
        let inverse = ActuationCompensation::new(&effects).expect("within bounds");
        let allocation = Allocation::new(Some(inverse), limit).expect("a limit");
        let [v_as, v_qs, v_qc, v_ac] = v.map(T::from_f64);
        let theta = T::from_f64(theta);
        let (sin, cos) = cvg_model::Real::sin_cos(theta);
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, cos, sin);
        prop_assert_eq!(drive.status, Status::Within);
        let f = effects.iter().fold(drive.volts, |f, (id, values)| id.actuate(values, f, &Moment::origin())).along_orbit(theta);
        let tolerance = T::tolerance(&ALLOCATION) * ratio.max(1.0 / ratio);
        for (made, commanded) in [(f.a_s, v_as), (f.q_s, v_qs), (f.q_c, v_qc), (f.a_c, v_ac)] {
            prop_assert_near!(made.to_f64(), commanded.to_f64(), tolerance);
        }
    }
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    //= specs/equation-09.md#energy-command
    //= type=test
    //# With equal gains the energy command MUST change the energy only, and take it out where the command is positive.
    /// With equal gains v_as > 0 takes energy out at every angle and does nothing else: no precession, no quadrature.
    #[test]
    fn prop_with_equal_gains_the_energy_command_moves_only_the_energy(
        a in sizes(), theta in angles(), v_as in -1.0..1.0_f64, gain in sizes(), two_omega in 1e3..1e6_f64,
    ) {
        let e = Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope();
        let f = ActuationGains { x: gain, y: gain }.axis_forces(&ControlOutputs { v_as, v_qc: 0.0 }, theta);
        let rate = e.pendulum_rate(&f.envelope_rate(two_omega));
        let scale = a * gain / two_omega;
        prop_assert_near!(rate.e, -2.0 * a * gain * v_as / two_omega, 1e-13 * scale);
        prop_assert_near!(rate.q, 0.0, 1e-13 * scale);
        prop_assert_near!(e.precession(&f.envelope_rate(two_omega)), 0.0, 1e-13 * gain / (two_omega * a));
    }

    //= specs/equation-09.md#quadrature-command
    //= type=test
    //# With equal gains the quadrature command MUST change the quadrature only, and add to it where the command is positive.
    /// With equal gains v_qc > 0 adds quadrature at every angle and does nothing else.
    #[test]
    fn prop_with_equal_gains_the_quadrature_command_moves_only_the_quadrature(
        a in sizes(), theta in angles(), v_qc in -1.0..1.0_f64, gain in sizes(), two_omega in 1e3..1e6_f64,
    ) {
        let e = Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope();
        let f = ActuationGains { x: gain, y: gain }.axis_forces(&ControlOutputs { v_as: 0.0, v_qc }, theta);
        let rate = e.pendulum_rate(&f.envelope_rate(two_omega));
        let scale = a * gain / two_omega;
        prop_assert_near!(rate.q, 2.0 * a * gain * v_qc / two_omega, 1e-13 * scale);
        prop_assert_near!(rate.e, 0.0, 1e-13 * scale);
        prop_assert_near!(e.precession(&f.envelope_rate(two_omega)), 0.0, 1e-13 * gain / (two_omega * a));
    }
}

#[test]
fn at_0_degrees_the_energy_command_drives_x_and_at_90_degrees_y() {
    let gains = ActuationGains { x: 2.0, y: 3.0 };
    let v = ControlOutputs { v_as: 1.0, v_qc: 0.0 };
    let along_x = gains.axis_forces(&v, 0.0);
    assert_eq!((along_x.x_s, along_x.y_s), (2.0, 0.0));
    let along_y = gains.axis_forces(&v, FRAC_PI_2);
    assert_eq!(along_y.y_s, 3.0);
    assert!(along_y.x_s.abs() < 1e-15);
}

//= specs/equation-09.md#projection
//= type=test
//# Each channel MUST make its gain times the projection of both commands onto its axis.
#[test]
fn snapshot_of_the_forces_around_a_turn() {
    // G_Ax/G_Ay = 1.0113, as the paper identified
    let gains = ActuationGains { x: 1.0113, y: 1.0 };
    let v = ControlOutputs { v_as: -1.0, v_qc: 0.1 };
    let mut table = String::from("theta_deg      f_xc      f_xs      f_yc      f_ys\n");
    for theta_deg in (0..=180_i32).step_by(30) {
        let theta = f64::from(theta_deg).to_radians();
        // the axes are those of an orbit, which has the same forces on it
        let axes = Orbit { a: 1.0, q: 1.0, theta, delta: 0.0 }.envelope();
        let [x, y] = [gains.x, gains.y];
        let shares = [x * v.v_qc * axes.x_s, x * v.v_as * axes.x_c, y * v.v_qc * axes.y_s, y * v.v_as * axes.y_c];
        let f = gains.axis_forces(&v, theta);
        for (force, share) in [f.x_c, f.x_s, f.y_c, f.y_s].into_iter().zip(shares) {
            approx::assert_abs_diff_eq!(force, share, epsilon = 1e-15);
        }
        let row = shares.map(|v| format!("{v:10.5}").replace("-0.00000", " 0.00000"));
        table += &format!("{theta_deg:9}{}\n", row.concat());
    }
    insta::assert_snapshot!(table);
}
