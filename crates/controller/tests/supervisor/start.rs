//! From rest to operation: listening, sweeps, the lock and the spin-up.

use super::*;

#[test]
fn it_listens_for_its_time_and_until_there_is_a_beat() {
    let mut state = SupervisorState::default();
    for k in 1..LISTEN {
        let command = supervisor().step(&mut state, &well(), Some(Beat { x2: 9.0, y2: 9.0, windows: 8 }));
        assert_eq!((state.mode, state.windows, command), (Mode::Listen, k, LoopCommand::Listen));
    }
    assert_eq!(becomes(state, &well()), (Mode::Listen, None, LoopCommand::Listen), "no beat yet");
    let (after, command) = hear(state, 9.0, 9.0);
    assert_eq!((after.mode, after.windows, command), (Mode::Lock, 0, LoopCommand::Tune));
}

#[test]
fn a_vibration_is_heard_above_the_threshold_in_the_mean_of_both_channels() {
    let listened = in_mode(Mode::Listen, LISTEN - 1);
    let heard = |x2, y2| hear(listened, x2, y2).0.mode == Mode::Lock;
    // eight windows of 0.25 V² are 2 V²
    assert!(!heard(1.0, 1.0));
    assert!(heard(1.25, 1.0));
    assert!(heard(1.0, 1.25));
}

#[test]
fn what_is_not_heard_is_looked_for_by_as_many_sweeps_as_are_set() {
    for sweeps in 0..5 {
        let listened = SupervisorState { sweeps, ..in_mode(Mode::Listen, LISTEN - 1) };
        let (after, command) = hear(listened, 0.1, 0.1);
        let expected = if sweeps < 3 { (Mode::Sweep, None) } else { (Mode::Fault, Some(Fault::NoResonance)) };
        assert_eq!((after.mode, after.fault_now(), command), (expected.0, expected.1, LoopCommand::Rest), "{sweeps}");
    }
}

#[test]
fn a_channel_with_less_than_a_400th_of_the_power_is_dead_after_a_sweep_or_a_dead_channel() {
    let listened = |sweeps, fault| SupervisorState { sweeps, fault, ..in_mode(Mode::Listen, LISTEN - 1) };
    let mode = |state, x2, y2| hear(state, x2, y2).0.mode;
    for (x2, y2) in [(399.01, 0.99), (0.99, 399.01)] {
        // before a sweep it may be a line along an axis
        assert_eq!(mode(listened(0, None), x2, y2), Mode::Lock);
        assert_eq!(mode(listened(0, Some(Fault::NoLock)), x2, y2), Mode::Lock);
        assert_eq!(mode(listened(0, Some(Fault::DeadChannel)), x2, y2), Mode::Sweep);
        assert_eq!(mode(listened(1, None), x2, y2), Mode::Sweep);
        assert_eq!(mode(listened(2, None), x2, y2), Mode::Sweep);
        let (after, command) = hear(listened(3, None), x2, y2);
        assert_eq!((after.fault_now(), command), (Some(Fault::DeadChannel), LoopCommand::Rest));
    }
    for (x2, y2) in [(399.0, 1.0), (1.0, 399.0), (200.0, 200.0)] {
        assert_eq!(mode(listened(1, None), x2, y2), Mode::Lock);
    }
}

#[test]
fn a_sweep_crosses_the_band_evenly_each_twice_as_long_as_the_last_and_every_second_opposed() {
    // with a budget for the longest of them
    let patient = SupervisorSettings { spin_up_s: 1e4 * WINDOW_S, ..settings() };
    let supervisor = || Supervisor::<f64>::new(&patient).expect("valid");
    for (sweeps, length) in [(0, 4), (1, 8), (2, 16), (3, 32), (8, 1024), (12, 1024)] {
        let mut state = SupervisorState { sweeps, ..in_mode(Mode::Sweep, 0) };
        for k in 1..length {
            let LoopCommand::Sweep { correction_rad_s, opposed } = supervisor().step(&mut state, &well(), None) else {
                panic!("sweep {sweeps} ended after {k} windows");
            };
            let expected = -100.0 + 200.0 * f64::from(k) / f64::from(length);
            assert!((correction_rad_s - expected).abs() < 1e-12, "{correction_rad_s}, not {expected}");
            assert_eq!(opposed, [1, 3].contains(&sweeps));
        }
        let command = supervisor().step(&mut state, &well(), None);
        assert_eq!((state.mode, state.sweeps, command), (Mode::Listen, sweeps + 1, LoopCommand::Rest));
    }
}

#[test]
fn a_sweep_longer_than_can_be_counted_lasts_as_long_as_can_be_counted() {
    let long = SupervisorSettings { sweep_s: 3e8, ..settings() };
    let mut state = SupervisorState { sweeps: 8, windows: u32::MAX - 2, ..in_mode(Mode::Sweep, 0) };
    let supervisor = Supervisor::<f64>::new(&long).expect("valid");
    assert!(matches!(supervisor.step(&mut state, &well(), None), LoopCommand::Sweep { .. }));
    assert_eq!((supervisor.step(&mut state, &well(), None), state.mode), (LoopCommand::Rest, Mode::Listen));
    // beyond what half of the count can hold it stays at the upper end of the band
    for windows in [(1 << 31) - 2, (1 << 31) - 1, 1 << 31, 3_000_000_000] {
        let mut state = SupervisorState { sweeps: 8, windows, ..in_mode(Mode::Sweep, 0) };
        let LoopCommand::Sweep { correction_rad_s, .. } = supervisor.step(&mut state, &well(), None) else {
            panic!("{windows}: it sweeps")
        };
        assert!((correction_rad_s / long.band_rad_s - 1.0).abs() < 1e-8, "{windows}: {correction_rad_s}");
    }
}

