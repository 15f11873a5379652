//! The bound that every command passes.

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
