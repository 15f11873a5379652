//! The filter's cycle: slice by slice it does what a dense filter does at once.

use super::*;
use crate::cycle::{Doubt, FIRST_MEASURE, MEASURE, OPEN};
use crate::parameters::{DETECTION, OTHERS, Parameter as P, dot};
use crate::regressors::{CHANNELS, turned};
use crate::state::{Commit, State};
use crate::window::{Push, Sample, Sums};

/// A state in its last stage, that runs, with numbers everywhere.
pub(super) fn busy() -> State<f64> {
    let mut s = calibrator().start();
    let value = |k: usize| ((k * 37 + 11) % 23) as f64 / 23.0 - 0.4;
    (s.schedule.live, s.schedule.stage, s.schedule.fresh, s.schedule.settle) = (true, 4, 10, 0);
    for c in 0..CHANNELS {
        for j in 0..N {
            s.filter.shown[c][j] = 0.1 * value(j + 5 * c);
        }
        s.filter.seen[c] = 0.02 * value(c);
        s.filter.noise[c] = 1e-4 * (c + 1) as f64;
        s.filter.last_innovation[c] = 1e-3 * value(c + 3);
        s.before.y[c] = 0.1 * value(c + 7);
        s.before.late[c] = 1e-3 * value(c + 9);
    }
    for j in 0..N {
        s.filter.mean[j] = 0.05 * value(j + 2);
    }
    (s.before.cos_2, s.before.sin_2, s.before.whole, s.before.angle) = (0.6, -0.8, true, 1e-4);
    let theta: f64 = 0.7;
    s.sample = Sample {
        y: [0.01, 0.03, 0.002],
        before_next: -0.02,
        per_amplitude: 0.9,
        r: 0.01,
        push: Push { along: 0.05, aside: 0.6, quadrature: 0.1, across: 0.01 },
        early: [1e-3, 2e-3, 3e-3],
        late: [4e-3, 5e-3, 6e-3],
        cos: theta.cos(),
        sin: theta.sin(),
        cos_2: (2.0 * theta).cos(),
        sin_2: (2.0 * theta).sin(),
    };
    s
}

fn covariance(s: &State<f64>) -> [[f64; N]; N] {
    core::array::from_fn(|i| core::array::from_fn(|j| s.filter.ud.covariance(i, j)))
}

#[test]
fn a_measurement_in_slices_is_that_of_a_dense_filter() {
    for c in 0..CHANNELS {
        let c_ = calibrator();
        let mut s = busy();
        let before = s;
        let (h, mean, p) = (s.filter.shown[c], s.filter.mean, covariance(&s));
        for k in 0..MEASURE {
            c_.measure(&mut s, c, k);
        }
        let ph: [f64; N] = core::array::from_fn(|i| (0..N).map(|j| p[i][j] * h[j]).sum());
        let innovation = before.filter.seen[c] - dot(&h, &mean);
        let change = innovation - before.filter.last_innovation[c];
        let old = before.filter.noise[c];
        let noise = old + 0.004 * ((0.5 * change * change).min(9.0 * old) - old);
        near(s.filter.noise[c], noise, 1e-18);
        let variance = noise + 3e-6 * 3e-6;
        let all = variance + dot(&h, &ph);
        assert!(s.schedule.accept);
        for i in 0..N {
            near(s.filter.mean[i], mean[i] + ph[i] / all * innovation, 1e-13);
            for j in 0..N {
                near(s.filter.ud.covariance(i, j), p[i][j] - ph[i] * ph[j] / all, 1e-13);
            }
        }
        assert_eq!((s.filter.innovation[c], s.filter.last_innovation[c]), (innovation, innovation));
        assert_eq!(s.schedule.angle_used, u16::from(c == 1));
        // and then the cycle is past
        let (rate, direct) = rates(&before.sample, &before.correction.known, c, true);
        for j in 0..N {
            near(s.filter.shown[c][j], 0.992 * h[j] + 0.02 * rate[j] - direct[j], 1e-15);
        }
        let ahead: f64 = (0..N).map(|j| (0.02 * rate[j] - direct[j]) * s.filter.mean[j]).sum();
        near(s.before.angle, if c == 1 { ahead } else { before.before.angle }, 1e-16);
        if c == 2 {
            // the angle counts from the last step on
            assert_eq!((s.before.y, s.before.late), ([0.01, -0.02, 0.002], before.sample.late));
            assert_eq!((s.before.cos_2, s.before.sin_2), (before.sample.cos_2, before.sample.sin_2));
        } else {
            assert_eq!(s.before.y, before.before.y);
        }
        // the other channels are left alone
        for other in (0..CHANNELS).filter(|o| *o != c) {
            assert_eq!(s.filter.shown[other], before.filter.shown[other]);
            assert_eq!(s.filter.noise[other], before.filter.noise[other]);
        }
    }
}

