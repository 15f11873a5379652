//! What a cycle of control steps goes through: its slices, its turn, the virtual precession, and when a commit is due.

use cvg_model::Pendulum;

use super::cycles::busy;
use super::*;
use crate::cycle::{FIRST_MEASURE, MEASURE, TAKEN};
use crate::parameters::{OTHERS, Parameter as P};
use crate::regressors::CHANNELS;
use crate::state::{Commit, State};
use crate::status::Mode;
use crate::window::{Push, Sums};
use crate::{Commands, Health};

/// What the loops see of a device at rest.
fn calm(i: usize) -> (Pendulum<f64>, (f64, f64), Commands<f64>) {
    let theta = 1e-3 * i as f64;
    let k = 1.6 * 1.6;
    let (sin_2, cos_2) = (2.0 * theta).sin_cos();
    let p = Pendulum { e: 1.01 * k, q: 2e-3 * k, r: cos_2 * k, s: sin_2 * k, l: 1e-3 * k };
    (p, (theta.cos(), theta.sin()), Commands { energy_v: -0.05, precession_v: 0.1, quadrature_v: 0.2 })
}

#[test]
fn eighty_control_steps_are_a_cycle_and_each_has_its_slice() {
    let c = calibrator();
    let mut s = busy();
    (s.step, s.closed) = (0, Sums::after((1.0, 0.0)));
    for i in 0..160 {
        let (p, direction, commands) = calm(i);
        let before = s;
        c.step(&mut s, &p, direction, &commands, Health::Operating);
        assert_eq!(usize::from(s.step), (i + 1) % 80);
        if i == 79 {
            assert_eq!(s.sums, Sums::after(direction), "the next begins");
            let mut sample = s.closed.close(5e-4).expect("a whole cycle");
            near(sample.y[0], 0.5 * f64::ln(1.01), 1e-8);
            s.closed.direct(&mut sample);
            // from the step before the first, at an angle of 0, too
            near(sample.y[1], 0.0395, 1e-12);
        }
        if i >= 80 {
            // the mean moves at the end of a measurement and nowhere else
            let ends = (0..CHANNELS as u16).map(|c| (FIRST_MEASURE + MEASURE * c + TAKEN) / 2);
            let may = ends.into_iter().any(|step| step == i as u16 - 80);
            assert!(before.filter.mean == s.filter.mean || may, "step {}", i - 80);
        }
    }
    assert!(s.schedule.live);
    // a lone disturbed step spoils its cycle
    for at in [0, 41, 79] {
        let mut s = c.start();
        for i in 0..81 {
            let (p, direction, commands) = calm(i);
            let health = if i == at { Health::Disturbed } else { Health::Operating };
            c.step(&mut s, &p, direction, &commands, health);
        }
        assert!(!s.schedule.live, "step {at}");
        assert_eq!((s.schedule.settle, s.before.whole), (37, false));
    }
}

/// From the mean angle of a cycle to that of the next, whatever the turn between them and however often round.
#[test]
fn the_turn_of_a_cycle_is_that_from_mean_to_mean() {
    let c = calibrator();
    for rate in [0.0, 2e-4, -3e-3, 8e-3] {
        let mut s = busy();
        let at = |k: i32| 3.0 + rate * f64::from(k) + 1e-6 * f64::from(k * k);
        let push = Push { along: 0.0, aside: 0.0, quadrature: 0.0, across: 0.0 };
        let p = Pendulum { e: 1.0, q: 0.0, r: 0.0, s: 0.0, l: 0.0 };
        let pair = |theta: f64| (theta.cos(), theta.sin());
        let mut sums = Sums::after(pair(at(-1)));
        let mut mean = [0.0; 2];
        for (n, mean) in mean.iter_mut().enumerate() {
            for k in 80 * n as i32..80 * (n as i32 + 1) {
                sums.add(&p, pair(at(k)), pair(at(k - 1)), &push, &[0.0; N]);
                *mean += at(k) / 80.0;
            }
            s.sample = sums.close(5e-4).expect("whole");
            sums.direct(&mut s.sample);
            (s.sample.early, s.sample.late, s.before.late) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            (s.filter.mean, s.before.angle) = ([0.0; N], 0.0);
            c.integrate_all(&mut s, 1);
            for k in 0..MEASURE {
                c.measure(&mut s, 2, k);
            }
            sums = Sums::after(pair(at(80 * (n as i32 + 1) - 1)));
        }
        near(s.schedule.turn, mean[1] - mean[0], 1e-11);
        near(s.sample.cos, mean[1].cos(), 1e-11);
        near(s.sample.sin, mean[1].sin(), 1e-11);
    }
}

