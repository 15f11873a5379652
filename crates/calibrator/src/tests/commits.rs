//! Commits: what is moved, what is left, what is taken back, and what is kept over a night.

use super::*;
use crate::commit::{DECIDE, WEIGH};
use crate::correction::Correction;
use crate::parameters::{OTHERS, Parameter as P};
use crate::record::{BYTES, Refused};
use crate::state::{Commit, Filter, State, Work};
use crate::ud::{Ud, Update};

/// A filter that took some measurements, so that everything hangs together.
pub(super) fn correlated(variance: f64) -> Ud<f64> {
    let mut ud = Ud::diagonal(variance);
    for k in 0..6 {
        let h: [f64; N] = core::array::from_fn(|j| ((j * 7 + k * 5) % 11) as f64 / 11.0 - 0.4);
        let mut update = Update::idle();
        ud.measure(&mut update, &h, 0.3 * variance);
    }
    ud
}

/// A filter that knows the detection well.
fn told() -> Filter<f64> {
    Filter { ud: Ud::diagonal(1e-6), ..Filter::new() }
}

fn due(stage: u8) -> State<f64> {
    let mut s = calibrator().start();
    s.filter.ud = correlated(0.01);
    s.filter.mean = core::array::from_fn(|j| 0.3 * (((j * 37 + 11) % 23) as f64 / 23.0 - 0.4));
    (s.schedule.live, s.schedule.stage, s.schedule.commit) = (true, stage, Commit::Forth);
    (s.schedule.fresh, s.schedule.used, s.schedule.settle, s.before.whole) = (9, 500, 0, true);
    s.schedule.swept = 7.0;
    s
}

/// The cycle of a commit.
fn committed(mut s: State<f64>) -> State<f64> {
    for step in 0..80 {
        s.step = step;
        calibrator().work(&mut s);
    }
    s
}

/// What was moved of each parameter, in expected units, by the mean that is left.
fn moved(before: &State<f64>, after: &State<f64>) -> [f64; N] {
    core::array::from_fn(|j| before.filter.mean[j] - after.filter.mean[j])
}

/// Solves a small system.
fn solved(mut a: [[f64; 3]; 3], mut b: [f64; 3]) -> [f64; 3] {
    for i in 0..3 {
        for row in 0..3 {
            if row != i {
                let f = a[row][i] / a[i][i];
                for k in 0..3 {
                    a[row][k] -= f * a[i][k];
                }
                b[row] -= f * b[i];
            }
        }
    }
    core::array::from_fn(|i| b[i] / a[i][i])
}

#[test]
fn the_others_are_committed_as_they_are_given_what_is_committed_of_the_detection() {
    for told in [true, false] {
        let mut before = due(3);
        // a detection far beyond its interval, or well within
        for j in OTHERS..N {
            before.filter.mean[j] = if told { 0.4 } else { 1e-3 } * [1.0, -1.0, 1.0][j - OTHERS];
        }
        before.schedule.angle_used = 250;
        let after = committed(before);
        let by = moved(&before, &after);
        let delta: [f64; 3] = core::array::from_fn(|k| by[OTHERS + k] - before.filter.mean[OTHERS + k]);
        for k in 0..3 {
            near(delta[k], if told { 0.0 } else { -before.filter.mean[OTHERS + k] }, 1e-12);
        }
        let p = |i: usize, j: usize| before.filter.ud.covariance(i, j);
        let detection = core::array::from_fn(|i| core::array::from_fn(|j| p(OTHERS + i, OTHERS + j)));
        let weights = solved(detection, delta);
        for j in 0..OTHERS {
            let given = before.filter.mean[j] + (0..3).map(|k| p(j, OTHERS + k) * weights[k]).sum::<f64>();
            near(by[j], given, 1e-12);
        }
        assert_eq!(after.schedule.stage, 4);
        assert!(after.filter.ud == before.filter.ud, "the third stage goes on with what it knows");
        assert_eq!((after.schedule.used, after.schedule.fresh, after.before.whole), (0, 0, false));
        assert_eq!(after.schedule.swept, 0.0);
        assert_eq!((after.schedule.settle, after.schedule.commit, after.score), (37, Commit::None, 0.0));
        assert_eq!(after.trial, [0.0; N], "only the last stage is on trial");
    }
}

