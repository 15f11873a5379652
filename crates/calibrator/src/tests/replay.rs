//! A replay, row by row: what it takes of a row, what it learns of a cycle, what a pass begins with and ends with.

extern crate std;
use std::vec::Vec;

use cvg_model::Orbit;

use super::*;
use crate::parameters::Parameter as P;
use crate::tests::{calibrator, near, settings};
use crate::ud::Ud;

fn replay() -> Replay<f64> {
    Replay::new(&settings(), 5e-4).expect("inside its domain")
}

fn none() -> AxisForces<f64> {
    AxisForces::default()
}

/// What a device at `theta` shows that turns by `rate` rad/s, row `k`.
fn seen(theta: f64, rate: f64, k: usize) -> Envelope<f64> {
    let theta = theta + rate * 5e-4 * k as f64;
    Orbit { a: 1.6, q: 0.01, theta, delta: 0.0 }.envelope()
}

/// So many rows of it, and what the cycles among them showed.
fn rows(replay: &mut Replay<f64>, theta: f64, rate: f64, count: usize) -> Vec<Innovations<f64>> {
    (0..count).filter_map(|k| replay.row(&seen(theta, rate, k), &none())).collect()
}

/// Forces move the envelope; what they push is that motion, seen along the orbit and from its own phase.
#[test]
fn a_push_is_what_the_forces_make_of_the_envelope_along_the_orbit_and_in_its_phase() {
    let (c, s) = (calibrator(), calibrator().start());
    let f = AxisForces { x_c: 0.3, x_s: -0.8, y_c: 0.7, y_s: 0.4 };
    for degrees in (-170..180).step_by(35) {
        for delta in [-1e-3, 0.0, 1e-3] {
            let theta = f64::from(degrees).to_radians();
            let p = Orbit { a: 1.6, q: 0.0, theta, delta }.envelope().pendulum();
            let push = c.pushed(&s, &c.normal(&p), (theta.cos(), theta.sin()), &f);
            // 2.5/s of 1 V on an amplitude of 1.6 V
            let per_v = 2.5 / 1.6;
            let moved = Envelope::new(-f.x_s * per_v, f.x_c * per_v, -f.y_s * per_v, f.y_c * per_v);
            let along = moved.turned(-theta.sin(), theta.cos());
            let own = along * delta.cos() - along.quarter_ahead() * delta.sin();
            for (got, expected) in
                [(push.along, own.x_c), (push.across, own.x_s), (push.aside, own.y_c), (push.quadrature, own.y_s)]
            {
                near(got, expected, 2e-6);
            }
        }
    }
}

#[test]
fn the_direction_of_a_row_is_that_of_the_vibration_in_phase_all_the_way_round() {
    for degrees in (-175..=180).step_by(5) {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let mut replay = replay();
        replay.row(&seen(f64::from(degrees).to_radians(), 0.0, 0), &none());
        near(replay.state.direction.0, cos, 1e-12);
        near(replay.state.direction.1, sin, 1e-12);
    }
}

#[test]
fn what_was_interrupted_is_not_used_and_nothing_is_walked_across() {
    let told = |innovations: &[Innovations<f64>]| innovations.iter().all(|i| i.of.iter().all(Option::is_some));
    let mut whole = replay();
    assert!(rows(&mut whole, 0.3, 0.0, 80).len() == 1 && told(&rows(&mut whole, 0.3, 0.0, 160)));
    // a cycle with an interruption shows nothing
    let mut broken = replay();
    rows(&mut broken, 0.3, 0.0, 160);
    rows(&mut broken, 0.3, 0.0, 40);
    broken.interrupt();
    let shown = rows(&mut broken, 0.3, 0.0, 40);
    assert_eq!(shown, [Innovations { of: [None; CHANNELS], turning: false }]);
    // and the first row after it is no turn, wherever the pattern is
    let (mut after, mut anew) = (replay(), replay());
    rows(&mut after, 0.3, 0.0, 80);
    for replay in [&mut after, &mut anew] {
        replay.interrupt();
        replay.row(&seen(1.2, 0.0, 0), &AxisForces { x_s: 0.5, ..none() });
    }
    assert_eq!(after.state.sums, anew.state.sums);
}

