//! The pattern angle: Equation 4, unwrapped, whatever comes in.

use approx::assert_abs_diff_eq;
use cvg_estimator::direction::{major_axis, major_axis_of};
use cvg_estimator::{AngleState, PatternAngle, Period, Reading, Status};
use cvg_model::{Envelope, Orbit};
use proptest::prelude::*;

fn tracker(period: Period) -> PatternAngle<f64> {
    PatternAngle::new(period, 1e-6).expect("valid")
}

fn orbit(theta: f64, q: f64, delta: f64) -> Envelope<f64> {
    Orbit { a: 1.0, q, theta, delta }.envelope()
}

#[test]
fn a_pattern_that_turns_is_followed_over_its_period_in_both_senses() {
    for sense in [1.0, -1.0] {
        let angle = tracker(Period::Pattern);
        let mut state = AngleState::default();
        let mut first = None;
        for k in 0..2000 {
            let theta = sense * 0.05 * f64::from(k);
            let seen = angle.step(&mut state, &orbit(theta, 0.01, 0.02)).degrees(Period::Pattern);
            let start = *first.get_or_insert(seen);
            assert_abs_diff_eq!(seen - start, theta.to_degrees(), epsilon = 1e-9);
        }
    }
}

#[test]
fn a_full_turn_sensor_is_followed_over_its_own_period() {
    let angle = tracker(Period::FullTurn);
    let mut state = AngleState::default();
    for k in 0..500 {
        let theta = 0.1 * f64::from(k);
        let reading = angle.step(&mut state, &Envelope::new(theta.cos(), 0.0, theta.sin(), 0.0));
        assert_abs_diff_eq!(reading.degrees(Period::FullTurn), theta.to_degrees(), epsilon = 1e-9);
    }
}

#[test]
fn single_precision_keeps_its_resolution_after_a_day() {
    let angle = PatternAngle::<f32>::new(Period::Pattern, 1e-6).expect("valid");
    // a day at 500 deg/s
    let mut state = AngleState { periods: 240_000, within_rad: 0.5 };
    let (sin, cos) = 0.500_01_f32.sin_cos();
    let reading = angle.step(&mut state, &Envelope::new(cos, 0.0, sin, 0.0));
    let expected = 240_000.0 * 180.0 + 0.500_01_f64.to_degrees();
    assert_abs_diff_eq!(reading.degrees(Period::Pattern), expected, epsilon = 1e-5);
}

#[test]
fn an_envelope_without_direction_holds_the_last_reading_and_says_so() {
    let angle = tracker(Period::Pattern);
    let mut state = AngleState::default();
    let known = angle.step(&mut state, &orbit(0.3, 0.0, 0.0));
    let rest = angle.step(&mut state, &Envelope::zero());
    assert_eq!((rest.within_rad, rest.status), (known.within_rad, Status::Undetermined));
    let broken = angle.step(&mut state, &Envelope::new(f64::NAN, 0.0, 1.0, 0.0));
    assert_eq!((broken.within_rad, broken.status), (known.within_rad, Status::Invalid));
    assert_eq!(angle.step(&mut state, &orbit(0.31, 0.0, 0.0)).status, Status::Valid);
}

/// A circle vibrates as much as a line, and lies nowhere.
#[test]
fn a_circle_has_no_angle() {
    let angle = tracker(Period::Pattern);
    let mut state = AngleState::default();
    angle.step(&mut state, &orbit(0.5, 0.0, 0.0));
    for e in [Envelope::new(1.0, 0.0, 0.0, 1.0), Envelope::new(0.0, 0.5, -0.5, 0.0)] {
        let reading = angle.step(&mut state, &e);
        assert_eq!((reading.status, reading.periods), (Status::Undetermined, 0), "{e:?}");
        assert_abs_diff_eq!(reading.within_rad, 0.5, epsilon = 1e-15);
    }
}

#[test]
fn a_threshold_that_is_no_amplitude_is_refused() {
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(PatternAngle::new(Period::Pattern, bad).map_err(|e| e.parameter), Err("least_v"));
    }
}

