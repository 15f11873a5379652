//! Interruptions and faults: what coasts, what ends, what is tried again.

use super::*;

#[test]
fn a_window_without_a_measurement_coasts_in_every_mode_and_has_a_cause() {
    let modes = [Mode::Listen, Mode::Sweep, Mode::Lock, Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown];
    for mode in modes {
        let (after, command) = step(in_mode(mode, 2), &invalid());
        assert_eq!((after.mode, after.windows, command), (Mode::Coast, 0, LoopCommand::Rest));
        assert_eq!((after.cause, after.coasts), (Some(Fault::InvalidSamples), 1));
    }
}

#[test]
fn a_pattern_that_jumps_in_operation_coasts_with_a_dead_channel_as_cause() {
    let jumped = Observation { jumped: true, ..well() };
    for mode in [Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        let (after, command) = step(in_mode(mode, FORGET + 5), &jumped);
        assert_eq!((after.mode, after.cause, command), (Mode::Coast, Some(Fault::DeadChannel), LoopCommand::Rest));
    }
    // a pattern that is not yet controlled may
    assert_eq!(becomes(in_mode(Mode::SpinUp, 2), &jumped), (Mode::SpinUp, None, RUN));
}

#[test]
fn the_fifty_first_interruption_is_a_fault() {
    let before = |coasts| SupervisorState { coasts, ..in_mode(Mode::WholeAngle, 2) };
    assert_eq!(becomes(before(49), &invalid()), (Mode::Coast, None, LoopCommand::Rest));
    let (after, command) = step(before(50), &invalid());
    assert_eq!((after.fault_now(), after.coasts, command), (Some(Fault::InvalidSamples), 0, LoopCommand::Rest));
}

#[test]
fn the_fifty_first_lost_phase_is_a_fault() {
    let lost = with(|p| p.l = 12.5);
    for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
        let before = |coasts| SupervisorState { coasts, cause: Some(Fault::DeadChannel), ..in_mode(mode, 2) };
        let (after, command) = step(before(49), &lost);
        assert_eq!((after.mode, after.coasts, command), (Mode::Lock, 50, LoopCommand::Snap));
        assert_eq!(after.cause, Some(Fault::DeadChannel), "why it coasted is another matter");
        assert_eq!(becomes(before(50), &lost), fault(Fault::NoLock));
    }
}

#[test]
fn a_converter_at_its_end_and_one_that_repeats_itself_are_named_as_what_they_are() {
    let silent = |clipped, repeats| Observation { clipped, repeats, ..energy(0.0) };
    let jumped = |clipped, repeats| Observation { clipped, repeats, jumped: true, ..well() };
    for (clipped, repeats, low, dead) in [
        (false, false, Fault::AmplitudeLow, Fault::DeadChannel),
        (false, true, Fault::StuckChannel, Fault::StuckChannel),
        (true, false, Fault::Saturated, Fault::Saturated),
        (true, true, Fault::Saturated, Fault::Saturated),
    ] {
        for mode in [Mode::SpinUp, Mode::WholeAngle, Mode::Hold, Mode::RingDown] {
            assert_eq!(becomes(in_mode(mode, 3), &silent(clipped, repeats)), fault(low), "{mode:?}");
        }
        let (after, _) = step(in_mode(Mode::WholeAngle, 3), &jumped(clipped, repeats));
        assert_eq!((after.mode, after.cause), (Mode::Coast, Some(dead)));
    }
    let railed = Observation { clipped: true, repeats: true, ..well() };
    let before = SupervisorState { repeats: IN_A_ROW - 1, ..in_mode(Mode::WholeAngle, 1) };
    assert_eq!(becomes(before, &railed), fault(Fault::Saturated));
}

#[test]
fn two_windows_in_a_row_end_a_coast_in_a_lock_or_in_listening() {
    let (one, command) = step(in_mode(Mode::Coast, 2), &well());
    assert_eq!((one.mode, one.good, command), (Mode::Coast, 1, LoopCommand::Rest));
    assert_eq!(step(one, &invalid()).0.good, 0);
    assert_eq!(becomes(one, &well()), (Mode::Lock, None, LoopCommand::Snap));
    assert_eq!(becomes(one, &energy(LEAST)), (Mode::Lock, None, LoopCommand::Snap));
    assert_eq!(becomes(one, &energy(0.99 * LEAST)), (Mode::Listen, None, LoopCommand::Rest));
}

