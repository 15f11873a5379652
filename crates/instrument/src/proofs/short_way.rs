//! The short way of nearly every window against the way of all, in what joins the parts.

use cvg_estimator::Movement;
use cvg_model::{AxisForces, Float};
use kani::Arbitrary;

use crate::Continuity;
use crate::continuity::Sight;
use crate::drives::{limited, put_out};
use crate::step::{repeats, unlike};

fn sight_is_the_same(unseen: u32) {
    let before = Continuity { unseen: kani::any(), counting: true, lost: kani::any() };
    let well = Sight {
        valid: true,
        clear: true,
        movement: Movement::Steady,
        interrupted: false,
        in_operation: true,
        in_fault: false,
    };
    let mut after = before;
    after.see(well, kani::any(), || true);
    kani::cover!(before.lost && before.unseen > 0, "lost before");
    kani::cover!(!before.lost, "not lost");
    assert!(after == Continuity { unseen, ..before });
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// [`Continuity::see`] of a window of which nothing is amiss, in operation, sets what was unseen to nothing, and that is all: from
/// any state in which the count means something.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_sight_is_the_same() {
    sight_is_the_same(0);
}

/// One window is claimed to be unseen.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_sight_is_the_same() {
    sight_is_the_same(1);
}

fn what_is_unlike_does_not_repeat<T: Float + Arbitrary>(either: bool) {
    let (now, before): ([T; 4], [T; 4]) = (kani::any(), kani::any());
    let other = unlike(&now, &before);
    kani::cover!(other && now[2] == before[2], "the last sample alone is the same");
    kani::cover!(!other && repeats(&now, &before), "a window that repeats");
    if other || (either && now[0] != before[0]) {
        kani::cover!(other || now[1] == before[1], "not the same");
        assert!(!repeats(&now, &before));
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// A window that is [`unlike`] the one before does not [`repeats`] it: for any bits.
#[kani::proof]
pub fn proof_what_is_unlike_does_not_repeat_f32() {
    what_is_unlike_does_not_repeat::<f32>(false);
}

/// A window is claimed not to repeat the one before where X alone differs.
#[kani::proof]
#[kani::should_panic]
pub fn twin_what_is_unlike_does_not_repeat_f32() {
    what_is_unlike_does_not_repeat::<f32>(true);
}

/// `turned(force)`: whether a force may have its sign turned round.
fn outputs_are_the_same<T: Float + Arbitrary>(turned: impl Fn(T) -> bool) {
    // precondition: what the settings accept
    let limit: T = kani::any_where(|l: &T| *l > T::zero() && l.is_finite());
    let a = AxisForces { x_c: kani::any(), x_s: kani::any(), y_c: kani::any(), y_s: kani::any() };
    let alike = |v: T| if turned(v) && kani::any() { -v } else { v };
    let b = AxisForces { x_c: alike(a.x_c), x_s: alike(a.x_s), y_c: alike(a.y_c), y_s: alike(a.y_s) };
    let (cos, sin): (T, T) = (kani::any(), kani::any());
    let (one, other) = (put_out(limit, &a, cos, sin), put_out(limit, &b, cos, sin));
    kani::cover!(one.0 == limit && one.1 < T::zero(), "one at the limit, the other within");
    assert!(one.0 == other.0 && one.1 == other.1);
    let long = limited(limit, a.x_c * cos + a.x_s * sin, a.y_c * cos + a.y_s * sin);
    assert!(one.0 == long.0 && one.1 == long.1);
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// [`put_out`] makes the same of forces that differ in the sign of zero alone, but for the sign of zero, and the same as
/// [`limited`], which it spares: for any bits of forces and phase.
#[kani::proof]
pub fn proof_outputs_are_the_same_f32() {
    outputs_are_the_same(|force: f32| force == 0.0);
}

/// The sign of forces up to one is turned round too.
#[kani::proof]
#[kani::should_panic]
pub fn twin_outputs_are_the_same_f32() {
    outputs_are_the_same(|force: f32| force <= 1.0);
}
