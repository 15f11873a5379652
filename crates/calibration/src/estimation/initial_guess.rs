//! Where a fit starts: the motion of each run.
//!
//! From here on residuals are small against the period, so no angle is ever unwrapped against its neighbour again.

use rayon::prelude::*;

use crate::data::agreement::Gain;
use crate::data::track::{Segment, Track};
use crate::error::Refusal;
use crate::estimation::propagation::Start;
use crate::estimation::swing::{Swing, pull, swing_of};
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{circular_mean, line, median, robust_deviation};
use crate::recording::Role;

/// Samples, or steps between neighbours, that a first estimate needs no more of.
const ENOUGH: usize = 20_000;

/// A fit finds what pulls the pattern by itself where the end of a run is off by less without it, rad: engineering choice, a twentieth of
/// the pattern's period.
const LARGEST_BEHIND: f64 = 0.16;

/// The motion of a track under a hypothesis: its angular gain, and where its segments start.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    pub(crate) angular_gain: f64,
    pub(crate) starts: Vec<Start>,
    /// robust deviation of the angle from the line, rad
    pub(crate) deviation: f64,
    /// pattern angle covered, rad
    pub(crate) travel: f64,
    /// how the angle swings about the line
    pub(crate) swing: Swing,
    /// what the halves of the segments tell of the angular gain, where they are long enough to tell
    pub(crate) halves: Vec<Gain>,
}

/// What is known of an angular gain before the motion is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Guess {
    /// nothing, or what the campaign states: what leaves least is kept
    Open(Option<f64>),
    /// it is this one, whatever its aliases leave
    Settled(f64),
}

/// Bearing of sample `i` of a track under a hypothesis, rad.
pub(crate) fn bearing(track: &Track, hypothesis: &Hypothesis, i: usize) -> f64 {
    hypothesis.bearing(&hypothesis.unread(track.envelope(i), &track.moment(i, 0.0)))
}

/// Bearings of a track under a hypothesis, rad, per segment, every `stride` samples.
pub(crate) fn bearings(track: &Track, hypothesis: &Hypothesis, stride: usize) -> Vec<Vec<f64>> {
    let of =
        |s: &Segment| s.range.clone().into_par_iter().step_by(stride).map(|i| bearing(track, hypothesis, i)).collect();
    track.segments.iter().map(of).collect()
}

/// Finds the motion of a track: tries the given angular gain and what neighbouring samples say, and keeps what leaves least.
pub(crate) fn motion(track: &Track, hypothesis: &Hypothesis, guess: Guess) -> Result<Motion, Refusal> {
    let bearings = bearings(track, hypothesis, track.stride);
    let guesses: Vec<f64> = match guess {
        Guess::Settled(k) => vec![k],
        Guess::Open(given) => given.into_iter().chain(neighbours(track, hypothesis, &bearings)).collect(),
    };
    let motion = guesses
        .into_iter()
        .filter(|g| g.is_finite() && *g != 0.0)
        .map(|g| follow(track, hypothesis, &bearings, g))
        .filter(|m| m.angular_gain.is_finite() && m.deviation.is_finite())
        .min_by(|a, b| a.deviation.total_cmp(&b.deviation))
        .ok_or_else(|| {
            Refusal::new(
                &track.name,
                "the angle does not follow the input at all",
                "angular_gain in the campaign, or finer sampling",
            )
        })?;
    Ok(motion)
}

/// Median ln of the amplitude over a segment.
fn mean_ln_amplitude(track: &Track, segment: &Segment, hypothesis: &Hypothesis) -> f64 {
    let stride = (segment.range.len() / 1000).max(1);
    let mut values: Vec<f64> = segment
        .range
        .clone()
        .step_by(stride)
        .map(|i| 0.5 * hypothesis.unread(track.envelope(i), &track.moment(i, 0.0)).pendulum().e.ln())
        .collect();
    median(&mut values)
}

/// Angular gain from steps between neighbouring samples.
fn neighbours(track: &Track, hypothesis: &Hypothesis, bearings: &[Vec<f64>]) -> Option<f64> {
    let mut steps = Vec::new();
    for (segment, bearing) in track.segments.iter().zip(bearings) {
        for (n, w) in bearing.windows(2).enumerate().take(ENOUGH) {
            let i = segment.range.start + n * track.stride;
            let input = track.input_rad[i + track.stride] - track.input_rad[i];
            if input.abs() > 1e-6 {
                steps.push(wrapped(w[1] - w[0], hypothesis.period_rad) / input);
            }
        }
    }
    (steps.len() >= 8).then(|| hypothesis.sense() * median(&mut steps))
}