#[test]
fn a_turn_by_exactly_half_a_period_counts_no_period() {
    let half_turns = |period: Period, from: Envelope<f64>, to: Envelope<f64>| {
        let mut state = AngleState::default();
        tracker(period).step(&mut state, &from);
        tracker(period).step(&mut state, &to).periods
    };
    // ±90° of 360°, and ±45° of 180°: exact in floating point
    let (up, down) = (Envelope::new(0.0, 0.0, 1.0, 0.0), Envelope::new(0.0, 0.0, -1.0, 0.0));
    assert_eq!((half_turns(Period::FullTurn, up, down), half_turns(Period::FullTurn, down, up)), (0, 0));
    let (rising, falling) = (Envelope::new(1.0, 0.0, 1.0, 0.0), Envelope::new(1.0, 0.0, -1.0, 0.0));
    assert_eq!((half_turns(Period::Pattern, rising, falling), half_turns(Period::Pattern, falling, rising)), (0, 0));
}

#[test]
fn an_angle_exactly_at_either_end_of_its_period_is_a_last_angle() {
    use core::f64::consts::{FRAC_PI_2, PI};
    for (period, half) in [(Period::Pattern, FRAC_PI_2), (Period::FullTurn, PI)] {
        for end in [half, -half] {
            let state = AngleState { periods: 3, within_rad: end };
            let held = tracker(period).step(&mut state.clone(), &Envelope::zero());
            assert_eq!((held.periods, held.within_rad), (3, end), "{period:?} holds its end");
            // a little on, over the cut, is the next period's beginning
            let on = Orbit { a: 1.0, q: 0.0, theta: end + end.signum() * 0.1, delta: 0.0 }.envelope();
            let reading = tracker(period).step(&mut state.clone(), &on);
            assert_eq!(reading.periods, if end > 0.0 { 4 } else { 2 }, "{period:?} from {end}");
        }
    }
}

#[test]
fn the_count_of_periods_stays_at_its_ends() {
    let (up, down) = (orbit(1.5, 0.0, 0.0), orbit(-1.5, 0.0, 0.0));
    for (last, from, to) in [(i64::MAX, &up, &down), (i64::MIN, &down, &up)] {
        let mut state = AngleState { periods: last, ..AngleState::default() };
        tracker(Period::Pattern).step(&mut state, from);
        assert_eq!(tracker(Period::Pattern).step(&mut state, to).periods, last);
    }
}

#[test]
fn a_vibration_has_a_direction_above_the_least_amplitude() {
    let status = |period, x: f64, y: f64| {
        let angle = PatternAngle::new(period, 0.5).expect("valid");
        angle.step(&mut AngleState::default(), &Envelope::new(x, 0.0, y, 0.0)).status
    };
    for period in [Period::Pattern, Period::FullTurn] {
        for (x, y) in [(0.51, 0.0), (0.0, 0.51), (-0.4, 0.4), (3.0, 0.0), (0.0, 3.0)] {
            assert_eq!(status(period, x, y), Status::Valid, "{x} {y}");
        }
        for (x, y) in [(0.5, 0.0), (0.0, 0.5), (0.3, 0.3), (0.0, 0.0)] {
            assert_eq!(status(period, x, y), Status::Undetermined, "{x} {y}");
        }
        // too large for its square
        assert_eq!(status(period, 1e200, 1e-9), Status::Invalid);
    }
}

#[test]
fn an_orbit_too_small_for_its_squares_has_no_direction_of_its_axis() {
    // from where R² rounds to zero to where it is rounded by a hundredth
    for y_c in [1e-85, 1.253_685_680_185_679_2e-81, 1e-80, 1e-78] {
        let e = Envelope::new(0.0, 0.0, y_c, 0.0);
        let direction = major_axis(&e, &e.pendulum());
        assert_eq!((direction.cos, direction.sin, direction.status), (1.0, 0.0, Status::Undetermined), "{y_c}");
    }
    for y_c in [1e-76, 1e-20, 1.0, 1e70] {
        let e = Envelope::new(0.0, 0.0, y_c, 0.0);
        let direction = major_axis(&e, &e.pendulum());
        assert_eq!((direction.cos, direction.status), (0.0, Status::Valid), "{y_c}");
        assert_abs_diff_eq!(direction.sin, 1.0, epsilon = 1e-14);
    }
}

