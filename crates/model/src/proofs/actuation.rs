//! Equations 8 to 11.

use crate::actuation::{actuation_gain_ratio, misaligned_forces};
use crate::{ActuationGains, ControlOutputs, Float};
use kani::Arbitrary;

use super::{is_nan, sized};

/// Powers of two, so that the products' bounds are exact.
const LARGEST_COMMAND: f64 = 1024.0;
const LARGEST_GAIN: f64 = 1_048_576.0;

fn any_outputs<T: Float + Arbitrary>() -> ControlOutputs<T> {
    // precondition: outputs as limited by the controllers, at most a kilovolt
    ControlOutputs { v_as: sized(0.0, LARGEST_COMMAND), v_qc: sized(0.0, LARGEST_COMMAND) }
}

fn misaligned_forces_are_bounded<T: Float + Arbitrary>(share: T) {
    let v = any_outputs::<T>();
    // precondition: a gain of any size that electronics have
    let gain: T = sized(0.0, LARGEST_GAIN);
    // precondition: a finite angle
    let theta_error: T = kani::any_where(|theta: &T| theta.is_finite());
    let f = misaligned_forces(gain, &v, theta_error);
    let most = share * T::from_f64(LARGEST_COMMAND * LARGEST_GAIN);
    kani::cover!(f.q_s > T::one() && f.a_c < T::zero(), "a leak");
    kani::cover!(theta_error == T::zero() && f.a_s > T::one(), "aligned");
    for force in [f.a_s, f.q_s, f.q_c, f.a_c] {
        assert!(force >= -most && force <= most);
    }
    if theta_error == T::zero() {
        kani::cover!(true, "aligned");
        assert!(f.a_s == gain * v.v_as && f.q_c == gain * v.v_qc);
        assert!(f.q_s == T::zero() && f.a_c == T::zero());
    }
}

//= specs/equation-08.md#aligned-forces
//# Without an angle error each command MUST act on its own axis only.
/// Equation 8's forces ([`misaligned_forces`]) never exceed the largest gain times the largest command, and without an
/// error each command acts on its own axis alone.
#[kani::proof]
pub fn proof_misaligned_forces_are_bounded_f32() {
    misaligned_forces_are_bounded(1.0_f32);
}

/// The command alone is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_misaligned_forces_are_bounded_f32() {
    misaligned_forces_are_bounded(1.0 / LARGEST_GAIN as f32);
}

fn axis_forces_are_bounded<T: Float + Arbitrary>(share: T) {
    let v = any_outputs::<T>();
    // precondition: gains of any size that electronics have
    let gains: ActuationGains<T> = ActuationGains { x: sized(0.0, LARGEST_GAIN), y: sized(0.0, LARGEST_GAIN) };
    // precondition: a cosine and a sine
    let (cos, sin): (T, T) = (sized(0.0, 1.0), sized(0.0, 1.0));
    let f = gains.axis_forces_along(&v, cos, sin);
    let most = share * T::from_f64(LARGEST_COMMAND * LARGEST_GAIN);
    kani::cover!(f.x_c > T::one() && f.y_s < T::zero(), "forces on both axes");
    for force in [f.x_c, f.x_s, f.y_c, f.y_s] {
        assert!(force >= -most && force <= most);
    }
    if cos == T::one() && sin == T::zero() {
        kani::cover!(f.x_s > T::one(), "along X");
        assert!(f.x_s == gains.x * v.v_as && f.y_c == gains.y * v.v_qc && f.y_s == T::zero() && f.x_c == T::zero());
    }
}

//= specs/equation-09.md#projection
//# Each channel MUST make its gain times the projection of both commands onto its axis.
/// Equation 9's forces along a direction ([`ActuationGains::axis_forces_along`]) never exceed the largest gain times the largest command, and at
/// 0° each channel has its own command alone.
#[kani::proof]
pub fn proof_axis_forces_are_bounded_f32() {
    axis_forces_are_bounded(1.0_f32);
}

/// The command alone is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_axis_forces_are_bounded_f32() {
    axis_forces_are_bounded(1.0 / LARGEST_GAIN as f32);
}

fn half_a_turn_reverses<T: Float + Arbitrary>(turned: impl Fn(T, T) -> (T, T)) {
    let gains: ActuationGains<T> = ActuationGains { x: kani::any(), y: kani::any() };
    let v: ControlOutputs<T> = ControlOutputs { v_as: kani::any(), v_qc: kani::any() };
    let (cos, sin): (T, T) = (kani::any(), kani::any());
    let (cos_there, sin_there) = turned(cos, sin);
    let (a, b) = (gains.axis_forces_along(&v, cos, sin), gains.axis_forces_along(&v, cos_there, sin_there));
    kani::cover!(a.x_c > T::one() && a.y_s < -T::one() && a.x_c.is_finite(), "forces on both axes");
    kani::cover!(is_nan(a.x_c), "no number");
    for (here, there) in [(a.x_c, b.x_c), (a.x_s, b.x_s), (a.y_c, b.y_c), (a.y_s, b.y_s)] {
        assert!(here == -there || (is_nan(here) && is_nan(there)));
    }
}

//= specs/equation-09.md#half-a-turn-reverses-the-forces
//# Turning the orientation by 180° MUST reverse every force.
/// Equation 9 along a direction ([`ActuationGains::axis_forces_along`]) and along its opposite gives exactly opposite
/// forces, for any bits of gains, commands and direction.
#[kani::proof]
pub fn proof_half_a_turn_reverses_f32() {
    half_a_turn_reverses(|cos: f32, sin: f32| (-cos, -sin));
}

