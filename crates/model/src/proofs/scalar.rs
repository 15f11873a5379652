//! The bound that every command passes, and the whole number below one.

use crate::Float;
use kani::Arbitrary;

fn bound_holds<T: Float + Arbitrary>(share: T) {
    let (value, limit): (T, T) = (kani::any(), kani::any());
    let bounded = value.bounded(limit);
    kani::cover!(bounded == limit && limit > T::one() && value > limit, "held at the limit");
    kani::cover!(bounded == value && value < T::zero(), "left as it was");
    kani::cover!(super::is_nan(value) && limit > T::zero(), "no number");
    if limit >= T::zero() {
        kani::cover!(true, "a limit");
        assert!(bounded >= -(share * limit) && bounded <= share * limit);
    } else {
        kani::cover!(true, "no limit");
        assert!(bounded == T::zero());
    }
    if value >= -limit && value <= limit {
        kani::cover!(true, "within the limit");
        assert!(bounded == value);
    }
}

/// [`Float::bounded`] lies within its limit for any bits of both, is 0 where there is no limit, and is the value itself
/// where that lies within.
#[kani::proof]
pub fn proof_bound_holds_f32() {
    bound_holds(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_bound_holds_f32() {
    bound_holds(0.5_f32);
}

/// [`Float::bounded`] lies within its limit for any bits of both, is 0 where there is no limit, and is the value itself
/// where that lies within.
#[kani::proof]
pub fn proof_bound_holds_f64() {
    bound_holds(1.0_f64);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_bound_holds_f64() {
    bound_holds(0.5_f64);
}

fn floor_is_below<T: Float + Arbitrary>(most: T) {
    let hundred = T::from_f64(100.0);
    // budget: a conversion of small numbers is enough to tell a floor from what is rounded towards zero
    let value: T = kani::any_where(|v: &T| *v >= -hundred && *v <= hundred);
    let floor = value.floor();
    kani::cover!(value < T::zero() && floor != value, "below zero and not whole");
    kani::cover!(value > T::zero() && floor == value, "whole");
    // not the difference from it: that of a tiny negative number is rounded to one
    assert!(floor <= value && value < floor + most);
}

/// [`Float::floor`] is below its number by less than one, on both sides of zero.
#[kani::proof]
pub fn proof_floor_is_below_f32() {
    floor_is_below(1.0_f32);
}

/// Half of one is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_floor_is_below_f32() {
    floor_is_below(0.5_f32);
}
