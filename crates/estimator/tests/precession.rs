//! How a pattern that turns is followed from window to window: against the angle that it was given.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use approx::assert_abs_diff_eq;
use cvg_estimator::{Direction, Movement, Precession, PrecessionState, Status};
use cvg_model::{Envelope, Float, Pendulum};

const WINDOW_S: f64 = 0.5;
const SMOOTHING_S: f64 = 2.0;
/// 0.1 rad a window, and 0.2 rad besides: more than 0.3 rad is a jump
const FASTEST_RAD_S: f64 = 0.2;
const LEAST_JUMP_RAD: f64 = 0.2;
const LEAST_V: f64 = 0.5;

fn tracker() -> Precession<f64> {
    Precession::new(WINDOW_S, SMOOTHING_S, FASTEST_RAD_S, LEAST_JUMP_RAD, 0.75, LEAST_V).expect("valid")
}

/// A line at `theta` of amplitude 2.
fn line(theta: f64) -> Pendulum<f64> {
    let (sin, cos) = (2.0 * theta).sin_cos();
    Pendulum { e: 4.0, q: 0.0, r: 4.0 * cos, s: 4.0 * sin, l: 0.0 }
}

/// The state after patterns at these angles, and the last movement.
fn followed(angles: impl IntoIterator<Item = f64>) -> (PrecessionState<f64>, Movement) {
    let (mut state, mut movement) = (PrecessionState::default(), Movement::Unknown);
    for theta in angles {
        movement = tracker().step(&mut state, &line(theta));
    }
    (state, movement)
}

#[test]
fn the_first_window_is_a_direction_and_no_movement() {
    for theta in [0.0, 0.4, 1.2, -0.7, -1.5] {
        let (state, movement) = followed([theta]);
        assert_eq!(movement, Movement::Unknown);
        assert_abs_diff_eq!(state.cos_2, (2.0 * theta).cos(), epsilon = 1e-15);
        assert_abs_diff_eq!(state.sin_2, (2.0 * theta).sin(), epsilon = 1e-15);
        assert_eq!((state.sin_2_per_window, state.half_turns), (0.0, 0));
        assert_abs_diff_eq!(state.degrees(), theta.to_degrees(), epsilon = 1e-13);
    }
}

#[test]
fn the_unwrapped_angle_follows_any_number_of_half_turns_in_both_senses() {
    for sense in [1.0, -1.0] {
        let mut state = PrecessionState::default();
        for k in 0..200 {
            let theta = sense * 0.11 * f64::from(k);
            let movement = tracker().step(&mut state, &line(theta));
            assert_eq!(movement, if k == 0 { Movement::Unknown } else { Movement::Steady });
            assert_abs_diff_eq!(state.degrees(), theta.to_degrees(), epsilon = 1e-10);
            let (half_turns, within) = state.angle();
            assert_abs_diff_eq!(f64::from(half_turns) * PI + within, theta, epsilon = 1e-12);
            assert!(within.abs() <= FRAC_PI_2);
        }
    }
}

#[test]
fn a_pattern_exactly_at_ninety_degrees_is_on_the_positive_side() {
    let mut state = PrecessionState { cos_2: -0.96, sin_2: 0.28, ..PrecessionState::default() };
    let at = |r, s| Pendulum { e: 4.0, q: 0.0, r, s, l: 0.0 };
    // from above the cut onto it, in both spellings of zero, and beyond
    for zero in [0.0, -0.0] {
        tracker().step(&mut state, &at(-4.0, zero));
        assert_eq!((state.half_turns, state.angle()), (0, (0, FRAC_PI_2)));
    }
    tracker().step(&mut state, &at(-3.84, -1.12));
    assert_eq!(state.half_turns, 1);
    // back onto the cut
    tracker().step(&mut state, &at(-4.0, 0.0));
    assert_eq!((state.half_turns, state.angle()), (0, (0, FRAC_PI_2)));
}

