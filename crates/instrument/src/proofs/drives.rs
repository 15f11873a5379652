//! What is put out.

use cvg_model::{AxisForces, Float};
use kani::Arbitrary;

use crate::drives::put_out;

fn outputs_are_within_the_limit<T: Float + Arbitrary>(share: T) {
    // precondition: what the settings accept
    let limit: T = kani::any_where(|l: &T| *l > T::zero() && l.is_finite());
    let drives = AxisForces { x_c: kani::any(), x_s: kani::any(), y_c: kani::any(), y_s: kani::any() };
    let (cos, sin): (T, T) = (kani::any(), kani::any());
    let (x, y) = put_out(limit, &drives, cos, sin);
    kani::cover!(x == limit && y < T::zero() && y > -limit, "one at the limit, the other within");
    kani::cover!(x == T::zero() && !drives.x_c.is_finite() && y != T::zero(), "no number");
    assert!(x.magnitude() <= share * limit);
    assert!(y.magnitude() <= share * limit);
}

//= specs/dsp.md#bounded-commands
//# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
/// Both outputs of [`put_out`], the last thing that every way through the step calls, are numbers within the converter's limit,
/// for any bits of drives and phase: whatever the parts before it made of state and samples.
#[kani::proof]
pub fn proof_outputs_are_within_the_limit_f32() {
    outputs_are_within_the_limit(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_outputs_are_within_the_limit_f32() {
    outputs_are_within_the_limit(0.5_f32);
}

//= specs/dsp.md#bounded-commands
//# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
/// Both outputs of [`put_out`], the last thing that every way through the step calls, are numbers within the converter's limit,
/// for any bits of drives and phase: whatever the parts before it made of state and samples.
#[kani::proof]
pub fn proof_outputs_are_within_the_limit_f64() {
    outputs_are_within_the_limit(1.0_f64);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_outputs_are_within_the_limit_f64() {
    outputs_are_within_the_limit(0.5_f64);
}