#[test]
fn the_phase_is_locked_after_twenty_windows_in_a_row_with_little_phase_error() {
    let mut state = in_mode(Mode::Lock, 0);
    let good = with(|p| p.l = -4.99);
    assert_eq!(supervisor().step(&mut state, &good, None), LoopCommand::Snap);
    assert_eq!(state.good, 0, "the window before the reference was set");
    for k in 1..IN_A_ROW {
        assert_eq!((supervisor().step(&mut state, &good, None), state.good), (LoopCommand::Lock, k));
    }
    // a fifth of the energy is too much
    for l in [5.0, -5.0] {
        let (after, command) = step(state, &with(|p| p.l = l));
        assert_eq!((after.mode, after.good, command), (Mode::Lock, 0, LoopCommand::Lock));
    }
    let (after, command) = step(state, &good);
    assert_eq!((after.mode, after.good, after.windows, command), (Mode::SpinUp, 0, 0, RUN));
}

#[test]
fn without_a_lock_in_its_time_there_is_a_fault() {
    let bad = with(|p| p.l = 12.0);
    assert_eq!(becomes(in_mode(Mode::Lock, LOCK - 2), &bad), (Mode::Lock, None, LoopCommand::Lock));
    assert_eq!(becomes(in_mode(Mode::Lock, LOCK - 1), &bad), fault(Fault::NoLock));
    // a lock in the last window is one
    let locked = SupervisorState { good: IN_A_ROW - 1, ..in_mode(Mode::Lock, LOCK - 1) };
    assert_eq!(becomes(locked, &well()), (Mode::SpinUp, None, RUN));
}

#[test]
fn what_falls_silent_while_locking_is_listened_for_again() {
    assert_eq!(becomes(in_mode(Mode::Lock, 3), &energy(LEAST)), (Mode::Lock, None, LoopCommand::Lock));
    assert_eq!(becomes(in_mode(Mode::Lock, 3), &energy(0.99 * LEAST)), (Mode::Listen, None, LoopCommand::Rest));
}

#[test]
fn the_spin_up_waits_for_twenty_windows_in_a_row_at_the_set_point() {
    let good = |o: &Observation<f64>| step(SupervisorState { good: 5, ..in_mode(Mode::SpinUp, 8) }, o).0.good;
    for e in [20.01, 25.0, 29.99] {
        assert_eq!(good(&energy(e)), 6, "{e}");
    }
    // a fifth off the set energy is too far
    for e in [20.0, 30.0, 6.0, 50.0] {
        assert_eq!(good(&energy(e)), 0, "{e}");
    }
    for (q, expected) in [(2.49, 6), (-2.49, 6), (2.5, 0), (-2.5, 0)] {
        assert_eq!(good(&with(|p| p.q = q)), expected, "{q}");
    }
    let mut state = SupervisorState { sweeps: 2, ..in_mode(Mode::SpinUp, 0) };
    for k in 1..IN_A_ROW {
        assert_eq!((supervisor().step(&mut state, &well(), None), state.good, state.sweeps), (RUN, k, 2));
    }
    for (requested, mode, command) in [
        (RequestedMode::WholeAngle, Mode::WholeAngle, RUN),
        (RequestedMode::Hold, Mode::Hold, RUN_HELD),
        (RequestedMode::RingDown, Mode::RingDown, RUN_DOWN),
    ] {
        let (after, got) = step(SupervisorState { requested, ..state }, &well());
        assert_eq!((after.mode, after.sweeps, after.windows, got), (mode, 0, 0, command));
    }
}

#[test]
fn a_pattern_on_an_axis_after_it_jumped_is_one_channel_that_is_left() {
    let last = |cause| SupervisorState { cause, good: IN_A_ROW - 1, ..in_mode(Mode::SpinUp, 25) };
    let (jumped, other) = (Some(Fault::DeadChannel), Some(Fault::InvalidSamples));
    let line = |r: f64, s: f64| with(move |p| (p.r, p.s) = (r, s));
    let running = (Mode::WholeAngle, None, RUN);
    for sign in [1.0, -1.0] {
        for on_axis in [line(24.0, sign * 0.79), line(-24.0, sign * 0.79)] {
            assert_eq!(becomes(last(jumped), &on_axis), fault(Fault::DeadChannel));
            assert_eq!(becomes(last(other), &on_axis), running);
            assert_eq!(becomes(last(None), &on_axis), running);
        }
        // a thirtieth is off the axis
        assert_eq!(becomes(last(jumped), &line(30.0, sign)), running);
    }
}

#[test]
fn a_spin_up_runs_the_loops_until_its_time_is_over() {
    let slow = energy(12.0);
    for (requested, command) in
        [(RequestedMode::WholeAngle, RUN), (RequestedMode::Hold, RUN_HELD), (RequestedMode::RingDown, RUN_HELD)]
    {
        let before = SupervisorState { requested, ..in_mode(Mode::SpinUp, SPIN_UP - 2) };
        assert_eq!(becomes(before, &slow), (Mode::SpinUp, None, command));
    }
    assert_eq!(becomes(in_mode(Mode::SpinUp, SPIN_UP - 1), &slow), fault(Fault::NoSpinUp));
}

#[test]
fn an_amplitude_that_is_gone_while_the_drives_run_is_a_fault() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        assert_eq!(becomes(in_mode(mode, 3), &energy(0.99 * LEAST)), fault(Fault::AmplitudeLow), "{mode:?}");
        assert_eq!(becomes(in_mode(mode, 3), &energy(LEAST)).0, mode);
    }
}