/// Follows the angle along a guessed gain: each sample is taken nearest to the median of the last few.
fn follow(track: &Track, hypothesis: &Hypothesis, bearings: &[Vec<f64>], guess: f64) -> Motion {
    const MEMORY: usize = 5;
    let sense = hypothesis.sense();
    let mut gains = Vec::new();
    let mut halves = Vec::new();
    let mut followed: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    for (segment, bearing) in track.segments.iter().zip(bearings) {
        let zero = track.input_rad[segment.range.start];
        let turned: Vec<f64> = segment.range.clone().step_by(track.stride).map(|i| track.input_rad[i] - zero).collect();
        let mut recent = [0.0; MEMORY];
        let mut rest: Vec<f64> = Vec::with_capacity(turned.len());
        for (n, (b, a)) in bearing.iter().zip(&turned).enumerate() {
            let raw = b - sense * guess * a;
            let near = if n == 0 {
                raw
            } else {
                let mut few = recent;
                median(&mut few[..n.min(MEMORY)])
            };
            let value = near + wrapped(raw - near, hypothesis.period_rad);
            recent[n % MEMORY] = value;
            rest.push(value);
        }
        let (slope, ..) = robust_line(&turned, &rest);
        halves.extend(gains_of_halves(&turned, &rest, guess, (hypothesis, track.speed_and_drift())));
        let weight: f64 = turned.iter().map(|a| a * a).sum();
        gains.push((guess + sense * slope, weight));
        followed.push((turned, rest));
    }
    let weight: f64 = gains.iter().map(|g| g.1).sum();
    let gain = gains.iter().map(|g| g.0 * g.1).sum::<f64>() / weight.max(f64::MIN_POSITIVE);
    let mut off = Vec::new();
    let mut steady = Vec::new();
    let starts = followed
        .iter()
        .map(|(turned, rest)| {
            let after: Vec<f64> = turned.iter().zip(rest).map(|(a, r)| r - sense * (gain - guess) * a).collect();
            let angle = circular_mean(after.iter().copied(), hypothesis.period_rad);
            off.extend(after.iter().map(|r| wrapped(r - angle, hypothesis.period_rad)));
            steady.extend(turned.iter().map(|a| angle + sense * gain * a));
            Start { angle, ..Start::default() }
        })
        .zip(&track.segments)
        .map(|(start, segment)| Start { amplitude: mean_ln_amplitude(track, segment, hypothesis), ..start })
        .collect();
    let (lo, hi) = track
        .segments
        .iter()
        .flat_map(|s| s.range.clone())
        .map(|i| gain * track.input_rad[i])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let every = (off.len() / ENOUGH).max(1);
    let swing = Swing::of(steady.into_iter().zip(off.iter().copied()).step_by(every));
    Motion { angular_gain: gain, starts, deviation: robust_deviation(off.into_iter()), travel: hi - lo, swing, halves }
}

/// What pulls the pattern, where it slows a run by so much that the run's end would be lost without it.
pub(crate) fn pulled(moving: &[(Track, Motion)], sense: f64) -> Option<[f64; 2]> {
    let one_way = moving.iter().filter_map(|(t, m)| Some((sense * m.angular_gain * t.one_way_rate()?, m)));
    let pulls = pull(&one_way.clone().map(|(precession, m)| (precession, m.swing)).collect::<Vec<_>>())?;
    let mut behind = one_way.map(|(precession, m)| swing_of(pulls, precession).slowing() * m.travel);
    behind.any(|by| by > LARGEST_BEHIND).then_some(pulls)
}

/// The angular gain of all runs, the farther they turn the more they count, with what pulls the pattern.
pub(crate) fn common_gain(moving: &[(Track, Motion)], pulls: Option<[f64; 2]>, sense: f64) -> f64 {
    let (sum, weight) = moving.iter().fold((0.0, 0.0), |(sum, all), (track, m)| {
        let slowing = |p| swing_of(p, sense * m.angular_gain * track.mean_rate()).slowing();
        let weight = m.travel.powi(2) * track.samples(Role::Fit) as f64;
        (sum + weight * m.angular_gain * (1.0 + pulls.map_or(0.0, slowing)), all + weight)
    });
    sum / weight
}

/// A line, fitted once more without its outliers: slope, intercept, and what is left, robustly.
fn robust_line(x: &[f64], y: &[f64]) -> (f64, f64, f64) {
    let (mut slope, mut intercept) = line(x, y);
    let mut left = 0.0;
    for _ in 0..3 {
        let off = |(a, r): (&f64, &f64)| r - slope * a - intercept;
        left = robust_deviation(x.iter().zip(y).map(off));
        let limit = 4.0 * left + 1e-9;
        let (x, y): (Vec<f64>, Vec<f64>) =
            x.iter().zip(y).filter(|p| off(*p).abs() < limit).map(|(a, r)| (*a, *r)).unzip();
        (slope, intercept) = line(&x, &y);
    }
    (slope, intercept, left)
}

/// What either half of a segment tells of the angular gain, where it covers a turn of the pattern.
fn gains_of_halves(
    turned: &[f64],
    rest: &[f64],
    guess: f64,
    (hypothesis, motion): (&Hypothesis, [f64; 2]),
) -> Vec<Gain> {
    let period = hypothesis.period_rad;
    let middle = turned.len() / 2;
    [0..middle, middle..turned.len()]
        .into_iter()
        .filter_map(|part| {
            let (x, y) = (&turned[part.clone()], &rest[part]);
            let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let (slope, intercept, left) = robust_line(x, y);
            let gain = guess + hypothesis.sense() * slope;
            let every = (x.len() / ENOUGH).max(1);
            let off = || {
                let some = x.iter().zip(y).step_by(every);
                some.map(|(a, r)| (hypothesis.sense() * gain * a, r - intercept - slope * a))
            };
            let told = || Gain::new(gain, left, period, high - low, motion).slowed_by(Swing::of(off()).slowing());
            (gain.abs() * (high - low) > 2.0 * period).then(told)
        })
        .collect()
}