#[test]
fn a_pass_begins_with_the_noise_of_the_one_before_and_with_nothing_else() {
    let mut walked = replay();
    rows(&mut walked, 0.3, 0.0, 800);
    walked.state.filter.noise = [1e-6, 2e-6, 3e-6];
    let (correction, filter) = (walked.state.correction, walked.state.filter);
    assert!(filter.ud != Ud::diagonal(1.0) && walked.seconds() != [0.0; 2]);
    walked.begin(3, Learning::On);
    assert_eq!(walked.state.filter, Filter { noise: [1e-6, 2e-6, 3e-6], ..Filter::new() });
    assert_eq!((walked.state.schedule.stage, walked.state.schedule.settle), (3, 0));
    assert_eq!((walked.state.correction, walked.seconds(), walked.follows), (correction, [0.0; 2], false));
    // one that only looks keeps what is believed
    let mut looking = replay();
    looking.state.filter = filter;
    looking.begin(2, Learning::Off);
    assert_eq!((looking.state.filter, looking.state.schedule.stage), (filter, 2));
}

/// Between the end of one pass and the beginning of the next the pattern did not turn.
#[test]
fn another_pass_does_not_go_on_where_the_last_one_ended() {
    let (mut again, mut first) = (replay(), replay());
    rows(&mut again, 0.3, 0.0, 800);
    assert!(again.state.before.whole);
    for replay in [&mut again, &mut first] {
        replay.begin(1, Learning::On);
        rows(replay, 1.2, 0.0, 80);
        assert_eq!((replay.state.schedule.turn, replay.state.schedule.swept), (0.0, 0.0));
    }
}

/// The direction of a cycle is the mean over its rows, of the first as of those that follow.
#[test]
fn the_direction_of_a_cycle_is_the_mean_of_its_rows() {
    let mut replay = replay();
    let (theta, rate) = (0.3, 2.0);
    rows(&mut replay, theta, rate, 240);
    // rows 160 to 239
    let mean = theta + rate * 5e-4 * 199.5;
    near(replay.state.sample.cos, mean.cos(), 1e-9);
    near(replay.state.sample.sin, mean.sin(), 1e-9);
}

/// What is doubted of the precession is what the last pass left, and not the first.
#[test]
fn each_pass_says_anew_how_well_the_precession_is_known() {
    let mut replay = replay();
    for variance in [0.01, 0.0001] {
        replay.state.filter.ud = Ud::diagonal(variance);
        replay.state.schedule.angle_used = 250;
        replay.relinearise().expect("of a device");
        let doubt = replay.doubt.expect("a known precession was seen");
        near(doubt.force_scale, variance.sqrt() * P::ForceScale.expected::<f64>(), 1e-12);
        near(doubt.rate, variance.sqrt() * P::Rate.expected::<f64>(), 1e-12);
    }
}

#[test]
fn a_pass_that_learns_nothing_tells_what_it_sees_and_believes_what_it_did() {
    for learning in [Learning::On, Learning::Off] {
        let mut replay = replay();
        replay.begin(3, learning);
        // an ellipse that nothing explains
        let shown = rows(&mut replay, 0.3, 0.0, 400);
        assert!(shown.last().is_some_and(|i| i.of.iter().all(Option::is_some)), "{shown:?}");
        assert_eq!(replay.state.filter.mean == [0.0; N], learning == Learning::Off);
        assert_eq!(replay.state.schedule.stage, 3, "a cycle has no stage of its own");
    }
}

#[test]
fn seconds_are_counted_by_whether_the_base_turns() {
    let mut still = replay();
    rows(&mut still, 0.3, 0.0, 800);
    let mut turning = replay();
    rows(&mut turning, 0.3, 2.0, 800);
    // ten cycles of 40 ms, but those before anything can be compared
    let [precessing, none] = still.seconds();
    assert!((0.3..=0.4).contains(&precessing) && none == 0.0, "{precessing} {none}");
    let [precessing, turned] = turning.seconds();
    assert!((0.2..=0.4).contains(&turned) && precessing < 0.1, "{precessing} {turned}");
}