/// The direction is mirrored, not turned.
#[kani::proof]
#[kani::should_panic]
pub fn twin_half_a_turn_reverses_f32() {
    half_a_turn_reverses(|cos: f32, sin: f32| (-cos, sin));
}

/// Equation 9 along a direction ([`ActuationGains::axis_forces_along`]) and along its opposite gives exactly opposite
/// forces, for any bits of gains, commands and direction.
#[kani::proof]
pub fn proof_half_a_turn_reverses_f64() {
    half_a_turn_reverses(|cos: f64, sin: f64| (-cos, -sin));
}

/// The direction is mirrored, not turned.
#[kani::proof]
#[kani::should_panic]
pub fn twin_half_a_turn_reverses_f64() {
    half_a_turn_reverses(|cos: f64, sin: f64| (-cos, sin));
}

fn equal_gains_do_not_leak<T: Float + Arbitrary>(factor: T) {
    let v = any_outputs::<T>();
    // precondition: a gain of any size that electronics have
    let x: T = sized(0.0, 1e6);
    // precondition: an angle whose double is finite
    let theta: T = sized(0.0, 1e30);
    let f = ActuationGains { x, y: factor * x }.orbit_forces(&v, theta);
    kani::cover!(theta > T::one(), "any angle");
    kani::cover!(f.a_s > T::one() && f.q_c < T::zero(), "both commands");
    assert!(f.a_s == x * v.v_as && f.q_c == x * v.v_qc);
    assert!(f.q_s == T::zero() && f.a_c == T::zero());
}

//= specs/equation-10.md#equal-gains-leave-equation-8
//# Equal gains MUST give the forces of Equation 8 without an angle error, exactly.
/// With equal gains Equation 10 ([`ActuationGains::orbit_forces`]) gives gain times command on the command's own axis
/// and nothing on the other, exactly.
#[kani::proof]
pub fn proof_equal_gains_do_not_leak_f32() {
    equal_gains_do_not_leak(1.0_f32);
}

/// The gains differ by one percent.
#[kani::proof]
#[kani::should_panic]
pub fn twin_equal_gains_do_not_leak_f32() {
    equal_gains_do_not_leak(1.01_f32);
}

fn leak_is_bounded<T: Float + Arbitrary>(share: T) {
    let v = any_outputs::<T>();
    // precondition: gains of any size that electronics have
    let gains: ActuationGains<T> = ActuationGains { x: sized(0.0, 1e6), y: sized(0.0, 1e6) };
    // budget: angles of so many turns
    let f = gains.orbit_forces(&v, sized(0.0, 1e6));
    let half = T::half() * (gains.y - gains.x);
    kani::cover!(f.q_s > T::one() && f.a_c < T::zero(), "a leak");
    assert!(f.q_s.magnitude() <= share * (half * v.v_as).magnitude());
    assert!(f.a_c.magnitude() <= share * (half * v.v_qc).magnitude());
    assert!(f.a_s.is_finite() && f.q_c.is_finite());
}

/// Equation 10's force on the wrong axis ([`ActuationGains::orbit_forces`]) never exceeds half the difference of the
/// gains times the command.
#[kani::proof]
pub fn proof_leak_is_bounded_f32() {
    leak_is_bounded(1.0_f32);
}

/// 99 % are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_leak_is_bounded_f32() {
    leak_is_bounded(0.99_f32);
}

//= specs/equation-10.md#equal-gains-leave-equation-8
//# Equal gains MUST give the forces of Equation 8 without an angle error, exactly.
/// With equal gains Equation 10 ([`ActuationGains::orbit_forces`]) gives gain times command on the command's own axis
/// and nothing on the other, exactly.
#[kani::proof]
pub fn proof_equal_gains_do_not_leak_f64() {
    equal_gains_do_not_leak(1.0_f64);
}

/// The gains differ by one percent.
#[kani::proof]
#[kani::should_panic]
pub fn twin_equal_gains_do_not_leak_f64() {
    equal_gains_do_not_leak(1.01_f64);
}

fn ratio_keeps_its_sign<T: Float + Arbitrary>(turned: T) {
    // precondition: decay times and outputs of any size that a ring-down has
    let (tau_0, tau_90): (T, T) = (sized(1e-6, 1e6), sized(1e-6, 1e6));
    // precondition: outputs other than zero
    let (v_0, v_90): (T, T) = (sized(1e-6, 1e6), sized(1e-6, 1e6));
    // precondition: decay times are positive
    kani::assume(tau_0 > T::zero() && tau_90 > T::zero());
    let ratio = actuation_gain_ratio(tau_0, v_0, tau_90, turned * v_90);
    kani::cover!(ratio > T::two(), "X is stronger");
    kani::cover!(ratio < T::zero(), "one drive is reversed");
    assert!(ratio.is_finite() && ratio != T::zero());
    assert!((ratio > T::zero()) == ((v_0 > T::zero()) == (v_90 > T::zero())));
}

//= specs/equation-11.md#ratio-of-the-gains
//# The ratio MUST be the gain of X over the gain of Y where each control output balances the damping along its axis.
/// Equation 11 ([`actuation_gain_ratio`]) is a finite number other than zero, positive where both outputs have one sign.
#[kani::proof]
pub fn proof_ratio_keeps_its_sign_f32() {
    ratio_keeps_its_sign(1.0_f32);
}

/// One output is taken with the other sign.
#[kani::proof]
#[kani::should_panic]
pub fn twin_ratio_keeps_its_sign_f32() {
    ratio_keeps_its_sign(-1.0_f32);
}
