//! What runs once per sample beside Equation 3: total, bounded, and itself again after anything.

use core::f64::consts::PI;

use cvg_controller::{Allocation, Heading, OrbitCommands, PiState, RateLoop};
use cvg_estimator::direction::{Direction, major_axis, major_axis_of};
use cvg_estimator::{AngleState, LockState, PatternAngle, Period, PhaseLock, Precession, PrecessionState, Status};
use cvg_instrument::{Instrument, Settings};
use cvg_model::effects::EffectId;
use cvg_model::{Envelope, Orbit, Pendulum, Real};
use cvg_prover::{Exact, Proof, Refusal};
use cvg_tests::domain::{envelope_patterns, envelopes, orbits, patterns, wrapped};
use cvg_tests::proof::{WRONG, holds_outside, rejects};
use cvg_tests::scalar::rounded_envelope;
use cvg_tests::tolerances::{ANGLE, DIRECTION};
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

const LIMIT: f64 = 5.0;

/// Half of a period in the scalar.
fn half_period<T: Scalar>(period: Period) -> f64 {
    let half = if matches!(period, Period::Pattern) { T::half() } else { T::one() };
    (T::PI * half).to_f64()
}

fn lock<T: Scalar>() -> PhaseLock<T> {
    let [bandwidth, damping, period, limit] = [20.0, 0.7, 1e-3, LIMIT].map(T::from_f64);
    PhaseLock::new(bandwidth, damping, period, limit).expect("inside its domain")
}

fn tracker<T: Scalar>() -> Precession<T> {
    Precession::new(5e-4, 8e-3, 35.0, 0.1, 3e-4, 1e-9).expect("inside its domain")
}

/// The direction as the instrument finds it: by the tracker of the pattern's motion.
fn flown<T: Scalar>(e: &Envelope<T>) -> Direction<T> {
    let mut state = PrecessionState::default();
    tracker().step(&mut state, &e.pendulum());
    major_axis_of(e, state.cos_2, state.sin_2)
}

