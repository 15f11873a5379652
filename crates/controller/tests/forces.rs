//! From commands to drives: Equation 9, its inverse, and the loop that holds the pattern.

use approx::assert_abs_diff_eq;
use cvg_controller::{ActuationCompensation, Allocation, Heading, OrbitCommands, PiState, RateLoop, Status};
use cvg_model::effects::EffectId;
use cvg_model::{ActuationGains, ControlOutputs, Orbit, Pendulum};
use proptest::prelude::*;

const LIMIT_V: f64 = 5.0;

fn plain() -> Allocation<f64> {
    Allocation::new(None, LIMIT_V).expect("valid")
}

#[test]
fn a_limit_that_is_no_voltage_is_refused() {
    assert!(Allocation::<f64>::new(None, 0.0).is_err());
    assert!(Allocation::<f64>::new(None, f64::NAN).is_err());
}

#[test]
fn drives_that_cannot_push_in_every_direction_are_refused() {
    let outside = [(EffectId::ActuationGainMismatch, [0.0; 4])];
    assert!(ActuationCompensation::<f64>::new(&outside).is_err());
    let readout = [(EffectId::DetectionSkew, [0.0; 4])];
    assert_eq!(ActuationCompensation::<f64>::new(&readout).map_err(|e| e.parameter), Err("detection-skew"));
}

#[test]
fn the_rate_loop_brings_the_pattern_to_its_heading_and_holds_it_against_a_drift() {
    let (b, period) = (1.5, 5e-4);
    let rate = RateLoop::tuned(12.0, 1.0, b, 10.0, period, LIMIT_V).expect("valid");
    let target = Heading::new(1.2).expect("finite");
    let mut state = PiState::default();
    let (mut theta, mut a, drift) = (0.9, 1.0, 0.3);
    for _ in 0..4000 {
        let p = Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope().pendulum();
        let v_qs = rate.step(&mut state, &p, &target).volts;
        theta += (drift - b / a * v_qs) * period;
        a *= 1.0 - period / 2.0;
    }
    assert_abs_diff_eq!(theta, 1.2, epsilon = 1e-6);
}

proptest! {
    #[test]
    fn the_allocation_is_equation_9(v_as in -1.0_f64..1.0, v_qc in -1.0_f64..1.0, theta in -7.0_f64..7.0) {
        let (sin, cos) = theta.sin_cos();
        let drive = plain().step(&OrbitCommands { v_as, v_qc, ..OrbitCommands::default() }, cos, sin);
        let f = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&ControlOutputs { v_as, v_qc }, theta);
        prop_assert_eq!(drive.status, Status::Within);
        for (got, expected) in [
            (drive.volts.x_c, f.x_c), (drive.volts.x_s, f.x_s), (drive.volts.y_c, f.y_c), (drive.volts.y_s, f.y_s),
        ] {
            prop_assert!((got - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn all_four_commands_come_back_along_the_orbit_through_compensated_drives(
        v_as in -1.0_f64..1.0, v_qs in -1.0_f64..1.0, v_qc in -1.0_f64..1.0, v_ac in -1.0_f64..1.0,
        theta in -3.1_f64..3.1, ratio in 0.5_f64..2.0, skew in -0.5_f64..0.5,
    ) {
        let effects = [
            (EffectId::ActuationSkew, [skew, 0.0, 0.0, 0.0]),
            (EffectId::ActuationGainMismatch, [ratio, 0.0, 0.0, 0.0]),
        ];
        let inverse = ActuationCompensation::new(&effects).expect("regular");
        let allocation = Allocation::new(Some(inverse), 100.0).expect("valid");
        let (sin, cos) = theta.sin_cos();
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, cos, sin).volts;
        // the drives act in the library's order: gains, then skew
        let forces = effects.iter().rev().fold(drive, |f, (id, values)| id.actuate(values, f)).along_orbit(theta);
        prop_assert!((forces.a_s - v_as).abs() < 1e-12);
        prop_assert!((forces.q_s - v_qs).abs() < 1e-12);
        prop_assert!((forces.q_c - v_qc).abs() < 1e-12);
        prop_assert!((forces.a_c - v_ac).abs() < 1e-12);
    }

    #[test]
    fn any_bit_pattern_gives_drives_within_the_limit(v in prop::array::uniform4(any::<u64>()), cos: u64, sin: u64) {
        let [v_as, v_qs, v_qc, v_ac] = v.map(f64::from_bits);
        let commands = OrbitCommands { v_as, v_qs, v_qc, v_ac };
        let f = plain().step(&commands, f64::from_bits(cos), f64::from_bits(sin)).volts;
        for volts in [f.x_c, f.x_s, f.y_c, f.y_s] {
            prop_assert!(volts.abs() <= LIMIT_V);
        }
    }

    #[test]
    fn the_rate_loop_is_total(e: u64, r: u64, s: u64, integral: u64) {
        let rate = RateLoop::tuned(12.0, 1.0, 1.0, 10.0, 5e-4, LIMIT_V).expect("valid");
        let [e, r, s, integral] = [e, r, s, integral].map(f64::from_bits);
        let p = Pendulum { e, r, s, ..Pendulum::default() };
        let mut state = PiState { integral };
        let volts = rate.step(&mut state, &p, &Heading::new(0.3).expect("finite")).volts;
        prop_assert!(volts.abs() <= LIMIT_V && state.integral.is_finite());
    }
}