#[test]
fn what_passes_the_positive_axis_is_no_half_turn() {
    for (from, to) in [(0.1, -0.1), (-0.1, 0.1), (0.7, 0.8), (0.8, 0.7), (-0.7, -0.8), (-0.8, -0.7)] {
        assert_eq!(followed([from, to]).0.half_turns, 0, "{from} to {to}");
    }
    // exactly a quarter of a turn away there is no shorter way
    let mut state = PrecessionState { cos_2: 0.6, sin_2: 0.8, ..PrecessionState::default() };
    let movement = tracker().step(&mut state, &Pendulum { e: 4.0, q: 0.0, r: -2.4, s: -3.2, l: 0.0 });
    assert_eq!((state.cos_2, movement, state.half_turns), (-0.6, Movement::Jumped, 0));
    // the shorter way is taken, also where it is long
    assert_eq!(followed([1.2, 1.2 + 0.7]).0.half_turns, 1);
    assert_eq!(followed([0.2, 0.2 - 0.7]).0.half_turns, 0);
    assert_eq!(followed([-1.2, -1.2 - 0.7]).0.half_turns, -1);
}

#[test]
fn the_rate_approaches_that_of_the_pattern_with_its_time_constant() {
    for moved in [0.02, -0.05] {
        for n in 1..12 {
            let (state, movement) = followed((0..=n).map(|k| 0.3 + moved * f64::from(k)));
            // a quarter of a window's share in the low-pass
            let expected = (2.0 * moved).sin() * (1.0 - 0.75_f64.powi(n));
            assert_eq!(movement, Movement::Steady);
            assert_abs_diff_eq!(state.sin_2_per_window, expected, epsilon = 1e-14);
            assert_abs_diff_eq!(tracker().rate_rad_s(&state), expected / 2.0 / WINDOW_S, epsilon = 1e-14);
        }
    }
}

#[test]
fn a_pattern_that_moves_more_than_its_fastest_and_the_least_jump_has_jumped() {
    for start in [0.0, 1.0, 1.5, -1.4, -0.3] {
        for sense in [1.0, -1.0] {
            assert_eq!(followed([start, start + sense * 0.2999]).1, Movement::Steady);
            for far in [0.3001, 0.6, FRAC_PI_4 + 0.01, 1.2, FRAC_PI_2, 1.9 * FRAC_PI_4] {
                let (state, movement) = followed([start, start + sense * far]);
                assert_eq!((movement, state.sin_2_per_window), (Movement::Jumped, 0.0), "{start} {far}");
            }
        }
    }
}

#[test]
fn a_line_without_an_amplitude_or_a_number_has_no_direction_and_forgets() {
    let mut state = followed([0.3, 0.35]).0;
    let half = |size: f64| Pendulum { e: 4.0, q: 0.0, r: 0.6 * size, s: 0.8 * size, l: 0.0 };
    let known = state;
    assert_eq!(tracker().step(&mut state, &half(0.26)), Movement::Steady, "0.51 V is a line");
    let infinite = Pendulum { r: f64::INFINITY, ..line(0.3) };
    let none = Pendulum { s: f64::NAN, ..line(0.3) };
    for p in [Pendulum { r: 0.25, s: 0.0, ..line(0.0) }, half(0.24), half(0.0), infinite, none] {
        let mut state = PrecessionState { half_turns: 7, ..known };
        assert_eq!(tracker().step(&mut state, &p), Movement::Unknown);
        let lost = PrecessionState { half_turns: 7, ..PrecessionState::default() };
        assert_eq!(state, lost, "{p:?}");
        assert_eq!(tracker().step(&mut state, &line(0.3)), Movement::Unknown, "the window after it knows no last one");
    }
}

#[test]
fn a_state_that_is_no_direction_is_no_last_direction() {
    let movement = |cos_2, sin_2| {
        let mut state = PrecessionState { cos_2, sin_2, sin_2_per_window: 0.1, half_turns: 0 };
        (tracker().step(&mut state, &line(0.0)), state.sin_2_per_window)
    };
    // (1, 0) is the new direction: what was before shows in full as `along` and `across`
    for (cos_2, sin_2) in [(0.5, 0.0), (0.0, 0.5), (2.1, 0.0), (0.0, 0.0), (f64::NAN, 0.0), (f64::INFINITY, 1.0)] {
        assert_eq!(movement(cos_2, sin_2), (Movement::Unknown, 0.0), "{cos_2} {sin_2}");
    }
    // nor is one of exactly half the length to the short way, which would go on from it
    let p = Pendulum { r: 0.6, s: 0.8, ..line(0.0) };
    let mut state = PrecessionState { cos_2: 0.3, sin_2: 0.4, sin_2_per_window: 0.0, half_turns: 0 };
    assert!(!tracker().step_steadily(&mut state, &p));
    assert_eq!(tracker().step(&mut state, &p), Movement::Unknown);
    assert_eq!(movement(2.0, 0.0).0, Movement::Steady);
    assert_eq!(movement(0.51, 0.0).0, Movement::Steady);
    assert_eq!(movement(0.3, 0.3).0, Movement::Steady);
    assert_eq!(movement(-0.51, 0.0).0, Movement::Jumped);
    assert_eq!(movement(0.0, 0.51).0, Movement::Jumped);
    assert_eq!(movement(0.0, -0.51).0, Movement::Jumped);
}

