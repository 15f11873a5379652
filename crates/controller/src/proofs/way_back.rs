//! From every fault back into operation: a rank that falls with every window in which all is as it should be.
//!
//! The rank is how many such windows are left. What holds of one step from any state on the way holds of the whole way.

use cvg_model::{Float, Pendulum};
use kani::Arbitrary;

use super::supervisor::{any_state, any_supervisor};
use crate::supervisor::{Beat, ENOUGH, LONG_REST, Mode, Observation, RequestedMode, Supervisor, SupervisorState};

/// Windows of a lock, of which the first sets the phase, and of a spin-up.
const LOCKED: u64 = ENOUGH as u64 + 1;
const SPUN_UP: u64 = ENOUGH as u64;

fn rest<T>(s: &Supervisor<T>, state: &SupervisorState) -> u32 {
    if state.starts < s.retries { s.rest } else { s.rest.saturating_mul(LONG_REST) }
}

/// Windows left until operation, of a state on the way; `None` of one that is not.
fn left<T>(s: &Supervisor<T>, state: &SupervisorState) -> Option<u64> {
    let (windows, good) = (u64::from(state.windows), u64::from(state.good));
    let start = u64::from(s.listen) + LOCKED + SPUN_UP;
    if state.mode == Mode::Fault {
        // at least one more, however long it has rested
        let more = u64::from(rest(s, state)).saturating_sub(windows);
        return Some(start + if more > 0 { more } else { 1 });
    }
    // a start that began after the rest, and has lost no window
    let made = match state.mode {
        Mode::Listen if windows < u64::from(s.listen) => windows,
        Mode::Lock if windows < LOCKED && good == windows.saturating_sub(1) => u64::from(s.listen) + windows,
        Mode::SpinUp if windows < SPUN_UP && good == windows => u64::from(s.listen) + LOCKED + windows,
        _ => return None,
    };
    let clean = state.clipped == 0 && state.cause.is_none() && u64::from(state.trying) == made;
    if clean { Some(start - made) } else { None }
}

/// A window in which all is as it should be in every mode: a line at the set energy, off the axes, of unlike channels.
fn as_it_should_be<T: Float>() -> (Observation<T>, Option<Beat<T>>) {
    let r = T::ratio;
    let pendulum = Pendulum { e: r(1, 1), q: r(0, 1), r: r(3, 5), s: r(4, 5), l: r(0, 1) };
    let seen = Observation { pendulum, valid: true, clipped: false, repeats: false, jumped: false };
    (seen, Some(Beat { x2: r(6, 1), y2: r(2, 1), windows: 8 }))
}

fn the_way_back_ends<T: Float + Arbitrary>(fall: u64) {
    // budget: one device and one window in which all is well, since two products of the same are not the same to the solver
    let supervisor = Supervisor {
        set_2: T::one(),
        low_2: T::ratio(1, 4),
        high_2: T::ratio(9, 4),
        detection_threshold_2: T::ratio(1, 64),
        band_rad_s: T::one(),
        ..any_supervisor::<T>()
    };
    let (o, beat) = as_it_should_be();
    // precondition: times as `new` makes them: of at least a window, and a budget for the shortest start
    kani::assume(supervisor.listen > 0 && supervisor.endure > 0);
    // precondition: the same
    kani::assume(u64::from(supervisor.budget) > u64::from(supervisor.listen) + LOCKED + SPUN_UP);
    // precondition: the same, for a lock and a spin-up
    kani::assume(supervisor.lock > ENOUGH + 1 && supervisor.spin_up > ENOUGH + 1);
    let mut state = any_state();
    // precondition: an instrument that is to be on
    kani::assume(state.requested != RequestedMode::Off);
    let before = left(&supervisor, &state);
    let was = state.mode;
    supervisor.step(&mut state, &o, beat);
    kani::cover!(was == Mode::Fault && state.mode == Mode::Listen && before.is_some(), "a rest is over");
    kani::cover!(was == Mode::Listen && state.mode == Mode::Lock && before.is_some(), "heard");
    kani::cover!(was == Mode::Lock && state.mode == Mode::SpinUp && before.is_some(), "locked");
    kani::cover!(was == Mode::SpinUp && state.mode == Mode::WholeAngle && before.is_some(), "spun up");
    if let Some(before) = before {
        kani::cover!(true, "on the way");
        let after = match state.mode {
            Mode::WholeAngle | Mode::Hold | Mode::RingDown => Some(0),
            _ => left(&supervisor, &state),
        };
        // one window less is left, and so on until none is
        assert!(after == before.checked_sub(fall));
    }
}

//= specs/dsp.md#way-back
//# From every fault the instrument MUST be in operation within its longest rest and its shortest start once all that it observes is as it should be.
/// [`Supervisor::step`], with any times, from any fault and from any state of a start that followed one, after a window of a
/// line at the set energy, is one window nearer to operation: from a fault as many as are left of its rest, then those of
/// listening, 21 of the lock and 20 of the spin-up.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_the_way_back_ends_f32() {
    the_way_back_ends::<f32>(1);
}

/// Each window is claimed to be worth two.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_the_way_back_ends_f32() {
    the_way_back_ends::<f32>(2);
}

//= specs/dsp.md#way-back
//# From every fault the instrument MUST be in operation within its longest rest and its shortest start once all that it observes is as it should be.
/// [`Supervisor::step`], with any times, from any fault and from any state of a start that followed one, after a window of a
/// line at the set energy, is one window nearer to operation: from a fault as many as are left of its rest, then those of
/// listening, 21 of the lock and 20 of the spin-up.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_the_way_back_ends_f64() {
    the_way_back_ends::<f64>(1);
}

/// Each window is claimed to be worth two.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_the_way_back_ends_f64() {
    the_way_back_ends::<f64>(2);
}
