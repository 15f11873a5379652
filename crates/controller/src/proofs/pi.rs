//! The PI of both controllers of Equation 3.

use cvg_model::Float;
use kani::Arbitrary;

use crate::{Command, Pi, PiState, Status};

/// Any controller that can be built, and its limit.
pub(super) fn any_controller<T: Float + Arbitrary>() -> (Pi<T>, T) {
    let any: Pi<T> = Pi {
        gain: kani::any(),
        integration_time_s: kani::any(),
        period_s: kani::any(),
        limit_v: kani::any(),
        integral_limit: kani::any(),
    };
    // precondition: what `new` accepts
    kani::assume(assumed(&any));
    (any, any.limit_v)
}

/// What the proofs assume of a controller, which is more than `new` builds: of the integral's limit it is not said that it
/// comes of the others. A test holds what `new` accepts against it.
pub(super) fn assumed<T: Float>(pi: &Pi<T>) -> bool {
    let positive = |v: T| v > T::zero() && v.is_finite();
    let times = positive(pi.integration_time_s) && positive(T::two() * pi.integration_time_s) && positive(pi.period_s);
    times && positive(pi.gain) && positive(pi.limit_v) && positive(pi.integral_limit)
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

/// No output at all is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_output_is_bounded_f32() {
    output_is_bounded(0.0_f32);
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

/// No integral at all is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_state_is_within_its_limit_f32() {
    state_is_within_its_limit(0.0_f32);
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

/// `is_outward(after, before)`: the integral moved upward where the output is at the limit to which that would drive it.
fn does_not_wind_up<T: Float + Arbitrary>(is_outward: impl Fn(T, T) -> bool) {
    let (pi, limit_v) = any_controller::<T>();
    let mut state: PiState<T> = PiState { integral: kani::any() };
    // what the step takes the integral as
    let before = state.integral.bounded(pi.integral_limit);
    let (command, against) = match kani::any::<u8>() {
        0 => (pi.energy(&mut state, kani::any(), kani::any()), false),
        1 => (pi.quadrature(&mut state, kani::any()), true),
        _ => (pi.control(&mut state, kani::any()), false),
    };
    if command.status == Status::Limited {
        let is_high = (command.volts == limit_v) != against;
        kani::cover!(is_high && state.integral < before, "let back from the upper limit");
        kani::cover!(!is_high && state.integral == before, "held at the lower limit");
        let grown = if is_high { is_outward(state.integral, before) } else { is_outward(before, state.integral) };
        assert!(!grown);
    }
}

//= specs/equation-03.md#no-windup
//# The integral MUST NOT grow in the direction in which the output is at its limit.
/// Where the output of [`Pi::energy`], [`Pi::quadrature`] or [`Pi::control`] is at its limit, the integral is not further in the
/// direction of that limit than before, for any bits of input and state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_pi_does_not_wind_up_f32() {
    does_not_wind_up(|after: f32, before: f32| after > before);
}

/// It is claimed not to go back either.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_pi_does_not_wind_up_f32() {
    does_not_wind_up(|after: f32, before: f32| after != before);
}
