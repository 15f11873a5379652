//! Equations 5, 6 and 7.

use crate::detection::{angle_error, angle_error_bound, measured_angle};
use crate::{DetectionGains, Float};
use kani::Arbitrary;

use super::{is_nan, sized};

/// Between these a product of two gains and a variable of the pendulum neither overflows nor vanishes in `f32`.
const GAIN: (f64, f64) = (1e-6, 1e6);

fn quadrature_keeps_zero_and_sign<T: Float + Arbitrary>(one_sign: bool) {
    // precondition: gains of any size that electronics have
    let gains: DetectionGains<T> = DetectionGains { x: sized(GAIN.0, GAIN.1), y: sized(GAIN.0, GAIN.1) };
    // precondition: gains of one sign
    kani::assume((gains.x > T::zero()) == (gains.y > T::zero()) || !one_sign);
    let q: T = kani::any();
    // precondition: no underflow
    kani::assume(q == T::zero() || (q.magnitude() > T::from_f64(1e-20) && q.magnitude() < T::from_f64(1e20)));
    let q_d = gains.measured_quadrature(q);
    kani::cover!(q == T::zero(), "no quadrature");
    kani::cover!(q < T::zero() && gains.x < T::zero(), "both channels reversed");
    kani::cover!(q > T::one(), "quadrature");
    assert!((q_d == T::zero()) == (q == T::zero()));
    assert!((q_d > T::zero()) == (q > T::zero()));
}

//= specs/equation-05.md#zero-is-kept
//# The measured quadrature of an orbit without quadrature MUST be zero.
//= specs/equation-05.md#sign-is-kept
//# Detection gains of one sign MUST keep the sign of the quadrature.
/// Equation 5, [`DetectionGains::measured_quadrature`], keeps zero and the sign: a loop that nulls the measured quadrature nulls the quadrature.
#[kani::proof]
pub fn proof_quadrature_keeps_zero_and_sign_f32() {
    quadrature_keeps_zero_and_sign::<f32>(true);
}

/// Gains of opposite signs are let in.
#[kani::proof]
#[kani::should_panic]
pub fn twin_quadrature_keeps_zero_and_sign_f32() {
    quadrature_keeps_zero_and_sign::<f32>(false);
}

//= specs/equation-05.md#zero-is-kept
//# The measured quadrature of an orbit without quadrature MUST be zero.
//= specs/equation-05.md#sign-is-kept
//# Detection gains of one sign MUST keep the sign of the quadrature.
/// Equation 5, [`DetectionGains::measured_quadrature`], keeps zero and the sign: a loop that nulls the measured quadrature nulls the quadrature.
#[kani::proof]
pub fn proof_quadrature_keeps_zero_and_sign_f64() {
    quadrature_keeps_zero_and_sign::<f64>(true);
}

/// Gains of opposite signs are let in.
#[kani::proof]
#[kani::should_panic]
pub fn twin_quadrature_keeps_zero_and_sign_f64() {
    quadrature_keeps_zero_and_sign::<f64>(false);
}

fn reversed_channel_reverses<T: Float + Arbitrary>(reversed: impl Fn(DetectionGains<T>) -> DetectionGains<T>) {
    let gains: DetectionGains<T> = DetectionGains { x: kani::any(), y: kani::any() };
    let q: T = kani::any();
    let (a, b) = (gains.measured_quadrature(q), reversed(gains).measured_quadrature(q));
    kani::cover!(a > T::one() && a.is_finite(), "quadrature");
    kani::cover!(is_nan(a), "no number");
    assert!(a == -b || (is_nan(a) && is_nan(b)));
}

//= specs/equation-05.md#reversed-channel
//# Reversing one channel MUST reverse the sign of the measured quadrature.
/// Reversing a channel reverses [`DetectionGains::measured_quadrature`] exactly, for any bits of gains and quadrature.
#[kani::proof]
pub fn proof_reversed_channel_reverses_f32() {
    reversed_channel_reverses(|g: DetectionGains<f32>| DetectionGains { y: -g.y, ..g });
}

/// Both channels are reversed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_reversed_channel_reverses_f32() {
    reversed_channel_reverses(|g: DetectionGains<f32>| DetectionGains { x: -g.x, y: -g.y });
}

fn equal_gains_hide_the_angle<T: Float + Arbitrary>(factor: T) {
    // precondition: gains other than zero, of any size that electronics have
    let x: T = sized(GAIN.0, GAIN.1);
    let gains = DetectionGains { x, y: factor * x };
    // precondition: an energy whose products do not overflow
    let e: T = sized(0.0, 1e20);
    // budget: angles of so many turns
    let (a, b) = (sized(0.0, 1e6), sized(0.0, 1e6));
    let (at_a, at_b) = (gains.measured_energy(e, a), gains.measured_energy(e, b));
    kani::cover!(at_a > T::one(), "energy");
    assert!(at_a == at_b);
}

//= specs/equation-06.md#equal-gains
//# Equal gains MUST make the measured energy independent of the angle.
/// With equal gains Equation 6, [`DetectionGains::measured_energy`], gives the same number at any two angles.
#[kani::proof]
pub fn proof_equal_gains_hide_the_angle_f32() {
    equal_gains_hide_the_angle(1.0_f32);
}

