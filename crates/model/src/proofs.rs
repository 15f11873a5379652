//! Claims on the equations that hold bit for bit: harnesses in Kani's syntax.
//!
//! `cargo xtask prove` proves them on the compiled code, `cargo test` samples them, `cargo kani` checks them where Kani
//! is installed. Each `proof_` has a `twin_` with an error planted in the same body, which has to be refuted. An
//! assumption is either a "precondition:" of the function or a "budget:" of the solver.
//!
//! √, sine, cosine and arctangent are out of a solver's reach; [`stand_in`] takes their place.

pub mod actuation;
pub mod detection;
pub mod pendulum;
pub mod scalar;
pub mod stand_in;

use crate::Float;
use kani::Arbitrary;

/// A number of that magnitude, of either sign.
pub(crate) fn sized<T: Float + Arbitrary>(least: f64, most: f64) -> T {
    let value: T = kani::any();
    kani::assume(value.magnitude() >= T::from_f64(least) && value.magnitude() <= T::from_f64(most));
    value
}

/// NaN, of whatever bits.
pub(crate) fn is_nan<T: Float>(value: T) -> bool {
    value.partial_cmp(&value).is_none()
}