for_each_scalar! {
    //= specs/electronics.md#direction-is-bounded
    //= type=test
    //# The components of the direction of the major axis MUST be finite and below two in magnitude for every input.
    #[test]
    fn prop_a_direction_of_any_bits_of_a_tracker_is_bounded(
        e in envelope_patterns::<T>(), cos_2 in patterns::<T>(), sin_2 in patterns::<T>(),
    ) {
        let d = major_axis_of(&e, cos_2, sin_2);
        prop_assert!(d.cos.to_f64().abs() < 2.0 && d.sin.to_f64().abs() < 2.0, "{d:?}");
    }

    //= specs/electronics.md#direction-is-a-unit-vector
    //= type=test
    //# The direction of the major axis MUST have the length one up to rounding.
    //= specs/electronics.md#direction-of-equation-4
    //= type=test
    //# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
    #[test]
    fn prop_the_direction_that_the_drives_are_given_is_a_unit_vector_along_equation_4(o in orbits()) {
        let (e, _) = rounded_envelope::<T>(&o.envelope());
        let p = e.pendulum();
        let d = flown(&e);
        prop_assert_eq!(d.status, Status::Valid);
        prop_assert_near!(d.cos.to_f64().hypot(d.sin.to_f64()), 1.0, T::tolerance(&DIRECTION));
        let off = wrapped(d.angle().to_f64() - p.angle().to_f64(), PI);
        let condition = p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64());
        prop_assert_near!(off, 0.0, 2.0 * T::tolerance(&ANGLE) * condition);
    }

    //= specs/equation-04.md#unwrapping
    //= type=test
    //# The unwrapped angle MUST follow the pattern over any number of turns as long as it turns less than 90° from one sample to the next.
    //= specs/dsp.md#unwrapping
    //= type=test
    //# The unwrapped angle MUST follow a turning pattern through any number of half turns without a jump.
    #[test]
    fn prop_the_angle_that_the_instrument_tells_follows_any_walk(
        start in -1.57..1.57_f64, steps in prop::collection::vec(-1.56..1.56_f64, 1..60),
    ) {
        let (mut state, mut theta) = (PrecessionState::<T>::default(), start);
        let mut see = |theta: f64| {
            let (e, _) = rounded_envelope::<T>(&Orbit { a: 1.0, q: 0.0, theta, delta: 0.0 }.envelope());
            tracker().step(&mut state, &e.pendulum());
            state.degrees()
        };
        see(theta);
        for step in steps {
            theta += step;
            let told = see(theta);
            prop_assert_near!(told, theta.to_degrees(), 2e2 * T::tolerance(&ANGLE));
        }
    }

    //= specs/electronics.md#reading-within-its-period
    //= type=test
    //# The reading of the pattern angle MUST be finite and within half its period of zero for every input and every state.
    #[test]
    fn prop_a_reading_of_any_bits_lies_within_its_period(
        e in envelope_patterns::<T>(), within in patterns::<T>(), periods: i64, full_turn: bool,
    ) {
        let period = if full_turn { Period::FullTurn } else { Period::Pattern };
        let tracker = PatternAngle::<T>::new(period, T::from_f64(0.0)).expect("a least amplitude of 0");
        let reading = tracker.step(&mut AngleState { periods, within_rad: within }, &e);
        prop_assert!(reading.within_rad.to_f64().abs() <= half_period::<T>(period), "{reading:?}");
    }

    //= specs/electronics.md#reading-is-held
    //= type=test
    //# An envelope without a direction MUST leave the reading as it was and say so.
    #[test]
    fn prop_a_reading_is_held_where_there_is_no_direction(o in orbits(), size in 0.0..2.0_f64, broken: bool) {
        let tracker = PatternAngle::<T>::new(Period::Pattern, T::from_f64(0.0)).expect("a least amplitude of 0");
        let mut state = AngleState::default();
        let before = tracker.step(&mut state, &rounded_envelope::<T>(&o.envelope()).0);
        let (size, none) = (T::from_f64(size), T::from_f64(0.0));
        let nowhere = if broken {
            Envelope::new(T::from_f64(f64::NAN), size, size, size)
        } else {
            Envelope::new(size, none, none, size)
        };
        let held = tracker.step(&mut state, &nowhere);
        prop_assert_eq!((held.periods, held.within_rad), (before.periods, before.within_rad));
        prop_assert_eq!(held.status, if broken { Status::Invalid } else { Status::Undetermined });
    }

    //= specs/electronics.md#reading-recovers
    //= type=test
    //# The first envelope with a direction MUST give the angle of that envelope whatever was read before.
    #[test]
    fn prop_a_reading_recovers_from_any_bits(
        e in envelope_patterns::<T>(), within in patterns::<T>(), periods: i64, o in orbits(),
    ) {
        let tracker = PatternAngle::<T>::new(Period::Pattern, T::from_f64(0.0)).expect("a least amplitude of 0");
        let mut state = AngleState { periods, within_rad: within };
        tracker.step(&mut state, &e);
        let line = rounded_envelope::<T>(&o.envelope()).0;
        let reading = tracker.step(&mut state, &line);
        prop_assert_eq!(reading.status, Status::Valid);
        prop_assert_eq!(reading.within_rad, line.pendulum().angle());
    }

    //= specs/electronics.md#direction-is-bounded
    //= type=test
    //# The components of the direction of the major axis MUST be finite and below two in magnitude for every input.
    #[test]
    fn prop_a_direction_of_any_bits_is_bounded(e in envelope_patterns::<T>()) {
        let d = major_axis(&e, &e.pendulum());
        prop_assert!(d.cos.to_f64().abs() < 2.0 && d.sin.to_f64().abs() < 2.0, "{d:?}");
    }

    //= specs/electronics.md#direction-is-a-unit-vector
    //= type=test
    //# The direction of the major axis MUST have the length one up to rounding.
    #[test]
    fn prop_a_direction_has_length_one(e in envelopes()) {
        let (e, _) = rounded_envelope::<T>(&e);
        let d = major_axis(&e, &e.pendulum());
        prop_assert_near!(d.cos.to_f64().hypot(d.sin.to_f64()), 1.0, T::tolerance(&DIRECTION));
    }

    //= specs/electronics.md#direction-of-equation-4
    //= type=test
    //# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
    #[test]
    fn prop_the_direction_is_equation_4_up_to_half_a_turn(o in orbits()) {
        let (e, _) = rounded_envelope::<T>(&o.envelope());
        let p = e.pendulum();
        let d = major_axis(&e, &p);
        prop_assert_eq!(d.status, Status::Valid);
        let off = wrapped(d.angle().to_f64() - p.angle().to_f64(), PI);
        let condition = p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64());
        prop_assert_near!(off, 0.0, 2.0 * T::tolerance(&ANGLE) * condition);
    }

    //= specs/electronics.md#correction-within-its-limit
    //= type=test
    //# The frequency correction MUST be finite and within its limit for every input and every state.
    #[test]
    fn prop_a_correction_of_any_bits_is_within_its_limit(
        e in patterns::<T>(), l in patterns::<T>(), detuning in patterns::<T>(),
    ) {
        let zero = T::from_f64(0.0);
        let mut state = LockState { detuning_rad_s: detuning };
        let correction = lock::<T>().step(&mut state, &Pendulum { e, q: zero, r: zero, s: zero, l });
        prop_assert!(correction.rad_s.to_f64().abs() <= LIMIT, "{correction:?}");
        prop_assert!(state.detuning_rad_s.to_f64().abs() <= LIMIT, "{state:?}");
    }

    //= specs/electronics.md#correction-is-held
    //= type=test
    //# Pendulum variables that hold no phase MUST leave the integral part of the correction as it was.
    #[test]
    fn prop_a_correction_is_held_where_there_is_no_phase(detuning in -LIMIT..LIMIT, broken in 0..3_i32) {
        let (zero, nan) = (T::from_f64(0.0), T::from_f64(f64::NAN));
        let (e, l) = [(zero, zero), (nan, zero), (T::from_f64(1.0), nan)][usize::try_from(broken).unwrap_or(0)];
        let mut state = LockState { detuning_rad_s: T::from_f64(detuning) };
        let correction = lock::<T>().step(&mut state, &Pendulum { e, q: zero, r: zero, s: zero, l });
        prop_assert_eq!(state.detuning_rad_s, T::from_f64(detuning));
        prop_assert_eq!(correction.rad_s, T::from_f64(detuning));
        prop_assert_ne!(correction.status, Status::Valid);
    }

    //= specs/electronics.md#drives-within-their-limit
    //= type=test
    //# Each drive MUST get a finite voltage within its limit for every command and every direction.
    #[test]
    fn prop_drives_of_any_bits_are_within_their_limit(
        v in proptest::array::uniform4(patterns::<T>()), cos in patterns::<T>(), sin in patterns::<T>(),
    ) {
        let allocation = Allocation::new(None, T::from_f64(LIMIT)).expect("a limit");
        let [v_as, v_qs, v_qc, v_ac] = v;
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, cos, sin).volts;
        for volts in [drive.x_c, drive.x_s, drive.y_c, drive.y_s] {
            prop_assert!(volts.to_f64().abs() <= LIMIT, "{drive:?}");
        }
    }

    //= specs/electronics.md#heading-within-its-limit
    //= type=test
    //# The output that holds the pattern MUST be finite and within its limit for every input and every state.
    #[test]
    fn prop_the_output_that_holds_the_pattern_is_within_its_limit_for_any_bits(
        v in proptest::array::uniform4(patterns::<T>()),
    ) {
        let [bandwidth, damping, drive, largest, period, limit] = [12.0, 1.0, 1.0, 10.0, 5e-4, LIMIT].map(T::from_f64);
        let rate = RateLoop::tuned(bandwidth, damping, drive, largest, period, limit).expect("inside its domain");
        let heading = Heading::new(T::from_f64(0.3)).expect("finite");
        let [e, r, s, integral] = v;
        let mut state = PiState { integral };
        let volts = rate.step(&mut state, &Pendulum { e, q: e, r, s, l: e }, &heading).volts;
        prop_assert!(volts.to_f64().abs() <= LIMIT && state.integral.is_finite(), "{volts:?} {state:?}");
    }
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    /// The first command of a fresh loop is in proportion to the sine of twice the angle that is missing.
    #[test]
    fn prop_the_command_that_holds_the_pattern_is_in_proportion_to_its_error(
        target in -PI..PI, missing in prop::array::uniform2(0.02..1.5_f64), a in 0.1..2.0_f64,
    ) {
        let rate = RateLoop::tuned(12.0, 1.0, 1.0, 100.0, 5e-4, 1e6).expect("inside its domain");
        let heading = Heading::new(target).expect("finite");
        let [one, other] = missing.map(|by| {
            let orbit = Orbit { a, q: 0.0, theta: target + by, delta: 0.0 };
            rate.step(&mut PiState::default(), &orbit.envelope().pendulum(), &heading).volts / (2.0 * by).sin()
        });
        prop_assert!(one != 0.0);
        prop_assert_near!(one / other, 1.0, 1e-9);
    }
}