#[test]
fn noise_is_learned_from_the_sixth_cycle_and_no_faster_than_nine_times_itself() {
    let after = |fresh: u16, seen: f64| {
        let mut s = busy();
        (s.schedule.fresh, s.filter.seen[0]) = (fresh, seen);
        calibrator().measure(&mut s, 0, 0);
        s.filter.noise[0]
    };
    assert_eq!(after(5, 5.0), 1e-4);
    near(after(6, 5.0), 1e-4 * (1.0 + 0.004 * 8.0), 1e-18);
    near(after(u16::MAX, 5.0), 1e-4 * (1.0 + 0.004 * 8.0), 1e-18);
    let quiet = busy();
    let same = dot(&quiet.filter.shown[0], &quiet.filter.mean) + quiet.filter.last_innovation[0];
    near(after(6, same), 1e-4 * 0.996, 1e-18);
}

#[test]
fn an_innovation_beyond_six_deviations_is_refused_in_the_last_stage() {
    for c in 0..CHANNELS {
        for sign in [1.0, -1.0] {
            let run = |stage: u8, deviations: f64| {
                let mut s = busy();
                (s.schedule.stage, s.schedule.fresh, s.schedule.refused) = (stage, 3, 7);
                let floor = [1e-3, 5e-4, 1e-4, 2e-5, 3e-6, 3e-6][usize::from(stage)];
                let all = s.filter.noise[c] + floor * floor + s.filter.ud.variance_along(&s.filter.shown[c]);
                s.filter.seen[c] = dot(&s.filter.shown[c], &s.filter.mean) + sign * deviations * f64::sqrt(all);
                for k in 0..MEASURE {
                    calibrator().measure(&mut s, c, k);
                }
                s
            };
            let within = run(4, 5.999);
            assert!(within.schedule.accept && within.filter.mean != busy().filter.mean);
            assert_eq!(within.schedule.refused, if c == 1 { 7 } else { 6 });
            let beyond = run(4, 6.001);
            assert!(!beyond.schedule.accept && beyond.filter.mean == busy().filter.mean);
            assert_eq!(covariance(&beyond), covariance(&busy()));
            assert_eq!((beyond.schedule.refused, beyond.schedule.hold[c]), if c == 1 { (7, 25) } else { (9, 1) });
            for stage in 0..4 {
                assert!(run(stage, 20.0).schedule.accept, "a coarse stage takes everything");
            }
        }
    }
    // what is no number is never taken, and a second of refusals begins the integrals anew
    let mut s = busy();
    s.filter.seen[0] = f64::NAN;
    for k in 0..MEASURE {
        calibrator().measure(&mut s, 0, k);
    }
    assert!(!s.schedule.accept && s.filter.mean == busy().filter.mean);
    let mut s = busy();
    (s.filter.seen[2], s.schedule.hold[2]) = (1e3, 25);
    calibrator().measure(&mut s, 2, 0);
    calibrator().measure(&mut s, 2, OPEN);
    assert_eq!((s.schedule.hold[2], s.filter.seen[2], s.filter.shown[2]), (0, 0.0, [0.0; N]));
}

/// Each stage trusts what is seen as far as its floor says: of a parameter that shows by as much, half is learned.
#[test]
fn each_stage_has_a_floor_of_its_own() {
    for (stage, floor) in [(0, 1e-3), (1, 5e-4), (2, 1e-4), (3, 2e-5), (4, 3e-6), (5, 3e-6), (u8::MAX, 3e-6)] {
        let mut s = busy();
        s.schedule.stage = stage;
        (s.filter.mean, s.filter.noise, s.schedule.fresh) = ([0.0; N], [1e-18; CHANNELS], 1);
        s.filter.shown[0] = unit(P::Damping, floor);
        s.filter.seen[0] = floor;
        for k in 0..MEASURE {
            calibrator().measure(&mut s, 0, k);
        }
        near(s.filter.mean[P::Damping as usize], 0.5, 1e-6);
    }
}