#[test]
fn a_direction_of_the_detection_is_committed_beyond_three_deviations_only() {
    for (ratio, skew, phase) in [(2.9, 0.0, 0.0), (0.0, -2.9, 0.0), (0.0, 0.0, 2.9)] {
        for share in [1.0, 1.1] {
            for sign in [1.0, -1.0] {
                let mut before = due(3);
                before.filter.ud = Ud::diagonal(1e-4);
                before.filter.mean = [0.0; N];
                let values = [phase, ratio, skew].map(|v| 1e-2 * v * share * sign);
                before.filter.mean[OTHERS..].copy_from_slice(&values);
                let by = moved(&before, &committed(before));
                for (k, v) in values.into_iter().enumerate() {
                    near(by[OTHERS + k], if share > 1.05 { v } else { 0.0 }, 1e-12);
                }
            }
        }
    }
    // in the last stage, while it turns, beyond two
    for (stage, moving, sigmas) in [(4, 1, 2.0), (4, 0, 3.0), (3, 1, 3.0)] {
        for share in [0.99, 1.01] {
            let mut before = due(stage);
            before.filter.ud = Ud::diagonal(1e-4);
            before.filter.mean = unit(P::DetectionRatio, 1e-2 * sigmas * share);
            before.schedule.moving = moving;
            let expected = if share > 1.0 { 1e-2 * sigmas * share } else { 0.0 };
            near(moved(&before, &committed(before))[P::DetectionRatio as usize], expected, 1e-12);
        }
    }
    // a phase that is hardly known is not, whatever its mean
    for (variance, expected) in [(0.2499, 2.0), (0.2501, 0.0)] {
        let mut before = due(3);
        before.filter.ud = Ud::diagonal(variance);
        before.filter.mean = unit(P::DetectionPhase, 2.0);
        near(moved(&before, &committed(before))[P::DetectionPhase as usize], expected, 1e-12);
    }
    // ratio and skew that hang together, in either sense: along the direction that is told, across it not
    for hang in [0.2, -0.2] {
        let mut before = due(3);
        before.filter.ud = Ud::with_last(1e-4, &[1e-4, 1e-6, 1e-2, 0.0, 0.0, hang]).expect("a covariance");
        before.filter.mean = [0.0; N];
        (before.filter.mean[OTHERS + 1], before.filter.mean[OTHERS + 2]) = (0.05, hang.signum() * 0.05);
        let by = moved(&before, &committed(before));
        let (ug, us) = (0.03, 6e-3);
        let ud = &before.filter.ud;
        let (gg, ss) = (ud.variance(OTHERS + 1) * ug * ug, ud.variance(OTHERS + 2) * us * us);
        let gs = ud.covariance(OTHERS + 1, OTHERS + 2) * ug * us;
        let angle = 0.5 * f64::atan2(2.0 * gs, gg - ss);
        let (mut g, mut k) = (0.0, 0.0);
        let mut told = 0;
        for (x, y) in [(angle.cos(), angle.sin()), (-angle.sin(), angle.cos())] {
            let (along, variance) =
                (x * 0.05 * ug + y * hang.signum() * 0.05 * us, x * x * gg + 2.0 * x * y * gs + y * y * ss);
            if along.abs() > 3.0 * variance.sqrt() {
                (g, k, told) = (g + x * along, k + y * along, told + 1);
            }
        }
        assert_eq!(told, 1, "one of two directions");
        near(by[OTHERS + 1], g / ug, 1e-12);
        near(by[OTHERS + 2], k / us, 1e-12);
    }
}

