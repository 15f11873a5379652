//! The PI of both controllers of Equation 3.

use cvg_model::Float;
use kani::Arbitrary;

use crate::{Command, Pi, PiState, Status};

/// Any controller that can be built, and its limit.
pub(super) fn any_controller<T: Float + Arbitrary>() -> (Pi<T>, T) {
    let limit_v = kani::any();
    // precondition: a configuration that `new` accepts
    match Pi::new(kani::any(), kani::any(), kani::any(), limit_v) {
        Ok(pi) => (pi, limit_v),
        Err(_) => {
            kani::assume(false);
            unreachable!()
        }
    }
}

/// One step of the energy, the quadrature or the plain controller, on any input.
fn any_step<T: Float + Arbitrary>(pi: &Pi<T>, state: &mut PiState<T>) -> Command<T> {
    match kani::any::<u8>() {
        0 => pi.energy(state, kani::any(), kani::any()),
        1 => pi.quadrature(state, kani::any()),
        _ => pi.control(state, kani::any()),
    }
}

fn output_is_bounded<T: Float + Arbitrary>(share: T) {
    let (pi, limit_v) = any_controller::<T>();
    let mut state = PiState { integral: kani::any() };
    let command = any_step(&pi, &mut state);
    kani::cover!(command.status == Status::Within, "the output is as asked");
    kani::cover!(command.status == Status::Limited, "the output is limited");
    kani::cover!(command.status == Status::Invalid, "the input is no number");
    assert!(command.volts >= -(share * limit_v) && command.volts <= share * limit_v);
    assert!(state.integral.is_finite());
}

//= specs/equation-03.md#bounded-output
//# The output MUST be finite and within its limit for every input.
/// The output of [`Pi::energy`], [`Pi::quadrature`] and [`Pi::control`] lies within its limit and the integral is
/// finite, for any bits of input and state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_pi_output_is_bounded_f32() {
    output_is_bounded(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_output_is_bounded_f32() {
    output_is_bounded(0.5_f32);
}

fn state_is_within_its_limit<T: Float + Arbitrary>(share: T) {
    let (pi, _) = any_controller::<T>();
    let mut state = PiState { integral: kani::any() };
    let _ = any_step(&pi, &mut state);
    kani::cover!(state.integral == pi.integral_limit, "held at its limit");
    kani::cover!(state.integral < T::zero(), "negative");
    assert!(state.integral.magnitude() <= share * pi.integral_limit);
}

//= specs/equation-03.md#recovery
//# A finite error MUST be answered by the law or by the limit whatever the state was before.
/// After one step of [`Pi::energy`], [`Pi::quadrature`] or [`Pi::control`] the integral lies within what alone commands the
/// limit, for any bits of input and of the state before. So it does after every further step.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_pi_state_is_within_its_limit_f32() {
    state_is_within_its_limit(1.0_f32);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_state_is_within_its_limit_f32() {
    state_is_within_its_limit(0.5_f32);
}

fn error_is_answered<T: Float + Arbitrary>(admitted: impl Fn(T) -> bool) {
    let (pi, limit_v) = any_controller::<T>();
    let mut state = PiState { integral: kani::any() };
    // precondition: a finite error
    let error: T = kani::any_where(|e| admitted(*e));
    let command = pi.control(&mut state, error);
    kani::cover!(command.status == Status::Within, "as the law asks");
    kani::cover!(command.volts == limit_v, "at the limit");
    assert!(command.status != Status::Invalid);
    assert!(command.status == Status::Within || command.volts.magnitude() == limit_v);
}

//= specs/equation-03.md#recovery
//# A finite error MUST be answered by the law or by the limit whatever the state was before.
/// A finite error is answered by the law or by the limit in [`Pi::control`], for any bits of the state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_pi_answers_a_finite_error_f32() {
    error_is_answered(|e: f32| e.is_finite());
}

/// Errors that are no numbers are let in.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_answers_a_finite_error_f32() {
    error_is_answered(|_: f32| true);
}