/// A channel that is refused for a second begins anew with the next refusal.
#[test]
fn a_channel_that_is_refused_for_a_second_begins_anew() {
    for c in [0, 2] {
        for (held, after) in [(23, 24), (24, 25), (25, 0)] {
            let mut s = busy();
            (s.schedule.hold[c], s.filter.seen[c]) = (held, 1e3);
            let before = s;
            for k in 0..=OPEN {
                calibrator().measure(&mut s, c, k);
            }
            assert_eq!((s.schedule.accept, s.schedule.hold[c]), (false, after));
            let anew = if after == 0 { ([0.0; N], 0.0) } else { (before.filter.shown[c], 1e3) };
            assert_eq!((s.filter.shown[c], s.filter.seen[c]), anew, "{held}");
        }
        // in a row: one that is taken ends it
        let mut s = busy();
        (s.schedule.hold[c], s.filter.seen[c]) = (24, 0.0);
        s.filter.shown[c] = [0.0; N];
        for k in 0..=OPEN {
            calibrator().measure(&mut s, c, k);
        }
        assert_eq!((s.schedule.accept, s.schedule.hold[c]), (true, 0));
    }
}

/// The detection is told by the amplitude while the instrument turns, and by nothing else.
#[test]
fn a_detection_is_told_while_it_turns() {
    for c in 0..CHANNELS {
        for excited in [false, true] {
            let mut s = busy();
            (s.schedule.excited, s.schedule.untold) = (excited, 77);
            for k in 0..MEASURE {
                calibrator().measure(&mut s, c, k);
            }
            assert!(s.schedule.accept);
            assert_eq!(s.schedule.untold, if c == 0 && excited { 0 } else { 77 }, "{c} {excited}");
        }
    }
    // and each cycle is one since
    for (before, after) in [(0, 1), (77, 78), (u16::MAX, u16::MAX)] {
        let mut s = busy();
        s.schedule.untold = before;
        calibrator().plan(&mut s);
        assert_eq!(s.schedule.untold, after);
    }
}

/// What was learned in the first stage before it was noticed that the base turns is no rest.
#[test]
fn a_turn_in_the_first_stage_begins_it_anew() {
    for (stage, used) in [(0, 0), (1, 99), (4, 99)] {
        let mut s = busy();
        (s.sample.push.aside, s.schedule.turn) = (0.0, 5.0 * 0.1 / 25.0);
        (s.schedule.stage, s.schedule.used, s.schedule.angle_used) = (stage, 99, 250);
        let doubt = Doubt::of(&s);
        calibrator().notice(&mut s, doubt);
        assert_eq!((s.schedule.excited, s.schedule.used), (true, used), "stage {stage}");
        assert_eq!(s.schedule.commit == Commit::Forget, stage == 0);
        for k in 40..80 {
            s.step = k;
            calibrator().work(&mut s);
        }
        let forgotten = s.filter.mean[..OTHERS].iter().all(|m| *m == 0.0);
        assert_eq!(forgotten, stage == 0);
    }
}

/// A cycle that is not whole is followed by none that could be compared with it.
#[test]
fn a_cycle_that_is_not_whole_is_not_the_one_before() {
    let mut s = busy();
    s.closed = Sums::after((1.0, 0.0));
    s.closed.spoil();
    calibrator().close(&mut s);
    assert_eq!((s.schedule.live, s.before.whole, s.schedule.settle), (false, false, 37));
    // and nothing is done with what it holds
    let before = s;
    for k in 1..77 {
        s.step = k;
        calibrator().work(&mut s);
    }
    assert_eq!((s.filter.mean, s.filter.shown, s.schedule.fresh), (before.filter.mean, before.filter.shown, 10));
}