#[test]
fn each_stage_commits_what_it_may_and_forgets_as_it_should() {
    let coarse = [P::SplitCos, P::SplitSin, P::Damping, P::ForceScale];
    for stage in 0..4 {
        for used in [249, 250] {
            let mut before = due(stage);
            before.filter.ud = Ud::diagonal(0.01);
            before.schedule.angle_used = used;
            (before.schedule.before_rest, before.schedule.uses_of_symmetry) = (4, 7);
            let after = committed(before);
            assert_eq!(after.schedule.before_rest, 0, "the stages go on from here");
            assert_eq!(after.schedule.uses_of_symmetry, 7, "what a record says was used stays so");
            for p in P::ALL.into_iter().take(OTHERS) {
                let untold = matches!(p, P::ForceScale | P::ForceRotation | P::Rate) && used < 250;
                let moved = !untold && (stage > 0 || coarse.contains(&p));
                let mean = if moved { 0.0 } else { before.filter.mean[p as usize] };
                // the coarse stages begin anew
                let mean = if stage < 3 { 0.0 } else { mean };
                near(after.filter.mean[p as usize], mean, 1e-12);
                let unmoved = after.correction.known[p as usize] == before.correction.known[p as usize]
                    && after.correction.drives == before.correction.drives;
                assert!(!moved || !unmoved, "stage {stage}: {p:?}");
            }
            if stage == 0 {
                // the coarse ones alone: of the drives their scale
                for p in P::ALL.into_iter().filter(|p| !coarse.contains(p)) {
                    assert_eq!(after.correction.known[p as usize], before.correction.known[p as usize], "{p:?}");
                }
                let drives = after.correction.drives;
                assert_eq!((drives.xx, drives.xy, drives.yx), (drives.yy, Complex::real(0.0), Complex::real(0.0)));
                assert_eq!(drives.xx.im, 0.0);
            }
            // of the detection the first two say nothing yet, and what the very first believes is forgotten
            if stage == 0 {
                assert_eq!(after.filter.mean, [0.0; N]);
            } else if stage < 2 {
                assert_eq!(after.filter.mean[OTHERS..], before.filter.mean[OTHERS..]);
            }
            assert_eq!(after.schedule.stage, stage + 1);
            let variance = match (stage, used) {
                (3, _) | (1 | 2, 250) => 0.01,
                _ => 1.0,
            };
            near(after.filter.ud.variance(0), variance, 1e-15);
            near(after.filter.ud.variance(OTHERS), if stage == 0 { 1.0 } else { 0.01 }, 1e-15);
            assert!(!after.schedule.cold);
        }
    }
    // what was told before a first stage is kept
    let mut before = due(0);
    before.schedule.cold = false;
    let after = committed(before);
    assert_eq!(after.filter.mean[OTHERS..], before.filter.mean[OTHERS..]);
    near(after.filter.ud.variance(OTHERS), before.filter.ud.variance(OTHERS), 1e-15);
    // what is not known to half its expectation is not moved
    for (variance, moves) in [(0.249, true), (0.251, false)] {
        let mut before = due(3);
        before.filter.ud = Ud::diagonal(variance);
        let by = moved(&before, &committed(before));
        assert_eq!(by[P::ForceRatio as usize] != 0.0, moves);
    }
}

#[test]
fn a_commit_of_the_last_stage_is_on_trial_and_taken_back_as_a_whole() {
    let mut before = due(4);
    before.schedule.angle_used = 250;
    let after = committed(before);
    assert_eq!(after.schedule.stage, 4);
    let by = moved(&before, &after);
    assert!(by.iter().any(|v| v.abs() > 0.01));
    for j in 0..N {
        near(after.trial[j], by[j], 1e-13);
    }
    let mut failed = after;
    (failed.schedule.commit, failed.score, failed.schedule.settle) = (Commit::Back, -21.0, 0);
    let back = committed(failed);
    for p in P::ALL {
        near(back.filter.mean[p as usize], before.filter.mean[p as usize], 1e-13);
        near(back.correction.known[p as usize], before.correction.known[p as usize], 2e-4 * p.expected::<f64>());
    }
    near(back.correction.detection_ratio(), before.correction.detection_ratio(), 1e-5);
    assert_eq!((back.taken_back, back.trial, back.score), (1, [0.0; N], 0.0));
    assert_eq!((back.schedule.commit, back.schedule.settle, back.schedule.stage), (Commit::None, 37, 4));
    assert!(back.filter.ud == after.filter.ud);
}

/// What stands where the commit was may be no device any more: then nothing is taken back, of the mean neither.
#[test]
fn a_commit_that_leads_back_to_no_device_stays() {
    let mut before = due(4);
    (before.schedule.commit, before.score) = (Commit::Back, -21.0);
    before.trial = unit(P::OffsetX, 13.0);
    let after = committed(before);
    assert_eq!((after.correction, after.filter.mean), (before.correction, before.filter.mean));
    assert_eq!((after.trial, after.taken_back, after.schedule.stage), ([0.0; N], 0, 4));
}

