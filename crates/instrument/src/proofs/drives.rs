//! What is put out.

use cvg_model::{AxisForces, Float};
use kani::Arbitrary;

use crate::delay::Delay;
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

fn drives_are_within_eight_limits<T: Float + Arbitrary>(times: i32) {
    // precondition: what the settings accept: a sine, a cosine, and less than a radian that a correction may turn
    let within = |most: T| kani::any_where(move |v: &T| v.magnitude() <= most);
    // precondition: limits that the settings accept: converters of 1e-9 to 1e9 V
    let limit: T = kani::any_where(|l: &T| *l >= T::from_f64(1e-10) && *l <= T::from_f64(1e10));
    let delay = Delay { cos: within(T::one()), sin: within(T::one()), s: kani::any() };
    let correction: T = kani::any();
    // precondition: a correction within its limit, which is proved of the phase loop and of what is ordered where it does not run
    kani::assume((correction * delay.s).magnitude() <= T::one());
    let forces = AxisForces { x_c: within(limit), x_s: within(limit), y_c: within(limit), y_s: within(limit) };
    let drive = delay.undone(&forces, correction);
    kani::cover!(drive.x_c > limit && drive.y_s < -limit, "beyond the limit of the forces");
    let most = T::ratio(times, 1) * limit;
    for volts in [drive.x_c, drive.x_s, drive.y_c, drive.y_s] {
        assert!(volts.magnitude() <= most);
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The drives that [`Delay::undone`] makes of forces within their limit are numbers within eight times that, for any delay whose
/// correction turns less than a radian.
#[kani::proof]
pub fn proof_drives_are_within_eight_limits_f32() {
    drives_are_within_eight_limits::<f32>(8);
}

/// Once the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_drives_are_within_eight_limits_f32() {
    drives_are_within_eight_limits::<f32>(1);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The drives that [`Delay::undone`] makes of forces within their limit are numbers within eight times that, for any delay whose
/// correction turns less than a radian.
#[kani::proof]
pub fn proof_drives_are_within_eight_limits_f64() {
    drives_are_within_eight_limits::<f64>(8);
}

/// Once the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_drives_are_within_eight_limits_f64() {
    drives_are_within_eight_limits::<f64>(1);
}
