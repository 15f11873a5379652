//! Equation 3: the two controllers hold the energy and null the quadrature, with the signs that brake and cancel.

use core::f64::consts::TAU;

use cvg_controller::pi::{Pi, PiState, energy_control, quadrature_control};
use cvg_controller::{Command, Status};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{ActuationGains, ControlOutputs, Envelope, Orbit};
use cvg_tests::domain::{patterns, sizes};
use cvg_tests::scalar::rounded;
use cvg_tests::tolerances::CONTROL;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

/// Controllers that can be built: gain, integration time, sample period and limit over decades.
fn controllers<T: Scalar>() -> impl Strategy<Value = (Pi<T>, [f64; 4])> {
    (sizes(), sizes(), 1e-5..1e-2_f64, sizes()).prop_map(|(gain, time, period, limit)| {
        let [gain, time, period, limit] = [gain, time, period, limit].map(T::from_f64);
        let pi = Pi::new(gain, time, period, limit).expect("all are positive");
        (pi, [gain, time, period, limit].map(cvg_model::Float::to_f64))
    })
}

for_each_scalar! {
    //= specs/equation-03.md#proportional-part
    //= type=test
    //# A step of the error MUST change the output at once by the gain times the step.
    #[test]
    fn prop_the_outputs_are_the_proportional_and_the_integral_part_with_the_signs_of_the_paper(
        gain in sizes(), time in sizes(), error in -1.0..1.0_f64, integral in -1.0..1.0_f64,
    ) {
        let ((gain, gain64), (time, time64)) = (rounded::<T>(gain), rounded::<T>(time));
        let ((error, error64), (integral, integral64)) = (rounded::<T>(error), rounded::<T>(integral));
        let expected = gain64 * error64 + gain64 * integral64 / (2.0 * time64);
        let tolerance = T::tolerance(&CONTROL) * gain64 * (error64.abs() + integral64.abs() / time64);
        prop_assert_near!(energy_control(gain, time, error, integral).to_f64(), expected, tolerance);
        prop_assert_near!(quadrature_control(gain, time, error, integral).to_f64(), -expected, tolerance);
    }

    //= specs/equation-03.md#signs
    //= type=test
    //# The energy output MUST be positive where the measured energy stays above its set value, and the quadrature output MUST be negative where the measured quadrature stays positive.
    #[test]
    fn prop_too_much_energy_brakes_and_positive_quadrature_is_driven_down(
        gain in sizes(), time in sizes(), error in 1e-3..1.0_f64, integral in 0.0..1.0_f64,
    ) {
        let [gain, time, error, integral] = [gain, time, error, integral].map(T::from_f64);
        prop_assert!(energy_control(gain, time, error, integral) > 0.0);
        prop_assert!(quadrature_control(gain, time, error, integral) < 0.0);
    }

    //= specs/equation-03.md#integral-part
    //= type=test
    //# A constant error MUST change the output by the gain times the error times the time over twice the integration time.
    /// Output after `steps` samples of a constant error: K e (1 + t/2τ).
    #[test]
    fn prop_a_constant_error_raises_the_output_along_a_ramp(
        (pi, [gain, time, period, limit]) in controllers::<T>(), share in -1.0..1.0_f64, steps in 1..200_i32,
    ) {
        // so small that neither part reaches the limit
        let ramp = 1.0 + f64::from(steps) * period / (2.0 * time);
        let (error, error64) = rounded::<T>(0.9 * share * limit / (gain * ramp));
        let mut state = PiState::default();
        let mut last = Command { volts: T::from_f64(0.0), status: Status::Within };
        for _ in 0..steps {
            last = pi.energy(&mut state, error, T::from_f64(0.0));
        }
        let tolerance = T::tolerance(&CONTROL) * f64::from(steps) * limit;
        prop_assert_near!(last.volts.to_f64(), gain * error64 * ramp, tolerance);
        prop_assert_eq!(last.status, Status::Within);
    }

    //= specs/equation-03.md#bounded-output
    //= type=test
    //# The output MUST be finite and within its limit for every input.
    #[test]
    fn prop_the_output_is_finite_and_within_its_limit_for_any_bits(
        (pi, [_, _, _, limit]) in controllers::<T>(),
        integral in patterns::<T>(), measured in patterns::<T>(), set in patterns::<T>(),
    ) {
        for quadrature in [false, true] {
            let mut state = PiState { integral };
            let command =
                if quadrature { pi.quadrature(&mut state, measured) } else { pi.energy(&mut state, measured, set) };
            prop_assert!(command.volts.to_f64().abs() <= limit, "{command:?}");
            prop_assert!(state.integral.is_finite(), "{state:?}");
        }
    }

    //= specs/equation-03.md#no-windup
    //= type=test
    //# The integral MUST NOT grow in the direction in which the output is at its limit.
    #[test]
    fn prop_at_the_limit_the_integral_does_not_grow_outward(
        (pi, [gain, time, _, limit]) in controllers::<T>(), integral in patterns::<T>(), measured in patterns::<T>(),
    ) {
        // what the integral is taken as: never more than what commands the limit by itself
        let most = 2.0 * time * limit / gain;
        let before = integral.to_f64();
        let before = if before.is_nan() { 0.0 } else { before.clamp(-most, most) };
        let mut state = PiState { integral };
        let command = pi.energy(&mut state, measured, T::from_f64(0.0));
        if command.status == Status::Limited {
            let outward = command.volts.to_f64().signum();
            let slack = T::tolerance(&CONTROL) * most;
            prop_assert!(state.integral.to_f64() * outward <= before * outward + slack, "{state:?} after {before:e}");
        }
    }

    //= specs/equation-03.md#recovery
    //= type=test
    //# A finite error MUST be answered by the law or by the limit whatever the state was before.
    #[test]
    fn prop_a_finite_error_is_answered_after_any_bits(
        (pi, _) in controllers::<T>(), integral in patterns::<T>(), before in patterns::<T>(), error in patterns::<T>(),
    ) {
        prop_assume!(error.is_finite());
        let mut state = PiState { integral };
        pi.control(&mut state, before);
        prop_assert_ne!(pi.control(&mut state, error).status, Status::Invalid);
    }
}

