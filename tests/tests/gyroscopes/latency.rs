//! An output that is stamped late, under a rate that changes: by the rate of the sample alone the angle would be wrong to second order.

use std::f64::consts::TAU;

use cvg_calibration::recording::{Campaign, Recording, Role, Run};
use cvg_tests::angle_sensor::{Noise, find, identified, run};
use cvg_tests::bench::holds;

const ANGULAR_GAIN: f64 = 0.78;
const RATIO: f64 = 1.0132;
const LATENCY_S: f64 = 0.030;

/// 40 s of a pattern of 1 V that turns by −k times the input angle, read through unequal gains and stamped late.
fn turning(name: &str, rate: impl Fn(f64) -> f64, angle: impl Fn(f64) -> f64, noise: &mut Noise) -> Run {
    let t_s: Vec<f64> = (0..8000).map(|i| 0.005 * f64::from(i)).collect();
    let mut recording = Recording { rate_dps: Some(t_s.iter().map(|t| rate(*t)).collect()), ..Recording::default() };
    let [mut x, mut y] = [Vec::new(), Vec::new()];
    for t in &t_s {
        let (sin, cos) = (-ANGULAR_GAIN * angle(t - LATENCY_S)).to_radians().sin_cos();
        x.push(cos + 1e-4 * noise.sample());
        y.push(RATIO * sin + 1e-4 * noise.sample());
    }
    let mut quiet = || Some(t_s.iter().map(|_| 1e-4 * noise.sample()).collect());
    (recording.xs_v, recording.ys_v) = (quiet(), quiet());
    (recording.xc_v, recording.yc_v, recording.t_s) = (Some(x), Some(y), t_s);
    run(name, Role::Fit, recording)
}

#[test]
fn a_late_output_leaves_the_angular_gain_alone_where_the_rate_swings() {
    let w = TAU * 0.2;
    for seed in 0..4 {
        let mut noise = Noise::new(seed);
        let mut runs = vec![turning(
            "swing.csv",
            |t| 150.0 * (w * t).sin() + 40.0,
            |t| 150.0 / w * (1.0 - (w * t).cos()) + 40.0 * t,
            &mut noise,
        )];
        for rate in [300.0, -300.0] {
            runs.push(turning(&format!("{rate}.csv"), |_| rate, |t| rate * t, &mut noise));
        }
        let i = identified(Campaign { device: "made".into(), runs, ..Campaign::default() });
        let latency = find(&i, "angle-latency").unwrap().parameters[0].clone();
        println!("{seed}: {:?} {:?} {latency:?}", i.report.angular_gain, i.report.detection_gain_ratio);
        assert!(holds(&i.report.angular_gain, ANGULAR_GAIN), "seed {seed}: {:?}", i.report.angular_gain);
        assert!((latency.value - LATENCY_S).abs() < 1e-4, "seed {seed}: {latency:?}");
    }
}

/// Every run swings at one frequency: what is late goes with it, and was a line in time of 0.3 Hz.
#[test]
fn what_is_late_under_a_swing_alone_is_no_line_in_time() {
    let w = TAU * 0.3;
    let swing =
        turning("swing.csv", |t| 300.0 * (w * t).sin(), |t| 300.0 / w * (1.0 - (w * t).cos()), &mut Noise::new(11));
    let i = identified(Campaign { device: "made".into(), runs: vec![swing], ..Campaign::default() });
    let latency = find(&i, "angle-latency").unwrap().parameters[0].clone();
    assert!((latency.value - LATENCY_S).abs() < 1e-3, "{latency:?}");
    assert!(find(&i, "time-periodic").is_none(), "{:?}", i.report.effects);
}