/// A channel that begins anew leaves the others as they are.
#[test]
fn a_channel_begins_anew_by_itself() {
    for c in 0..CHANNELS {
        let mut s = busy();
        s.filter.seen = [1.0, 2.0, 3.0];
        let before = s.filter;
        s.filter.restart(c);
        for other in 0..CHANNELS {
            let kept = if other == c { ([0.0; N], 0.0) } else { (before.shown[other], before.seen[other]) };
            assert_eq!((s.filter.shown[other], s.filter.seen[other]), kept, "{c} {other}");
        }
    }
}

/// In slices, what is doubted of the precession is what is doubted at once.
#[test]
fn the_doubt_of_a_cycle_is_that_of_force_scale_and_rate() {
    let mut s = busy();
    s.filter.ud = crate::tests::commits::correlated(0.04);
    // two slices a step; the first two close the cycle
    for step in 1..=FIRST_MEASURE / 2 {
        s.step = step;
        calibrator().work(&mut s);
    }
    assert_ne!(Doubt::of(&s).force_scale, Doubt::of(&s).rate);
    near(s.schedule.doubt.force_scale, Doubt::of(&s).force_scale, 1e-15);
    near(s.schedule.doubt.rate, Doubt::of(&s).rate, 1e-15);
}

/// After a gap nothing says how far the pattern turned, and what it turned by before is past.
#[test]
fn a_cycle_after_none_shows_no_turn() {
    for whole in [true, false] {
        let mut s = busy();
        (s.schedule.turn, s.before.whole) = (0.3, whole);
        calibrator().integrate_all(&mut s, 1);
        assert_eq!(s.schedule.turn == 0.0, !whole, "{whole}");
        assert!(s.schedule.turn != 0.3, "{whole}");
    }
}

#[test]
fn an_angle_that_is_held_back_is_not_used_and_begins_anew() {
    let mut s = busy();
    s.schedule.hold[1] = 2;
    calibrator().measure(&mut s, 1, 0);
    assert_eq!((s.schedule.hold[1], s.schedule.accept), (1, false));
    assert_eq!((s.filter.shown[1], s.filter.seen[1]), ([0.0; N], 0.0));
    let mut s = busy();
    s.schedule.hold = [3, 0, 3];
    for c in [0, 2] {
        calibrator().measure(&mut s, c, 0);
        assert!(s.schedule.accept && s.schedule.hold[c] == 3, "the others are");
    }
    let mut s = busy();
    s.schedule.fresh = 0;
    calibrator().measure(&mut s, 0, 0);
    assert!(!s.schedule.accept);
}

#[test]
fn what_was_seen_and_what_should_have_shown_are_integrated_and_forgotten_slowly() {
    for c in 0..CHANNELS {
        let mut s = busy();
        (s.schedule.turn, s.schedule.excited) = (0.03, true);
        let before = s;
        calibrator().integrate_all(&mut s, c);
        let (h, direct) = rates(&before.sample, &before.correction.known, c, true);
        let change = before.sample.y[c] - before.before.y[c];
        let seen = change - before.before.late[c] - before.sample.early[c];
        near(s.filter.seen[c], 0.992 * before.filter.seen[c] + seen, 1e-16);
        let mut expected = before.filter.shown[c];
        let mut new = 0.0;
        for j in 0..N {
            expected[j] += 0.02 * h[j] + direct[j];
            new += (0.02 * h[j] + direct[j]) * before.filter.mean[j];
        }
        if c == 1 {
            near(s.schedule.turn, seen - new - 1e-4, 1e-16);
        } else {
            let now = turned(c, before.sample.cos_2, before.sample.sin_2, 0.015);
            let then = turned(c, 0.6, -0.8, 0.015);
            for k in 0..DETECTION {
                expected[OTHERS + k] += now[k] + then[k];
            }
        }
        for j in 0..N {
            near(s.filter.shown[c][j], expected[j], 1e-16);
        }
        // without a cycle before, or before the loops have settled, nothing is kept
        for spoil in [|s: &mut State<f64>| s.before.whole = false, |s: &mut State<f64>| s.schedule.fresh = 0] {
            let mut s = before;
            spoil(&mut s);
            calibrator().integrate_all(&mut s, c);
            assert_eq!((s.filter.shown[c], s.filter.seen[c]), ([0.0; N], 0.0));
        }
    }
    // at rest a turn tells nothing of the detection
    let mut s = busy();
    (s.schedule.turn, s.schedule.excited) = (0.03, false);
    let before = s.filter.shown[0];
    calibrator().integrate_all(&mut s, 0);
    assert_eq!(s.filter.shown[0][OTHERS..], before[OTHERS..]);
}

