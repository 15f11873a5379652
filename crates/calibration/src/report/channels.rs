//! What is left in every channel under a hypothesis: not of the angle alone, but of the amplitude, of the quadrature
//! and of both commands, so that a reader sees in which of them a cause shows, and how it scales.
//!
//! | channel | what is left | unit |
//! | --- | --- | --- |
//! | angle | θ less Equation 1 and the mechanics | deg |
//! | amplitude | ln a less the energy balance | 1 |
//! | vas | growth that the energy command makes against the damping, ȧ/a | 1/s |
//! | vqc | growth of the quadrature that its command makes against anisoelasticity, q̇/a | 1/s |
//! | quadrature | q/a | 1 |
//!
//! All behind the readout that the hypothesis undoes, over the fitted runs, less the best line of each segment.

use cvg_model::effects::EffectId;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::{
    Along, WHITENESS_LAGS, WHITENESS_LEVEL, autocorrelation, drift_power, harmonics, inflation, ljung_box,
    resolved_harmonics, strongest_line, white_band,
};
use crate::estimation::amplitude_equation::energy_balance;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::propagation::{Row, Stepping, propagate};
use crate::estimation::residuals::Residual;
use crate::facts::{Follows, Harmonic};
use crate::model::hypothesis::Hypothesis;
use crate::model::unknowns::Unknowns;
use crate::recording::{Instrument, Role};
use crate::report::{ChannelHarmonic, ChannelLine, ChannelReport, Exponent, HarmonicScaling};

/// Harmonics of the pattern and of the table that are looked at.
const HARMONICS: u32 = 8;
/// A harmonic this many half intervals large is told in how it scales.
const SCALING_TOLD: f64 = 2.0;
/// Rates and amplitudes that spread by less than this, in ln, tell no exponent.
const LEAST_SPREAD: f64 = 0.1;
/// Noise is at least this share of the mean square of a channel.
const LEAST_NOISE_SHARE: f64 = 1e-3;
/// exp(−power/2) times the number of lines looked at, from which a line is no accident.
const ACCIDENT: f64 = 1e-3;

/// What a channel is called and counted in, and one sample of it.
struct Channel {
    name: &'static str,
    unit: &'static str,
    of: fn(&Sample<'_>) -> f64,
}

/// What a sample says under the hypothesis that closes the energy balance best.
struct Sample<'a> {
    row: &'a Row<'a>,
    closed: &'a Hypothesis,
    v_qc: f64,
}

fn amplitude(sample: &Sample<'_>) -> f64 {
    sample.row.amplitude
}

fn quadrature(sample: &Sample<'_>) -> f64 {
    let pendulum = sample.row.vibration.pendulum();
    0.5 * pendulum.q / pendulum.e
}

fn v_as(sample: &Sample<'_>) -> f64 {
    sample.row.growth
}

/// q̇/a = G v_qc/a + ½(Δω sin 2θ_ω cos 2θ − Δω cos 2θ_ω sin 2θ).
fn v_qc(sample: &Sample<'_>) -> f64 {
    let pendulum = sample.row.vibration.pendulum();
    let line = pendulum.r.hypot(pendulum.s);
    let (sin, cos) = (pendulum.s / line, pendulum.r / line);
    let split = sample.closed.member(EffectId::Anisoelasticity).map_or([0.0; 2], |m| [m.values[0], m.values[1]]);
    sample.closed.force_scale * sample.v_qc / pendulum.e.sqrt() + 0.5 * (split[1] * cos - split[0] * sin)
}

/// The analysis of every channel that was recorded, angle first.
pub(crate) fn channels(dataset: &Dataset, fit: &Fit, stage: &str, angle: &Evaluation) -> Vec<ChannelReport> {
    let closed = energy_balance(&dataset.tracks, &fit.hypothesis, &fit.starts)
        .map_or_else(|| fit.hypothesis.clone(), |balance| balance.closed);
    let all = |f: fn(&crate::data::track::Track) -> bool| dataset.tracks.iter().all(|p| f(&p.track));
    let gyroscope = dataset.instrument == Instrument::Gyroscope;
    let commands = gyroscope && all(crate::data::track::Track::has_commands) && closed.force_scale != 0.0;
    let recorded = [
        (all(crate::data::track::Track::has_amplitude), Channel { name: "amplitude", unit: "1", of: amplitude }),
        (commands, Channel { name: "vas", unit: "1/s", of: v_as }),
        (commands, Channel { name: "vqc", unit: "1/s", of: v_qc }),
        (
            gyroscope && all(crate::data::track::Track::has_quadrature),
            Channel { name: "quadrature", unit: "1", of: quadrature },
        ),
    ];
    let recorded: Vec<Channel> = recorded.into_iter().filter_map(|(there, channel)| there.then_some(channel)).collect();
    let (others, amplitudes) = left(dataset, fit, &closed, &recorded);
    let all: Vec<_> = std::iter::once(("angle", "deg", angle))
        .chain(recorded.iter().zip(&others).map(|(channel, evaluation)| (channel.name, channel.unit, evaluation)))
        .collect();
    all.into_par_iter().map(|(name, unit, evaluation)| analysis(stage, name, unit, evaluation, &amplitudes)).collect()
}