#[test]
fn a_reading_needs_the_least_amplitude_that_was_set() {
    let (least, theta) = (0.3_f64, 0.7_f64);
    for period in [Period::Pattern, Period::FullTurn] {
        let tracker = PatternAngle::new(period, least).expect("in its domain");
        for (a, status) in [(0.301, Status::Valid), (0.299, Status::Undetermined)] {
            let e = Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope();
            assert_eq!(tracker.step(&mut AngleState::default(), &e).status, status, "{period:?}, {a} V");
        }
    }
}

#[test]
fn a_phase_is_undetermined_at_rest_and_invalid_where_a_variable_is_no_number() {
    let status = |e: f64, l: f64| {
        lock::<f64>().step(&mut LockState::default(), &Pendulum { e, q: 0.0, r: 0.0, s: 0.0, l }).status
    };
    assert_eq!(status(0.0, 0.0), Status::Undetermined);
    for (e, l) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, f64::INFINITY)] {
        assert_eq!(status(e, l), Status::Invalid, "E = {e}, L = {l}");
    }
}

#[test]
fn a_drive_that_overflows_is_no_number_asked_for_too_much() {
    let allocation = Allocation::new(None, LIMIT).expect("inside its domain");
    let (half, most, none) = (0.5_f64.sqrt(), f64::MAX, 0.0);
    // each makes one of the four drives overflow
    for [v_as, v_qs, v_qc, v_ac] in
        [[most, most, none, none], [most, -most, none, none], [none, none, most, most], [none, none, -most, most]]
    {
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, half, half);
        assert_eq!(drive.status, cvg_controller::Status::Invalid, "{v_as:e} {v_qs:e} {v_qc:e} {v_ac:e}");
    }
    let large = OrbitCommands { v_as: 1e6, v_qs: 0.0, v_qc: 0.0, v_ac: 0.0 };
    assert_eq!(allocation.step(&large, half, half).status, cvg_controller::Status::Limited);
}