#[test]
fn a_commit_of_no_device_moves_nothing_and_begins_anew() {
    let mut before = due(3);
    before.schedule.cold = false;
    before.filter.ud = Ud::diagonal(1e-4);
    before.filter.mean = unit(P::OffsetX, 13.0);
    let after = committed(before);
    assert_eq!(after.correction, before.correction);
    assert_eq!((after.filter.mean, after.filter.ud), ([0.0; N], Ud::diagonal(1.0)));
    assert_eq!((after.schedule.commit, after.schedule.settle, after.schedule.stage), (Commit::None, 37, 0));
    assert!(!before.schedule.cold && after.schedule.cold, "as after a start");
}

/// Five times what is expected of devices, in force and believed together, and not a bit more.
#[test]
fn a_detection_of_no_device_is_forgotten_and_the_mechanics_in_force_are_kept() {
    let known = unit(P::SplitCos, 1.0);
    for p in [P::DetectionRatio, P::DetectionSkew, P::DetectionPhase] {
        for (in_force, believed, kept) in [
            (0.0, 4.9, true),
            (0.0, 5.1, false),
            (2.0, 2.8, true),
            (2.0, 3.3, false),
            (0.0, -5.1, false),
            (0.0, f64::NAN, false),
        ] {
            let mut before = due(3);
            let mut started = known;
            started[p as usize] = in_force * p.expected::<f64>();
            before.correction = before.correction.moved(&started).expect("of a device");
            before.filter.ud = Ud::diagonal(1e-4);
            before.filter.mean = unit(p, believed);
            let after = committed(before);
            assert_eq!(after.schedule.stage == 4, kept, "{p:?} {in_force} {believed}");
            if !kept {
                assert_eq!(after.correction, before.correction);
                assert_eq!((after.filter.mean, after.filter.ud), ([0.0; N], Ud::diagonal(1.0)));
            }
        }
    }
}

/// The symmetry of the split is a measurement of a ten-thousandth, and less with each use: it is taken where it tells more than
/// that, and where what it tells is no further off than four deviations.
#[test]
fn a_symmetry_is_used_where_it_tells_more_than_its_noise() {
    for (used, noise) in [(0_u16, 1e-8), (1, 2e-8), (3, 4e-8)] {
        let weighed = |spread: f64, deviations: f64| {
            let mut s = due(4);
            s.schedule.accept = true;
            s.schedule.uses_of_symmetry = used;
            s.filter.spread = spread * noise;
            s.score = deviations * f64::sqrt((spread + 1.0) * noise);
            calibrator().commit_slice(&mut s, WEIGH);
            (s.schedule.accept, s.schedule.uses_of_symmetry)
        };
        assert_eq!((weighed(3.99, 0.0), weighed(4.01, 0.0)), ((false, used), (true, used + 1)));
        for sign in [1.0, -1.0] {
            assert_eq!((weighed(9.0, sign * 3.99), weighed(9.0, sign * 4.01)), ((true, used + 1), (false, used)));
        }
    }
}

#[test]
fn a_split_is_symmetric_and_what_is_not_is_the_detections() {
    let mut before = due(4);
    (before.schedule.angle_used, before.filter.ud) = (251, Ud::diagonal(1e-3));
    before.filter.mean = [0.0; N];
    let known = &mut before.correction.known;
    (known[P::SplitCos as usize], known[P::SplitSin as usize]) = (1.5, -2.5);
    (known[P::AnisodampingSin as usize], known[P::QuadratureRate as usize]) = (0.01, 2e-3);
    let mut row = [0.0; N];
    for (p, slope) in [
        (P::QuadratureRate, 1.0),
        (P::DetectionRatio, 0.5 * 2.5),
        (P::DetectionSkew, -0.5 * 1.5),
        (P::DetectionPhase, 0.01),
    ] {
        row[p as usize] = slope * p.expected::<f64>();
    }
    let spread: f64 = row.iter().map(|h| h * h * 1e-3).sum();
    let run = |uses: u16, change: fn(&mut State<f64>)| {
        let mut s = before;
        s.schedule.uses_of_symmetry = uses;
        change(&mut s);
        for k in 0..DECIDE {
            calibrator().commit_slice(&mut s, k);
        }
        s
    };
    let unknown = 1e-3 * (0.03_f64 * 0.03 + 6e-3 * 6e-3);
    let bent = 0.5 * 1.5_f64.hypot(2.5) * unknown;
    for uses in [0_u16, 3] {
        let s = run(uses, |_| {});
        let noise = 1e-8 * f64::from(uses + 1) + bent * bent;
        for j in 0..N {
            near(s.filter.mean[j], -2e-3 * row[j] * 1e-3 / (spread + noise), 1e-14);
        }
        assert_eq!(s.schedule.uses_of_symmetry, uses + 1);
    }
    // used where it says more than what is known, is believable, and the forces' phase and scale are known
    let unused: [fn(&mut State<f64>); 5] = [
        |s| s.schedule.stage = 3,
        |s| s.schedule.angle_used = 250,
        |s| s.filter.ud = Ud::diagonal(2.6e-3),
        |s| s.filter.ud = Ud::diagonal(1e-6),
        |s| s.correction.known[P::QuadratureRate as usize] = 0.02,
    ];
    for change in unused {
        let s = run(0, change);
        assert_eq!((s.filter.mean, s.schedule.uses_of_symmetry), ([0.0; N], 0));
    }
}