/// The gains differ by one percent.
#[kani::proof]
#[kani::should_panic]
pub fn twin_equal_gains_hide_the_angle_f32() {
    equal_gains_hide_the_angle(1.01_f32);
}

fn measured_energy_is_not_negative<T: Float + Arbitrary>(least: T) {
    // precondition: gains of any size that electronics have
    let gains: DetectionGains<T> = DetectionGains { x: sized(GAIN.0, GAIN.1), y: sized(GAIN.0, GAIN.1) };
    // budget: an energy whose products do not overflow
    let e: T = kani::any_where(|e| *e >= T::zero() && *e <= T::from_f64(1e6));
    // budget: angles of so many turns
    let e_d = gains.measured_energy(e, sized(0.0, 1e6));
    kani::cover!(e_d > T::one(), "energy");
    kani::cover!(e_d == T::zero() && e > T::zero(), "hidden by rounding");
    assert!(e_d >= least && e_d.is_finite());
}

/// Equation 6, [`DetectionGains::measured_energy`], gives a finite energy of 0 or more, wherever the cosine rounds to.
#[kani::proof]
pub fn proof_measured_energy_is_not_negative_f32() {
    measured_energy_is_not_negative(0.0_f32);
}

/// More than zero is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_measured_energy_is_not_negative_f32() {
    measured_energy_is_not_negative(f32::MIN_POSITIVE);
}

fn angles_are_total<T: Float + Arbitrary>(most: T) {
    let (g, theta): (T, T) = (kani::any(), kani::any());
    for angle in [measured_angle(g, theta), angle_error(g, theta), angle_error_bound(g)] {
        kani::cover!(angle < -T::one(), "beyond −57°");
        kani::cover!(is_nan(angle), "no number");
        assert!(angle.magnitude() <= most || is_nan(angle));
    }
}

//= specs/equation-07.md#total
//# The measured angle, the error and the bound MUST lie within 180° of zero or be NaN.
/// Equation 7 ([`measured_angle`]), its error ([`angle_error`]) and the bound of the error ([`angle_error_bound`]) lie
/// within 180° or are NaN, for any bits.
#[kani::proof]
pub fn proof_angles_are_total_f32() {
    angles_are_total(f32::PI);
}

/// 90° are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_angles_are_total_f32() {
    angles_are_total(f32::PI * 0.5);
}

//= specs/equation-07.md#total
//# The measured angle, the error and the bound MUST lie within 180° of zero or be NaN.
/// Equation 7 ([`measured_angle`]), its error ([`angle_error`]) and the bound of the error ([`angle_error_bound`]) lie
/// within 180° or are NaN, for any bits.
#[kani::proof]
pub fn proof_angles_are_total_f64() {
    angles_are_total(f64::PI);
}

/// 90° are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_angles_are_total_f64() {
    angles_are_total(f64::PI * 0.5);
}

fn error_has_no_branch_cut<T: Float + Arbitrary>(most: T) {
    // precondition: g > 0, of any size that electronics have
    let g: T = kani::any_where(|g| *g >= T::from_f64(GAIN.0) && *g <= T::from_f64(GAIN.1));
    // budget: angles of so many turns
    let error = angle_error(g, sized(0.0, 1e6));
    kani::cover!(error > T::one() && g > T::one(), "beyond 57°");
    kani::cover!(g < T::one(), "Y is weaker");
    assert!(error.magnitude() <= most);
    if g == T::one() {
        kani::cover!(true, "equal gains");
        assert!(error == T::zero());
    }
    let bound = angle_error_bound(g);
    assert!(bound >= T::zero() && bound <= most);
}

//= specs/equation-07.md#no-mismatch
//# Equal gains MUST give an error of exactly zero.
/// [`angle_error`] is finite, stays off the branch cut (within 90°), and is exactly 0 for equal gains;
/// [`angle_error_bound`] is not negative and within 90°.
#[kani::proof]
pub fn proof_error_has_no_branch_cut_f32() {
    error_has_no_branch_cut(f32::PI * 0.5);
}

/// 60° are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_error_has_no_branch_cut_f32() {
    error_has_no_branch_cut(f32::PI / 3.0);
}

//= specs/equation-05.md#reversed-channel
//# Reversing one channel MUST reverse the sign of the measured quadrature.
/// Reversing a channel reverses [`DetectionGains::measured_quadrature`] exactly, for any bits of gains and quadrature.
#[kani::proof]
pub fn proof_reversed_channel_reverses_f64() {
    reversed_channel_reverses(|g: DetectionGains<f64>| DetectionGains { y: -g.y, ..g });
}

/// Both channels are reversed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_reversed_channel_reverses_f64() {
    reversed_channel_reverses(|g: DetectionGains<f64>| DetectionGains { x: -g.x, y: -g.y });
}

/// Equation 6, [`DetectionGains::measured_energy`], gives a finite energy of 0 or more, wherever the cosine rounds to.
#[kani::proof]
pub fn proof_measured_energy_is_not_negative_f64() {
    measured_energy_is_not_negative(0.0_f64);
}

/// More than zero is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_measured_energy_is_not_negative_f64() {
    measured_energy_is_not_negative(f64::MIN_POSITIVE);
}
