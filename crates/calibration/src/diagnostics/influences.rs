//! What the angle error of a gyroscope may follow: the columns that [`decompose`] shares it among.

use std::f64::consts::PI;

use crate::diagnostics::decomposition::{Influence, decompose};
use crate::diagnostics::evaluate::Evaluation;
use crate::facts::Share;

/// Harmonics of the pattern angle and of the table's, and those of the pattern that may go with rate, direction and
/// amplitude: readout and drive make the second and the fourth.
const PATTERN_HARMONICS: [u32; 6] = [1, 2, 3, 4, 6, 8];
const TABLE_HARMONICS: [u32; 4] = [1, 2, 3, 4];
const SCALED_HARMONICS: [u32; 2] = [2, 4];
/// Waves of the time within each run; none as fast as a turn of the pattern, because what is n per turn is position.
const TIME_WAVES: u32 = 4;
/// Rows beyond which every so many are looked at.
const ENOUGH_ROWS: usize = 6000;
/// Speeds and amplitudes that differ by less than this share are one.
const SAME: f64 = 0.05;

/// One sample of an error, with all that it may follow.
struct Sample {
    /// error, rad
    error: f64,
    /// pattern angle and table angle, rad
    pattern: f64,
    table: f64,
    /// time within the run, 0 to 1
    within: f64,
    /// nominal precession, rad/s
    precession: f64,
    /// amplitude of the run over the largest
    amplitude: f64,
}

/// Shares of the variance of a gyroscope's angle error; `amplitudes` are those of the tracks, V.
pub(crate) fn shares(evaluation: &Evaluation, amplitudes: &[f64]) -> Vec<Share> {
    let samples = samples(evaluation, amplitudes);
    let error: Vec<f64> = samples.iter().map(|s| s.error).collect();
    decompose(&error, &influences(&samples))
}

fn samples(evaluation: &Evaluation, amplitudes: &[f64]) -> Vec<Sample> {
    let rows: usize = evaluation.segments.iter().map(|s| s.angle.len()).sum();
    let stride = (rows / ENOUGH_ROWS).max(1);
    let largest = amplitudes.iter().fold(f64::MIN_POSITIVE, |m, a| m.max(*a));
    let mut out = Vec::new();
    for (s, kept) in evaluation.segments.iter().zip(&evaluation.kept) {
        let [Some(first), Some(last)] = [s.t_s.first(), s.t_s.last()] else { continue };
        let rows = (0..s.angle.len()).filter(|&i| kept[i]).step_by(stride);
        out.extend(rows.map(|i| Sample {
            error: s.angle[i],
            pattern: s.direction[i],
            table: s.table[i],
            within: (s.t_s[i] - first) / (last - first).max(f64::MIN_POSITIVE),
            precession: s.precession[i],
            amplitude: amplitudes[s.track] / largest,
        }));
    }
    out
}