#[test]
fn the_direction_of_twice_the_angle_wants_a_direction_and_a_vibration_along_it() {
    let along_x = Envelope::new(2.0, 0.0, 0.0, 0.0);
    let of = |e: &Envelope<f64>, cos_2: f64, sin_2: f64| {
        let d = major_axis_of(e, cos_2, sin_2);
        (d.cos, d.sin, d.status)
    };
    assert_eq!(of(&along_x, 1.0, 0.0), (1.0, 0.0, Status::Valid));
    assert_eq!(of(&Envelope::new(-2.0, 0.0, 0.0, 0.0), 1.0, 0.0), (-1.0, 0.0, Status::Valid));
    assert_eq!(of(&Envelope::new(0.0, 0.0, 3.0, 0.0), -1.0, 0.0), (0.0, 1.0, Status::Valid));
    assert_eq!(of(&Envelope::new(0.0, 0.0, -3.0, 0.0), -1.0, 0.0), (-0.0, -1.0, Status::Valid));
    // the largest that is taken for a unit vector
    let (cos, sin, status) = of(&along_x, 1.0, 2.0);
    assert_abs_diff_eq!(cos, 0.5_f64.sqrt(), epsilon = 1e-15);
    assert_abs_diff_eq!(sin, 0.5_f64.sqrt(), epsilon = 1e-15);
    assert_eq!(status, Status::Valid);
    let none = |status| (1.0, 0.0, status);
    assert_eq!(of(&along_x, 1.0, 2.01), none(Status::Undetermined));
    assert_eq!(of(&along_x, 3.0, 0.0), none(Status::Undetermined));
    assert_eq!(of(&Envelope::new(0.0, 1.0, 2.0, 0.0), 1.0, 0.0), none(Status::Undetermined), "no vibration along X");
    assert_eq!(of(&Envelope::new(1e-200, 0.0, 0.0, 0.0), 1.0, 0.0), none(Status::Undetermined), "nor of its square");
    assert_eq!(of(&along_x, 0.0, 0.0), (1.0, 0.0, Status::Valid), "the origin counts as 0°");
    assert_eq!(of(&along_x, f64::NAN, 0.0), none(Status::Invalid));
    assert_eq!(of(&along_x, 1e200, 0.0), none(Status::Invalid));
}

#[test]
fn a_state_of_no_number_is_held_as_zero_and_counts_nothing() {
    for period in [Period::Pattern, Period::FullTurn] {
        for within_rad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let state = AngleState { periods: 7, within_rad };
            let mut held = state;
            let reading = tracker(period).step(&mut held, &Envelope::zero());
            assert_eq!((reading.periods, reading.within_rad), (7, 0.0), "{period:?}, no vibration, {within_rad}");
            let mut known = state;
            let line = Orbit { a: 1.0, q: 0.0, theta: 1.5, delta: 0.0 }.envelope();
            let reading = tracker(period).step(&mut known, &line);
            assert_eq!((reading.periods, reading.status), (7, Status::Valid), "{period:?}, a line, {within_rad}");
            assert!((reading.within_rad - 1.5).abs() < 1e-12, "{period:?}: {}", reading.within_rad);
        }
    }
}