/// The mean amplitude of each fitted segment.
pub(crate) fn amplitudes(dataset: &Dataset, fit: &Fit) -> Vec<f64> {
    left(dataset, fit, &fit.hypothesis, &[]).1
}

/// What is left of each channel in the fitted segments, and the mean amplitude of each segment.
fn left(dataset: &Dataset, fit: &Fit, closed: &Hypothesis, channels: &[Channel]) -> (Vec<Evaluation>, Vec<f64>) {
    let none = Unknowns::new(closed, Vec::new());
    let mut segments: Vec<Vec<Residual>> = vec![Vec::new(); channels.len()];
    let mut amplitudes = Vec::new();
    for (number, (p, starts)) in dataset.tracks.iter().zip(&fit.starts).enumerate() {
        for (segment, start) in p.track.segments.iter().zip(starts).filter(|(s, _)| s.role == Role::Fit) {
            let mut base = Residual::new(number, segment);
            let mut values: Vec<Vec<f64>> = vec![Vec::new(); channels.len()];
            let mut ln_amplitude = 0.0;
            let stepping = Stepping::without(p.limit.angle);
            propagate(&p.track, segment, closed, &none, *start, stepping, |row| {
                base.push(&p.track, row);
                ln_amplitude += row.ln_amplitude;
                let v_qc = p.track.commands(row.index, 1).map_or(0.0, |c| c.now.v_qc);
                let sample = Sample { row, closed, v_qc };
                for (channel, values) in channels.iter().zip(&mut values) {
                    values.push((channel.of)(&sample));
                }
            });
            amplitudes.push((ln_amplitude / base.angle.len().max(1) as f64).exp());
            for (segments, values) in segments.iter_mut().zip(values) {
                segments.push(Residual { angle: values, ..base.clone() });
            }
        }
    }
    (segments.into_iter().map(Evaluation::of).collect(), amplitudes)
}

fn analysis(stage: &str, channel: &str, unit: &str, e: &Evaluation, amplitudes: &[f64]) -> ChannelReport {
    let count = e.errors().count();
    let correlation = autocorrelation(e, WHITENESS_LAGS);
    let inflated = inflation(&correlation, count);
    // the residual's own unit, of what is stated in degrees
    let own = |degrees: f64| if unit == "deg" { degrees } else { degrees.to_radians() };
    let mean_square = e.mean_square();
    let rms = |power: f64| own((power / count.max(1) as f64).sqrt().to_degrees());
    let waves: Vec<Harmonic> = [Follows::Pattern, Follows::Table]
        .into_iter()
        .flat_map(|of| harmonics(e, of, resolved_harmonics(e, of, HARMONICS), inflated))
        .collect();
    let large = |h: &Harmonic| h.amplitude_deg > SCALING_TOLD * h.ci95_deg;
    // of what is left, that which is none of the pattern's harmonics
    let of_pattern = waves.iter().filter(|h| h.of == Follows::Pattern && large(h));
    let periodic = of_pattern.map(|h| 0.5 * h.amplitude_deg.to_radians().powi(2)).sum::<f64>();
    let noise = (mean_square - periodic).max(LEAST_NOISE_SHARE * mean_square) * inflated;
    let found = waves
        .iter()
        .map(|h| ChannelHarmonic {
            of: h.of,
            n: h.n,
            amplitude: own(h.amplitude_deg),
            ci95: own(h.ci95_deg),
            phase_deg: h.phase_deg,
            scaling: large(h).then(|| scaling(e, h.of, h.n, noise, amplitudes)).flatten(),
        })
        .collect();
    // power beyond which the strongest of so many lines is no accident
    let told = |looked_at: f64| 2.0 * mean_square * inflated * (looked_at / ACCIDENT).ln();
    let line = strongest_line(e, Along::Time, told(count as f64))
        .filter(|(frequency, _)| !of_a_harmonic(e, *frequency))
        .map(|(frequency_hz, power)| ChannelLine { frequency_hz, rms: rms(power) });
    let drift = drift_power(e);
    ChannelReport {
        stage: stage.into(),
        channel: channel.into(),
        unit: unit.into(),
        rms: own(mean_square.sqrt().to_degrees()),
        white: ljung_box(&correlation, count) >= WHITENESS_LEVEL,
        band99: white_band(count),
        autocorrelation: correlation,
        harmonics: found,
        line,
        drift_rms: (drift > told(1.0)).then(|| rms(drift)),
    }
}

