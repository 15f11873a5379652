//! Half turns: counted while they are seen, and doubted, aloud, when they may not have been.

use cvg_instrument::{Continuity, Mode, RequestedMode};
use cvg_model::Float;

use super::Bench;

fn unseen_turns_are_doubted<T: Float>() {
    // a pattern that turns by half a turn in a gap, and a whole number of the carrier's periods and of half turns later
    for rate in [20.0, -20.0] {
        let mut bench = Bench::<T>::running(0.2, rate);
        // 0.157 s: half a turn, and 2387.6 periods
        bench.unseen(15_708);
        bench.windows(300);
        assert!(bench.status.half_turns_lost, "{rate}");
        // until it is acknowledged, and no longer
        bench.windows(300);
        assert!(bench.status.half_turns_lost && bench.status.mode == Mode::WholeAngle);
        bench.state.acknowledge_half_turns();
        assert!(!bench.state.status.half_turns_lost);
        bench.windows(300);
        assert!(!bench.status.half_turns_lost, "{:?}", bench.state.continuity);
    }
}

fn a_phase_that_jumps_is_doubted<T: Float>() {
    // by 3 degrees the loops go on, and yet nobody knows how long nobody looked
    for jump in [0.06, -0.06] {
        let mut bench = Bench::<T>::running(0.2, 0.0);
        bench.phase_rad += jump;
        bench.windows(2);
        assert!(bench.status.half_turns_lost && bench.status.mode == Mode::WholeAngle, "{:?}", bench.state.supervisor);
    }
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.phase_rad += 0.01;
    bench.windows(200);
    assert!(!bench.status.half_turns_lost);
}

fn too_long_without_a_window_is_doubted<T: Float>() {
    // at 35 rad/s 45 degrees are 44 windows
    for (windows, doubted) in [(40, false), (44, false), (45, true), (60, true)] {
        let mut bench = Bench::<T>::running(0.2, 1.0);
        bench.windows_through(windows, |_| [f64::NAN; 2]);
        assert_eq!(bench.state.continuity.lost, doubted, "{windows} windows");
        bench.windows(300);
        assert_eq!(bench.status.half_turns_lost, doubted, "{windows} windows");
        assert_eq!(bench.status.mode, Mode::WholeAngle);
    }
    // as many as can be counted, and one more
    let mut bench = Bench::<T>::running(0.2, 1.0);
    bench.state.continuity.unseen = u32::MAX;
    bench.windows_through(1, |_| [f64::NAN; 2]);
    assert!(bench.status.half_turns_lost);
}

fn an_acknowledgement_shows_no_window<T: Float>() {
    // 40 windows that nobody saw are few enough, and so are 10; together they are not
    for acknowledges in [true, false] {
        let mut bench = Bench::<T>::running(0.2, 1.0);
        bench.windows_through(40, |_| [f64::NAN; 2]);
        assert!(!bench.state.continuity.lost);
        if acknowledges {
            bench.state.acknowledge_half_turns();
        }
        bench.windows_through(10, |_| [f64::NAN; 2]);
        assert!(bench.state.continuity.lost, "acknowledged in between: {acknowledges}");
    }
}

fn a_jump_and_a_fault_are_doubted<T: Float>() {
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.theta_rad += 0.5;
    bench.windows(3);
    assert!(bench.status.half_turns_lost, "a jump");
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.amplitude_v = 0.001;
    bench.windows(3);
    assert!(bench.status.half_turns_lost, "silence");
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.amplitude_v = 2.0;
    assert!(bench.fault(1000, |v| v).is_some() && bench.status.half_turns_lost, "a fault");
}

fn a_direction_that_is_lost_between_operation_and_operation_is_doubted<T: Float>() {
    // a phase that is far off is locked anew, and the pattern has no direction for a while: who knows how it turned
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.state.supervisor.mode = Mode::Lock;
    bench.state.supervisor.windows = 5;
    bench.windows(1);
    assert!(!bench.status.half_turns_lost && bench.status.mode == Mode::Lock);
    bench.amplitude_v = 0.0;
    bench.windows(1);
    assert!(bench.status.half_turns_lost, "{:?}", bench.state.supervisor);
}

fn a_start_is_no_loss<T: Float>() {
    let bench = Bench::<T>::running(0.2, 0.0);
    assert_eq!(bench.state.continuity, Continuity { unseen: 0, counting: true, lost: false });
    // a request for another mode neither
    for (requested, mode) in [(RequestedMode::Hold, Mode::Hold), (RequestedMode::RingDown, Mode::RingDown)] {
        let mut bench = Bench::<T>::running(0.2, 0.0);
        bench.state.request(requested);
        bench.windows(10);
        assert!(bench.status.mode == mode && !bench.status.half_turns_lost, "{mode:?}");
        bench.phase_rad += 0.06;
        bench.windows(2);
        assert!(bench.status.half_turns_lost, "a phase that jumps in {mode:?}");
    }
}

fn at_rest_there_is_nothing_to_lose<T: Float>() {
    let mut bench = Bench::<T>::running(0.2, 0.0);
    bench.amplitude_v = 0.0;
    bench.windows(1);
    assert!(bench.status.half_turns_lost && bench.status.mode == Mode::Fault);
    // the rest after a fault is over, and it listens
    let listens = (0..2000).any(|_| {
        bench.windows(1);
        bench.status.mode == Mode::Listen
    });
    assert!(listens, "{:?}", bench.state.supervisor);
    bench.state.acknowledge_half_turns();
    bench.windows(5);
    assert!(!bench.status.half_turns_lost, "no direction, and none before");
    bench.amplitude_v = 1.0;
    bench.windows(500);
    assert!(bench.status.mode == Mode::WholeAngle, "{:?}", bench.state.supervisor);
    assert!(!bench.status.half_turns_lost, "a first direction is no interruption");
}

in_both_precisions! {
    turns_that_nobody_saw_are_doubted_until_it_is_acknowledged unseen_turns_are_doubted;
    a_phase_that_is_not_where_it_was_left_is_doubted a_phase_that_jumps_is_doubted;
    as_many_windows_as_a_pattern_needs_for_45_degrees_are_doubted too_long_without_a_window_is_doubted;
    windows_that_nobody_saw_are_as_many_after_an_acknowledgement an_acknowledgement_shows_no_window;
    a_pattern_that_jumps_and_one_that_falls_silent_are_doubted a_jump_and_a_fault_are_doubted;
    a_direction_that_is_lost_while_it_locks_is_doubted a_direction_that_is_lost_between_operation_and_operation_is_doubted;
    a_start_and_another_request_lose_nothing a_start_is_no_loss;
    what_is_acknowledged_without_a_direction_is_not_lost_with_the_first at_rest_there_is_nothing_to_lose;
}