#[test]
fn the_short_way_is_a_steady_move_on_one_side_of_the_axis() {
    for (from, to) in [(0.3, 0.4), (1.2, 1.1), (-0.3, -0.5), (-1.2, -0.95)] {
        let (mut short, _) = followed([from]);
        let mut whole = short;
        assert!(tracker().step_steadily(&mut short, &line(to)));
        assert_eq!((tracker().step(&mut whole, &line(to)), whole), (Movement::Steady, short));
        assert_abs_diff_eq!(short.sin_2_per_window, (2.0 * (to - from)).sin() / 4.0, epsilon = 1e-15);
        assert_abs_diff_eq!(short.degrees(), to.to_degrees(), epsilon = 1e-13);
    }
    let refused = |state: PrecessionState<f64>, p: &Pendulum<f64>| {
        let mut after = state;
        let steady = tracker().step_steadily(&mut after, p);
        // as text, in which NaN is NaN
        assert!(steady || format!("{after:?}") == format!("{state:?}"), "something changed");
        !steady
    };
    let at = |theta: f64| followed([theta]).0;
    // no last direction, across either end of the R axis, onto it, a jump, no line, no number
    assert!(refused(PrecessionState::default(), &line(0.3)));
    assert!(refused(at(0.05), &line(-0.05)) && refused(at(1.55), &line(1.6)) && refused(at(0.05), &line(0.0)));
    assert!(refused(at(0.4), &line(0.7001)) && refused(at(0.8), &line(0.4999)) && !refused(at(0.4), &line(0.6999)));
    let small = |size: f64| Pendulum { e: 4.0, q: 0.0, r: 0.0, s: size, l: 0.0 };
    assert!(refused(at(0.7), &small(0.25)) && !refused(at(0.7), &small(0.26)));
    for no_number in [f64::NAN, f64::INFINITY] {
        assert!(refused(at(0.4), &Pendulum { r: no_number, ..line(0.4) }));
        assert!(refused(at(0.4), &Pendulum { s: no_number, ..line(0.4) }));
    }
    // a state of five to eleven eighths of a unit vector is a direction, and its rate has to be one
    let sized = |size: f64| PrecessionState { cos_2: 0.6 * size, sin_2: 0.8 * size, ..PrecessionState::default() };
    let same = Pendulum { e: 4.0, q: 0.0, r: 2.4, s: 3.2, l: 0.0 };
    for (size, expected) in [(0.62, true), (0.63, false), (1.37, false), (1.38, true)] {
        assert_eq!(refused(sized(size), &same), expected, "{size}");
    }
    for rate in [0.8, -0.8, f64::NAN] {
        assert!(refused(PrecessionState { sin_2_per_window: rate, ..at(0.4) }, &line(0.4)), "{rate}");
    }
}

#[test]
fn a_rate_in_the_state_beyond_a_jump_is_taken_as_a_jump() {
    let most = 0.6_f64.sin();
    for (held, expected) in [(9.0, most), (-9.0, -most), (f64::NAN, 0.0), (0.1, 0.1)] {
        let state = PrecessionState { sin_2_per_window: held, ..PrecessionState::default() };
        assert_abs_diff_eq!(tracker().rate_rad_s(&state), expected, epsilon = 1e-15);
    }
}

