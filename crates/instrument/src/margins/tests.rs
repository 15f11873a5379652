//! Margins of the four loops as they are sampled, delayed and limited, from the coefficients that the code has.
//!
//! Of each loop the variable x that it holds at nothing moves by ẋ = −g u with the loop's action u, in units of x per second; a
//! window shows its average; the action that comes of it is in force in the next window:
//!
//! $$L(z) = g\,\frac{T}{z-1}\cdot\frac{z+1}{2}\cdot z^{-1-d}\Big(c_0+\frac{c_1}{z-1}\Big).$$
//!
//! c₀ and c₁ are what the code answers to a pulse, d are windows of delay beyond those. Damping of the resonator, which
//! steadies each loop, is neglected.

extern crate std;

use core::f64::consts::{PI, TAU};
use std::boxed::Box;
use std::format;

use cvg_controller::PiState;
use cvg_estimator::LockState;
use cvg_model::Pendulum;

use crate::{Instrument, Settings};

const LOOPS: [&str; 4] = ["energy", "quadrature", "phase", "rate"];

/// The action, x/s, that the code of a loop answers to an average x of a window.
fn code(name: &str, s: &Settings<'_>) -> Box<dyn FnMut(f64) -> f64> {
    let i = Instrument::<f64>::new(s).expect("inside its domain");
    // at the set amplitude a, b V⁻¹ moves amplitude and quadrature
    let x = PI * s.carrier_hz / s.sample_hz;
    let (a, b) = (s.amplitude_v, s.drive_per_s_v * x.sin() / x);
    let (mut pi, mut lock) = (PiState::default(), LockState::default());
    let still = Pendulum { e: a * a, q: 0.0, r: a * a, s: 0.0, l: 0.0 };
    match name {
        "energy" => Box::new(move |x| b * i.energy.energy(&mut pi, (a + x).powi(2), i.energy_set_v2).volts),
        "quadrature" => Box::new(move |x| -b * i.quadrature.quadrature(&mut pi, 2.0 * a * x).volts),
        "phase" => Box::new(move |x| {
            let p = Pendulum { l: -a * a * (2.0 * x).sin(), ..still };
            i.phase.step(&mut lock, &p).rad_s
        }),
        _ => Box::new(move |x| {
            // held at nothing
            let (sin, cos) = (2.0 * x).sin_cos();
            let p = Pendulum { r: a * a * cos, s: a * a * sin, ..still };
            b / a * i.rate.step(&mut pi, &p, &i.hold).volts
        }),
    }
}

/// c₀ and c₁: what the code answers to a pulse, and to nothing ever after.
fn coefficients(name: &str, s: &Settings<'_>) -> (f64, f64) {
    let (pulse, mut act) = (1e-7, code(name, s));
    let first = act(pulse);
    let second = act(0.0);
    assert!((act(0.0) - second).abs() <= 1e-9 * second.abs(), "an integral that leaks");
    (first / pulse, second / pulse)
}

/// Gain and phase (rad, in (−2π, 0]) of the loop at the angular frequency `w` (rad/s).
fn response((c0, c1): (f64, f64), period_s: f64, delay_s: f64, w: f64) -> (f64, f64) {
    // on the circle z − 1 = 2i sin(wT/2) e^{iwT/2} and z + 1 = 2 cos(wT/2) e^{iwT/2}
    let half = 0.5 * w * period_s;
    let plant = period_s * half.cos() / (2.0 * half.sin());
    // c₀ + c₁ z⁻¹/(1 − z⁻¹) = c₀ − c₁/2 − i c₁/(2 tan(wT/2))
    let (re, im) = (c0 - 0.5 * c1, -0.5 * c1 / half.tan());
    let phase = -0.5 * PI - w * (period_s + delay_s) + im.atan2(re);
    (plant * re.hypot(im), phase)
}

/// Margins of a loop: gain as a factor, phase in degrees, delay in s.
#[derive(Clone, Copy, Debug)]
struct Margins {
    crossover_hz: f64,
    gain: f64,
    phase_deg: f64,
    delay_s: f64,
}