fn detect(s: &mut State<f64>) {
    let doubt = Doubt::of(s);
    calibrator().notice(s, doubt);
}

#[test]
fn rotation_is_noticed_by_what_nothing_explains_of_the_angle() {
    let detected = |change: fn(&mut State<f64>)| {
        let mut s = busy();
        s.sample.push.aside = 0.0;
        s.schedule.fresh = 3;
        change(&mut s);
        detect(&mut s);
        s
    };
    // a fifth of the way each cycle: above 0.02 rad/s and twice the doubt of a constant rate, here 0.02 of it
    for sign in [1.0, -1.0] {
        for (rate, moving) in [(0.0599, false), (0.0601, true)] {
            let mut s = busy();
            (s.sample.push.aside, s.schedule.turn) = (0.0, sign * 5.0 * rate / 25.0);
            detect(&mut s);
            near(s.schedule.rate, sign * 5.0 * rate, 1e-14);
            near(s.schedule.swept, busy().schedule.swept + 5.0 * rate / 25.0, 1e-14);
            near(s.schedule.unexplained, sign * rate, 1e-14);
            assert_eq!(s.schedule.excited, moving, "{rate}");
            assert_eq!((s.schedule.moving, s.schedule.hold[1]), if moving { (49, 25) } else { (0, 0) });
            // the integrals begin anew when it begins
            assert_eq!(s.schedule.fresh, if moving { 1 } else { 11 });
        }
        // a force scale in doubt by a tenth explains 2.5 times its share of a precession
        let mut s = busy();
        (s.sample.push.aside, s.schedule.turn) = (-1.0, sign * 5.0 * 0.3 / 25.0);
        detect(&mut s);
        assert!(!s.schedule.excited);
        s.schedule.turn = sign * 5.0 * 0.35 / 25.0;
        s.schedule.unexplained = 0.0;
        detect(&mut s);
        assert!(s.schedule.excited);
    }
    // it is over two seconds after it was seen last
    let s = detected(|s| s.schedule.moving = 1);
    assert_eq!((s.schedule.moving, s.schedule.excited, s.schedule.hold[1]), (0, true, 25));
    let s = detected(|_| {});
    assert!(!s.schedule.excited && s.schedule.hold[1] == 0);
    // the first rest after a start in rotation: what it tells was never seen before
    let stage = |used: u16, stage: u8| {
        let mut s = busy();
        s.sample.push.aside = 0.0;
        (s.schedule.moving, s.schedule.angle_used, s.schedule.stage, s.schedule.used) = (1, used, stage, 99);
        detect(&mut s);
        (s.schedule.stage, s.schedule.used)
    };
    assert_eq!((stage(249, 4), stage(249, 2)), ((1, 0), (1, 0)));
    assert_eq!((stage(250, 4), stage(249, 1), stage(249, 0)), ((4, 99), (1, 99), (0, 99)));
    // and where it was too short to tell anything, what was learned before it goes on
    let resumed = |used: u16, stage: u8, before: u8| {
        let mut s = busy();
        (s.sample.push.aside, s.schedule.turn) = (0.0, 5.0 * 0.1 / 25.0);
        (s.schedule.angle_used, s.schedule.stage, s.schedule.before_rest) = (used, stage, before);
        detect(&mut s);
        assert!(s.schedule.excited);
        s.schedule.stage
    };
    assert_eq!([resumed(249, 1, 4), resumed(249, 1, 2), resumed(249, 1, 0)], [4, 2, 1]);
    assert_eq!([resumed(250, 1, 4), resumed(249, 2, 4), resumed(249, 0, 4)], [1, 2, 0]);
    let mut s = busy();
    s.sample.push.aside = 0.0;
    (s.schedule.moving, s.schedule.angle_used, s.schedule.stage) = (1, 100, 3);
    detect(&mut s);
    assert_eq!((s.schedule.stage, s.schedule.before_rest), (1, 3));
    // loops settle before anything is integrated
    let s = detected(|s| s.schedule.settle = 2);
    assert_eq!((s.schedule.settle, s.schedule.fresh), (1, 0));
    assert_eq!(detected(|s| s.schedule.fresh = u16::MAX).schedule.fresh, u16::MAX);
}

