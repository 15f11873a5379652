//! Equations 2 and 4.

use crate::{Envelope, Float, Pendulum};
use kani::Arbitrary;

use super::is_nan;

fn any_envelope<T: Float + Arbitrary>() -> Envelope<T> {
    Envelope::new(kani::any(), kani::any(), kani::any(), kani::any())
}

fn energy_bounds_the_orientation<T: Float + Arbitrary>(share: T) {
    let e = any_envelope::<T>();
    let p = e.pendulum();
    kani::cover!(p.e > T::one() && p.e.is_finite() && p.r < T::zero(), "a vibration along Y");
    kani::cover!(p.e == T::zero() && e.x_c != T::zero(), "underflow");
    kani::cover!(is_nan(p.e), "no number");
    let no_number = is_nan(e.x_c) || is_nan(e.x_s) || is_nan(e.y_c) || is_nan(e.y_s);
    assert!(p.e >= T::zero() || (is_nan(p.e) && no_number));
    if !is_nan(p.r) {
        kani::cover!(p.r > T::zero(), "a vibration along X");
        assert!(p.r.magnitude() <= share * p.e);
    }
}

//= specs/equation-02.md#energy-is-not-negative
//# The energy MUST be zero or more, or NaN where a component of the envelope is NaN.
//= specs/equation-02.md#energy-bounds-the-orientation
//# The magnitude of R MUST NOT exceed E.
/// The energy of [`Envelope::pendulum`] is not negative and bounds |R|, for any bits of the envelope.
#[kani::proof]
pub fn proof_energy_bounds_the_orientation_f32() {
    energy_bounds_the_orientation(1.0_f32);
}

/// Half the energy is claimed to bound |R|.
#[kani::proof]
#[kani::should_panic]
pub fn twin_energy_bounds_the_orientation_f32() {
    energy_bounds_the_orientation(0.5_f32);
}

fn a_finite_energy_is_of_numbers<T: Float + Arbitrary>(claimed: impl Fn(T) -> bool) {
    let e = any_envelope::<T>();
    kani::cover!(e.x_c.is_finite() && e.y_s.is_finite() && !e.pendulum().e.is_finite(), "too large");
    if e.pendulum().e.is_finite() {
        kani::cover!(e.x_s < -T::one(), "a vibration");
        assert!(claimed(e.x_c) && claimed(e.x_s) && claimed(e.y_c) && claimed(e.y_s));
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// Where the energy of [`Envelope::pendulum`] is finite, so is each part of the envelope, for any bits of it.
#[kani::proof]
pub fn proof_a_finite_energy_is_of_numbers_f32() {
    a_finite_energy_is_of_numbers(|v: f32| v.is_finite());
}

/// That each part is below 2⁶⁰ is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_a_finite_energy_is_of_numbers_f32() {
    a_finite_energy_is_of_numbers(|v: f32| v.magnitude() < 1.152_921_5e18);
}

/// The same number, or both none.
fn same<T: Float>(a: T, b: T) -> bool {
    a == b || (is_nan(a) && is_nan(b))
}

fn half_a_turn_is_no_turn<T: Float + Arbitrary>(turned: impl Fn(Envelope<T>) -> Envelope<T>) {
    let e = any_envelope::<T>();
    let (p, q) = (e.pendulum(), turned(e).pendulum());
    kani::cover!(p.q > T::one() && p.q.is_finite() && p.s < T::zero(), "a turning vibration");
    assert!(same(p.e, q.e) && same(p.q, q.q) && same(p.r, q.r) && same(p.s, q.s) && same(p.l, q.l));
}

//= specs/equation-02.md#half-a-turn
//# The variables of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
/// [`Envelope::pendulum`] of an envelope and of its negative are the same numbers, for any bits.
#[kani::proof]
pub fn proof_half_a_turn_is_no_turn_f32() {
    half_a_turn_is_no_turn(|e: Envelope<f32>| -e);
}

/// One component keeps its sign.
#[kani::proof]
#[kani::should_panic]
pub fn twin_half_a_turn_is_no_turn_f32() {
    half_a_turn_is_no_turn(|e: Envelope<f32>| Envelope { x_c: e.x_c, ..-e });
}

fn angle_is_in_range<T: Float + Arbitrary>(half_turn: T, positive: impl Fn(T) -> bool) {
    let (r, s): (T, T) = (kani::any(), kani::any());
    let angle = Pendulum { e: r, q: r, r, s, l: r }.angle();
    kani::cover!(angle > T::one(), "beyond 57°");
    kani::cover!(is_nan(angle), "no number");
    assert!(angle.magnitude() <= half_turn || (is_nan(angle) && (is_nan(r) || is_nan(s))));
    // R of a circle is a difference of equal numbers: +0
    if r == T::zero() && s == T::zero() && positive(r) {
        kani::cover!(true, "a circle");
        assert!(angle == T::zero());
    }
}

//= specs/equation-04.md#range
//# The angle MUST lie within 90° of zero, or be NaN where R or S is NaN.
//= specs/equation-04.md#circle
//# The angle of a circular orbit MUST be zero.
/// The pattern angle [`Pendulum::angle`] lies within 90° or is NaN where R or S is, and is 0 for a circle, for any bits.
#[kani::proof]
pub fn proof_angle_is_in_range_f32() {
    angle_is_in_range(f32::PI * 0.5, |r: f32| r.is_sign_positive());
}

/// 45° are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_angle_is_in_range_f32() {
    angle_is_in_range(f32::PI * 0.25, |r: f32| r.is_sign_positive());
}

//= specs/equation-04.md#range
//# The angle MUST lie within 90° of zero, or be NaN where R or S is NaN.
//= specs/equation-04.md#circle
//# The angle of a circular orbit MUST be zero.
/// The pattern angle [`Pendulum::angle`] lies within 90° or is NaN where R or S is, and is 0 for a circle, for any bits.
#[kani::proof]
pub fn proof_angle_is_in_range_f64() {
    angle_is_in_range(f64::PI * 0.5, |r: f64| r.is_sign_positive());
}

/// 45° are claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_angle_is_in_range_f64() {
    angle_is_in_range(f64::PI * 0.25, |r: f64| r.is_sign_positive());
}

//= specs/equation-02.md#energy-is-not-negative
//# The energy MUST be zero or more, or NaN where a component of the envelope is NaN.
//= specs/equation-02.md#energy-bounds-the-orientation
//# The magnitude of R MUST NOT exceed E.
/// The energy of [`Envelope::pendulum`] is not negative and bounds |R|, for any bits of the envelope.
#[kani::proof]
pub fn proof_energy_bounds_the_orientation_f64() {
    energy_bounds_the_orientation(1.0_f64);
}

/// Half the energy is claimed to bound |R|.
#[kani::proof]
#[kani::should_panic]
pub fn twin_energy_bounds_the_orientation_f64() {
    energy_bounds_the_orientation(0.5_f64);
}

//= specs/equation-02.md#half-a-turn
//# The variables of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
/// [`Envelope::pendulum`] of an envelope and of its negative are the same numbers, for any bits.
#[kani::proof]
pub fn proof_half_a_turn_is_no_turn_f64() {
    half_a_turn_is_no_turn(|e: Envelope<f64>| -e);
}

/// One component keeps its sign.
#[kani::proof]
#[kani::should_panic]
pub fn twin_half_a_turn_is_no_turn_f64() {
    half_a_turn_is_no_turn(|e: Envelope<f64>| Envelope { x_c: e.x_c, ..-e });
}
