//! Operation: its modes, its bounds, and what is forgotten.

use super::*;

#[test]
fn each_mode_of_operation_has_its_orders() {
    for (mode, command) in [(Mode::WholeAngle, RUN), (Mode::Hold, RUN_HELD), (Mode::RingDown, RUN_DOWN)] {
        assert_eq!(becomes(in_mode(mode, 3), &well()), (mode, None, command));
    }
}

#[test]
fn a_request_is_fulfilled_at_once_where_the_amplitude_allows() {
    let modes = [
        (RequestedMode::WholeAngle, Mode::WholeAngle, RUN),
        (RequestedMode::Hold, Mode::Hold, RUN_HELD),
        (RequestedMode::RingDown, Mode::RingDown, RUN_DOWN),
    ];
    for (_, from, _) in modes {
        for (requested, to, command) in modes {
            let before = SupervisorState { requested, ..in_mode(from, 4) };
            assert_eq!(becomes(before, &well()), (to, None, command), "{from:?} to {to:?}");
            // a quarter of the set energy is enough
            assert_eq!(becomes(before, &energy(6.25)), (to, None, command), "{from:?} to {to:?}");
            if from != to {
                assert_eq!(becomes(before, &energy(6.24)), (Mode::SpinUp, None, RUN), "{from:?} to {to:?}");
            }
        }
    }
}

#[test]
fn earlier_faults_are_forgotten_after_a_time_in_which_all_was_well() {
    let past = |mode, windows| SupervisorState {
        starts: 2,
        coasts: 9,
        trying: 7,
        cause: Some(Fault::DeadChannel),
        repeats: 3,
        clipped: 3,
        bad: 3,
        ..in_mode(mode, windows)
    };
    for mode in [Mode::WholeAngle, Mode::Hold] {
        let (kept, _) = step(past(mode, FORGET - 2), &well());
        assert_eq!((kept.starts, kept.coasts, kept.trying, kept.cause), (2, 9, 7, Some(Fault::DeadChannel)));
        assert_eq!(kept.windows, FORGET - 1);
        let (forgotten, _) = step(past(mode, FORGET - 1), &well());
        assert_eq!((forgotten.starts, forgotten.coasts, forgotten.trying, forgotten.cause), (0, 0, 0, None));
        // windows out of bounds as soon as the time that is endured was well, and a converter that moves is not stuck
        let (kept, _) = step(past(mode, ENDURE - 2), &well());
        assert_eq!((kept.bad, kept.clipped, kept.repeats), (3, 3, 0));
        let (forgotten, _) = step(past(mode, ENDURE - 1), &well());
        assert_eq!((forgotten.bad, forgotten.clipped, forgotten.starts), (0, 0, 2));
        // in a window that is on a bound or has a blemish not all is well
        let mut blemishes = vec![energy(6.25), energy(56.25)];
        blemishes.push(Observation { clipped: true, ..well() });
        blemishes.push(Observation { repeats: true, ..well() });
        for o in blemishes {
            let (kept, _) = step(past(mode, FORGET + 5), &o);
            assert_eq!((kept.mode, kept.starts, kept.coasts), (mode, 2, 9), "{o:?}");
            // the time begins anew
            assert_eq!((kept.windows, kept.bad), (0, 3), "{o:?}");
        }
        // just inside of the bounds it is
        let inside = [
            energy(6.26),
            energy(56.24),
            with(|p| p.q = 12.49),
            with(|p| p.q = -12.49),
            with(|p| p.l = 12.49),
            with(|p| p.l = -12.49),
        ];
        for o in inside {
            assert_eq!(step(past(mode, FORGET + 5), &o).0.starts, 0, "{o:?}");
        }
    }
    // a ring-down says nothing about the energy loop
    assert_eq!(step(past(Mode::RingDown, FORGET + 5), &well()).0.starts, 2);
}

#[test]
fn an_amplitude_or_a_quadrature_out_of_bounds_is_endured_for_its_time() {
    let high = Observation { pendulum: Pendulum { e: 56.26, ..well().pendulum }, ..well() };
    let round = with(|p| p.q = 12.5);
    let opposite = with(|p| p.q = -12.5);
    let cases = [(high, Fault::AmplitudeHigh), (round, Fault::QuadratureHigh), (opposite, Fault::QuadratureHigh)];
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        for (o, name) in cases {
            let mut state = in_mode(mode, 3);
            for k in 1..ENDURE {
                supervisor().step(&mut state, &o, None);
                assert_eq!((state.mode, state.bad), (mode, k), "{o:?}");
            }
            // a window in bounds takes nothing back
            assert_eq!(step(state, &well()).0.bad, ENDURE - 1, "{mode:?}");
            assert_eq!(becomes(state, &o), fault(name), "{mode:?}");
        }
    }
}