#[test]
fn the_direction_is_turned_ahead_by_the_lead() {
    for (theta, rate) in [(0.3, 0.1), (-1.1, 0.05), (2.4, -0.08)] {
        let state = PrecessionState { sin_2_per_window: rate * 2.0 * WINDOW_S, ..PrecessionState::default() };
        let now = Direction { cos: f64::cos(theta), sin: f64::sin(theta), status: Status::Valid };
        let ahead = tracker().ahead(&state, &now);
        let psi: f64 = rate * 0.75;
        // to second order: what is left is of the third
        assert_abs_diff_eq!(ahead.cos, (theta + psi).cos(), epsilon = psi.abs().powi(3) / 5.0);
        assert_abs_diff_eq!(ahead.sin, (theta + psi).sin(), epsilon = psi.abs().powi(3) / 5.0);
        assert_eq!(ahead.status, Status::Valid);
    }
}

/// The state may hold anything: what is beyond a jump leads as a jump does, what is no number not at all.
#[test]
fn a_motion_beyond_a_jump_leads_no_farther_than_one() {
    let now = Direction { cos: 0.6, sin: 0.8, status: Status::Valid };
    let led = |sin_2_per_window| tracker().ahead(&PrecessionState { sin_2_per_window, ..Default::default() }, &now);
    let jump = (2.0 * (FASTEST_RAD_S * WINDOW_S + LEAST_JUMP_RAD)).sin();
    for beyond in [1.01 * jump, 1.0, 1e30, f64::INFINITY] {
        assert_eq!(led(beyond), led(jump), "{beyond}");
        assert_eq!(led(-beyond), led(-jump), "{beyond}");
    }
    assert_eq!(led(f64::NAN), now);
}

#[test]
fn a_direction_that_is_led_ahead_is_as_valid_as_it_was() {
    let state = PrecessionState { sin_2_per_window: 0.1, ..PrecessionState::default() };
    for status in [Status::Valid, Status::Undetermined, Status::Invalid] {
        assert_eq!(tracker().ahead(&state, &Direction { cos: 0.6, sin: 0.8, status }).status, status);
    }
}

/// The faintest and the strongest line amplitudes that may be the least one, V: of a line that has a direction with them the
/// vector has the length one, at every angle.
fn least_lines_have_directions<T: Float>(faint_v: f64, strong_v: f64) {
    let new = |v: f64| Precession::<T>::new(WINDOW_S, SMOOTHING_S, FASTEST_RAD_S, LEAST_JUMP_RAD, 0.75, v);
    for refused in [0.7 * faint_v, 1e-12 * faint_v, 1.01 * strong_v, 1e12 * strong_v] {
        assert_eq!(new(refused).err().map(|e| e.parameter), Some("least_v"), "{refused}");
    }
    for least_v in [faint_v, 1e-3, 1.0, 0.99 * strong_v] {
        let tracker = new(least_v).expect("within its domain");
        for degree in 0..360 {
            let (sin, cos) = f64::from(degree).to_radians().sin_cos();
            let line = 1.001 * least_v * least_v;
            let zero = T::zero();
            let p = Pendulum { e: zero, q: zero, r: T::from_f64(line * cos), s: T::from_f64(line * sin), l: zero };
            let mut state = PrecessionState::default();
            tracker.step(&mut state, &p);
            let length = state.cos_2.to_f64().hypot(state.sin_2.to_f64());
            assert!((length - 1.0).abs() < 4.0 * T::epsilon().to_f64(), "{least_v} V, {degree} deg: {length}");
        }
    }
}

#[test]
fn a_least_line_whose_square_leaves_the_range_of_the_numbers_is_refused() {
    least_lines_have_directions::<f32>(3.3e-10, 4.29e9);
    least_lines_have_directions::<f64>(1.3e-77, 1.157e77);
}