fn influences(samples: &[Sample]) -> Vec<Influence> {
    let column = |f: &dyn Fn(&Sample) -> f64| samples.iter().map(f).collect::<Vec<f64>>();
    // harmonics of an angle, each sample's by its own factor
    let harmonics = |orders: &[u32], angle: fn(&Sample) -> f64, factor: &dyn Fn(&Sample) -> f64| -> Vec<Vec<f64>> {
        let of = |k: u32, wave: fn(f64) -> f64| column(&|s| factor(s) * wave(f64::from(k) * angle(s)));
        orders.iter().flat_map(|&k| [of(k, f64::cos), of(k, f64::sin)]).collect()
    };
    let pattern = |s: &Sample| s.pattern;
    let range = |f: fn(&Sample) -> f64| {
        samples.iter().map(f).fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), v| (low.min(v), high.max(v)))
    };
    let mut all = vec![
        Influence { of: "pattern", columns: harmonics(&PATTERN_HARMONICS, pattern, &|_| 1.0) },
        Influence { of: "table", columns: harmonics(&TABLE_HARMONICS, |s| s.table, &|_| 1.0) },
        Influence {
            of: "time",
            columns: (1..=TIME_WAVES).map(|k| column(&|s| (PI * f64::from(k) * s.within).cos())).collect(),
        },
    ];
    let (slowest, fastest) = range(|s| s.precession.abs());
    if fastest > (1.0 + SAME) * slowest && slowest > 0.0 {
        // a drift moves the angle by the inverse of the rate; beside what does not change, that makes any course with it
        let drift = |s: &Sample| slowest / s.precession.abs();
        all.push(Influence { of: "rate", columns: harmonics(&SCALED_HARMONICS, pattern, &drift) });
    }
    if samples.iter().any(|s| s.precession > 0.0) && samples.iter().any(|s| s.precession < 0.0) {
        let factor = |s: &Sample| s.precession.signum();
        all.push(Influence { of: "direction", columns: harmonics(&SCALED_HARMONICS, pattern, &factor) });
    }
    let (weakest, strongest) = range(|s| s.amplitude);
    if strongest > (1.0 + SAME) * weakest {
        let factor = |s: &Sample| s.amplitude * s.amplitude;
        all.push(Influence { of: "amplitude", columns: harmonics(&SCALED_HARMONICS, pattern, &factor) });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::residuals::Residual;

    /// An error by pattern angle, precession and time.
    type Error<'a> = &'a dyn Fn(f64, f64, f64) -> f64;

    /// Runs of 60 s at these precession rates, each with an error by pattern angle, precession and time.
    fn evaluation(rates: &[f64], error: impl Fn(f64, f64, f64) -> f64) -> Evaluation {
        let noise = |i: usize| 2e-6 * ((i * 7919 % 1009) as f64 / 1009.0 - 0.5);
        let segments = rates.iter().enumerate().map(|(track, &precession)| {
            let t_s: Vec<f64> = (0..3000).map(|i| 0.02 * f64::from(i)).collect();
            let direction: Vec<f64> = t_s.iter().map(|t| precession * t).collect();
            let angle = (0..t_s.len()).map(|i| error(direction[i], precession, t_s[i]) + noise(i)).collect();
            Residual {
                track,
                samples: t_s.len(),
                table: direction.iter().map(|d| -d / 0.8).collect(),
                turned: direction.iter().map(|d| -d / 0.8).collect(),
                precession: vec![precession; t_s.len()],
                amplitude: vec![0.0; t_s.len()],
                t_s,
                direction,
                angle,
            }
        });
        Evaluation::of(segments.collect())
    }

    fn largest(shares: &[Share]) -> (&str, f64) {
        let all = shares.iter().map(|s| (s.of.as_str(), s.share));
        all.fold(("", 0.0), |most, s| if s.1 > most.1 { s } else { most })
    }

    #[test]
    fn an_error_is_given_to_what_it_follows() {
        let rates = [6.8, -6.8, 0.8, -0.8];
        let cases: [(&str, Error<'_>); 5] = [
            ("pattern", &|theta, _, _| 1e-4 * (4.0 * theta).sin()),
            ("table", &|theta, _, _| 1e-4 * (3.0 * theta / 0.8).sin()),
            ("time", &|_, _, t| 1e-4 * (std::f64::consts::TAU * t / 60.0).cos()),
            ("rate", &|theta, rate, _| 1e-4 / rate.abs() * (4.0 * theta).cos()),
            ("direction", &|theta, rate, _| 1e-4 * rate.signum() * (2.0 * theta).cos()),
        ];
        for (of, error) in cases {
            let shares = shares(&evaluation(&rates, error), &[1.0; 4]);
            let (most, share) = largest(&shares);
            assert!(most == of && share > 0.7, "{of}: {shares:?}");
        }
    }

    #[test]
    fn noise_follows_nothing() {
        let shares = shares(&evaluation(&[6.8, -6.8], |_, _, _| 0.0), &[1.0; 2]);
        let (most, share) = largest(&shares);
        assert!(most == "rest" && share > 0.95, "{shares:?}");
    }
}