#[test]
fn an_amplitude_up_to_one_and_a_half_times_its_set_value_is_in_bounds() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        for e in [30.0, 50.0, 56.25] {
            let (after, _) = step(SupervisorState { bad: 3, ..in_mode(mode, 3) }, &energy(e));
            assert_eq!((after.mode, after.bad), (mode, 3), "{e}");
        }
    }
}

#[test]
fn an_amplitude_below_half_is_endured_for_its_time_but_in_a_ring_down() {
    for mode in [Mode::WholeAngle, Mode::Hold] {
        let mut state = in_mode(mode, 3);
        for k in 1..ENDURE {
            supervisor().step(&mut state, &energy(6.24), None);
            assert_eq!((state.mode, state.bad), (mode, k));
        }
        assert_eq!(becomes(state, &energy(6.25)).0, mode);
        assert_eq!(becomes(state, &energy(6.24)), fault(Fault::AmplitudeLow));
    }
    for mode in [Mode::SpinUp, Mode::RingDown] {
        let before = SupervisorState { bad: ENDURE - 1, ..in_mode(mode, 3) };
        let (after, _) = step(before, &energy(6.24));
        assert_eq!((after.mode, after.bad), (mode, ENDURE - 1));
    }
}

#[test]
fn a_phase_error_of_half_the_energy_locks_anew() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        for l in [12.5, -12.5] {
            let locked = becomes(in_mode(mode, 3), &with(|p| p.l = l));
            assert_eq!(locked, (Mode::Lock, None, LoopCommand::Snap), "{mode:?}");
        }
        assert_eq!(becomes(in_mode(mode, 3), &with(|p| p.l = 12.49)).0, mode);
    }
}

#[test]
fn an_instrument_goes_on_as_requested_where_nothing_is_counted_and_nothing_to_forget() {
    let on = |state: SupervisorState, o: Observation<f64>| {
        let on = supervisor().runs_unchanged(&state, &o.pendulum);
        if on {
            // all that a step does is to count the window
            let mut counted = state;
            counted.count();
            assert_eq!(step(state, &o), (counted, if state.mode == Mode::Hold { RUN_HELD } else { RUN }));
        }
        on
    };
    for mode in [Mode::WholeAngle, Mode::Hold] {
        let state = in_mode(mode, FORGET + 5);
        assert!(on(state, well()));
        for requested in [RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off] {
            assert_eq!(on(SupervisorState { requested, ..state }, well()), requested == state.requested);
        }
        for (bad, repeats, clipped) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 1)] {
            assert!(!on(SupervisorState { bad, repeats, clipped, ..state }, well()));
            // until it is forgotten, what was out of bounds or clipped stays counted, untouched
            let lately = |windows| SupervisorState { bad, repeats, clipped, windows, ..state };
            assert_eq!(on(lately(ENDURE - 2), well()), repeats == 0);
            assert!(!on(lately(ENDURE - 1), well()));
        }
        // what is left of earlier starts is forgotten by a whole step
        let dead = Some(Fault::DeadChannel);
        for (starts, coasts, trying, cause) in
            [(1, 0, 0, None), (0, 1, 0, None), (0, 0, 1, None), (1, 1, 1, None), (0, 0, 0, dead), (2, 3, 9, dead)]
        {
            let past = |windows| SupervisorState { starts, coasts, trying, cause, windows, ..state };
            assert!(on(past(FORGET - 2), well()) && !on(past(FORGET - 1), well()) && !on(past(u32::MAX), well()));
        }
        assert!(on(SupervisorState { windows: u32::MAX, ..state }, well()));
        for (e, expected) in [(6.25, false), (6.26, true), (56.24, true), (56.25, false), (f64::NAN, false)] {
            assert_eq!(on(state, energy(e)), expected, "{e}");
        }
        // quadrature and phase together below a sixteenth of the energy
        for (q, l, expected) in [(0.8, 0.76, true), (-0.8, -0.76, true), (0.8, 0.77, false), (1.6, 0.0, false)] {
            assert_eq!(on(state, with(|p| (p.q, p.l) = (q, l))), expected, "{q} {l}");
        }
    }
    for mode in [Mode::Listen, Mode::Sweep, Mode::Lock, Mode::SpinUp, Mode::RingDown, Mode::Coast, Mode::Fault] {
        assert!(!on(in_mode(mode, 3), well()), "{mode:?}");
    }
}

#[test]
fn a_phase_is_near_below_a_sixteenth_of_the_energy() {
    for (l, expected) in [(0.0, true), (1.56, true), (-1.56, true), (1.57, false), (-1.57, false), (f64::NAN, false)] {
        assert_eq!(Supervisor::in_phase(&with(|p| p.l = l).pendulum), expected, "{l}");
    }
}

#[test]
fn windows_are_counted_as_far_as_they_can_be() {
    let mut state = in_mode(Mode::Hold, u32::MAX - 1);
    state.count();
    assert_eq!(state, in_mode(Mode::Hold, u32::MAX));
    state.count();
    assert_eq!(state, in_mode(Mode::Hold, u32::MAX));
}