//= specs/dsp.md#clock-of-another-day
//= type=test
//# An effect that is told by the time of a recording MUST be refused where the electronics compensate.
#[test]
fn what_a_recordings_clock_told_is_not_compensated_on_another_day() {
    for id in [EffectId::GainDrift, EffectId::TimePeriodic] {
        let effects = [(id, id.neutral())];
        let refused = Instrument::<f32>::new(&Settings { readout: &effects, ..Settings::default() });
        assert_eq!(refused.expect_err("an effect in time").parameter, "readout", "{id:?}");
    }
}

/// Why [`direction`] claims nothing on some paths.
const ACROSS: &str = "no vibration in phase with the reference along the major axis";

/// 2ρ(ρ + |R|) > 0, the square of the length by which the direction is divided.
fn length_is_positive(proof: &mut Proof, p: &Pendulum<Exact>) -> Result<(), Refusal> {
    let (line, one, two) = (p.r.norm(p.s), Exact::one(), Exact::two());
    let size = if p.r < Exact::zero() { -p.r } else { p.r };
    let cross = proof.product(line, size);
    proof.positive("2ρ(ρ + |R|)", two * line * (line + size), one, two * line * line, &[(two * cross, one)])
}

/// Any envelope but a circle. The direction is found wherever the vibration along it has a part in phase.
fn direction(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [x_c, x_s, y_c, y_s] = ["x_c", "x_s", "y_c", "y_s"].map(Exact::real);
    let e = Envelope::new(x_c, x_s, y_c, y_s);
    let p = e.pendulum();
    let eccentricity = p.r.squared() + p.s.squared();
    proof.assume_positive(eccentricity)?;
    let d = major_axis(&e, &p);
    length_is_positive(proof, &p)?;
    if d.status != Status::Valid {
        let line = p.r.norm(p.s);
        let (cos, sin) = if p.r < Exact::zero() { (p.s, line - p.r) } else { (line + p.r, p.s) };
        if cos * x_c + sin * y_c == Exact::zero() {
            proof.outside(ACROSS);
        }
        return Ok(());
    }
    proof.equal("length", d.cos * d.cos + d.sin * d.sin, planted * planted * planted)?;
    // twice the direction is that of (R, S): no cross product
    let (cos_2, sin_2) = (d.cos * d.cos - d.sin * d.sin, Exact::two() * d.sin * d.cos);
    proof.equal("R", cos_2 * p.r.norm(p.s), planted * p.r)?;
    proof.equal("S", sin_2 * p.r.norm(p.s), planted * p.s)
}

