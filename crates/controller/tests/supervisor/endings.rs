//! Nothing goes on for ever: whatever is observed, a start ends, and what is out of bounds again and again is a fault.

use super::*;

/// Windows of a start with these settings: twice each mode's longest time.
const BUDGET: u32 = 2 * (4 * LISTEN + (1 + 2 + 4) * SWEEP + LOCK + SPIN_UP + COAST);

const HEARD: Beat<f64> = Beat { x2: 400.0, y2: 400.0, windows: 1 };

/// After how many windows, from power-on, the supervisor is in operation or in a fault, if each window is `o` of the state.
fn ends(o: impl Fn(&SupervisorState) -> Observation<f64>) -> Option<(u32, SupervisorState)> {
    let mut state = SupervisorState::default();
    for k in 1..10 * BUDGET {
        let seen = o(&state);
        supervisor().step(&mut state, &seen, Some(HEARD));
        if !matches!(state.mode, Mode::Listen | Mode::Sweep | Mode::Lock | Mode::SpinUp | Mode::Coast) {
            return Some((k, state));
        }
    }
    None
}

#[test]
fn a_phase_that_is_lost_in_every_spin_up_ends_the_start() {
    let lost = with(|p| (p.e, p.l) = (1.0, 0.9));
    let (k, state) =
        ends(|s| if s.mode == Mode::SpinUp && s.windows > 10 { lost } else { energy(1.0) }).expect("an end");
    assert!(k <= BUDGET && state.mode == Mode::Fault, "{k} windows, {state:?}");
}

#[test]
fn what_falls_silent_in_every_lock_ends_the_start() {
    let (k, state) = ends(|s| energy(if s.mode == Mode::Lock { 0.0 } else { 1.0 })).expect("an end");
    assert_eq!((k, state.mode), (BUDGET, Mode::Fault));
}

#[test]
fn the_budget_names_what_the_start_was_at() {
    let spent = |mode, trying| SupervisorState { trying, cause: Some(Fault::DeadChannel), ..in_mode(mode, 0) };
    let names = [
        (Mode::Listen, Fault::NoResonance),
        (Mode::Sweep, Fault::NoResonance),
        (Mode::Lock, Fault::NoLock),
        (Mode::SpinUp, Fault::NoSpinUp),
        (Mode::Coast, Fault::DeadChannel),
    ];
    for (mode, name) in names {
        let (after, _) = step(spent(mode, BUDGET - 2), &well());
        assert_eq!((after.mode, after.trying), (mode, BUDGET - 1));
        let (after, command) = step(spent(mode, BUDGET - 1), &well());
        assert_eq!((after.fault_now(), after.trying, command), (Some(name), 0, LoopCommand::Rest));
    }
    for mode in [Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        let before = SupervisorState { trying: u32::MAX, ..in_mode(mode, 3) };
        assert_eq!(becomes(before, &well()).0, mode, "operation is no start");
    }
}

#[test]
fn a_pattern_that_comes_back_up_after_a_ring_down_has_a_budget_of_its_own() {
    let before =
        SupervisorState { requested: RequestedMode::WholeAngle, trying: BUDGET - 1, ..in_mode(Mode::RingDown, 99) };
    let (after, _) = step(before, &energy(1.0));
    assert_eq!((after.mode, after.trying), (Mode::SpinUp, 0));
}

/// How many windows it takes until a fault, from operation, if all but every `nth` window is well.
fn until_fault(o: &Observation<f64>, nth: u32) -> Option<(u32, Option<Fault>)> {
    // a budget for fifty interruptions
    let patient = SupervisorSettings { spin_up_s: 1e4 * WINDOW_S, ..settings() };
    let supervisor = Supervisor::<f64>::new(&patient).expect("valid");
    let mut state = in_mode(Mode::WholeAngle, FORGET);
    for k in 1..10_000 {
        // between them, the phase and the amplitude are found again
        let seen = if state.mode == Mode::WholeAngle && k % nth == 0 { *o } else { well() };
        supervisor.step(&mut state, &seen, Some(HEARD));
        if state.mode == Mode::Fault {
            return Some((k, state.fault_now()));
        }
    }
    None
}

#[test]
fn what_is_out_of_bounds_again_and_again_is_a_fault_as_if_it_were_all_the_time() {
    let bad = [
        (energy(100.0 * SET_2), Fault::AmplitudeHigh),
        (energy(6.0), Fault::AmplitudeLow),
        (with(|p| p.q = 20.0), Fault::QuadratureHigh),
        (Observation { clipped: true, ..well() }, Fault::Saturated),
    ];
    for (o, name) in bad {
        for nth in 1..=ENDURE {
            assert_eq!(until_fault(&o, nth), Some((nth * ENDURE, Some(name))), "every {nth}th window");
        }
        // forgotten in between: that many windows in a row were well
        assert_eq!(until_fault(&o, ENDURE + 1), None, "{name:?}");
    }
}

#[test]
fn interruptions_are_counted_until_all_was_well_for_long() {
    for (o, name) in [(invalid(), Fault::InvalidSamples), (with(|p| p.l = 20.0), Fault::NoLock)] {
        let (_, fault) = until_fault(&o, FORGET - 1).expect("a fault");
        assert_eq!(fault, Some(name));
    }
}

#[test]
fn what_is_no_number_is_out_of_bounds() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        let round = with(|p| p.q = f64::NAN);
        assert_eq!(step(in_mode(mode, 3), &round).0.bad, 1, "{mode:?}");
        for o in [energy(f64::NAN), with(|p| p.l = f64::NAN)] {
            assert_eq!(becomes(in_mode(mode, 3), &o), (Mode::Lock, None, LoopCommand::Snap), "{mode:?}");
        }
    }
}

#[test]
fn the_longest_start_that_can_be_set_has_the_longest_budget_that_can_be_counted() {
    // a lock and a spin-up that take nearly 2^31 windows each: twice both is more than is counted
    let most_s = f64::from((1_u32 << 31) - 1) * WINDOW_S;
    let s = SupervisorSettings { lock_s: most_s, spin_up_s: most_s, ..settings() };
    let supervisor = Supervisor::<f64>::new(&s).expect("valid");
    for (trying, mode) in [(1_000_000, Mode::Lock), (u32::MAX - 2, Mode::Lock), (u32::MAX - 1, Mode::Fault)] {
        let mut state = SupervisorState { trying, ..in_mode(Mode::Lock, 1) };
        supervisor.step(&mut state, &well(), None);
        assert_eq!(state.mode, mode, "after {trying} windows");
    }
}
