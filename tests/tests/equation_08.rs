//! Equation 8: forces applied at the measured instead of the true orientation leak into the other axis of the orbit.

use core::f64::consts::PI;

use cvg_model::actuation::misaligned_forces;
use cvg_model::resonator::Anisotropy;
use cvg_model::resonator::Resonator;
use cvg_model::{ActuationGains, ControlOutputs, Envelope, Orbit};
use cvg_tests::domain::{angles, outputs, sizes};
use cvg_tests::scalar::rounded;
use cvg_tests::tolerances::MISALIGNED_FORCES;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

fn rounded_outputs<T: Scalar>(v: &ControlOutputs<f64>) -> ControlOutputs<T> {
    ControlOutputs { v_as: T::from_f64(v.v_as), v_qc: T::from_f64(v.v_qc) }
}

for_each_scalar! {
    //= specs/equation-08.md#rotation-of-the-commands
    //= type=test
    //# The forces along the orbit MUST be the commanded forces turned by the angle error.
    #[test]
    fn prop_each_command_is_turned_by_the_angle_error(gain in sizes(), v in outputs(), error in angles()) {
        let ((gain, gain64), v, (error, error64)) = (rounded::<T>(gain), rounded_outputs::<T>(&v), rounded::<T>(error));
        let f = misaligned_forces(gain, &v, error);
        let (energy, quadrature) = (gain64 * v.v_as.to_f64(), gain64 * v.v_qc.to_f64());
        let tolerance = T::tolerance(&MISALIGNED_FORCES) * (energy.abs() + quadrature.abs());
        prop_assert_near!(f.a_s.to_f64(), energy * error64.cos(), tolerance);
        prop_assert_near!(f.q_s.to_f64(), energy * error64.sin(), tolerance);
        prop_assert_near!(f.a_c.to_f64(), -quadrature * error64.sin(), tolerance);
        prop_assert_near!(f.q_c.to_f64(), quadrature * error64.cos(), tolerance);
    }

    //= specs/equation-08.md#isometry
    //= type=test
    //# The size of the forces that one command makes along both axes of the orbit MUST be the gain times the command.
    #[test]
    fn prop_misalignment_turns_a_force_and_keeps_its_size(gain in sizes(), v in outputs(), error in angles()) {
        let ((gain, gain64), v, (error, _)) = (rounded::<T>(gain), rounded_outputs::<T>(&v), rounded::<T>(error));
        let f = misaligned_forces(gain, &v, error);
        let tolerance = T::tolerance(&MISALIGNED_FORCES) * gain64;
        prop_assert_near!(f.a_s.to_f64().hypot(f.q_s.to_f64()), gain64 * v.v_as.to_f64().abs(), tolerance);
        prop_assert_near!(f.a_c.to_f64().hypot(f.q_c.to_f64()), gain64 * v.v_qc.to_f64().abs(), tolerance);
    }

    //= specs/equation-08.md#aligned-forces
    //= type=test
    //# Without an angle error each command MUST act on its own axis only.
    #[test]
    fn prop_aligned_forces_stay_on_their_axes(gain in sizes(), v in outputs()) {
        let (gain, v) = (rounded::<T>(gain).0, rounded_outputs::<T>(&v));
        let f = misaligned_forces(gain, &v, T::from_f64(0.0));
        prop_assert_eq!((f.a_s, f.q_c), (gain * v.v_as, gain * v.v_qc));
        prop_assert_eq!((f.q_s, f.a_c), (0.0, 0.0));
    }

    //= specs/equation-08.md#leak-follows-the-sign-of-the-error
    //= type=test
    //# Reversing the angle error MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
    #[test]
    fn prop_what_leaks_follows_the_sign_of_the_angle_error(gain in sizes(), v in outputs(), error in angles()) {
        let (gain, v, error) = (rounded::<T>(gain).0, rounded_outputs::<T>(&v), rounded::<T>(error).0);
        let (plus, minus) = (misaligned_forces(gain, &v, error), misaligned_forces(gain, &v, -error));
        prop_assert_eq!((plus.a_s, plus.q_c), (minus.a_s, minus.q_c));
        prop_assert_eq!((plus.q_s, plus.a_c), (-minus.q_s, -minus.a_c));
    }

    //= specs/equation-08.md#projection-at-the-measured-angle
    //= type=test
    //# The forces MUST be those of the projection at the measured angle with equal gains, seen along the true orbit.
    /// Equation 9 at the measured angle with equal gains, seen along the true orbit.
    #[test]
    fn prop_it_is_the_projection_at_the_measured_angle_seen_from_the_true_one(
        gain in sizes(), v in outputs(), theta in angles(), error in -0.5..0.5_f64,
    ) {
        let ((gain, gain64), v) = (rounded::<T>(gain), rounded_outputs::<T>(&v));
        let ((theta, theta64), (measured, measured64)) = (rounded::<T>(theta), rounded::<T>(theta + error));
        let seen = ActuationGains { x: gain, y: gain }.axis_forces(&v, measured).along_orbit(theta);
        let expected = misaligned_forces(gain64, &rounded_outputs(&ControlOutputs {
            v_as: v.v_as.to_f64(), v_qc: v.v_qc.to_f64(),
        }), measured64 - theta64);
        let tolerance = 2.0 * T::tolerance(&MISALIGNED_FORCES) * gain64 * (v.v_as.to_f64().abs() + v.v_qc.to_f64().abs());
        prop_assert_near!(seen.a_s.to_f64(), expected.a_s, tolerance);
        prop_assert_near!(seen.q_s.to_f64(), expected.q_s, tolerance);
        prop_assert_near!(seen.a_c.to_f64(), expected.a_c, tolerance);
        prop_assert_near!(seen.q_c.to_f64(), expected.q_c, tolerance);
    }
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    //= specs/equation-08.md#precession-by-a-misaligned-energy-controller
    //= type=test
    //# An energy controller that balances the damping at a wrong orientation MUST precess the pattern at the tangent of the angle error over the decay time.
    /// Where the misaligned energy controller balances damping, it precesses the pattern at +tan(θ_error)/τ.
    #[test]
    fn prop_a_misaligned_energy_controller_precesses_the_pattern(
        theta in angles(), error in -0.5..0.5_f64, amplitude in sizes(), tau_s in 1.0..100.0_f64,
    ) {
        let resonator = Resonator {
            omega_rad_s: 2.0 * PI * 15_200.0,
            angular_gain: 0.78,
            centrifugal_gain: 0.0,
            damping_per_s: 1.0 / tau_s,
            anisodamping: Anisotropy::none(),
            anisoelasticity: Anisotropy::none(),
        };
        let e = Orbit { a: amplitude, q: 0.0, theta, delta: 0.0 }.envelope();
        // v_as such that f_as = −2ωa/τ makes up for ȧ = −a/τ
        let v = ControlOutputs { v_as: -2.0 * resonator.omega_rad_s * amplitude / (tau_s * error.cos()), v_qc: 0.0 };
        let forces = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&v, theta + error);
        let rate = resonator.envelope_rate(&e, 0.0, 0.0) + forces.envelope_rate(2.0 * resonator.omega_rad_s);
        let energy = e.pendulum().e;
        prop_assert_near!(e.pendulum_rate(&rate).e, 0.0, 1e-12 * energy / tau_s);
        prop_assert_near!(e.precession(&rate), error.tan() / tau_s, 1e-12 / tau_s);
    }
}

