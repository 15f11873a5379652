//! The unwrapped pattern angle, and the beat's.

use cvg_model::Float;
use kani::Arbitrary;

use super::any_envelope;
use crate::beat::phase_ahead;
use crate::{AngleState, Beat, PatternAngle, Period, Status};

/// Any tracker that can be built, and half its period.
fn any_tracker<T: Float + Arbitrary>() -> (PatternAngle<T>, T) {
    let (period, half) = if kani::any() { (Period::Pattern, T::half()) } else { (Period::FullTurn, T::one()) };
    // precondition: a configuration that `new` accepts
    match PatternAngle::new(period, kani::any()) {
        Ok(tracker) => (tracker, half * T::PI),
        Err(_) => {
            kani::assume(false);
            unreachable!()
        }
    }
}

fn reading_is_within_its_period<T: Float + Arbitrary>(share: T) {
    let (tracker, half) = any_tracker::<T>();
    let before = AngleState { periods: kani::any(), within_rad: kani::any::<T>() };
    let mut state = before;
    let reading = tracker.step(&mut state, &any_envelope());
    kani::cover!(reading.status == Status::Valid && reading.within_rad > T::one(), "beyond 57°");
    kani::cover!(reading.status == Status::Undetermined, "no direction");
    kani::cover!(reading.status == Status::Invalid, "no number");
    assert!(reading.within_rad.magnitude() <= share * half);
    if reading.status != Status::Valid {
        kani::cover!(before.periods > 0, "held after turns");
        assert!(state.periods == before.periods && reading.periods == before.periods);
        if before.within_rad.magnitude() <= half {
            kani::cover!(before.within_rad > T::zero(), "held");
            assert!(reading.within_rad == before.within_rad);
        }
    }
}

//= specs/electronics.md#reading-within-its-period
//# The reading of the pattern angle MUST be finite and within half its period of zero for every input and every state.
//= specs/electronics.md#reading-is-held
//# An envelope without a direction MUST leave the reading as it was and say so.
/// The reading of [`PatternAngle::step`] lies within half its period, and without a direction it is the last one, for any
/// bits of envelope and state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_reading_is_within_its_period_f32() {
    reading_is_within_its_period(1.0_f32);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_reading_is_within_its_period_f32() {
    reading_is_within_its_period(0.5_f32);
}

fn unwrapping_takes_the_short_way<T: Float + Arbitrary>(slack: T, reversed: bool) {
    let (tracker, half) = any_tracker::<T>();
    let before = AngleState { periods: kani::any(), within_rad: kani::any::<T>() };
    // precondition: a state that a step with a direction has left
    kani::assume(before.within_rad.magnitude() <= half);
    // precondition: the count is not at its end
    kani::assume(before.periods > i64::MIN && before.periods < i64::MAX);
    let mut state = before;
    let reading = tracker.step(&mut state, &any_envelope());
    let passed = if reversed { before.periods - reading.periods } else { reading.periods - before.periods };
    kani::cover!(passed == 1, "a period more");
    kani::cover!(passed == -1, "a period less");
    kani::cover!(passed == 0 && reading.within_rad > before.within_rad, "none");
    assert!((-1..=1).contains(&passed));
    let moved = reading.within_rad - before.within_rad;
    let whole = if passed > 0 {
        T::two() * half
    } else if passed < 0 {
        -(T::two() * half)
    } else {
        T::zero()
    };
    assert!((moved + whole).magnitude() <= half * slack);
}

//= specs/equation-04.md#unwrapping
//# The unwrapped angle MUST follow the pattern over any number of turns as long as it turns less than 90° from one sample to the next.
/// From one reading of [`PatternAngle::step`] to the next the unwrapped angle moves by at most half a period, whatever
/// was measured: at most one period is counted, and the right one.
#[kani::proof]
pub fn proof_unwrapping_takes_the_short_way_f32() {
    unwrapping_takes_the_short_way(1.0 + 2.0 * f32::EPSILON, false);
}

/// Periods are counted with the wrong sign.
#[kani::proof]
#[kani::should_panic]
pub fn twin_unwrapping_takes_the_short_way_f32() {
    unwrapping_takes_the_short_way(1.0 + 2.0 * f32::EPSILON, true);
}

fn beat_is_bounded<T: Float + Arbitrary>(share: T) {
    let mut beat = Beat {
        last: any_envelope::<T>(),
        along: kani::any(),
        across: kani::any(),
        x2: kani::any(),
        y2: kani::any(),
        windows: kani::any(),
    };
    let e = any_envelope();
    beat.add(&e);
    let turned = beat.radians_per_window();
    let (cos, sin) = phase_ahead(&e);
    kani::cover!(turned > T::two(), "a fast beat");
    kani::cover!(cos == T::one() && sin == T::zero() && !e.x_c.is_finite(), "no number");
    assert!(turned.magnitude() <= share * T::PI);
    assert!(cos.is_finite() && sin.is_finite());
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// [`Beat::radians_per_window`] after [`Beat::add`] lies within half a turn and [`phase_ahead`] is finite, for any bits of
/// sums and envelope; the count does not overflow.
#[kani::proof]
pub fn proof_beat_is_bounded_f32() {
    beat_is_bounded(1.0_f32);
}

/// A quarter of a turn is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_beat_is_bounded_f32() {
    beat_is_bounded(0.5_f32);
}