/// Whenever in a cycle the split changes: the last slice of a cycle leaves the filter as it is, since its control step hands
/// over the sums as well.
#[test]
fn a_change_of_the_split_is_forgotten_whole_from_every_control_step_on() {
    let c = Calibrator::<f64>::new(&Settings { steps: 160, ..settings() }).expect("inside its domain");
    for at in 0..160 {
        let mut s = due(4);
        s.schedule.commit = Commit::None;
        let before = s;
        c.split_changed(&mut s);
        s.step = at;
        while s.schedule.commit == Commit::Forget {
            let filter = s.filter;
            c.work(&mut s);
            assert!(s.step < 159 || s.filter == filter, "{at}");
            s.step = (s.step + 1) % 160;
        }
        assert_eq!(s.step, 0, "{at}: to the end of a cycle");
        assert!(matches!(s.filter.work, Work::Measure(u) if u == Update::idle()));
        for j in 0..N {
            let (mean, variance) =
                if j < OTHERS { (0.0, 1.0) } else { (before.filter.mean[j], before.filter.ud.variance(j)) };
            near(s.filter.mean[j], mean, 0.0);
            near(s.filter.ud.variance(j), variance, 1e-16);
        }
    }
}

/// The slices that are left of the cycle once a commit is through would be those of a measurement that never began.
#[test]
fn after_a_commit_nothing_is_measured_to_the_end_of_the_cycle() {
    let mut before = due(4);
    (before.schedule.angle_used, before.filter.ud) = (251, Ud::diagonal(1e-3));
    (before.correction.known[P::SplitCos as usize], before.correction.known[P::SplitSin as usize]) = (1.5, -2.5);
    before.filter.mean = [0.0; N];
    let mut through = before;
    for k in 0..DECIDE {
        calibrator().commit_slice(&mut through, k);
    }
    assert!(through.schedule.accept, "the symmetry was measured");
    let after = committed(before);
    assert!(after.filter.ud == through.filter.ud && after.filter.shown == through.filter.shown);
    assert!(!after.before.whole);
}

#[test]
fn a_change_of_the_split_forgets_the_mechanics_and_keeps_the_detection() {
    let mut s = due(4);
    (s.schedule.uses_of_symmetry, s.schedule.refused, s.schedule.angle_used) = (5, 900, 300);
    s.schedule.before_rest = 4;
    (s.trial, s.score) = ([0.1; N], 3.0);
    let before = s;
    calibrator().split_changed(&mut s);
    assert_eq!(s.schedule.commit, Commit::Forget);
    let s = committed(s);
    for j in 0..N {
        let (mean, variance) =
            if j < OTHERS { (0.0, 1.0) } else { (before.filter.mean[j], before.filter.ud.variance(j)) };
        near(s.filter.mean[j], mean, 0.0);
        near(s.filter.ud.variance(j), variance, 1e-16);
        for i in 0..OTHERS {
            assert!(i == j || s.filter.ud.covariance(i, j) == 0.0);
        }
    }
    for (i, j) in [(OTHERS, OTHERS + 1), (OTHERS, OTHERS + 2), (OTHERS + 1, OTHERS + 2)] {
        near(s.filter.ud.covariance(i, j), before.filter.ud.covariance(i, j), 1e-16);
    }
    let sc = s.schedule;
    assert_eq!((sc.stage, sc.used, sc.uses_of_symmetry, sc.refused, sc.angle_used), (0, 0, 0, 0, 0));
    assert_eq!((sc.commit, sc.settle, sc.fresh, sc.before_rest), (Commit::None, 37, 0, 0));
    assert_eq!((s.trial, s.score, s.before.whole), ([0.0; N], 0.0, false));
    assert_eq!(s.correction, before.correction);
}

