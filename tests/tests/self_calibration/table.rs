//! How well random devices calibrate themselves: the tables of the book.
//!
//! `CVG_LIFE` names the lives, separated by commas, or `all`; `CVG_TRIALS` is how many devices, `CVG_FIRST` the first of
//! them, `CVG_DOUBLE` takes double precision, `CVG_EACH` prints every device. Without `CVG_LIFE` none is measured.

use std::f64::consts::{PI, TAU};

use cvg_calibrator::{Parameter, State};
use cvg_model::Float;
use cvg_tests::envelope_loop::lives::{Life, all, lived, lived_under};
use cvg_tests::envelope_loop::{Device, Loop, bias_deg};

const LIVES: [Life; 6] =
    [Life::Rest, Life::RestThenHand, Life::Turning, Life::RestThenSlow, Life::SecondSplit, Life::Slow];
/// 100 ppm a minute, 1/s.
const DRIFT_PER_S: f64 = 1e-4 / 60.0;
/// Random walk that the calibrator takes devices to have, 1/√s.
const WANDER: f64 = 1.2e-5;

/// The first minutes of the table of lives, for every change.
#[test]
fn two_minutes_of_turning_take_most_of_the_bias_away() {
    for seed in [1000, 1001] {
        let outcome = live::<f32>(Life::Turning, seed, 120.0, 0.0);
        assert!(outcome.reduction[0] > 20.0, "{seed}: {:?}", outcome.reduction);
    }
}

struct Outcome {
    reduction: [f64; 2],
    left_deg: f64,
    /// what ratio and skew would make of an otherwise perfect device, nothing in force
    alone_deg: f64,
    z: [f64; 3],
    taken_back: u16,
    known: bool,
}

fn live<T: Float>(life: Life, seed: u64, seconds: f64, wander: f64) -> Outcome {
    let mut device = Device { wander, ..Device::random(seed) };
    if life == Life::SecondSplit {
        device.tuned = (TAU * 0.3, (seed as f64 * 0.618).fract() * PI);
    }
    let run = lived::<T>(&device, seed, life, seconds);
    let (ratio, skew) = run.detection();
    let none = run.calibrator.start();
    let measured = if life == Life::SecondSplit { device.with_split_tuned() } else { device.clone() };
    let measured = Device { ratio, skew, wander: 0.0, ..measured };
    let bias = |state: &State<T>, corrected, rate, seconds| bias_deg(&measured, state, corrected, rate, seconds);
    let left_deg = bias(&run.state, true, 500.0, 6.0);
    let alone = Device {
        anisodamping: (0.0, 0.0),
        split: (0.0, 0.0),
        offset: (0.0, 0.0),
        cubic: 0.0,
        phase: (0.0, 0.0),
        force: (1.0, 1.0),
        force_skew: 0.0,
        force_phase: 0.0,
        ..measured.clone()
    };
    let reduction = [
        bias(&none, false, 500.0, 6.0) / left_deg,
        bias(&none, false, 60.0, 24.0) / bias(&run.state, true, 60.0, 24.0),
    ];
    let z = |p: Parameter, truth: f64| {
        let e = run.state.estimate(p).unwrap();
        (e.value.to_f64() - truth) / e.sigma.to_f64()
    };
    let status = run.calibrator.status(&run.state);
    Outcome {
        reduction,
        left_deg,
        alone_deg: bias_deg(&alone, &none, false, 500.0, 6.0),
        z: [
            z(Parameter::DetectionRatio, ratio - 1.0),
            z(Parameter::DetectionSkew, ratio * skew),
            z(Parameter::DetectionPhase, device.phase.1 - device.phase.0),
        ],
        taken_back: status.taken_back,
        known: status.detection_known,
    }
}

fn quantile(sorted: &[f64], p: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * p) as usize]
}

/// What the environment asks for.
struct Wanted {
    lives: Vec<Life>,
    count: u64,
    first: u64,
    double: bool,
    each: bool,
}

fn wanted(variable: &str) -> Option<Wanted> {
    let Ok(only) = std::env::var(variable) else {
        println!("skipped: {variable} is not set");
        return None;
    };
    let number = |name: &str, default| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
    let named = |life: &Life| only == "all" || only.split(',').any(|o| o == format!("{life:?}"));
    Some(Wanted {
        lives: LIVES.into_iter().filter(named).collect(),
        count: number("CVG_TRIALS", 16),
        first: number("CVG_FIRST", 0),
        double: std::env::var("CVG_DOUBLE").is_ok(),
        each: std::env::var("CVG_EACH").is_ok(),
    })
}