//= specs/equation-08.md#what-each-force-moves
//= type=test
//# Each force along the orbit MUST move the property of the orbit that is its own: f_as the amplitude, f_qs the orientation, f_qc the quadrature and f_ac the phase, with the signs −, −, + and −.
/// The signs by which each force moves the orbit, for q ≈ 0.
#[test]
fn each_force_moves_its_own_property_of_the_orbit() {
    let (two_omega, a, theta) = (2.0, 3.0, 0.7);
    let e = Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope();
    let moved = |v_as: f64, v_qc: f64, offset: f64| {
        let f = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&ControlOutputs { v_as, v_qc }, theta + offset);
        let small = 1e-6;
        (e + f.envelope_rate(two_omega) * small, small)
    };
    // f_as > 0 takes amplitude out: ȧ = −f_as/2ω
    let (after, dt) = moved(1.0, 0.0, 0.0);
    approx::assert_relative_eq!((after.orbit().a - a) / dt, -0.5, max_relative = 1e-5);
    // f_qs > 0 turns the pattern backwards: θ̇ = −f_qs/(2ωa)
    let (after, dt) = moved(1.0, 0.0, PI / 2.0);
    approx::assert_relative_eq!((after.orbit().theta - theta) / dt, -0.5 / a, max_relative = 1e-5);
    // f_qc > 0 adds quadrature: q̇ = +f_qc/2ω
    let (after, dt) = moved(0.0, 1.0, 0.0);
    approx::assert_relative_eq!(after.orbit().q / dt, 0.5, max_relative = 1e-5);
    // f_ac > 0 holds the phase back: δ̇ = −f_ac/(2ωa); v_qc applied 90° behind is f_ac > 0
    let (after, dt) = moved(0.0, 1.0, -PI / 2.0);
    approx::assert_relative_eq!(after.orbit().delta / dt, -0.5 / a, max_relative = 1e-5);
}

//= specs/equation-08.md#rotation-of-the-commands
//= type=test
//# The forces along the orbit MUST be the commanded forces turned by the angle error.
#[test]
fn snapshot_of_what_leaks_at_the_worst_angle() {
    let mut table = String::from("mismatch_percent  theta_error_deg  f_as/(G_A v_as)  f_qs/(G_A v_as)\n");
    for percent in [-1.32, 0.5, 1.32, 5.0] {
        let g: f64 = 1.0 + percent / 100.0;
        let worst = 0.5 * ((g - 1.0) / (g + 1.0)).acos();
        // at the angle that is measured, seen along the line that is there
        let seen: f64 = Envelope::new(worst.cos(), 0.0, g * worst.sin(), 0.0).pendulum().angle();
        let v = ControlOutputs { v_as: 1.0, v_qc: 0.0 };
        let (error, f) = (seen - worst, ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&v, seen).along_orbit(worst));
        let leak = misaligned_forces(1.0, &v, cvg_model::detection::angle_error(g, worst));
        approx::assert_abs_diff_eq!(leak.a_s, f.a_s, epsilon = 1e-13);
        approx::assert_abs_diff_eq!(leak.q_s, f.q_s, epsilon = 1e-13);
        table += &format!("{percent:16.2}{:17.4}{:17.6}{:17.6}\n", error.to_degrees(), f.a_s, f.q_s);
    }
    insta::assert_snapshot!(table);
}
