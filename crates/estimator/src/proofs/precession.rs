//! The tracker of the pattern's motion.

use cvg_model::{Float, Pendulum};
use kani::Arbitrary;

use super::{LONGEST_DIRECTION, any_pendulum};
use crate::{Direction, Movement, Precession, PrecessionState, Status};

/// Any tracker that could be built.
pub(super) fn any_precession<T: Float + Arbitrary>() -> Precession<T> {
    let any = Precession {
        share: kani::any(),
        jump_sin_2: kani::any(),
        half_lead: kani::any(),
        window_s: kani::any(),
        least_2: kani::any(),
    };
    // precondition: what `new` accepts: shares of one, jumps below 45°, leads below ten windows
    kani::assume(assumed(&any));
    any
}

/// What the proofs assume of a tracker; a test holds what `new` accepts against it.
pub(super) fn assumed<T: Float>(p: &Precession<T>) -> bool {
    let share = |v: T, most: T| v >= T::zero() && v <= most;
    let positive = |v: T| v > T::zero() && v.is_finite();
    let shares = share(p.share, T::one()) && share(p.jump_sin_2, T::one()) && share(p.half_lead, T::ratio(5, 1));
    shares && positive(p.window_s) && positive(p.least_2)
}

fn half_turns_are_counted_singly<T: Float + Arbitrary>(most: i64) {
    let precession = any_precession::<T>();
    let before = PrecessionState {
        cos_2: kani::any(),
        sin_2: kani::any(),
        sin_2_per_window: kani::any(),
        half_turns: kani::any(),
    };
    let mut state = before;
    let p: Pendulum<T> = any_pendulum();
    let moved = precession.step(&mut state, &p);
    let passed = i64::from(state.half_turns) - i64::from(before.half_turns);
    kani::cover!(moved == Movement::Steady && passed == 1, "a half turn");
    kani::cover!(moved == Movement::Jumped, "a jump");
    assert!(passed >= -most && passed <= most);
    if moved == Movement::Unknown {
        kani::cover!(true, "nothing known");
        assert!(passed == 0 && state.sin_2_per_window == T::zero());
    }
    if moved == Movement::Steady {
        kani::cover!(true, "steady");
        assert!(state.sin_2_per_window.magnitude() <= T::two());
    }
}

//= specs/dsp.md#unwrapping
//# The unwrapped angle MUST follow a turning pattern through any number of half turns without a jump.
/// [`Precession::step`] counts at most one half turn a window, none where it knows no direction, and does not overflow; the
/// low-passed motion stays bounded, for any bits of pendulum variables and state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_half_turns_are_counted_singly_f32() {
    half_turns_are_counted_singly::<f32>(1);
}

/// None at all is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_half_turns_are_counted_singly_f32() {
    half_turns_are_counted_singly::<f32>(0);
}

fn direction_ahead_is_bounded<T: Float + Arbitrary>(longest: T) {
    let precession = any_precession::<T>();
    let state = PrecessionState {
        cos_2: kani::any(),
        sin_2: kani::any(),
        sin_2_per_window: kani::any(),
        half_turns: kani::any(),
    };
    // precondition: a direction as `major_axis_of` gives it, which is proved beside
    let bounded = || kani::any_where(|v: &T| v.magnitude() <= T::ratio(LONGEST_DIRECTION, 1));
    let ahead = precession.ahead(&state, &Direction { cos: bounded(), sin: bounded(), status: Status::Valid });
    let (_, within) = state.angle();
    kani::cover!(ahead.cos > T::one(), "turned ahead");
    assert!(ahead.cos.magnitude() <= longest && ahead.sin.magnitude() <= longest);
    assert!(within.magnitude() <= T::half() * T::PI);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The direction of [`Precession::ahead`] stays below 64 and the angle of [`PrecessionState::angle`] within 90°, for any bits
/// of the state.
#[kani::proof]
pub fn proof_direction_ahead_is_bounded_f32() {
    direction_ahead_is_bounded(64.0_f32);
}

/// Less than two is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_direction_ahead_is_bounded_f32() {
    direction_ahead_is_bounded(1.9_f32);
}
