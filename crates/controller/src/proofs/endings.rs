//! The supervisor goes on for ever in nothing: a rank that falls with every window, from every state, by one step.
//!
//! What holds of one step from any state holds of any number of them, so these are claims about unbounded time.

use cvg_model::Float;
use kani::Arbitrary;

use super::supervisor::{any_beat, any_observation, any_state, any_supervisor};
use crate::supervisor::{Fault, MOST_COASTS, Mode, Observation, RequestedMode, Supervisor, SupervisorState};

fn in_operation(mode: Mode) -> bool {
    matches!(mode, Mode::WholeAngle | Mode::Hold | Mode::RingDown)
}

/// Neither in operation nor in a fault.
fn starting(mode: Mode) -> bool {
    !in_operation(mode) && mode != Mode::Fault
}

fn starts_end<T: Float + Arbitrary>(fall: u32) {
    let supervisor = any_supervisor::<T>();
    let before = any_state();
    // precondition: an instrument that is to be on
    kani::assume(before.requested != RequestedMode::Off);
    // precondition: a fault has a name, as after every step
    kani::assume(before.mode != Mode::Fault || before.fault.is_some());
    let mut state = before;
    supervisor.step(&mut state, &any_observation(), any_beat());
    kani::cover!(starting(before.mode) && starting(state.mode) && before.mode != state.mode, "from mode to mode");
    kani::cover!(starting(before.mode) && state.fault_now() == Some(Fault::NoLock), "given up");
    kani::cover!(starting(before.mode) && in_operation(state.mode), "in operation");
    if starting(before.mode) && starting(state.mode) {
        kani::cover!(true, "a start goes on");
        // what is left of the budget falls with every window, and is never used up
        assert!(state.trying < supervisor.budget);
        assert!(state.trying - before.trying == fall);
    }
    if state.mode == Mode::Fault {
        kani::cover!(true, "in a fault");
        assert!(state.fault.is_some());
    }
}

//= specs/dsp.md#start-budget
//# A start MUST end in operation or in a fault with a name within its budget of windows whatever is observed.
/// [`Supervisor::step`], from any state and for any observation and beat, leaves a start for operation or for a fault with a
/// name, or takes one window from what is left of its budget: within as many windows the start has ended.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_starts_end_f32() {
    starts_end::<f32>(1);
}

/// Two windows are claimed to be taken.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_starts_end_f32() {
    starts_end::<f32>(2);
}

//= specs/dsp.md#start-budget
//# A start MUST end in operation or in a fault with a name within its budget of windows whatever is observed.
/// [`Supervisor::step`], from any state and for any observation and beat, leaves a start for operation or for a fault with a
/// name, or takes one window from what is left of its budget: within as many windows the start has ended.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_starts_end_f64() {
    starts_end::<f64>(1);
}

/// Two windows are claimed to be taken.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_starts_end_f64() {
    starts_end::<f64>(2);
}

/// All that is observed is well within the bounds, and it was so for at least `windows` windows.
fn calm<T: Float>(s: &Supervisor<T>, state: &SupervisorState, o: &Observation<T>, windows: u32) -> bool {
    let p = &o.pendulum;
    let bound = T::half() * p.e;
    let within = p.e > s.low_2 && p.e < s.high_2 && p.q.magnitude() < bound && p.l.magnitude() < bound;
    let well = o.valid && !o.clipped && !o.repeats && !o.jumped && within;
    matches!(state.mode, Mode::WholeAngle | Mode::Hold) && well && state.windows >= windows
}

/// The amplitude or the quadrature is out of bounds; on the way up, or down, an amplitude may be low.
fn out_of_bounds<T: Float>(s: &Supervisor<T>, mode: Mode, o: &Observation<T>) -> bool {
    let p = &o.pendulum;
    let (high, low, round) = (p.e > s.high_2, p.e < s.low_2, p.q.magnitude() >= T::half() * p.e);
    match mode {
        Mode::WholeAngle | Mode::Hold => high || low || round,
        Mode::RingDown | Mode::SpinUp => high || round,
        _ => false,
    }
}