#[test]
fn parameters_outside_their_domain_are_refused_by_name() {
    let good = [WINDOW_S, SMOOTHING_S, FASTEST_RAD_S, LEAST_JUMP_RAD, 0.75, LEAST_V];
    let new = |changes: &[(usize, f64)]| {
        let mut v = good;
        for &(place, value) in changes {
            v[place] = value;
        }
        Precession::<f64>::new(v[0], v[1], v[2], v[3], v[4], v[5]).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!(new(&[]), Ok(()));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(&[(0, bad)]), Err("window_s"), "{bad}");
        assert_eq!(new(&[(5, bad)]), Err("least_v"), "{bad}");
    }
    assert_eq!(new(&[(1, WINDOW_S)]), Ok(()), "no smoothing");
    for bad in [0.99 * WINDOW_S, f64::NAN, f64::INFINITY] {
        assert_eq!(new(&[(1, bad)]), Err("smoothing_s"), "{bad}");
    }
    for place in [2, 3] {
        for bad in [0.0, -0.1, f64::NAN] {
            assert_eq!(new(&[(place, bad)]), Err("fastest_rad_s"), "{bad}");
        }
    }
    // a quarter of π besides 0.1 rad
    assert_eq!(new(&[(3, FRAC_PI_4 - 0.1 - 1e-9)]), Ok(()));
    assert_eq!(new(&[(3, FRAC_PI_4 - 0.1 + 1e-9)]), Err("fastest_rad_s"));
    assert_eq!(new(&[(2, 1e-30), (3, FRAC_PI_4)]), Err("fastest_rad_s"));
    assert_eq!((new(&[(4, 0.0)]), new(&[(4, 4.99)])), (Ok(()), Ok(())));
    for bad in [-1e-9, 5.0, f64::NAN] {
        assert_eq!(new(&[(4, bad)]), Err("lead_s"), "{bad}");
    }
}

#[test]
fn degrees_are_those_of_the_angle_in_double_precision() {
    let state = PrecessionState { cos_2: 0.28_f32, sin_2: 0.96, half_turns: 1_000_001, ..PrecessionState::default() };
    let (_, within) = state.angle();
    assert_eq!(state.degrees(), 180.0 * 1_000_001.0 + f64::from(within).to_degrees());
}

#[test]
fn half_turns_are_counted_as_far_as_they_can_be() {
    for (half_turns, sense) in [(i32::MAX, 1.0), (i32::MIN, -1.0)] {
        let mut state = PrecessionState { half_turns, ..PrecessionState::default() };
        for theta in [1.5, 1.7] {
            tracker().step(&mut state, &line(sense * theta));
        }
        assert_eq!(state.half_turns, half_turns);
    }
}

#[test]
fn a_jump_leaves_the_rate_that_was_known() {
    for sense in [1.0, -1.0] {
        let mut state = followed([0.3, 0.3 + sense * 0.05]).0;
        let known = state.sin_2_per_window;
        assert_eq!(tracker().step(&mut state, &line(0.3 + sense * 0.75)), Movement::Jumped);
        assert_eq!(state.sin_2_per_window, known);
        assert_abs_diff_eq!(state.degrees(), (0.3 + sense * 0.75_f64).to_degrees(), epsilon = 1e-12);
    }
}

#[test]
fn a_state_of_anything_is_followed_from_the_second_window_on() {
    let tracker = Precession::<f64>::new(5e-4, 8e-3, 35.0, 0.1, 0.0, 1e-3).expect("valid");
    let p = Envelope::new(1.0, 0.0, 0.5, 0.0).pendulum();
    for garbage in [1e30, -1e30, f64::NAN, f64::INFINITY] {
        let mut state = PrecessionState { cos_2: garbage, sin_2: garbage, ..PrecessionState::default() };
        assert_ne!(tracker.step(&mut state, &p), Movement::Steady, "{garbage}");
        assert_eq!(tracker.step(&mut state, &p), Movement::Steady, "{garbage}");
    }
}

#[test]
fn a_pattern_on_an_axis_has_a_direction() {
    for (cos_2, sin_2) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.6, 0.8)] {
        assert!(PrecessionState { cos_2, sin_2, ..PrecessionState::<f64>::default() }.is_directed(), "{cos_2} {sin_2}");
    }
    assert!(!PrecessionState::<f64>::default().is_directed());
}

#[test]
fn the_angle_counts_half_turns_of_both_senses_as_far_as_they_can_be_counted() {
    let (at_30_deg, _) = followed([PI / 6.0]);
    for half_turns in [0, 1, -1, 1_000, -1_001, 1_000_000, -1_000_001, i32::MAX, i32::MIN] {
        let state = PrecessionState { half_turns, ..at_30_deg };
        assert_abs_diff_eq!(state.degrees(), 180.0 * f64::from(half_turns) + 30.0, epsilon = 1e-12);
    }
}