/// What the mean says enters the correction, and the mean starts from there.
#[test]
fn relinearised_is_the_correction_with_what_was_learned_in_it() {
    for sign in [1.0, -1.0] {
        let mut replay = replay();
        replay.state.filter.ud = Ud::diagonal(0.01);
        replay.state.filter.mean[P::SplitCos as usize] = sign * 0.3;
        replay.state.filter.mean[P::OffsetX as usize] = sign * 0.05;
        replay.state.schedule.angle_used = 250;
        let farthest = replay.relinearise().expect("of a device");
        // 0.3 of its expectation, in deviations of 0.1
        near(farthest, 3.0, 1e-12);
        near(replay.correction().known(P::SplitCos), sign * 0.3 * 2.0, 1e-12);
        near(replay.correction().known(P::OffsetX), sign * 0.05 * 1e-3, 1e-15);
        near(replay.left(P::SplitCos), 0.0, 1e-12);
        near(replay.left(P::OffsetX), 0.0, 1e-15);
    }
}

#[test]
fn a_variance_is_in_units_of_what_is_asked() {
    let mut replay = replay();
    replay.state.filter.ud = Ud::diagonal(0.04);
    for p in P::ALL {
        near(replay.variance(&[(p, 3.0)]), 9.0 * 0.04 * p.expected::<f64>().powi(2), 1e-15);
    }
    // of a sum, and of one that is named twice
    let both = 0.04 * (0.03_f64.powi(2) + 4.0 * 0.006_f64.powi(2));
    near(replay.variance(&[(P::DetectionRatio, 1.0), (P::DetectionSkew, -2.0)]), both, 1e-15);
    let twice = [(P::Damping, 1.0), (P::Damping, 0.5)];
    near(replay.variance(&twice), 0.04 * (1.5 * 0.1_f64).powi(2), 1e-15);
    for (variance, told) in [(0.249, true), (0.251, false)] {
        replay.state.filter.ud = Ud::diagonal(variance);
        for (used, seen) in [(249, false), (250, true)] {
            replay.state.schedule.angle_used = used;
            for p in P::ALL {
                let needs = matches!(p, P::ForceScale | P::ForceRotation | P::Rate);
                assert_eq!(replay.told(p), told && (seen || !needs), "{p:?}");
            }
        }
    }
}

#[test]
fn forces_are_held_for_their_share_of_a_row_and_no_longer() {
    let of = |hold_s| Replay::<f64>::new(&settings(), hold_s).map(|r| r.held).map_err(|e| e.parameter);
    assert_eq!([of(0.0), of(1.25e-4), of(5e-4)], [Ok(0.0), Ok(0.25), Ok(1.0)]);
    for hold_s in [-1e-6, 5.1e-4, f64::NAN, f64::INFINITY] {
        assert_eq!(of(hold_s), Err("hold_s"), "{hold_s}");
    }
    let of_steps = |steps| {
        let settings = Settings { control_s: 0.02, steps, ..settings() };
        Replay::<f64>::new(&settings, 0.0).map(|_| ()).map_err(|e| e.parameter)
    };
    assert_eq!([of_steps(1), of_steps(2)], [Err("steps"), Ok(())]);
}

/// What is expected of the noise is what every channel of every cycle is weighed by; what is no variance weighs nothing.
#[test]
fn noise_that_is_expected_stays_as_it_is() {
    let mut replay = replay();
    replay.expect([2e-6, 3e-6, 4e-6]);
    rows(&mut replay, 0.3, 0.0, 1600);
    assert!(replay.state.schedule.fresh > 6, "noise would be learned by now");
    assert_eq!(replay.state.filter.noise[..2], [2e-6, 3e-6]);
    for none in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        replay.expect([1e-6, none, 1e-6]);
        assert_eq!(replay.levels, Some([1e-6, 1.0, 1e-6]), "{none}");
    }
}

/// What is believed of the detection is what is in force and what was learned since, and of nothing else.
#[test]
fn what_is_believed_is_the_detection_in_force_with_what_was_learned() {
    let mut replay = replay();
    for (p, mean) in [(P::DetectionPhase, 0.5), (P::DetectionRatio, -0.25), (P::DetectionSkew, 0.75), (P::OffsetX, 0.9)]
    {
        replay.state.filter.mean[p as usize] = mean;
    }
    let believed = replay.believed().expect("of a device");
    near(believed.detection_phase(), 0.5 * 0.01, 1e-12);
    near(believed.detection_ratio(), -0.25 * 0.03, 1e-12);
    near(believed.detection_skew(), 0.75 * 6e-3, 1e-12);
    near(believed.known(P::OffsetX), 0.0, 1e-15);
    assert_eq!(*replay.correction(), Replay::<f64>::new(&settings(), 0.0).expect("inside").state.correction);
}
