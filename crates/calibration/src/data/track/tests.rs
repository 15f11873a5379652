use super::*;
use crate::recording::Recording;

const TURN_PER_SAMPLE: f64 = 0.01;

/// Ten times as many samples as are needed, the last quarter held out; commands that go with the pattern.
fn long() -> Track {
    let n = 10 * ENOUGH_SAMPLES;
    let turned = |i: usize| TURN_PER_SAMPLE * i as f64;
    let column = |f: &dyn Fn(f64) -> f64| Some((0..n).map(|i| f(turned(i))).collect());
    let recording = Recording {
        t_s: (0..n).map(|i| 1e-3 * i as f64).collect(),
        table_deg: column(&|a| -a.to_degrees()),
        xc_v: column(&f64::cos),
        yc_v: column(&f64::sin),
        vas_v: column(&|a| 0.3 + (4.0 * a).sin()),
        vqc_v: column(&|a| (2.0 * a).cos()),
        temp_c: column(&|a| 20.0 + 1e-4 * a),
        ..Recording::default()
    };
    let (file, kind) = ("long.csv".into(), crate::recording::RunKind::Rotation);
    let run = Run { kind, file, settle_s: 2.0, role: Role::Fit, amplitude: None, recording };
    Track::new(run, std::f64::consts::PI, true).expect("a track")
}

#[test]
fn a_long_run_is_thinned_as_far_as_its_pattern_turns_little_and_keeps_the_beginnings_of_its_segments() {
    let whole = long();
    let mut track = long();
    track.thin(TURN_PER_SAMPLE / 1e-3);
    let width = 10; // of as many samples as are needed; its pattern might turn by twenty of these steps
    assert!(track.is_thinned() && !whole.is_thinned());
    assert_eq!(track.segments.len(), 2);
    for (thin, full) in track.segments.iter().zip(&whole.segments) {
        assert_eq!(thin.role, full.role);
        assert_eq!(thin.range.len(), full.range.len().div_ceil(width));
        for (at, i) in thin.range.clone().zip(full.range.clone().step_by(width)) {
            assert_eq!(track.t_s[at].to_bits(), whole.t_s[i].to_bits());
            assert_eq!(track.input_rad[at].to_bits(), whole.input_rad[i].to_bits());
            assert_eq!(track.envelope(at), whole.envelope(i));
            let [thinned, as_it_was] = [track.commands(at, 1), whole.commands(i, width)].map(|c| c.expect("recorded"));
            assert_eq!(thinned.now, as_it_was.now);
            assert_eq!(thinned.turn_rad_s.to_bits(), as_it_was.turn_rad_s.to_bits());
        }
    }
    assert_eq!(track.dense().segments.len(), whole.segments.len());
    for (dense, full) in track.dense().segments.iter().zip(&whole.segments) {
        assert_eq!(dense.range.len(), full.range.len().min(DENSE_SAMPLES));
        for (at, i) in dense.range.clone().zip(full.range.clone()) {
            assert_eq!(track.dense().t_s[at].to_bits(), whole.t_s[i].to_bits());
            assert_eq!(track.dense().commands(at, 1).map(|c| c.now), whole.commands(i, 1).map(|c| c.now));
        }
    }
    // where its pattern turns faster, by less
    let mut fast = long();
    fast.thin(5.0 * TURN_PER_SAMPLE / 1e-3);
    assert_eq!(fast.segments[0].range.len(), whole.segments[0].range.len().div_ceil(4));
    // from the recording's start on: what the input does before a segment adds up
    assert!(track.t_s[0] < 1e-9 && track.dense().t_s[0] < 1e-9);
    track.refer_to(20.0);
    let (at, dense) = (track.segments[1].range.start, track.dense().segments[1].range.start);
    assert!(track.warmer_k(at) > 0.0 && (track.warmer_k(at) - track.dense().warmer_k(dense)).abs() < 1e-12);
}

#[test]
fn the_mean_of_few_samples_or_of_many_stands_for_a_smooth_command() {
    let phase = 0.04;
    let v: Vec<f64> = (0..400).map(|i| 0.3 + (phase * f64::from(i)).sin()).collect();
    for width in [2, 3, 4, 5, 9, 12] {
        // what is left is of the sixth order in the phase of a width
        let left = (phase * width as f64).powi(6) / 100.0;
        let worst = (100..300).map(|i| (thinned(&v, i, width) - v[i]).abs()).fold(0.0, f64::max);
        assert!(worst < left + 1e-12, "{width}: {worst:e} and {left:e}");
    }
    // and none of them is lost: what they add up to is what the samples do
    let rough: Vec<f64> = (0..4000_u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761) >> 16) / 65_536.0).collect();
    for width in [3, 4] {
        let sum: f64 =
            (0..).map(|n| 500 + n * width).take_while(|i| *i < 3500).map(|i| thinned(&rough, i, width)).sum();
        let all: f64 = rough[500..3500].iter().sum();
        assert!((width as f64 * sum - all).abs() < 12.0, "{width}: {sum} of {all}");
    }
}

#[test]
fn a_run_of_samples_that_are_all_needed_stays_as_it_is() {
    let mut track = long();
    track.thin(30.0 * TURN_PER_SAMPLE / 1e-3);
    assert!(!track.is_thinned());
    assert_eq!(track.dense().t_s.len(), long().t_s.len());
}

#[test]
fn what_is_put_out_more_than_commanded_is_another_command_and_what_pushes_across() {
    let n = 400;
    let of = |f: fn(f64) -> f64| Some((0..n).map(|i| f(0.02 * f64::from(i))).collect::<Vec<_>>());
    let recording = Recording {
        t_s: (0..n).map(|i| 0.01 * f64::from(i)).collect(),
        rate_dps: Some(vec![2.0_f64.to_degrees(); 400]),
        xc_v: of(f64::cos),
        yc_v: of(f64::sin),
        vas_v: of(|_| -0.2),
        vqc_v: of(|theta| 0.5 * (2.0 * theta).sin()),
        ..Recording::default()
    };
    let (file, kind) = ("spin.csv".into(), crate::recording::RunKind::Rotation);
    let run = Run { kind, file, settle_s: 0.0, role: Role::Fit, amplitude: None, recording };
    let mut track = Track::whole(run, std::f64::consts::PI).expect("a track");
    let before = track.commands(150, 1).expect("commands");
    assert_eq!(before.across.to_bits(), 0.0_f64.to_bits());
    // at once on one interval, of which either end has half
    let mut added = vec![[[0.0; 2]; 2]; 399];
    added[150] = [[0.3, 0.1], [-0.2, 0.4]];
    track.put_out(&added);
    for i in [150, 151] {
        let (sin, cos) = (0.02 * i as f64).sin_cos();
        let after = track.commands(i, 1).expect("commands");
        let was = 0.5 * (0.04 * i as f64).sin();
        assert!((after.now.v_as + 0.2 - 0.5 * (0.3 * cos + 0.1 * sin)).abs() < 1e-12);
        assert!((after.now.v_qc - was - 0.5 * (0.4 * cos + 0.2 * sin)).abs() < 1e-12);
        assert!((after.across - 0.5 * (0.1 * cos - 0.3 * sin)).abs() < 1e-12);
    }
    assert_eq!(track.commands(152, 1).map(|v| v.across), Some(0.0));
}
