//! The direction of the major axis.

use cvg_model::Float;
use kani::Arbitrary;

use super::{LONGEST_DIRECTION, any_envelope};
use crate::Status;
use crate::direction::major_axis_of;

fn direction_of_twice_the_angle_is_bounded<T: Float + Arbitrary>(longest: T) {
    let (cos_2, sin_2): (T, T) = (kani::any(), kani::any());
    let d = major_axis_of(&any_envelope(), cos_2, sin_2);
    kani::cover!(d.status == Status::Valid && d.cos < T::zero() && d.sin > T::half(), "a direction");
    kani::cover!(d.status == Status::Undetermined, "no vibration along it");
    kani::cover!(d.status == Status::Invalid, "no number");
    assert!(d.cos.magnitude() <= longest && d.sin.magnitude() <= longest);
}

//= specs/electronics.md#direction-is-bounded
//# The components of the direction of the major axis MUST be finite and below two in magnitude for every input.
//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The components of [`major_axis_of`] are below three, for any bits of envelope and of the doubled angle. Below two rests on
/// more than the contract of the root: on √(w² + s²) ≥ w, which intervals and random tests show.
#[kani::proof]
pub fn proof_direction_of_twice_the_angle_is_bounded_f32() {
    direction_of_twice_the_angle_is_bounded(LONGEST_DIRECTION as f32);
}

/// A half is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_direction_of_twice_the_angle_is_bounded_f32() {
    direction_of_twice_the_angle_is_bounded(0.5_f32);
}
