//! The supervisor.

use cvg_model::{Float, Pendulum};
use kani::Arbitrary;

use crate::supervisor::{Beat, Fault, LoopCommand, Mode, Observation, RequestedMode, Supervisor, SupervisorState};

/// Any supervisor, also such as `new` would refuse.
pub(super) fn any_supervisor<T: Float + Arbitrary>() -> Supervisor<T> {
    Supervisor {
        set_2: kani::any(),
        low_2: kani::any(),
        high_2: kani::any(),
        detection_threshold_2: kani::any(),
        band_rad_s: kani::any(),
        sweep: kani::any(),
        sweeps: kani::any(),
        listen: kani::any(),
        lock: kani::any(),
        spin_up: kani::any(),
        coast: kani::any(),
        endure: kani::any(),
        rest: kani::any(),
        retries: kani::any(),
        forget: kani::any(),
        budget: kani::any(),
    }
}

fn any_fault() -> Option<Fault> {
    match kani::any::<u8>() % 11 {
        0 => Some(Fault::InvalidSamples),
        1 => Some(Fault::StuckChannel),
        2 => Some(Fault::Saturated),
        3 => Some(Fault::DeadChannel),
        4 => Some(Fault::NoResonance),
        5 => Some(Fault::NoLock),
        6 => Some(Fault::NoSpinUp),
        7 => Some(Fault::AmplitudeHigh),
        8 => Some(Fault::AmplitudeLow),
        9 => Some(Fault::QuadratureHigh),
        _ => None,
    }
}

pub(super) fn any_state() -> SupervisorState {
    SupervisorState {
        mode: match kani::any::<u8>() % 9 {
            0 => Mode::Listen,
            1 => Mode::Sweep,
            2 => Mode::Lock,
            3 => Mode::SpinUp,
            4 => Mode::WholeAngle,
            5 => Mode::Hold,
            6 => Mode::RingDown,
            7 => Mode::Coast,
            _ => Mode::Fault,
        },
        fault: any_fault(),
        requested: match kani::any::<u8>() % 4 {
            0 => RequestedMode::WholeAngle,
            1 => RequestedMode::Hold,
            2 => RequestedMode::RingDown,
            _ => RequestedMode::Off,
        },
        windows: kani::any(),
        good: kani::any(),
        bad: kani::any(),
        repeats: kani::any(),
        clipped: kani::any(),
        trying: kani::any(),
        sweeps: kani::any(),
        starts: kani::any(),
        cause: any_fault(),
        coasts: kani::any(),
    }
}

pub(super) fn any_observation<T: Float + Arbitrary>() -> Observation<T> {
    Observation {
        pendulum: Pendulum { e: kani::any(), q: kani::any(), r: kani::any(), s: kani::any(), l: kani::any() },
        valid: kani::any(),
        clipped: kani::any(),
        repeats: kani::any(),
        jumped: kani::any(),
    }
}

pub(super) fn any_beat<T: Float + Arbitrary>() -> Option<Beat<T>> {
    let beat = Beat { x2: kani::any(), y2: kani::any(), windows: kani::any() };
    if kani::any() { Some(beat) } else { None }
}

fn supervisor_is_total<T: Float + Arbitrary>(kept: impl Fn(&Observation<T>) -> bool) {
    let supervisor = any_supervisor::<T>();
    let mut state = any_state();
    // precondition: a fault has a name, as after every step
    kani::assume(state.mode != Mode::Fault || state.fault.is_some());
    let o = any_observation();
    let command = supervisor.step(&mut state, &o, any_beat());
    kani::cover!(state.mode == Mode::WholeAngle && command != LoopCommand::Rest, "in operation");
    kani::cover!(state.fault == Some(Fault::DeadChannel) && state.mode == Mode::Fault, "a fault");
    kani::cover!(matches!(command, LoopCommand::Sweep { .. }), "a sweep");
    if state.mode == Mode::Fault {
        kani::cover!(true, "in a fault");
        assert!(state.fault.is_some() && command == LoopCommand::Rest);
    }
    if state.requested == RequestedMode::Off || !kept(&o) {
        kani::cover!(state.mode != Mode::Fault, "at rest without a fault");
        assert!(command == LoopCommand::Rest);
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// [`Supervisor::step`] does not panic or overflow for any state, observation and beat; a fault keeps its name and the
/// drives off; an invalid window and a request for rest turn them off.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_supervisor_is_total_f32() {
    supervisor_is_total(|o: &Observation<f32>| o.valid);
}

/// The drives are claimed to be off after a clipped sample too.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_supervisor_is_total_f32() {
    supervisor_is_total(|o: &Observation<f32>| o.valid && !o.clipped);
}
