//! The supervisor window by window: what each mode orders, what ends it, after exactly how many windows, and on which
//! side of each bound the bound itself lies.

use cvg_controller::supervisor::{Beat, Observation, Orders};
use cvg_controller::{Fault, Mode, Supervisor, SupervisorSettings, SupervisorState, Wish};
use cvg_model::Pendulum;

/// Set energy, V²: the amplitude of 5 V squared.
const SET_2: f64 = 25.0;
/// The least energy with which the drives may run: a quarter of the 0.5 V squared that is heard.
const LEAST: f64 = 0.0625;

/// Times of the settings, in windows.
const LISTEN: u32 = 5;
const SWEEP: u32 = 4;
const LOCK: u32 = 30;
const SPIN_UP: u32 = 45;
const COAST: u32 = 6;
const ENDURE: u32 = 7;
const REST: u32 = 9;
const FORGET: u32 = 11;
/// Windows in a row that make a lock or a spin-up, and that show a converter to be stuck.
const IN_A_ROW: u32 = 20;
const WINDOW_S: f64 = 0.25;

const RUN: Orders<f64> = Orders::Run { hold: false, ring_down: false };
const RUN_HELD: Orders<f64> = Orders::Run { hold: true, ring_down: false };
const RUN_DOWN: Orders<f64> = Orders::Run { hold: true, ring_down: true };

fn settings() -> SupervisorSettings {
    let windows = |n: u32| f64::from(n) * WINDOW_S;
    SupervisorSettings {
        window_s: WINDOW_S,
        amplitude_v: 5.0,
        heard_v: 0.5,
        band_rad_s: 100.0,
        sweep_s: windows(SWEEP),
        sweeps: 3,
        listen_s: windows(LISTEN),
        lock_s: windows(LOCK),
        spin_up_s: windows(SPIN_UP),
        coast_s: windows(COAST),
        endure_s: windows(ENDURE),
        rest_s: windows(REST),
        retries: 2,
        forget_s: windows(FORGET),
    }
}

fn supervisor() -> Supervisor<f64> {
    Supervisor::new(&settings()).expect("valid")
}

/// The state in `mode` after so many windows of it.
fn in_mode(mode: Mode, windows: u32) -> SupervisorState {
    let wish = match mode {
        Mode::Hold => Wish::Hold,
        Mode::RingDown => Wish::RingDown,
        _ => Wish::WholeAngle,
    };
    SupervisorState { mode, wish, windows, ..SupervisorState::default() }
}

/// A line at the set amplitude, off the axes and in phase.
fn well() -> Observation<f64> {
    energy(SET_2)
}

/// The same line with another energy.
fn energy(e: f64) -> Observation<f64> {
    let pendulum = Pendulum { e, q: 0.0, r: 0.6 * e, s: 0.8 * e, l: 0.0 };
    Observation { pendulum, valid: true, clipped: false, repeats: false, jumped: false }
}

fn with(change: impl Fn(&mut Pendulum<f64>)) -> Observation<f64> {
    let mut o = well();
    change(&mut o.pendulum);
    o
}

fn invalid() -> Observation<f64> {
    Observation { valid: false, ..well() }
}

/// The state and the orders after one window.
fn step(mut state: SupervisorState, o: &Observation<f64>) -> (SupervisorState, Orders<f64>) {
    let orders = supervisor().step(&mut state, o, None);
    (state, orders)
}

/// The same while listening, with what was heard.
fn hear(mut state: SupervisorState, x2: f64, y2: f64) -> (SupervisorState, Orders<f64>) {
    let orders = supervisor().step(&mut state, &well(), Some(Beat { x2, y2, windows: 8 }));
    (state, orders)
}

/// What one window in a mode leads to.
fn becomes(before: SupervisorState, o: &Observation<f64>) -> (Mode, Option<Fault>, Orders<f64>) {
    let (after, orders) = step(before, o);
    (after.mode, after.fault_now(), orders)
}

const fn fault(fault: Fault) -> (Mode, Option<Fault>, Orders<f64>) {
    (Mode::Fault, Some(fault), Orders::Rest)
}

// ---- settings

#[test]
fn settings_that_are_no_positive_numbers_are_refused_by_name() {
    type Change = fn(&mut SupervisorSettings, f64);
    let fields: [(&str, Change); 4] = [
        ("window_s", |s, v| s.window_s = v),
        ("amplitude_v", |s, v| s.amplitude_v = v),
        ("heard_v", |s, v| s.heard_v = v),
        ("band_rad_s", |s, v| s.band_rad_s = v),
    ];
    for (name, change) in fields {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut s = settings();
            change(&mut s, bad);
            assert_eq!(Supervisor::<f64>::new(&s).map_err(|e| e.parameter), Err(name), "{bad}");
        }
    }
}