/// Ten minutes of random devices. `CVG_WANDER` lets ratio and skew walk as the calibrator takes them to.
#[test]
fn table_of_lives() {
    let Some(w) = wanted("CVG_LIFE") else { return };
    let wander = if std::env::var("CVG_WANDER").is_ok() { WANDER } else { 0.0 };
    for life in &w.lives {
        let outcomes = all(w.count, |n| {
            let seed = w.first + n;
            let o = if w.double {
                live::<f64>(*life, seed, 600.0, wander)
            } else {
                live::<f32>(*life, seed, 600.0, wander)
            };
            if w.each {
                let ([fast, slow], [a, b, c]) = (o.reduction, o.z);
                println!(
                    "each {life:?} {seed} {fast:.4} {slow:.4} {:.5} {a:.3} {b:.3} {c:.3} {} {}",
                    o.left_deg * 1e3,
                    o.known,
                    o.taken_back
                );
            }
            o
        });
        print_reductions(*life, &outcomes, w.first);
    }
}

fn print_reductions(life: Life, outcomes: &[Outcome], first: u64) {
    let count = outcomes.len();
    for (i, name) in ["500", " 60"].iter().enumerate() {
        let mut r: Vec<(f64, u64)> = outcomes.iter().map(|o| o.reduction[i]).zip(first..).collect();
        r.sort_by(|a, b| a.0.total_cmp(&b.0));
        let grew: Vec<u64> = r.iter().filter(|(r, _)| *r < 0.99 || r.is_nan()).map(|(_, n)| *n).collect();
        let worst: Vec<u64> = r.iter().take(4).map(|(_, n)| *n).collect();
        let r: Vec<f64> = r.iter().map(|(r, _)| *r).collect();
        println!(
            "{life:?} {name} deg/s, {count}: median {:.1}, 5 % below {:.2}, min {:.2}, grew {} {grew:?} worst {worst:?}",
            quantile(&r, 0.5),
            quantile(&r, 0.05),
            r[0],
            grew.len()
        );
    }
    let beyond: Vec<u64> =
        (first..).zip(outcomes).filter(|(_, o)| o.left_deg > 1.01 * o.alone_deg).map(|(n, _)| n).collect();
    println!("  more left at 500 deg/s than ratio and skew alone make: {} {beyond:?}", beyond.len());
    let held = |i: usize| outcomes.iter().filter(|o| o.z[i].abs() < 1.96).count() as f64 / count as f64;
    let mut left: Vec<f64> = outcomes.iter().map(|o| o.left_deg * 1e3).collect();
    left.sort_by(f64::total_cmp);
    println!(
        "  left {:.2} mdeg median, {:.2} at 95 %; intervals hold γ {:.3} s {:.3} ψ {:.3}; known {}; taken back {}",
        quantile(&left, 0.5),
        quantile(&left, 0.95),
        held(0),
        held(1),
        held(2),
        outcomes.iter().filter(|o| o.known).count(),
        outcomes.iter().map(|o| u32::from(o.taken_back)).sum::<u32>()
    );
}

/// How far the ratio is from that of a device whose gain moves, relative: as believed, and as in force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Followed {
    pub(super) believed_rms: f64,
    pub(super) in_force_rms: f64,
    in_force_most: f64,
    pub(super) said: bool,
}

pub(super) fn follow<T: Float>(life: Life, seed: u64, seconds: f64) -> Followed {
    let device = Device { drift_per_s: DRIFT_PER_S, ..Device::random(seed) };
    let (mut believed, mut in_force, mut most, mut count) = (0.0, 0.0, 0.0_f64, 0.0);
    let run = lived_under::<T>(&device, seed, life, seconds, |run: &Loop<'_, T>| {
        // the last two thirds: what came before has been learned by then
        if run.t > seconds / 3.0 {
            let truth = run.detection().0 - 1.0;
            let b = run.state.estimate(Parameter::DetectionRatio).unwrap().value.to_f64() - truth;
            let f = run.state.correction().detection_ratio().to_f64() - truth;
            believed += b * b;
            in_force += f * f;
            most = most.max(f.abs());
            count += 1.0;
        }
    });
    Followed {
        believed_rms: f64::sqrt(believed / count),
        in_force_rms: f64::sqrt(in_force / count),
        in_force_most: most,
        said: run.calibrator.status(&run.state).detection_followed,
    }
}

/// Drift of 100 ppm a minute: `CVG_DRIFT` names the lives as `CVG_LIFE` does.
#[test]
fn table_of_drift() {
    let Some(w) = wanted("CVG_DRIFT") else { return };
    for life in &w.lives {
        let followed = all(w.count, |n| follow::<f32>(*life, w.first + n, 600.0));
        let ppm = |of: fn(&Followed) -> f64| {
            let mut v: Vec<f64> = followed.iter().map(|f| of(f) * 1e6).collect();
            v.sort_by(f64::total_cmp);
            format!("{:.1} median {:.1} at 95 % {:.1} most", quantile(&v, 0.5), quantile(&v, 0.95), v[v.len() - 1])
        };
        println!("{life:?}, {}, ppm: believed rms {}", w.count, ppm(|f| f.believed_rms));
        println!("  in force rms {}", ppm(|f| f.in_force_rms));
        println!("  in force at any time {}", ppm(|f| f.in_force_most));
        println!("  {} said that they follow", followed.iter().filter(|f| f.said).count());
    }
}