proptest! {
    #[test]
    fn any_bit_pattern_gives_a_finite_reading_inside_its_period(
        bits in prop::array::uniform4(any::<u64>()), periods: i64, within: u64, full: bool,
    ) {
        let period = if full { Period::FullTurn } else { Period::Pattern };
        let [x_c, x_s, y_c, y_s] = bits.map(f64::from_bits);
        let mut state = AngleState { periods, within_rad: f64::from_bits(within) };
        let reading = tracker(period).step(&mut state, &Envelope::new(x_c, x_s, y_c, y_s));
        prop_assert!(reading.within_rad.to_degrees().abs() <= period.degrees() / 2.0 + 1e-9);
    }

    #[test]
    fn any_bit_pattern_in_single_precision_too(bits in prop::array::uniform4(any::<u32>()), within: u32) {
        let [x_c, x_s, y_c, y_s] = bits.map(f32::from_bits);
        let mut state = AngleState { periods: 0, within_rad: f32::from_bits(within) };
        let angle = PatternAngle::<f32>::new(Period::Pattern, 0.0).expect("valid");
        let reading = angle.step(&mut state, &Envelope::new(x_c, x_s, y_c, y_s));
        prop_assert!(reading.within_rad.is_finite() && reading.within_rad.abs() < 1.6);
    }

    #[test]
    fn the_direction_by_algebra_is_that_of_equation_4(
        theta in -3.1_f64..3.1, q in -0.9_f64..0.9, delta in -1.5_f64..1.5, a in 1e-3_f64..1e3,
    ) {
        let e = Orbit { a, q: q * a, theta, delta }.envelope();
        let p = e.pendulum();
        let direction = major_axis(&e, &p);
        prop_assert_eq!(direction.status, Status::Valid);
        // the same axis …
        let (sin, cos) = p.angle().sin_cos();
        prop_assert!((direction.cos * sin - direction.sin * cos).abs() < 1e-12);
        // … a unit vector …
        prop_assert!((direction.cos.hypot(direction.sin) - 1.0).abs() < 1e-14);
        // … in the sense of the in-phase vibration
        prop_assert!(direction.cos * e.x_c + direction.sin * e.y_c > 0.0);
        prop_assert!((direction.angle() - theta).sin().abs() < 1e-12);
    }

    #[test]
    fn the_direction_of_twice_the_angle_is_that_of_the_envelope(
        theta in -3.1_f64..3.1, q in -0.9_f64..0.9, delta in -1.5_f64..1.5, a in 1e-3_f64..1e3,
    ) {
        let e = Orbit { a, q: q * a, theta, delta }.envelope();
        let p = e.pendulum();
        let line = p.r.hypot(p.s);
        let (of, direction) = (major_axis_of(&e, p.r / line, p.s / line), major_axis(&e, &p));
        prop_assert_eq!(of.status, Status::Valid);
        prop_assert!((of.cos - direction.cos).abs() < 1e-15 && (of.sin - direction.sin).abs() < 1e-15);
    }

    #[test]
    fn the_direction_of_twice_the_angle_is_a_unit_vector_for_any_bit_pattern(
        bits in prop::array::uniform4(any::<u64>()), cos_2: u64, sin_2: u64, origin: bool,
    ) {
        let [x_c, x_s, y_c, y_s] = bits.map(f64::from_bits);
        let zero = if origin { 0.0 } else { 1.0 };
        let of = |e, c, s| major_axis_of(&e, zero * c, zero * s);
        let d = of(Envelope::new(x_c, x_s, y_c, y_s), f64::from_bits(cos_2), f64::from_bits(sin_2));
        prop_assert!((d.cos.hypot(d.sin) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_direction_of_any_bit_pattern_is_a_unit_vector(bits in prop::array::uniform4(any::<u64>())) {
        let [x_c, x_s, y_c, y_s] = bits.map(f64::from_bits);
        let e = Envelope::new(x_c, x_s, y_c, y_s);
        let direction = major_axis(&e, &e.pendulum());
        prop_assert!((direction.cos.hypot(direction.sin) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn degrees_are_those_of_the_reading_in_double_precision() {
    for within_rad in [0.7_f32, -1.3, 1e-7] {
        let reading = Reading { periods: 123_457, within_rad, status: Status::Valid };
        let degrees = f64::from(within_rad).to_degrees();
        assert_eq!(reading.degrees(Period::Pattern), 180.0 * 123_457.0 + degrees);
        assert_eq!(reading.degrees(Period::FullTurn), 360.0 * 123_457.0 + degrees);
    }
    // more periods than single precision counts one by one
    let many = Reading { periods: 16_777_217, within_rad: 0.0_f32, status: Status::Valid };
    assert_eq!(many.degrees(Period::Pattern), 180.0 * 16_777_217.0);
}