//= specs/electronics.md#direction-is-a-unit-vector
//= type=test
//# The direction of the major axis MUST have the length one up to rounding.
//= specs/electronics.md#direction-of-equation-4
//= type=test
//# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
#[test]
fn identity_the_direction_is_equation_4() {
    holds_outside(&[ACROSS], direction);
}

#[test]
fn identity_the_direction_is_equation_4_twin() {
    rejects(WRONG, direction);
}

/// Why [`direction_of_twice_the_angle`] claims nothing on a path that no unit vector takes: 2 + 2|cos 2θ| is at most 4.
const LONGER: &str = "a squared length above eight, which is at most four";

/// Any envelope, and any unit vector of twice an angle.
fn direction_of_twice_the_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [x_c, x_s, y_c, y_s] = ["x_c", "x_s", "y_c", "y_s"].map(Exact::real);
    let (sin_2, cos_2) = Exact::angle("2θ").sin_cos();
    let d = major_axis_of(&Envelope::new(x_c, x_s, y_c, y_s), cos_2, sin_2);
    let (one, two) = (Exact::one(), Exact::two());
    let size = if cos_2 < Exact::zero() { -cos_2 } else { cos_2 };
    let wide = one + size;
    proof.positive("(1 + |cos 2θ|)² + sin² 2θ", wide * wide + sin_2 * sin_2, one, two, &[(two * size, one)])?;
    if d.status != Status::Valid {
        if wide * wide + sin_2 * sin_2 > Exact::ratio(8, 1) {
            proof.may_be_empty(LONGER);
            proof.outside(LONGER);
            return Ok(());
        }
        let (cos, sin) = if cos_2 < Exact::zero() { (sin_2, wide) } else { (wide, sin_2) };
        let in_phase = cos * x_c + sin * y_c;
        proof.not_negative_by_path("nothing in phase along it", -(in_phase * in_phase))?;
        proof.outside(ACROSS);
        return Ok(());
    }
    proof.equal("length", d.cos * d.cos + d.sin * d.sin, planted * planted * planted)?;
    proof.equal("cos 2θ", d.cos * d.cos - d.sin * d.sin, planted * cos_2)?;
    proof.equal("sin 2θ", two * d.sin * d.cos, planted * sin_2)
}

//= specs/electronics.md#direction-is-a-unit-vector
//= type=test
//# The direction of the major axis MUST have the length one up to rounding.
//= specs/electronics.md#direction-of-equation-4
//= type=test
//# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
/// As the instrument finds it: from cos 2θ and sin 2θ.
#[test]
fn identity_the_direction_of_twice_the_angle_is_equation_4() {
    holds_outside(&[ACROSS, LONGER], direction_of_twice_the_angle);
}

#[test]
fn identity_the_direction_of_twice_the_angle_is_equation_4_twin() {
    rejects(WRONG, direction_of_twice_the_angle);
}