#[test]
fn what_is_heard_has_to_lie_below_a_third_of_the_set_amplitude() {
    let new = |heard_v| {
        Supervisor::<f64>::new(&SupervisorSettings { amplitude_v: 3.0, heard_v, ..settings() }).map_err(|e| e.parameter)
    };
    assert!(new(0.999).is_ok());
    assert_eq!(new(1.0), Err("heard_v"));
    assert_eq!(new(1.001), Err("heard_v"));
}

#[test]
fn a_time_is_a_window_at_least_and_fewer_than_two_to_the_31() {
    type Change = fn(&mut SupervisorSettings, f64);
    let fields: [(&str, Change); 8] = [
        ("sweep_s", |s, v| s.sweep_s = v),
        ("listen_s", |s, v| s.listen_s = v),
        ("lock_s", |s, v| s.lock_s = v),
        ("spin_up_s", |s, v| s.spin_up_s = v),
        ("coast_s", |s, v| s.coast_s = v),
        ("endure_s", |s, v| s.endure_s = v),
        ("rest_s", |s, v| s.rest_s = v),
        ("forget_s", |s, v| s.forget_s = v),
    ];
    let most = f64::from(1_u32 << 31) * WINDOW_S;
    for (name, change) in fields {
        let new = |time_s: f64| {
            let mut s = settings();
            change(&mut s, time_s);
            Supervisor::<f64>::new(&s).map(|_| ()).map_err(|e| e.parameter)
        };
        assert_eq!(new(WINDOW_S), Ok(()), "{name}");
        assert_eq!(new(most - WINDOW_S), Ok(()), "{name}");
        for bad in [0.99 * WINDOW_S, most, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(new(bad), Err(name), "{bad}");
        }
    }
}

// ---- from rest

#[test]
fn it_listens_for_its_time_and_until_there_is_a_beat() {
    let mut state = SupervisorState::default();
    for k in 1..LISTEN {
        let orders = supervisor().step(&mut state, &well(), Some(Beat { x2: 9.0, y2: 9.0, windows: 8 }));
        assert_eq!((state.mode, state.windows, orders), (Mode::Listen, k, Orders::Listen));
    }
    assert_eq!(becomes(state, &well()), (Mode::Listen, None, Orders::Listen), "no beat yet");
    let (after, orders) = hear(state, 9.0, 9.0);
    assert_eq!((after.mode, after.windows, orders), (Mode::Lock, 0, Orders::Tune));
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
        let (after, orders) = hear(listened, 0.1, 0.1);
        let expected = if sweeps < 3 { (Mode::Sweep, None) } else { (Mode::Fault, Some(Fault::NoResonance)) };
        assert_eq!((after.mode, after.fault_now(), orders), (expected.0, expected.1, Orders::Rest), "{sweeps}");
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
        let (after, orders) = hear(listened(3, None), x2, y2);
        assert_eq!((after.fault_now(), orders), (Some(Fault::DeadChannel), Orders::Rest));
    }
    for (x2, y2) in [(399.0, 1.0), (1.0, 399.0), (200.0, 200.0)] {
        assert_eq!(mode(listened(1, None), x2, y2), Mode::Lock);
    }
}

#[test]
fn a_sweep_crosses_the_band_evenly_each_twice_as_long_as_the_last_and_every_second_opposed() {
    for (sweeps, length) in [(0, 4), (1, 8), (2, 16), (3, 32), (8, 1024), (12, 1024)] {
        let mut state = SupervisorState { sweeps, ..in_mode(Mode::Sweep, 0) };
        for k in 1..length {
            let Orders::Sweep { correction_rad_s, opposed } = supervisor().step(&mut state, &well(), None) else {
                panic!("sweep {sweeps} ended after {k} windows");
            };
            let expected = -100.0 + 200.0 * f64::from(k) / f64::from(length);
            assert!((correction_rad_s - expected).abs() < 1e-12, "{correction_rad_s}, not {expected}");
            assert_eq!(opposed, [1, 3].contains(&sweeps));
        }
        let orders = supervisor().step(&mut state, &well(), None);
        assert_eq!((state.mode, state.sweeps, orders), (Mode::Listen, sweeps + 1, Orders::Rest));
    }
}

