//! The energy and quadrature controllers: Equation 3, its tuning rule, and its limits.

use approx::{assert_abs_diff_eq, assert_relative_eq};
use cvg_controller::pi::{energy_control, quadrature_control};
use cvg_controller::{Pi, PiState, Status};
use proptest::prelude::*;

const PERIOD_S: f64 = 5e-4;
const LIMIT_V: f64 = 10.0;

fn pi() -> Pi<f64> {
    Pi::new(7.8, 0.25, PERIOD_S, LIMIT_V).expect("valid")
}

#[test]
fn the_controllers_are_equation_3_with_its_signs() {
    // K = 2, τ = 0.5: 2[e + I]
    assert_eq!(energy_control(2.0, 0.5, 0.1, 0.3), 0.8);
    assert_eq!(quadrature_control(2.0, 0.5, 0.1, 0.3), -0.8);
}

#[test]
fn a_step_is_equation_3_on_the_sum_of_the_errors() {
    let pi = pi();
    let (mut energy, mut quadrature) = (PiState::default(), PiState::default());
    let mut integral = 0.0;
    for k in 0..100 {
        let e = 1e-3 * f64::from(k % 7 - 3);
        integral += e * PERIOD_S;
        let v_as = pi.energy(&mut energy, 1.0 + e, 1.0).volts;
        let v_qc = pi.quadrature(&mut quadrature, e).volts;
        assert_abs_diff_eq!(v_as, energy_control(7.8, 0.25, e, integral), epsilon = 1e-12);
        assert_abs_diff_eq!(v_qc, quadrature_control(7.8, 0.25, e, integral), epsilon = 1e-12);
    }
}

#[test]
fn the_tuning_rule_places_the_poles() {
    let (omega, damping, a, b): (f64, f64, f64, f64) = (6.0, 0.7, 0.8, 1.5);
    let pi = Pi::tuned(omega, damping, a, b, 1e-5, 1e3).expect("valid");
    assert_relative_eq!(pi.gain(), damping * omega / (a * b), max_relative = 1e-15);
    assert_relative_eq!(pi.integration_time_s(), damping / omega, max_relative = 1e-15);
    let mut state = PiState::default();
    // Ė = −2ab v, from a unit of error: the response of s² + 2ζω s + ω² is known
    let (mut e, mut t) = (1.0, 0.0);
    let omega_d = omega * (1.0 - damping * damping).sqrt();
    while t < 1.0 {
        e -= 2.0 * a * b * pi.control(&mut state, e).volts * 1e-5;
        t += 1e-5;
        let (sin, cos) = (omega_d * t).sin_cos();
        let exact = (-damping * omega * t).exp() * (cos - damping * omega / omega_d * sin);
        assert_abs_diff_eq!(e, exact, epsilon = 2e-4);
    }
}

#[test]
fn the_integral_does_not_wind_up_behind_the_limit() {
    let pi = pi();
    let mut state = PiState::default();
    for _ in 0..100_000 {
        let command = pi.control(&mut state, 2.0);
        assert_eq!((command.volts, command.status), (LIMIT_V, Status::Limited));
    }
    // the error gone, the command is back within the limit at once
    assert_eq!(pi.control(&mut state, -0.1).status, Status::Within);
    assert!(pi.control(&mut state, -0.1).volts.abs() < 2.0);
}

#[test]
fn an_error_that_is_no_number_leaves_the_integral_part() {
    let pi = pi();
    let mut state = pi.primed(-1.0);
    let command = pi.control(&mut state, f64::NAN);
    assert_eq!(command.status, Status::Invalid);
    assert_relative_eq!(command.volts, -1.0, max_relative = 1e-12);
    assert_relative_eq!(pi.control(&mut state, 0.0).volts, -1.0, max_relative = 1e-12);
}

#[test]
fn parameters_outside_their_domain_are_refused_by_name() {
    let refused = |r: Result<Pi<f64>, cvg_controller::ConfigError>| r.map_err(|e| e.parameter).err();
    assert_eq!(refused(Pi::new(0.0, 1.0, 1.0, 1.0)), Some("gain"));
    assert_eq!(refused(Pi::new(1.0, f64::NAN, 1.0, 1.0)), Some("integration_time_s"));
    assert_eq!(refused(Pi::new(1.0, 1.0, -1.0, 1.0)), Some("period_s"));
    assert_eq!(refused(Pi::new(1.0, 1.0, 1.0, f64::INFINITY)), Some("limit_v"));
    // each is a number, and what follows from them is not, or nothing
    assert_eq!(refused(Pi::new(1.0, 1.7e308, 1.0, 1.0)), Some("integration_time_s"));
    assert_eq!(refused(Pi::new(1e-300, 1e10, 1.0, 1e10)), Some("2 integration_time_s limit_v/gain"));
    assert_eq!(refused(Pi::new(1e300, 1e-30, 1.0, 1e-30)), Some("2 integration_time_s limit_v/gain"));
    assert_eq!(refused(Pi::tuned(2000.0, 1.0, 1.0, 1.0, PERIOD_S, 1.0)), Some("bandwidth_rad_s"));
}

