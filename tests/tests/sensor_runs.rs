//! Two-channel sensors on a shaft: an eccentric shaft beside offsets, as recorded by one run that goes one way.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::Identification;
use cvg_calibration::recording::{Campaign, Recording, Role, Run};
use cvg_tests::angle_sensor::{Noise, find, held_out, identified, run, sensor};

/// Two channels as they are built, V, and the shaft that they sit on.
#[derive(Clone, Copy)]
struct Built {
    offset_v: [f64; 2],
    gain_ratio: f64,
    skew: f64,
    /// once a turn of the shaft, deg, and its phase, rad
    eccentricity_deg: [f64; 2],
}

const BUILT: Built = Built { offset_v: [0.02, -0.01], gain_ratio: 1.02, skew: 0.0, eccentricity_deg: [0.0; 2] };
/// Noise of a channel, V, of an amplitude of 1 V.
const NOISE_V: f64 = 4e-4;

/// 4000 rows in 20 s at a steady rate, read by channels of this angular gain.
fn recorded(built: Built, rate_dps: f64, gain: f64, seed: u64) -> Recording {
    let mut noise = Noise::new(seed);
    let t_s: Vec<f64> = (0..4000).map(|i| 0.005 * f64::from(i)).collect();
    let table: Vec<f64> = t_s.iter().map(|t| rate_dps * t).collect();
    let read = |a: &f64| {
        let [size, phase] = built.eccentricity_deg;
        let (sin, cos) = (gain * (a + size * (a.to_radians() + phase).sin())).to_radians().sin_cos();
        let x = cos + built.offset_v[0] + NOISE_V * noise.sample();
        (x, built.gain_ratio * (sin + built.skew * cos) + built.offset_v[1] + NOISE_V * noise.sample())
    };
    let (x, y) = table.iter().map(read).unzip();
    Recording { t_s, table_deg: Some(table), xc_v: Some(x), yc_v: Some(y), ..Recording::default() }
}

fn of_runs(runs: Vec<Run>) -> Identification {
    identified(Campaign { angular_gain: None, ..sensor(runs) })
}

/// Whether the interval of a parameter holds what was planted.
fn holds(i: &Identification, effect: &str, at: usize, planted: f64) -> bool {
    let found = find(i, effect).map(|e| e.parameters[at].ci95.unwrap());
    found.is_some_and(|[low, high]| (low..=high).contains(&planted))
}

#[test]
fn an_eccentric_shaft_is_not_taken_for_an_offset_of_the_channels() {
    for seed in 0..4_u32 {
        let built = Built { eccentricity_deg: [0.3, f64::from(seed)], ..BUILT };
        let i = of_runs(vec![run("one-way.csv", Role::Fit, recorded(built, 37.0, 1.0, seed.into()))]);
        let offsets = find(&i, "detection-offset");
        assert!((0..2).all(|at| holds(&i, "detection-offset", at, BUILT.offset_v[at])), "seed {seed}: {offsets:?}");
        let once = i.report.unexplained.iter().find(|u| u.n == Some(1)).unwrap_or_else(|| panic!("seed {seed}"));
        assert!(once.suggestion.contains("eccentricity") && once.rms_deg > 0.1, "seed {seed}: {once:?}");
        // 4e-4 V of noise are 0.023°
        assert!(held_out(&i) < 0.025, "seed {seed}: {}°", held_out(&i));
    }
}

#[test]
fn offsets_without_an_eccentric_shaft_are_told_as_closely_as_the_noise_allows() {
    for seed in 0..2 {
        let i = of_runs(vec![run("one-way.csv", Role::Fit, recorded(BUILT, 37.0, 1.0, seed))]);
        let offset = find(&i, "detection-offset").unwrap();
        for (p, planted) in offset.parameters.iter().zip(BUILT.offset_v) {
            let [low, high] = p.ci95.unwrap();
            assert!((low..=high).contains(&planted) && high - low < 2e-4, "seed {seed}: {offset:?}");
        }
        assert!(i.report.unexplained.iter().all(|u| u.n != Some(1)), "seed {seed}: {:?}", i.report.unexplained);
    }
}