#[test]
fn a_sweep_longer_than_can_be_counted_lasts_as_long_as_can_be_counted() {
    let long = SupervisorSettings { sweep_s: 3e8, ..settings() };
    let mut state = SupervisorState { sweeps: 8, windows: u32::MAX - 2, ..in_mode(Mode::Sweep, 0) };
    let supervisor = Supervisor::<f64>::new(&long).expect("valid");
    assert!(matches!(supervisor.step(&mut state, &well(), None), Orders::Sweep { .. }));
    assert_eq!((supervisor.step(&mut state, &well(), None), state.mode), (Orders::Rest, Mode::Listen));
}

#[test]
fn the_phase_is_locked_after_twenty_windows_in_a_row_with_little_phase_error() {
    let mut state = in_mode(Mode::Lock, 0);
    let good = with(|p| p.l = -4.99);
    assert_eq!(supervisor().step(&mut state, &good, None), Orders::Snap);
    assert_eq!(state.good, 0, "the window before the reference was set");
    for k in 1..IN_A_ROW {
        assert_eq!((supervisor().step(&mut state, &good, None), state.good), (Orders::Lock, k));
    }
    // a fifth of the energy is too much
    for l in [5.0, -5.0] {
        let (after, orders) = step(state, &with(|p| p.l = l));
        assert_eq!((after.mode, after.good, orders), (Mode::Lock, 0, Orders::Lock));
    }
    let (after, orders) = step(state, &good);
    assert_eq!((after.mode, after.good, after.windows, orders), (Mode::SpinUp, 0, 0, RUN));
}

#[test]
fn without_a_lock_in_its_time_there_is_a_fault() {
    let bad = with(|p| p.l = 12.0);
    assert_eq!(becomes(in_mode(Mode::Lock, LOCK - 2), &bad), (Mode::Lock, None, Orders::Lock));
    assert_eq!(becomes(in_mode(Mode::Lock, LOCK - 1), &bad), fault(Fault::NoLock));
    // a lock in the last window is one
    let locked = SupervisorState { good: IN_A_ROW - 1, ..in_mode(Mode::Lock, LOCK - 1) };
    assert_eq!(becomes(locked, &well()), (Mode::SpinUp, None, RUN));
}