/// The paper's loop at a held angle: a resonator with losses and a frequency split, both controllers, Equation 9, and a
/// reference that stays on the phase of the vibration.
struct Loop {
    resonator: Resonator<f64>,
    drive: ActuationGains<f64>,
    energy: Pi<f64>,
    quadrature: Pi<f64>,
    set_v2: f64,
    period_s: f64,
}

impl Loop {
    fn new(bandwidth_rad_s: f64, damping: f64, theta_omega: f64) -> Self {
        let (omega, b) = (TAU * 15_200.0, 1.0);
        let period_s = 0.02 / (bandwidth_rad_s * (1.0 + 2.0 * damping));
        let tuned = || Pi::tuned(bandwidth_rad_s, damping, 1.0, b, period_s, 1e3).expect("a realisable loop");
        Self {
            resonator: Resonator {
                omega_rad_s: omega,
                angular_gain: 0.78,
                centrifugal_gain: 0.0,
                damping_per_s: 1.0 / 22.0,
                anisodamping: Anisotropy::none(),
                anisoelasticity: Anisotropy::new(TAU * 0.04, theta_omega),
            },
            drive: ActuationGains { x: 2.0 * omega * b, y: 2.0 * omega * b },
            energy: tuned(),
            quadrature: tuned(),
            set_v2: 1.0,
            period_s,
        }
    }

    /// The envelope after `duration_s`, and the outputs at the end.
    fn run(&self, mut e: Envelope<f64>, duration_s: f64) -> (Envelope<f64>, ControlOutputs<f64>) {
        let (mut energy, mut quadrature) = (PiState::default(), PiState::default());
        let mut v = ControlOutputs::default();
        let mut t_s = 0.0;
        while t_s < duration_s {
            let p = e.pendulum();
            v.v_as = self.energy.energy(&mut energy, p.e, self.set_v2).volts;
            v.v_qc = self.quadrature.quadrature(&mut quadrature, p.q).volts;
            let force = self.drive.axis_forces(&v, p.angle()).envelope_rate(2.0 * self.resonator.omega_rad_s);
            let rate = |e: &Envelope<f64>| self.resonator.envelope_rate(e, 0.0, 0.0) + force;
            let half = e + rate(&e) * (0.5 * self.period_s);
            e = e + rate(&half) * self.period_s;
            e = Orbit { delta: 0.0, ..e.orbit() }.envelope();
            t_s += self.period_s;
        }
        (e, v)
    }
}

proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 48, ..cvg_tests::config() })]

    //= specs/equation-03.md#stable-loop
    //= type=test
    //# The averaged loop of energy and controller MUST be stable for every positive gain and every positive integration time.
    /// Every positive gain and integration time, given here as bandwidth and damping of the loop.
    #[test]
    fn prop_the_closed_loops_settle_at_the_set_energy_and_at_no_quadrature(
        bandwidth in 1.0..50.0_f64, damping in 0.1..5.0_f64, a in 0.7..1.3_f64, q in -0.2..0.2_f64,
        theta in -1.5..1.5_f64, theta_omega in -1.5..1.5_f64,
    ) {
        let controlled = Loop::new(bandwidth, damping, theta_omega);
        let slowest_s = (2.0 * damping + 1.0 / damping) / bandwidth;
        let start = Orbit { a, q: a * q, theta, delta: 0.0 }.envelope();
        let (e, v) = controlled.run(start, 15.0 * slowest_s);
        let p = e.pendulum();
        // after 15 of its slowest times e⁻¹⁵ = 3e-7 of the start is left; the split still turns the pattern under the quadrature
        prop_assert_near!(p.e, 1.0, 1e-6);
        prop_assert_near!(p.q, 0.0, 2e-5);
        // v_as = −2ωa/(τG_A) < 0: it makes up for the damping
        prop_assert_near!(v.v_as, -1.0 / 22.0, 1e-4 / 22.0);
    }
}

#[test]
fn the_quadrature_output_at_rest_is_the_anisoelasticity_of_that_angle() {
    // Q̇ = −Δω sin 2(θ−θ_ω) + 2 v_qc (for a = 1, b = 1): v_qc = ½Δω sin 2(θ−θ_ω)
    let controlled = Loop::new(20.0, 1.0, 0.3);
    let (e, v) = controlled.run(Orbit { a: 1.0, q: 0.0, theta: 0.7, delta: 0.0 }.envelope(), 3.0);
    let expected = 0.5 * TAU * 0.04 * (2.0 * (e.pendulum().angle() - 0.3)).sin();
    approx::assert_abs_diff_eq!(v.v_qc, expected, epsilon = 1e-4);
}

#[test]
fn a_controller_outside_its_domain_is_refused_by_name() {
    for (n, name) in ["gain", "integration_time_s", "period_s", "limit_v"].into_iter().enumerate() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut p = [1.0; 4];
            p[n] = wrong;
            assert_eq!(Pi::new(p[0], p[1], p[2], p[3]).expect_err("outside the domain").parameter, name);
        }
    }
}

//= specs/equation-03.md#no-windup
//= type=test
//# The integral MUST NOT grow in the direction in which the output is at its limit.
/// A controller that is asked for more than its limit and then let go: it leaves the limit at once.
#[test]
fn snapshot_of_a_step_response_into_the_limit() {
    let pi = Pi::new(2.0, 0.05, 0.01, 1.0).expect("inside the domain");
    let mut state = PiState::default();
    let mut table = String::from("  n   error    v_as  status   integral\n");
    // in whole numbers: the errors in tenths and their sum, volts in fiftieths, of which the limit is 50
    let (mut sum, limit) = (0, 50);
    for n in 0..16_i32 {
        let tenths = if (4..10).contains(&n) { 8 } else { 1 };
        let tenths = if n < 12 { tenths } else { -2 };
        // 2 (e + Σ e · 0.01/0.1)
        let asked = 10 * tenths + sum + tenths;
        let limited = asked > limit;
        sum += if limited { 0 } else { tenths };
        let (error, volts, integral) =
            (f64::from(tenths) / 10.0, f64::from(asked.min(limit)) / 50.0, f64::from(sum) / 1000.0);
        let status = if limited { Status::Limited } else { Status::Within };
        let command: Command<f64> = pi.energy(&mut state, 1.0 + error, 1.0);
        assert_eq!(command.status, status, "{n}");
        approx::assert_abs_diff_eq!(command.volts, volts, epsilon = 1e-12);
        approx::assert_abs_diff_eq!(state.integral, integral, epsilon = 1e-12);
        table += &format!("{n:3}{error:8.3}{volts:8.3}  {:8}{integral:9.4}\n", format!("{status:?}"));
    }
    insta::assert_snapshot!(table);
}