#[test]
fn an_integral_beyond_its_limit_counts_as_the_limit_and_goes_on_from_there() {
    let pi = pi();
    let most = 2.0 * 0.25 * LIMIT_V / 7.8;
    for (sign, back) in [(1.0, 0.1), (-1.0, 0.1), (1.0, 1.3), (-1.0, 1.3)] {
        let mut state = PiState { integral: sign * 5.0 };
        let command = pi.control(&mut state, sign * -back);
        let integral = sign * (most - back * PERIOD_S);
        assert_abs_diff_eq!(state.integral, integral, epsilon = 1e-15);
        assert_abs_diff_eq!(command.volts, 7.8 * (sign * -back + integral / 0.5), epsilon = 1e-12);
        assert_eq!(command.status, Status::Within);
    }
}

#[test]
fn a_loop_is_realised_below_one_and_not_at_one() {
    let tuned = |bandwidth: f64, damping: f64| {
        Pi::tuned(bandwidth, damping, 0.8, 1.5, 1.0 / 2048.0, 1.0).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!((tuned(1023.9, 1.0), tuned(2047.9, 0.5)), (Ok(()), Ok(())));
    assert_eq!((tuned(1024.0, 1.0), tuned(2048.0, 0.5)), (Err("bandwidth_rad_s"), Err("bandwidth_rad_s")));
}

#[test]
fn at_the_limit_the_integral_stays_in_either_loop_and_either_sense() {
    let pi = pi();
    for sign in [1.0, -1.0] {
        for integral in [0.0, 0.2, -0.2] {
            let (mut energy, mut quadrature) = (PiState { integral }, PiState { integral });
            let v_as = pi.energy(&mut energy, sign * 3.0, 0.0);
            let v_qc = pi.quadrature(&mut quadrature, sign * 3.0);
            assert_eq!((v_as.volts, v_as.status, energy.integral), (sign * LIMIT_V, Status::Limited, integral));
            assert_eq!((v_qc.volts, v_qc.status, quadrature.integral), (-sign * LIMIT_V, Status::Limited, integral));
        }
    }
}

#[test]
fn the_short_way_is_the_law_within_all_limits_and_nothing_elsewhere() {
    let pi = pi();
    let mut state = PiState { integral: 0.3 };
    // 7.8 [e + ∫/2τ] with τ = ¼ s
    let integral = 0.3 + 0.1 * PERIOD_S;
    let volts = pi.energy_within(&mut state, 1.1, 1.0).expect("within");
    assert_abs_diff_eq!(volts, 7.8 * (0.1 + integral / 0.5), epsilon = 1e-12);
    assert_abs_diff_eq!(state.integral, integral, epsilon = 1e-15);
    let volts = pi.quadrature_within(&mut state, -0.1).expect("within");
    assert_abs_diff_eq!(volts, -7.8 * (-0.1 + 0.3 / 0.5), epsilon = 1e-12);
    assert_abs_diff_eq!(state.integral, 0.3, epsilon = 1e-15);
    // too much asked, too much summed though little asked, and no number
    for (integral, e) in [(0.3, 2.0), (0.3, -3.0), (5.0, -9.5), (-5.0, 9.5), (0.3, f64::NAN)] {
        let mut state = PiState { integral };
        assert_eq!((pi.energy_within(&mut state, e, 0.0), state.integral), (None, integral), "{e}");
        assert_eq!((pi.quadrature_within(&mut state, e), state.integral), (None, integral), "{e}");
    }
}

proptest! {
    #[test]
    fn any_bit_pattern_gives_a_command_within_the_limit(e: u64, integral: u64, later: u64) {
        let pi = pi();
        let mut state = PiState { integral: f64::from_bits(integral) };
        for error in [e, later] {
            prop_assert!(pi.energy(&mut state, f64::from_bits(error), 1.0).volts.abs() <= LIMIT_V);
            prop_assert!(pi.quadrature(&mut state, f64::from_bits(error)).volts.abs() <= LIMIT_V);
            prop_assert!(state.integral.is_finite());
        }
    }

    #[test]
    fn any_admissible_configuration_in_single_precision_is_total(
        k: u32, tau: u32, period: u32, limit: u32, e: u32, integral: u32,
    ) {
        let [k, tau, period, limit, e, integral] = [k, tau, period, limit, e, integral].map(f32::from_bits);
        if let Ok(pi) = Pi::new(k, tau, period, limit) {
            let mut state = PiState { integral };
            let command = pi.control(&mut state, e);
            prop_assert!(command.volts.abs() <= limit && state.integral.is_finite());
        }
    }
}

#[test]
fn an_integral_that_is_primed_beyond_the_limit_is_at_its_limit() {
    let pi = pi();
    assert_eq!(pi.primed(2.0 * LIMIT_V), pi.primed(LIMIT_V));
    assert_eq!(pi.primed(-f64::INFINITY), pi.primed(-LIMIT_V));
    assert_eq!(pi.primed(f64::NAN), PiState::default());
    assert!(pi.primed(0.5 * LIMIT_V).integral < pi.primed(LIMIT_V).integral);
}