#[test]
fn the_virtual_precession_goes_to_and_fro_in_its_stages() {
    let c = calibrator();
    let at = |stage: u8, moving: u16, settle: u16, second: u32| {
        let mut s = busy();
        let sc = &mut s.schedule;
        (sc.stage, sc.moving, sc.settle, sc.fresh) = (stage, moving, settle, 0);
        sc.profile = 25 * second;
        c.plan(&mut s);
        s.precession
    };
    let full = 0.698_131_7;
    for second in 0..40 {
        let sign = |hold: u32| if (second / hold) % 2 == 1 { -1.0 } else { 1.0 };
        assert_eq!(at(0, 0, 1, second), 0.0, "it waits for the loops at first");
        for stage in [0, 1] {
            assert_eq!(at(stage, 0, 0, second), sign(5) * full);
        }
        assert_eq!(at(1, 0, 1, second), sign(5) * full);
        let slow = if (second / 18) % 2 == 1 { 0.5 } else { 1.0 };
        for stage in [2, 4] {
            assert_eq!(at(stage, 0, 0, second), sign(9) * slow * full);
            assert_eq!(at(stage, 1, 0, second), sign(1) * 0.05);
        }
    }
    let mut s = busy();
    (s.schedule.live, s.precession) = (false, 0.4);
    c.plan(&mut s);
    assert_eq!((s.precession, s.schedule.profile, s.schedule.used), (0.0, 1, 0));
}

#[test]
fn a_commit_is_due_after_the_seconds_of_its_stage() {
    let c = calibrator();
    for (stage, seconds) in [(0, 10), (1, 10), (2, 20), (3, 20), (4, 40), (5, 40)] {
        let due = |used: u32, score: f64| {
            let mut s = busy();
            (s.schedule.stage, s.schedule.used, s.score) = (stage, used, score);
            c.plan(&mut s);
            (s.schedule.used, s.schedule.commit)
        };
        let last = 25 * seconds - 1;
        assert_eq!((due(last - 1, 0.0), due(last, 0.0)), ((last, Commit::None), (last + 1, Commit::Forth)));
        // what predicts far worse than before is taken back at once
        assert_eq!((due(3, -20.0).1, due(3, -20.001).1), (Commit::None, Commit::Back));
    }
    // cycles in which loops settle are none of it
    let mut s = busy();
    (s.schedule.stage, s.schedule.used, s.schedule.fresh, s.score) = (0, 250, 0, -21.0);
    c.plan(&mut s);
    assert_eq!((s.schedule.used, s.schedule.commit), (250, Commit::None));
    // while it turns, every twenty seconds, and every ten where it has swept half a turn
    for (stage, swept, seconds) in [(3, 9.0, 20), (4, 3.1, 20), (4, 3.2, 10)] {
        let due = |used: u32| {
            let mut s = busy();
            (s.schedule.stage, s.schedule.used, s.schedule.moving, s.schedule.swept) = (stage, used, 1, swept);
            c.plan(&mut s);
            s.schedule.commit
        };
        assert_eq!((due(25 * seconds - 2), due(25 * seconds - 1)), (Commit::None, Commit::Forth));
    }
    // when for long nothing is as it was learned, the mechanics are others now
    let mut s = busy();
    s.schedule.refused = 1000;
    c.plan(&mut s);
    assert_eq!(s.schedule.stage, 4);
    s.schedule.refused = 1001;
    c.plan(&mut s);
    assert_eq!((s.schedule.stage, s.schedule.refused, s.schedule.settle), (0, 0, 37));
}

#[test]
fn what_goes_on_is_told() {
    let c = calibrator();
    let mut s = busy();
    let told = |s: &State<f64>| c.status(s);
    assert_eq!((told(&s).mode, told(&s).learned), (Mode::AtRest, true));
    (s.schedule.moving, s.schedule.stage) = (1, 3);
    assert_eq!((told(&s).mode, told(&s).learned), (Mode::Turning, false));
    s.schedule.settle = 1;
    assert_eq!(told(&s).mode, Mode::Settling);
    // ½√(0.03² + 0.006²) of bias for what nobody told
    near(told(&s).bias_rad, 0.5 * 0.03_f64.hypot(0.006), 1e-15);
    for (sigma, known) in [(0.13, true), (0.1307, true), (0.131, false)] {
        s.filter.ud = crate::ud::Ud::diagonal(sigma * sigma);
        assert_eq!(told(&s).detection_known, known, "{sigma}");
        // by rotation within the last 20 seconds, of cycles of 40 ms
        for (untold, is_recent) in [(0, true), (499, true), (500, false), (501, false)] {
            s.schedule.untold = untold;
            assert_eq!(told(&s).detection_followed, known && is_recent, "{sigma}, {untold}");
        }
    }
    let ratio = s.estimate(P::DetectionRatio).expect("told");
    near(ratio.value, 0.03 * s.filter.mean[P::DetectionRatio as usize], 1e-15);
    near(ratio.sigma, 0.131 * 0.03, 1e-15);
    assert!(P::ALL.iter().take(OTHERS).all(|p| s.estimate(*p).is_none()));
}
