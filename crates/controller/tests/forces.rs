//! From commands to drives: Equation 9, its inverse, and the loop that holds the pattern.

use approx::assert_abs_diff_eq;
use cvg_controller::{ActuationCompensation, Allocation, Heading, OrbitCommands, PiState, RateLoop, Status};
use cvg_model::effects::{EffectId, Moment};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Float, Orbit, Pendulum};
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
fn drives_that_saturate_are_no_matrix_to_be_inverted() {
    let new = |inverse_level: f64| {
        let effects = [(EffectId::DriveSaturation, [inverse_level, 0.0, 0.0, 0.0])];
        ActuationCompensation::new(&effects).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!((new(0.0), new(0.1)), (Ok(()), Err("drive-saturation")));
}

#[test]
fn drives_that_follow_a_thermometer_are_undone_by_nobody_who_has_none() {
    let effects = [(EffectId::ActuationGainTemperature, [1e-3, 0.0, 0.0, 0.0])];
    let refused = ActuationCompensation::new(&effects).map(|_| ()).map_err(|e| e.parameter);
    assert_eq!(refused, Err("actuation-gain-temperature"));
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

#[test]
fn parameters_of_the_drives_are_refused_outside_their_bounds_by_name() {
    let new = |ratio: f64, more: f64| {
        let effects = [(EffectId::ActuationGainMismatch, [ratio, more, 0.0, 0.0])];
        ActuationCompensation::new(&effects).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!((new(0.2, 0.0), new(5.0, 0.0)), (Ok(()), Ok(())));
    for bad in [0.19, 5.01, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(bad, 0.0), Err("actuation_gain_ratio"), "{bad}");
    }
    assert_eq!(new(1.0, 0.5), Err("actuation-gain-mismatch"), "it has one parameter");
}

#[test]
fn where_drives_have_a_phase_equation_9_alone_gives_no_answer() {
    let with = |phase: f64| {
        let effects = [
            (EffectId::ActuationGainMismatch, [1.1, 0.0, 0.0, 0.0]),
            (EffectId::ActuationPhase, [phase, 0.0, 0.0, 0.0]),
        ];
        Allocation::new(Some(ActuationCompensation::new(&effects).expect("regular")), LIMIT_V).expect("valid")
    };
    for v_as in [0.0, 1.0, -1.0] {
        let v = ControlOutputs { v_as, v_qc: 0.5 * v_as };
        assert_eq!(plain().axes_within(&v, 0.6, 0.8).is_some(), !plain().turns());
        for (phase, straight) in [(0.0, true), (1e-9, false), (-0.3, false)] {
            assert_eq!(with(phase).turns(), !straight);
            assert_eq!(with(phase).axes_within(&v, 0.6, 0.8).is_some(), straight, "{phase}");
        }
    }
}

#[test]
fn compensated_drives_along_an_axis_are_the_command_over_the_gain_of_that_axis() {
    let effects = [(EffectId::ActuationGainMismatch, [4.0, 0.0, 0.0, 0.0])];
    let allocation = Allocation::new(Some(ActuationCompensation::new(&effects).expect("regular")), LIMIT_V);
    let command = OrbitCommands { v_as: 1.0, v_ac: 0.5, ..OrbitCommands::default() };
    let allocation = allocation.expect("valid");
    // gains of 2 and ½
    let along_x = allocation.step(&command, 1.0, 0.0);
    assert_eq!(
        (along_x.volts, along_x.status),
        (AxisForces { x_c: 0.25, x_s: 0.5, y_c: 0.0, y_s: 0.0 }, Status::Within)
    );
    let along_y = allocation.step(&command, 0.0, 1.0);
    assert_eq!(
        (along_y.volts, along_y.status),
        (AxisForces { x_c: 0.0, x_s: 0.0, y_c: 1.0, y_s: 2.0 }, Status::Within)
    );
}

#[test]
fn a_drive_asked_for_too_much_is_limited_and_for_no_number_is_invalid() {
    let step = |command: OrbitCommands<f64>, cos, sin| {
        let drive = plain().step(&command, cos, sin);
        let f = drive.volts;
        (drive.status, [f.x_c, f.x_s, f.y_c, f.y_s])
    };
    let none = OrbitCommands::default();
    assert_eq!(step(OrbitCommands { v_as: LIMIT_V, ..none }, 1.0, 0.0), (Status::Within, [0.0, LIMIT_V, 0.0, 0.0]));
    assert_eq!(step(OrbitCommands { v_as: 5.1, ..none }, 1.0, 0.0), (Status::Limited, [0.0, LIMIT_V, 0.0, 0.0]));
    assert_eq!(step(OrbitCommands { v_ac: -5.1, ..none }, 0.0, 1.0), (Status::Limited, [0.0, 0.0, -LIMIT_V, 0.0]));
    // one phase, the other, and one channel, the other
    let huge = 1e308;
    for (command, cos, sin) in [
        (OrbitCommands { v_as: f64::NAN, ..none }, 1.0, 0.5),
        (OrbitCommands { v_ac: f64::NAN, ..none }, 1.0, 0.5),
        (OrbitCommands { v_as: huge, v_ac: huge, ..none }, 0.0, 10.0),
        (OrbitCommands { v_as: huge, v_ac: huge, ..none }, 10.0, 0.0),
        (OrbitCommands { v_as: huge, ..none }, 0.0, 10.0),
        (OrbitCommands { v_as: huge, ..none }, 10.0, 0.0),
        (OrbitCommands { v_ac: huge, ..none }, 0.0, 10.0),
        (OrbitCommands { v_ac: huge, ..none }, 10.0, 0.0),
        (OrbitCommands { v_ac: huge, ..none }, 10.0, 10.0),
        (OrbitCommands { v_as: huge, ..none }, 10.0, 10.0),
    ] {
        let (status, volts) = step(command, cos, sin);
        assert_eq!(status, Status::Invalid, "{command:?}");
        assert!(volts.iter().all(|v| v.abs() <= LIMIT_V));
    }
}

/// A line of amplitude `a`, `off` the heading 0.3 by this angle.
fn off(a: f64, off: f64) -> Pendulum<f64> {
    Orbit { a, q: 0.0, theta: 0.3 + off, delta: 0.0 }.envelope().pendulum()
}

#[test]
fn the_rate_loop_is_its_law_scaled_by_the_amplitude() {
    let (omega, damping, b) = (12.0, 0.75, 1.5);
    let rate = RateLoop::tuned(omega, damping, b, 10.0, 5e-4, LIMIT_V).expect("valid");
    let target = Heading::new(0.3).expect("finite");
    let (gain, tau) = (2.0 * damping * omega / b, damping / omega);
    let (mut state, mut integral) = (PiState::default(), 0.0);
    for (a, angle) in [(2.0, 0.01), (0.5, -0.02), (1.5, 0.1)] {
        let error = 0.5 * f64::sin(2.0 * angle);
        integral += error * 5e-4;
        let command = rate.step(&mut state, &off(a, angle), &target);
        assert_abs_diff_eq!(command.volts, a * gain * (error + integral / (2.0 * tau)), epsilon = 1e-12);
        assert_eq!(command.status, Status::Within);
    }
}

#[test]
fn a_hold_is_realised_below_one_and_not_at_one() {
    let tuned = |bandwidth: f64, damping: f64| {
        RateLoop::tuned(bandwidth, damping, 1.5, 10.0, 1.0 / 2048.0, LIMIT_V).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!((tuned(1023.9, 1.0), tuned(2047.9, 0.5)), (Ok(()), Ok(())));
    assert_eq!((tuned(1024.0, 1.0), tuned(2048.0, 0.5)), (Err("bandwidth_rad_s"), Err("bandwidth_rad_s")));
}

/// The angle error is that of the axes: an ellipse is held as a line of its energy.
#[test]
fn an_ellipse_is_held_as_a_line_of_its_energy() {
    let rate = RateLoop::tuned(12.0, 0.75, 1.5, 10.0, 5e-4, LIMIT_V).expect("valid");
    let target = Heading::new(0.3).expect("finite");
    for (a, q) in [(0.8, 0.6), (0.8, -0.6), (0.96, 0.28)] {
        let held = |p: &Pendulum<f64>| rate.step(&mut PiState::default(), p, &target).volts;
        let ellipse = Orbit { a, q, theta: 0.4, delta: 0.0 }.envelope().pendulum();
        assert_abs_diff_eq!(held(&ellipse), held(&off(1.0, 0.1)), epsilon = 1e-12);
    }
}

/// Two effects of a kind act one after the other, and are both undone.
#[test]
fn of_two_skews_of_the_drives_both_are_undone() {
    let skewed = |skews: &[f64]| {
        let effects: Vec<_> = skews.iter().map(|s| (EffectId::ActuationSkew, [*s, 0.0, 0.0, 0.0])).collect();
        let drives = Allocation::new(Some(ActuationCompensation::new(&effects).expect("regular")), LIMIT_V);
        let command = OrbitCommands { v_as: 1.0, v_qs: 0.25, v_qc: -0.5, v_ac: 0.125 };
        drives.expect("valid").step(&command, 0.75, 0.5).volts
    };
    assert_eq!(skewed(&[0.25, 0.5]), skewed(&[0.75]));
    assert_ne!(skewed(&[0.25, 0.5]), skewed(&[0.25]));
}

/// Every heading, a pattern beside it, to so many units of rounding.
fn a_heading_is_approached_from_both_sides<T: Float>(rounding: f64) {
    let t = T::from_f64;
    let rate = RateLoop::tuned(t(12.0), t(1.0), t(1.5), t(100.0), t(5e-4), t(100.0)).expect("valid");
    for k in -36..=36 {
        let heading = f64::from(k) * 5.0_f64.to_radians();
        let target = Heading::new(t(heading)).expect("finite");
        for off in [-0.7, -0.02, 0.0, 0.02, 0.7] {
            let p = Orbit { a: t(1.0), q: t(0.0), theta: t(heading + off), delta: t(0.0) }.envelope().pendulum();
            let mut state = PiState::default();
            let volts = rate.step(&mut state, &p, &target).volts.to_f64();
            // K [ε + ε T/2τ] with K = 2ζω/b and τ = ζ/ω
            let error = 0.5 * f64::sin(2.0 * off);
            assert_abs_diff_eq!(volts, 16.0 * error * (1.0 + 5e-4 * 6.0), epsilon = 1e4 * rounding);
            assert_abs_diff_eq!(state.integral.to_f64(), 5e-4 * error, epsilon = 10.0 * rounding);
        }
    }
}

#[test]
fn a_heading_anywhere_is_approached_from_both_sides_in_either_precision() {
    a_heading_is_approached_from_both_sides::<f64>(1e-16);
    // angles of up to π are rounded by 1e-7, and the error has sixteen times that; the integral a two-thousandth
    a_heading_is_approached_from_both_sides::<f32>(1e-9);
    assert!(Heading::new(f64::INFINITY).is_err() && Heading::new(f64::NAN).is_err());
}

#[test]
fn the_rate_loop_holds_no_more_than_its_largest_rate_and_its_limit() {
    // 3 rad/s at 1.5 1/s per V and unit amplitude: 2 V
    let rate = RateLoop::tuned(12.0, 1.0, 1.5, 3.0, 5e-4, LIMIT_V).expect("valid");
    let target = Heading::new(0.3).expect("finite");
    for (a, volts) in [(1.0, 2.0), (0.5, 1.0), (2.0, 4.0), (2.75, LIMIT_V)] {
        let mut state = PiState::default();
        let command = rate.step(&mut state, &off(a, 0.7), &target);
        assert_abs_diff_eq!(command.volts, volts, epsilon = 1e-12);
        assert_eq!(command.status, Status::Limited);
    }
    let strong = RateLoop::tuned(12.0, 1.0, 1.5, 100.0, 5e-4, LIMIT_V).expect("valid");
    let command = strong.step(&mut PiState::default(), &off(2.0, 0.4), &target);
    assert_eq!((command.volts, command.status), (LIMIT_V, Status::Limited), "by the limit alone");
    for broken in [Pendulum { e: f64::NAN, ..off(1.0, 0.1) }, Pendulum { e: f64::INFINITY, ..off(1.0, 0.1) }] {
        let command = rate.step(&mut PiState::default(), &broken, &target);
        assert_eq!(command.status, Status::Invalid);
    }
    let no_direction = rate.step(&mut PiState::default(), &Pendulum::default(), &target);
    assert_eq!((no_direction.volts, no_direction.status), (0.0, Status::Invalid));
}

#[test]
fn the_short_way_is_taken_where_every_channel_is_within_its_limit() {
    let none = OrbitCommands::default();
    let both =
        |v: OrbitCommands<f64>, cos: f64, sin: f64| (plain().step_within(&v, cos, sin), plain().step(&v, cos, sin));
    let v = OrbitCommands { v_as: 1.0, v_qs: 0.5, v_qc: -0.25, v_ac: 2.0 };
    let (short, whole) = both(v, 0.6, 0.8);
    assert_eq!((short, whole.status), (Some(whole.volts), Status::Within));
    let volts = AxisForces { x_c: LIMIT_V, x_s: 0.0, y_c: 0.0, y_s: 0.0 };
    assert_eq!(plain().step_within(&OrbitCommands { v_ac: LIMIT_V, ..none }, 1.0, 0.0), Some(volts));
    // every channel near its limit, and one beyond
    let near = OrbitCommands { v_as: 4.9, v_qs: -4.9, v_qc: 4.9, v_ac: -4.9 };
    assert!(both(near, 1.0, 0.0).0.is_some());
    for over in [5.1, -5.1] {
        for v in [
            OrbitCommands { v_as: over, ..near },
            OrbitCommands { v_qs: over, ..near },
            OrbitCommands { v_qc: over, ..near },
            OrbitCommands { v_ac: over, ..near },
        ] {
            let (short, whole) = both(v, 1.0, 0.0);
            assert_eq!((short, whole.status), (None, Status::Limited), "{v:?}");
        }
    }
    assert_eq!(both(OrbitCommands { v_as: f64::NAN, ..none }, 1.0, 0.0).0, None);
}

#[test]
fn the_two_loops_alone_are_equation_9_through_the_compensation() {
    let v = ControlOutputs { v_as: 1.0, v_qc: 0.5 };
    let volts = AxisForces { x_c: -0.5 * 0.8, x_s: 0.6, y_c: 0.5 * 0.6, y_s: 0.8 };
    assert_eq!(plain().axes_within(&v, 0.6, 0.8), Some(volts));
    let effects = [(EffectId::ActuationGainMismatch, [4.0, 0.0, 0.0, 0.0])];
    let inverse = ActuationCompensation::new(&effects).expect("regular");
    let uneven = Allocation::new(Some(inverse), LIMIT_V).expect("valid");
    let halved = AxisForces { x_c: 0.5 * volts.x_c, x_s: 0.5 * volts.x_s, y_c: 2.0 * volts.y_c, y_s: 2.0 * volts.y_s };
    assert_eq!(uneven.axes_within(&v, 0.6, 0.8), Some(halved));
    for v in [7.0, -7.0, f64::NAN] {
        // 5.6 V along Y, and against X
        assert_eq!(plain().axes_within(&ControlOutputs { v_as: v, v_qc: 0.0 }, 0.6, 0.8), None, "{v}");
        assert_eq!(plain().axes_within(&ControlOutputs { v_as: 0.0, v_qc: v }, 0.6, 0.8), None, "{v}");
    }
}

/// Numbers at which something ends, of both signs.
fn edges<T: Float>() -> Vec<T> {
    let limit = LIMIT_V;
    let all = [
        0.0,
        5e-324,
        1e-45,
        1e-39,
        1e-20,
        0.5,
        0.6,
        0.8,
        1.0,
        limit,
        limit.next_up(),
        limit.next_down(),
        6.25,
        1e30,
        1e300,
    ];
    let more = [f64::INFINITY, f64::NAN, limit + 1e-6, limit - 1e-6];
    all.into_iter().chain(more).flat_map(|v| [T::from_f64(v), T::from_f64(-v)]).collect()
}

/// The way of the two loops alone is that of all four commands where the other two are none: to the last bit, but for the sign
/// of zero, and None where that is limited or invalid, or drives have a phase.
fn the_short_way_is_the_whole_way<T: Float + Default>() {
    let inverse = |phase: f64| {
        let effects = [
            (EffectId::ActuationGainMismatch, [1.3, 0.0, 0.0, 0.0].map(T::from_f64)),
            (EffectId::ActuationSkew, [0.2, 0.0, 0.0, 0.0].map(T::from_f64)),
            (EffectId::ActuationPhase, [phase, 0.0, 0.0, 0.0].map(T::from_f64)),
        ];
        ActuationCompensation::new(&effects).expect("regular")
    };
    let edges = edges::<T>();
    let mut within = 0;
    for compensation in [None, Some(inverse(0.0)), Some(inverse(-0.3))] {
        let allocation = Allocation::new(compensation, T::from_f64(LIMIT_V)).expect("valid");
        for &v_as in &edges {
            for &v_qc in &edges {
                for &cos in &edges {
                    for &sin in &edges {
                        let all = OrbitCommands { v_as, v_qc, ..OrbitCommands::default() };
                        let whole = allocation.step(&all, cos, sin);
                        let expected = (whole.status == Status::Within).then_some(whole.volts);
                        let short = allocation.axes_within(&ControlOutputs { v_as, v_qc }, cos, sin);
                        let of_two = if allocation.turns() { None } else { expected };
                        let same = short == of_two && allocation.step_within(&all, cos, sin) == expected;
                        assert!(same, "{v_as:?} {v_qc:?} {cos:?} {sin:?}: {short:?} and not {whole:?}");
                        within += usize::from(short.is_some());
                    }
                }
            }
        }
    }
    assert!(within > 10_000, "{within}");
}

#[test]
fn the_two_loops_alone_are_the_whole_way_at_every_edge() {
    the_short_way_is_the_whole_way::<f32>();
    the_short_way_is_the_whole_way::<f64>();
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
        theta in -3.1_f64..3.1, ratio in 0.5_f64..2.0, skew in -0.5_f64..0.5, phase in -0.5_f64..0.5,
    ) {
        let effects = [
            (EffectId::ActuationPhase, [phase, 0.0, 0.0, 0.0]),
            (EffectId::ActuationSkew, [skew, 0.0, 0.0, 0.0]),
            (EffectId::ActuationGainMismatch, [ratio, 0.0, 0.0, 0.0]),
        ];
        let inverse = ActuationCompensation::new(&effects).expect("regular");
        let allocation = Allocation::new(Some(inverse), 100.0).expect("valid");
        let (sin, cos) = theta.sin_cos();
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, cos, sin).volts;
        // the drives act in the library's order: gains, skew, phase
        let forces = effects.iter().rev().fold(drive, |f, (id, values)| id.actuate(values, f, &Moment::origin())).along_orbit(theta);
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
