//! The rate loop.

use cvg_model::{Float, Pendulum};
use kani::Arbitrary;

use super::pi::any_controller;
use crate::{Heading, PiState, RateLoop, Status};

fn heading_is_within_its_limit<T: Float + Arbitrary>(share: T) {
    let (pi, _) = any_controller::<T>();
    // precondition: a limit that `tuned` accepts
    let limit_v: T = kani::any_where(|v: &T| *v > T::zero() && v.is_finite());
    let rate = RateLoop { pi, limit_v };
    let target = Heading { cos_2: kani::any(), sin_2: kani::any() };
    let p = Pendulum { e: kani::any(), q: kani::any(), r: kani::any(), s: kani::any(), l: kani::any() };
    let mut state = PiState { integral: kani::any() };
    let command = rate.step(&mut state, &p, &target);
    kani::cover!(command.status == Status::Within && command.volts > T::zero(), "as asked");
    kani::cover!(command.status == Status::Limited, "limited");
    kani::cover!(command.status == Status::Invalid, "no number");
    assert!(command.volts >= -(share * limit_v) && command.volts <= share * limit_v);
}

//= specs/electronics.md#heading-within-its-limit
//# The output that holds the pattern MUST be finite and within its limit for every input and every state.
/// The output of [`RateLoop::step`] lies within its limit, for any bits of pendulum variables, target and state.
#[kani::proof]
pub fn proof_heading_is_within_its_limit_f32() {
    heading_is_within_its_limit(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_heading_is_within_its_limit_f32() {
    heading_is_within_its_limit(0.5_f32);
}