#[test]
fn a_parameter_a_cycle_may_have_wandered_while_it_is_better_known_than_expected() {
    let c = calibrator();
    let mut s = busy();
    s.filter.ud = crate::ud::Ud::diagonal(0.25);
    for turn in 0..2 * N {
        let j = s.filter.growing;
        assert_eq!(j, turn % N, "one after the other");
        let before = s.filter.ud.variance(j);
        for k in 0..N as u16 + 4 {
            c.grow(&mut s, k);
        }
        let wander = P::ALL[j].wander::<f64>() / P::ALL[j].expected::<f64>();
        near(s.filter.ud.variance(j) - before, wander * wander * 0.04 * 19.0, 1e-16);
    }
    // not while nothing is learned, and not beyond what is expected
    for spoil in
        [|s: &mut State<f64>| s.schedule.live = false, |s: &mut State<f64>| s.filter.ud = crate::ud::Ud::diagonal(1.0)]
    {
        let mut s = busy();
        s.filter.ud = crate::ud::Ud::diagonal(0.25);
        spoil(&mut s);
        let before = covariance(&s);
        for k in 0..N as u16 + 4 {
            c.grow(&mut s, k);
        }
        assert_eq!(covariance(&s), before);
    }
}

/// Whatever hangs together: a parameter that wanders takes no other with it, and is related to none by it.
#[test]
fn what_wanders_moves_its_own_variance_and_no_covariance() {
    let c = calibrator();
    for j in 0..N {
        let mut s = busy();
        s.filter.ud = super::commits::correlated(0.01);
        s.filter.growing = j;
        let before = covariance(&s);
        for k in 0..N as u16 + 4 {
            c.grow(&mut s, k);
        }
        let wander = P::ALL[j].wander::<f64>() / P::ALL[j].expected::<f64>();
        // far more than there is to see: the update is checked, not the number
        let q = wander * wander * 0.04 * 19.0;
        let after = covariance(&s);
        for i in 0..N {
            for k in 0..N {
                let grown = if i == j && k == j { q } else { 0.0 };
                near(after[i][k] - before[i][k], grown, 1e-5 * q + 1e-17);
            }
        }
    }
}

/// Rotation makes what the model neglects: 3e-5 of its rate, squared.
#[test]
fn rotation_adds_to_the_noise_by_the_square_of_its_rate() {
    let c_ = calibrator();
    for rate in [0.0, 0.3, -2.0, 5.0] {
        let mut s = busy();
        (s.schedule.excited, s.schedule.rate) = (true, rate);
        for k in 0..=OPEN {
            c_.measure(&mut s, 0, k);
        }
        let expected = s.filter.noise[0] + 3e-6 * 3e-6 + 9e-10 * rate * rate;
        near(1.0 / s.filter.work.update().expect("a measurement").inverse(), expected, 1e-16);
    }
}

/// What a commit on trial is worth: how much likelier it made what was seen after it.
#[test]
fn a_trial_is_scored_by_the_likelihood_of_what_is_seen_with_it_and_without() {
    let c_ = calibrator();
    for sign in [1.0, -1.0] {
        let mut s = busy();
        s.trial = core::array::from_fn(|j| sign * 0.01 * j as f64);
        let would = dot(&s.filter.shown[2], &s.trial);
        let (h, p) = (s.filter.shown[2], covariance(&s));
        let e = s.filter.seen[2] - dot(&h, &s.filter.mean);
        for k in 0..=OPEN {
            c_.measure(&mut s, 2, k);
        }
        let spread: f64 = (0..N).map(|i| (0..N).map(|j| h[i] * p[i][j] * h[j]).sum::<f64>()).sum();
        let all = spread + 1.0 / s.filter.work.update().expect("a measurement").inverse();
        let without = e + would;
        near(s.score, 0.5 * (without * without - e * e) / all, 1e-12);
    }
}