/// A frequency that a harmonic of the pattern or of the table has in some segment.
fn of_a_harmonic(e: &Evaluation, frequency_hz: f64) -> bool {
    e.segments.iter().any(|s| {
        let time = s.t_s.last().zip(s.t_s.first()).map_or(0.0, |(b, a)| b - a);
        if time <= 0.0 {
            return false;
        }
        let turns = |angle: &[f64]| {
            let steps = angle.windows(2).map(|w| crate::numerics::angles::wrapped(w[1] - w[0], std::f64::consts::TAU));
            (steps.sum::<f64>() / std::f64::consts::TAU / time).abs()
        };
        [turns(&s.direction), turns(&s.table)].into_iter().filter(|f| *f > 0.0).any(|f| {
            let n = (frequency_hz / f).round();
            n >= 1.0 && n <= f64::from(HARMONICS) && (frequency_hz - n * f).abs() < 1.0 / time
        })
    })
}

/// How the amplitude of a harmonic goes with rate, amplitude and direction from segment to segment.
fn scaling(e: &Evaluation, of: Follows, n: u32, mean_square: f64, amplitudes: &[f64]) -> Option<HarmonicScaling> {
    let (mut forward, mut backward) = (Vector2::zeros(), Vector2::zeros());
    let mut rows = Vec::new();
    for ((s, kept), amplitude) in e.segments.iter().zip(&e.kept).zip(amplitudes) {
        let (mut normal, mut right, mut rate, mut count) = (Matrix2::zeros(), Vector2::zeros(), 0.0, 0.0);
        for i in (0..s.angle.len()).filter(|&i| kept[i]) {
            let (sin, cos) = (f64::from(n) * s.base(of)[i]).sin_cos();
            let row = Vector2::new(cos, sin);
            normal += row * row.transpose();
            right += row * s.angle[i];
            rate += s.precession[i];
            count += 1.0;
        }
        let Some(wave) = normal.try_inverse().map(|inverse| inverse * right) else { continue };
        let weight = 0.5 * count * wave.norm_squared() / mean_square.max(f64::MIN_POSITIVE);
        *(if rate < 0.0 { &mut backward } else { &mut forward }) += wave * weight;
        if rate != 0.0 && wave.norm() > 0.0 {
            rows.push(([1.0, (rate / count).abs().ln(), amplitude.ln()], wave.norm().ln(), weight));
        }
    }
    let spread = |column: usize| {
        let ends = rows
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(r.0[column]), high.max(r.0[column])));
        ends.1 - ends.0 > LEAST_SPREAD
    };
    let columns: Vec<usize> = (0..3).filter(|&c| c == 0 || spread(c)).collect();
    let k = columns.len();
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k));
    for (row, value, weight) in &rows {
        let x = DVector::from_iterator(k, columns.iter().map(|&c| row[c]));
        normal.syger(*weight, &x, &x, 1.0);
        right.axpy(weight * value, &x, 1.0);
    }
    normal.fill_upper_triangle_with_lower_triangle();
    let inverse = normal.try_inverse()?;
    let solution = &inverse * right;
    let exponent = |column: usize| {
        let at = columns.iter().position(|&c| c == column)?;
        Some(Exponent { value: solution[at], ci95: 1.96 * inverse[(at, at)].max(0.0).sqrt() })
    };
    let both = forward.norm() > 0.0 && backward.norm() > 0.0;
    Some(HarmonicScaling {
        rate: exponent(1),
        amplitude: exponent(2),
        turns_with_direction: both.then(|| forward.dot(&backward) < 0.0),
    })
}