#[test]
fn a_record_keeps_what_is_in_force_what_is_known_of_the_detection_and_no_more() {
    let c = calibrator();
    let mut s = committed(due(3));
    s.filter.ud = correlated(0.5);
    s.schedule.uses_of_symmetry = 0x1234;
    for (used, scaled) in [(249, 0), (250, 1)] {
        s.schedule.angle_used = used;
        let bytes = c.save(&s);
        assert_eq!(bytes.len(), BYTES);
        assert_eq!(&bytes[..8], [b'C', b'V', b'G', b'S', 1, scaled, 0x34, 0x12]);
        let number = |k: usize| f64::from_le_bytes(core::array::from_fn(|b| bytes[8 + 8 * k + b]));
        for (k, v) in s.correction.known.iter().enumerate() {
            assert_eq!(number(k), *v);
        }
        let back = c.restore(&bytes).expect("whole");
        assert_eq!(back.correction, s.correction);
        assert_eq!((back.schedule.stage, back.schedule.uses_of_symmetry), (3, 0x1234));
        assert!(!back.schedule.cold, "what it knows of the detection is kept");
        let known = calibrator().restore(&c.save(&State { filter: told(), ..s })).expect("whole");
        let status = c.status(&known);
        assert!(status.detection_known && !status.detection_followed, "known from then, not told since");
        assert_eq!(back.schedule.angle_used, if scaled == 1 { 250 } else { 0 });
        assert_eq!((back.filter.mean, back.schedule.settle), ([0.0; N], 50));
        for i in 0..N {
            for j in 0..N {
                let expected = match (i < OTHERS, j < OTHERS, i == j) {
                    (true, true, true) => 0.01,
                    (false, false, _) => s.filter.ud.covariance(i, j),
                    _ => 0.0,
                };
                near(back.filter.ud.covariance(i, j), expected, 1e-15);
            }
        }
        // once more it is the same
        assert_eq!(c.save(&back), bytes);
    }
}

/// A record with another content and its right checksum.
fn sealed(mut bytes: [u8; BYTES]) -> [u8; BYTES] {
    let mut crc = !0_u32;
    for byte in &bytes[..BYTES - 4] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    bytes[BYTES - 4..].copy_from_slice(&(!crc).to_le_bytes());
    bytes
}

#[test]
fn a_whole_record_of_another_version_or_of_no_instrument_is_refused_for_what_it_is() {
    let c = calibrator();
    let bytes = c.save(&committed(due(3)));
    assert_eq!(sealed(bytes), bytes);
    let refused = |change: &dyn Fn(&mut [u8; BYTES])| {
        let mut other = bytes;
        change(&mut other);
        c.restore(&sealed(other)).map(|_| ()).expect_err("refused")
    };
    assert_eq!(refused(&|b| b[4] = 2), Refused::Version);
    assert_eq!(refused(&|b| b[4] = 0), Refused::Version);
    for mark in 0..4 {
        assert_eq!(refused(&|b| b[mark] ^= 0x20), Refused::Damaged);
    }
    // each number beyond any instrument's, and none at all; a variance of nothing and a negative one
    for k in 0..N + 4 + 8 + 6 {
        for v in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
            assert_eq!(
                refused(&|b| b[8 + 8 * k..16 + 8 * k].copy_from_slice(&v.to_le_bytes())),
                Refused::Implausible,
                "{k}"
            );
        }
    }
    for k in N + 12..N + 15 {
        for v in [0.0, -1e-3, 2.001] {
            assert_eq!(
                refused(&|b| b[8 + 8 * k..16 + 8 * k].copy_from_slice(&f64::to_le_bytes(v))),
                Refused::Implausible
            );
        }
    }
}

#[test]
fn values_in_force_from_the_start_are_those_that_are_given() {
    let c = calibrator();
    let state = c.start_from(&unit(P::DetectionRatio, 0.02)).expect("a device");
    assert_eq!(state.correction, Correction::none(0.04).moved(&unit(P::DetectionRatio, 0.02)).expect("a device"));
    assert!(c.start_from(&unit(P::DetectionRatio, 0.5)).is_none());
    assert!(c.start_from(&unit(P::Rate, f64::NAN)).is_none());
}