#[test]
fn a_coast_that_lasts_is_the_fault_that_caused_it() {
    let coasting = |cause, windows| SupervisorState { cause, ..in_mode(Mode::Coast, windows) };
    let jumped = Some(Fault::DeadChannel);
    assert_eq!(becomes(coasting(jumped, COAST - 2), &invalid()), (Mode::Coast, None, LoopCommand::Rest));
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
        assert_eq!(step(before(ENDURE - 2), &well()).0.clipped, ENDURE - 2, "{mode:?}");
    }
}

#[test]
fn after_a_rest_the_start_is_tried_again_as_often_as_is_set_and_then_after_long_rests() {
    let fallen = |starts, windows| SupervisorState {
        starts,
        sweeps: 3,
        fault: Some(Fault::NoLock),
        ..in_mode(Mode::Fault, windows)
    };
    assert_eq!(becomes(fallen(0, REST - 2), &well()), fault(Fault::NoLock));
    for starts in 0..2 {
        let (after, command) = step(fallen(starts, REST - 1), &well());
        assert_eq!((after.mode, after.starts, after.sweeps, command), (Mode::Listen, starts + 1, 0, LoopCommand::Rest));
        assert_eq!((after.fault, after.fault_now()), (Some(Fault::NoLock), None), "it is remembered, not in force");
    }
    let long = LONG_REST * REST;
    assert_eq!(becomes(fallen(2, long - 2), &well()), fault(Fault::NoLock));
    let (after, command) = step(fallen(2, long - 1), &well());
    assert_eq!((after.mode, after.starts, command), (Mode::Listen, 2, LoopCommand::Rest));
    assert_eq!(becomes(fallen(0, REST + 7), &invalid()), fault(Fault::NoLock), "not without a measurement");
    let clipped = Observation { clipped: true, ..well() };
    assert_eq!(becomes(fallen(0, REST + 7), &clipped), fault(Fault::NoLock), "not at the end of a converter's range");
    // a start is given all that it may use
    let cause = Some(Fault::DeadChannel);
    let used = SupervisorState { trying: 77, clipped: ENDURE - 1, cause, ..fallen(0, REST - 1) };
    let (after, _) = step(used, &well());
    assert_eq!((after.mode, after.trying, after.clipped, after.cause), (Mode::Listen, 0, 0, None));
}

/// A rest may be set so long that the long ones are longer than can be counted: they do not come round to short ones.
#[test]
fn a_long_rest_that_cannot_be_counted_is_the_longest_that_can() {
    let patient = SupervisorSettings { rest_s: f64::from(1_u32 << 27) * WINDOW_S, ..settings() };
    let patient = Supervisor::new(&patient).expect("valid");
    let after = |windows| {
        let fault = Some(Fault::NoLock);
        let mut state = SupervisorState { starts: 2, fault, ..in_mode(Mode::Fault, windows) };
        patient.step(&mut state, &well(), None);
        state.mode
    };
    assert_eq!([1, 1 << 27, u32::MAX - 2].map(after), [Mode::Fault; 3]);
    assert_eq!(after(u32::MAX - 1), Mode::Listen);
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
fn a_request_for_rest_turns_everything_off_and_keeps_the_name_of_the_fault() {
    for mode in [Mode::Listen, Mode::Sweep, Mode::WholeAngle, Mode::Hold, Mode::Coast, Mode::Fault] {
        let before = SupervisorState {
            requested: RequestedMode::Off,
            fault: Some(Fault::NoLock),
            starts: 2,
            sweeps: 1,
            good: 4,
            ..in_mode(mode, 7)
        };
        let (after, command) = step(before, &well());
        let expected =
            SupervisorState { requested: RequestedMode::Off, fault: Some(Fault::NoLock), ..SupervisorState::default() };
        assert_eq!((after, command), (expected, LoopCommand::Rest));
    }
}

#[test]
fn a_fault_is_in_force_in_the_mode_of_fault_only() {
    let remembered = SupervisorState { fault: Some(Fault::NoLock), ..in_mode(Mode::WholeAngle, 3) };
    assert_eq!(remembered.fault_now(), None);
    assert_eq!(SupervisorState { mode: Mode::Fault, ..remembered }.fault_now(), Some(Fault::NoLock));
}