fn margins(c: (f64, f64), period_s: f64) -> Margins {
    // where `f` changes its sign, which it does once on each of the ranges below
    let root = |mut lo: f64, mut hi: f64, f: &dyn Fn(f64) -> bool| {
        for _ in 0..200 {
            let middle = (lo * hi).sqrt();
            if f(middle) { lo = middle } else { hi = middle }
        }
        lo
    };
    let nyquist = 0.999_999 * PI / period_s;
    let crossover = root(1e-3, nyquist, &|w| response(c, period_s, 0.0, w).0 > 1.0);
    let turned = root(crossover, nyquist, &|w| response(c, period_s, 0.0, w).1 > -PI);
    let phase = PI + response(c, period_s, 0.0, crossover).1;
    Margins {
        crossover_hz: crossover / TAU,
        gain: 1.0 / response(c, period_s, 0.0, turned).0,
        phase_deg: phase.to_degrees(),
        delay_s: phase / crossover,
    }
}

/// The largest |x| in the last tenth of `windows`, of the loop that the code closes with `gain` times the plant and `delay` windows
/// more, from `start` on.
fn simulated(name: &str, s: &Settings<'_>, gain: f64, delay: usize, start: f64, windows: usize) -> f64 {
    let (mut act, mut x, mut worst) = (code(name, s), start, 0.0_f64);
    let mut pending = std::collections::VecDeque::from(std::vec![0.0; 1 + delay]);
    for n in 0..windows {
        let action = pending.pop_front().expect("as many as windows of delay");
        let next = x - gain * s.window_s() * action;
        pending.push_back(act(0.5 * (x + next)));
        x = next;
        if n >= windows / 10 * 9 {
            worst = worst.max(x.abs());
        }
    }
    worst
}

fn settings() -> [Settings<'static>; 2] {
    // the defaults, and loops five times as fast
    let plain = Settings::default();
    let mut fast = plain;
    for tuning in [&mut fast.energy, &mut fast.quadrature, &mut fast.phase, &mut fast.rate] {
        tuning.bandwidth_hz *= 5.0;
    }
    [plain, fast]
}

#[test]
fn a_loop_swings_on_at_its_gain_margin_and_nowhere_below() {
    for s in settings() {
        for name in LOOPS {
            let m = margins(coefficients(name, &s), s.window_s());
            let after = |gain| simulated(name, &s, gain, 0, 1e-6, 40_000);
            assert!(after(0.97 * m.gain) < 1e-7, "{name} swings below its margin: {m:?}");
            assert!(after(1.03 * m.gain) > 1e-5, "{name} decays beyond its margin: {m:?}");
        }
    }
}

#[test]
fn a_loop_swings_on_at_its_delay_margin_and_nowhere_below() {
    for s in settings() {
        for name in LOOPS {
            let m = margins(coefficients(name, &s), s.window_s());
            // whole windows below the margin and above it, by a twentieth at least
            let windows = m.delay_s / s.window_s();
            let (below, above) = ((0.95 * windows).floor(), (1.05 * windows).ceil());
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some ten or hundred windows")]
            let after = |delay: f64| simulated(name, &s, 1.0, delay as usize, 1e-6, 400_000);
            assert!(after(below) < 1e-7, "{name} swings below its margin: {m:?}");
            assert!(after(above) > 1e-5, "{name} decays beyond its margin: {m:?}");
        }
    }
}

/// A limit acts on what swings as a smaller gain: a loop that is stable at every smaller gain has no swing to be caught in.
#[test]
fn a_limit_leaves_every_loop_stable() {
    for s in settings() {
        for name in LOOPS {
            let (c0, c1) = coefficients(name, &s);
            for n in 0..=400 {
                let share = 10.0_f64.powf(-0.01 * f64::from(n));
                let m = margins((share * c0, share * c1), s.window_s());
                assert!(m.phase_deg > 0.0 && m.gain > 1.0, "{name} at {share} of its gain: {m:?}");
            }
        }
    }
    // and starts from afar, at its limit for long
    let tight = Settings { dac_limit_v: 0.2, ..Settings::default() };
    for name in ["energy", "quadrature", "rate"] {
        let settled = simulated(name, &tight, 1.0, 0, 0.6, 400_000);
        assert!(settled < 1e-6, "{name} does not come back from its limit: {settled}");
    }
}

#[test]
fn the_page_for_a_certifier_has_the_margins_of_the_code() {
    let s = Settings::default();
    let rows = LOOPS.map(|name| {
        let m = margins(coefficients(name, &s), s.window_s());
        let (phase, delay) = (m.phase_deg, 1e3 * m.delay_s);
        format!("| {name} | {:.1} Hz | {:.0} | {phase:.0}° | {delay:.0} ms |", m.crossover_hz, m.gain)
    });
    // the book is not in the package of this crate
    let Ok(page) = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/certifier.md")) else {
        return;
    };
    assert!(rows.iter().all(|row| page.contains(row)), "the page has other rows than\n{}", rows.join("\n"));
}