fn nothing_is_walked_around<T: Float + Arbitrary>(slack: u32) {
    let supervisor = any_supervisor::<T>();
    let before = any_state();
    // precondition: an instrument that is to be on
    kani::assume(before.requested != RequestedMode::Off);
    // precondition: not at the end of what can be counted, which is beyond every fault's time
    kani::assume(before.bad < u32::MAX && before.clipped < u32::MAX && before.coasts < u8::MAX);
    let mut state = before;
    let o = any_observation();
    supervisor.step(&mut state, &o, any_beat());
    kani::cover!(state.mode == Mode::Lock && state.coasts > before.coasts, "an interruption");
    kani::cover!(state.mode == Mode::WholeAngle && state.bad > before.bad, "out of bounds");
    kani::cover!(state.mode == Mode::Hold && state.bad == 0 && before.bad > 0, "forgotten");
    if before.mode != Mode::Fault && state.mode != Mode::Fault {
        kani::cover!(true, "no fault");
        if !calm(&supervisor, &state, &o, supervisor.endure) {
            kani::cover!(true, "not well for the time that is endured");
            assert!(state.bad >= before.bad && state.clipped == before.clipped + u32::from(o.clipped) + slack);
        }
        if !calm(&supervisor, &state, &o, supervisor.forget) {
            kani::cover!(true, "not well for the time to forget");
            assert!(state.coasts >= before.coasts && state.starts == before.starts);
        }
        if in_operation(before.mode) && starting(state.mode) {
            kani::cover!(true, "out of operation");
            // by a request for another mode, or counted
            assert!(state.coasts == before.coasts + 1 || (state.mode == Mode::SpinUp && state.trying == 0));
            assert!(state.coasts <= MOST_COASTS || state.mode == Mode::SpinUp);
        }
        if o.valid && before.mode == state.mode && out_of_bounds(&supervisor, before.mode, &o) {
            kani::cover!(o.pendulum.e > supervisor.high_2, "too high");
            kani::cover!(o.pendulum.e < supervisor.low_2, "too low");
            kani::cover!(before.mode == Mode::SpinUp, "on the way up");
            assert!(state.bad == before.bad + 1 && state.bad < supervisor.endure);
        }
        if matches!(state.mode, Mode::WholeAngle | Mode::Hold) && before.mode == state.mode {
            kani::cover!(true, "in operation still");
            // windows in a row in which all was well
            assert!(state.windows == 0 || calm(&supervisor, &state, &o, 0));
        }
    }
}

//= specs/dsp.md#faults-cannot-be-walked-around
//# A window out of bounds MUST be counted until a fault is named, rest is requested, or all was well for the time that is endured.
/// [`Supervisor::step`], from any state and for any observation and beat, takes nothing back of the windows that were out of
/// bounds or clipped but after the time that is endured, nor of the interruptions but after the time to forget, in which
/// all was well; it counts each departure from operation, and each window of an amplitude or a quadrature out of bounds that leaves
/// its mode as it was (on the way up and in a ring-down a low amplitude is none).
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_nothing_is_walked_around_f32() {
    nothing_is_walked_around::<f32>(0);
}

/// A clipped window is claimed to count twice.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_nothing_is_walked_around_f32() {
    nothing_is_walked_around::<f32>(1);
}

//= specs/dsp.md#faults-cannot-be-walked-around
//# A window out of bounds MUST be counted until a fault is named, rest is requested, or all was well for the time that is endured.
/// [`Supervisor::step`], from any state and for any observation and beat, takes nothing back of the windows that were out of
/// bounds or clipped but after the time that is endured, nor of the interruptions but after the time to forget, in which
/// all was well; it counts each departure from operation, and each window of an amplitude or a quadrature out of bounds that leaves
/// its mode as it was (on the way up and in a ring-down a low amplitude is none).
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_nothing_is_walked_around_f64() {
    nothing_is_walked_around::<f64>(0);
}

/// A clipped window is claimed to count twice.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_nothing_is_walked_around_f64() {
    nothing_is_walked_around::<f64>(1);
}