#[test]
fn what_falls_silent_while_locking_is_listened_for_again() {
    assert_eq!(becomes(in_mode(Mode::Lock, 3), &energy(LEAST)), (Mode::Lock, None, Orders::Lock));
    assert_eq!(becomes(in_mode(Mode::Lock, 3), &energy(0.99 * LEAST)), (Mode::Listen, None, Orders::Rest));
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
    for (wish, mode, orders) in [
        (Wish::WholeAngle, Mode::WholeAngle, RUN),
        (Wish::Hold, Mode::Hold, RUN_HELD),
        (Wish::RingDown, Mode::RingDown, RUN_DOWN),
    ] {
        let (after, got) = step(SupervisorState { wish, ..state }, &well());
        assert_eq!((after.mode, after.sweeps, after.windows, got), (mode, 0, 0, orders));
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
    for (wish, orders) in [(Wish::WholeAngle, RUN), (Wish::Hold, RUN_HELD), (Wish::RingDown, RUN_HELD)] {
        let before = SupervisorState { wish, ..in_mode(Mode::SpinUp, SPIN_UP - 2) };
        assert_eq!(becomes(before, &slow), (Mode::SpinUp, None, orders));
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

// ---- operation

#[test]
fn each_mode_of_operation_has_its_orders() {
    for (mode, orders) in [(Mode::WholeAngle, RUN), (Mode::Hold, RUN_HELD), (Mode::RingDown, RUN_DOWN)] {
        assert_eq!(becomes(in_mode(mode, 3), &well()), (mode, None, orders));
    }
}

#[test]
fn a_wish_is_fulfilled_at_once_where_the_amplitude_allows() {
    let modes = [
        (Wish::WholeAngle, Mode::WholeAngle, RUN),
        (Wish::Hold, Mode::Hold, RUN_HELD),
        (Wish::RingDown, Mode::RingDown, RUN_DOWN),
    ];
    for (_, from, _) in modes {
        for (wish, to, orders) in modes {
            let before = SupervisorState { wish, bad: 3, ..in_mode(from, 4) };
            let before = SupervisorState { wish, ..before };
            assert_eq!(becomes(before, &well()), (to, None, orders), "{from:?} to {to:?}");
            // a quarter of the set energy is enough
            assert_eq!(becomes(before, &energy(6.25)), (to, None, orders), "{from:?} to {to:?}");
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
        cause: Some(Fault::DeadChannel),
        repeats: 3,
        clipped: 3,
        bad: 3,
        ..in_mode(mode, windows)
    };
    for mode in [Mode::WholeAngle, Mode::Hold] {
        let (kept, _) = step(past(mode, FORGET - 2), &well());
        assert_eq!((kept.starts, kept.coasts, kept.cause), (2, 9, Some(Fault::DeadChannel)));
        // one window undoes one of each count, and a converter that moves is not stuck
        assert_eq!((kept.bad, kept.clipped, kept.repeats, kept.windows), (2, 2, 0, FORGET - 1));
        let (forgotten, _) = step(past(mode, FORGET - 1), &well());
        assert_eq!((forgotten.starts, forgotten.coasts, forgotten.cause), (0, 0, None));
        // in a window that is on a bound or has a blemish not all is well
        let mut blemishes = vec![energy(6.25), energy(56.25)];
        blemishes.push(Observation { clipped: true, ..well() });
        blemishes.push(Observation { repeats: true, ..well() });
        for o in blemishes {
            let (kept, _) = step(past(mode, FORGET + 5), &o);
            assert_eq!((kept.mode, kept.starts, kept.coasts), (mode, 2, 9), "{o:?}");
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
            // a window in bounds takes one back
            assert_eq!(step(state, &well()).0.bad, ENDURE - 2, "{mode:?}");
            assert_eq!(becomes(state, &o), fault(name), "{mode:?}");
        }
    }
}

#[test]
fn an_amplitude_up_to_one_and_a_half_times_its_set_value_is_in_bounds() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        for e in [30.0, 50.0, 56.25] {
            let (after, _) = step(SupervisorState { bad: 3, ..in_mode(mode, 3) }, &energy(e));
            assert_eq!((after.mode, after.bad), (mode, 2), "{e}");
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
        assert_eq!((after.mode, after.bad), (mode, ENDURE - 2));
    }
}

#[test]
fn a_phase_error_of_half_the_energy_locks_anew() {
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        for l in [12.5, -12.5] {
            let locked = becomes(in_mode(mode, 3), &with(|p| p.l = l));
            assert_eq!(locked, (Mode::Lock, None, Orders::Snap), "{mode:?}");
        }
        assert_eq!(becomes(in_mode(mode, 3), &with(|p| p.l = 12.49)).0, mode);
    }
}

// ---- interruptions

#[test]
fn a_window_without_a_measurement_coasts_in_every_mode_and_has_a_cause() {
    let modes = [Mode::Listen, Mode::Sweep, Mode::Lock, Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown];
    for mode in modes {
        let (after, orders) = step(in_mode(mode, 2), &invalid());
        assert_eq!((after.mode, after.windows, orders), (Mode::Coast, 0, Orders::Rest));
        assert_eq!((after.cause, after.coasts), (Some(Fault::InvalidSamples), 1));
    }
}

#[test]
fn a_pattern_that_jumps_in_operation_coasts_with_a_dead_channel_as_cause() {
    let jumped = Observation { jumped: true, ..well() };
    for mode in [Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        let (after, orders) = step(in_mode(mode, FORGET + 5), &jumped);
        assert_eq!((after.mode, after.cause, orders), (Mode::Coast, Some(Fault::DeadChannel), Orders::Rest));
    }
    // a pattern that is not yet controlled may
    assert_eq!(becomes(in_mode(Mode::SpinUp, 2), &jumped), (Mode::SpinUp, None, RUN));
}

#[test]
fn the_fifty_first_interruption_is_a_fault() {
    let before = |coasts| SupervisorState { coasts, ..in_mode(Mode::WholeAngle, 2) };
    assert_eq!(becomes(before(49), &invalid()), (Mode::Coast, None, Orders::Rest));
    let (after, orders) = step(before(50), &invalid());
    assert_eq!((after.fault_now(), after.coasts, orders), (Some(Fault::InvalidSamples), 0, Orders::Rest));
}

#[test]
fn two_windows_in_a_row_end_a_coast_in_a_lock_or_in_listening() {
    let (one, orders) = step(in_mode(Mode::Coast, 2), &well());
    assert_eq!((one.mode, one.good, orders), (Mode::Coast, 1, Orders::Rest));
    assert_eq!(step(one, &invalid()).0.good, 0);
    assert_eq!(becomes(one, &well()), (Mode::Lock, None, Orders::Snap));
    assert_eq!(becomes(one, &energy(LEAST)), (Mode::Lock, None, Orders::Snap));
    assert_eq!(becomes(one, &energy(0.99 * LEAST)), (Mode::Listen, None, Orders::Rest));
}

#[test]
fn a_coast_that_lasts_is_the_fault_that_caused_it() {
    let coasting = |cause, windows| SupervisorState { cause, ..in_mode(Mode::Coast, windows) };
    let jumped = Some(Fault::DeadChannel);
    assert_eq!(becomes(coasting(jumped, COAST - 2), &invalid()), (Mode::Coast, None, Orders::Rest));
    assert_eq!(becomes(coasting(jumped, COAST - 1), &invalid()), fault(Fault::DeadChannel));
    assert_eq!(becomes(coasting(None, COAST - 1), &invalid()), fault(Fault::InvalidSamples));
}

#[test]
fn a_converter_that_repeats_itself_twenty_times_in_a_row_is_stuck() {
    let repeated = Observation { repeats: true, ..well() };
    for mode in [Mode::Listen, Mode::WholeAngle, Mode::Coast] {
        let before = |repeats| SupervisorState { repeats, ..in_mode(mode, 1) };
        let (after, _) = step(before(IN_A_ROW - 2), &repeated);
        assert_eq!((after.fault_now(), after.repeats), (None, IN_A_ROW - 1));
        assert_eq!(becomes(before(IN_A_ROW - 1), &repeated), fault(Fault::StuckChannel));
        assert_eq!(step(before(IN_A_ROW - 1), &well()).0.repeats, 0);
    }
}

#[test]
fn a_converter_at_the_end_of_its_range_is_endured_for_its_time() {
    let clipped = Observation { clipped: true, ..well() };
    for mode in [Mode::Listen, Mode::WholeAngle, Mode::Coast] {
        let before = |clipped| SupervisorState { clipped, ..in_mode(mode, 1) };
        let (after, _) = step(before(ENDURE - 2), &clipped);
        assert_eq!((after.fault_now(), after.clipped), (None, ENDURE - 1));
        assert_eq!(becomes(before(ENDURE - 1), &clipped), fault(Fault::Saturated));
        assert_eq!(step(before(ENDURE - 1), &well()).0.clipped, ENDURE - 2);
    }
}

// ---- faults and rest

#[test]
fn after_a_rest_the_start_is_tried_again_as_often_as_is_set() {
    let fallen = |starts, windows| SupervisorState {
        starts,
        sweeps: 3,
        fault: Some(Fault::NoLock),
        ..in_mode(Mode::Fault, windows)
    };
    assert_eq!(becomes(fallen(0, REST - 2), &well()), fault(Fault::NoLock));
    for starts in 0..2 {
        let (after, orders) = step(fallen(starts, REST - 1), &well());
        assert_eq!((after.mode, after.starts, after.sweeps, orders), (Mode::Listen, starts + 1, 0, Orders::Rest));
        assert_eq!((after.fault, after.fault_now()), (Some(Fault::NoLock), None), "it is remembered, not in force");
    }
    assert_eq!(becomes(fallen(2, REST - 1), &well()), fault(Fault::NoLock));
    assert_eq!(becomes(fallen(0, REST + 7), &invalid()), fault(Fault::NoLock), "not without a measurement");
}

#[test]
fn a_converter_that_is_stuck_is_not_started() {
    let stuck =
        |repeats| SupervisorState { repeats, fault: Some(Fault::StuckChannel), ..in_mode(Mode::Fault, REST + 3) };
    let repeated = Observation { repeats: true, ..well() };
    assert_eq!(becomes(stuck(IN_A_ROW - 2), &repeated).0, Mode::Listen);
    assert_eq!(becomes(stuck(IN_A_ROW - 1), &repeated), fault(Fault::StuckChannel));
    assert_eq!(becomes(stuck(400), &well()).0, Mode::Listen, "as soon as it moves");
}

#[test]
fn the_wish_for_rest_turns_everything_off_and_keeps_the_name_of_the_fault() {
    for mode in [Mode::Listen, Mode::Sweep, Mode::WholeAngle, Mode::Hold, Mode::Coast, Mode::Fault] {
        let before = SupervisorState {
            wish: Wish::Off,
            fault: Some(Fault::NoLock),
            starts: 2,
            sweeps: 1,
            good: 4,
            ..in_mode(mode, 7)
        };
        let (after, orders) = step(before, &well());
        let expected = SupervisorState { wish: Wish::Off, fault: Some(Fault::NoLock), ..SupervisorState::default() };
        assert_eq!((after, orders), (expected, Orders::Rest));
    }
}

#[test]
fn a_fault_is_in_force_in_the_mode_of_fault_only() {
    let remembered = SupervisorState { fault: Some(Fault::NoLock), ..in_mode(Mode::WholeAngle, 3) };
    assert_eq!(remembered.fault_now(), None);
    assert_eq!(SupervisorState { mode: Mode::Fault, ..remembered }.fault_now(), Some(Fault::NoLock));
}
