//! How a harmonic goes with what differs between runs: its size in every segment, and the exponents of rate and amplitude.

use nalgebra::{DMatrix, DVector, Matrix4, Vector2, Vector4};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::diagnostics::evaluate::Evaluation;
use crate::facts::Follows;
use crate::model::written::Law;
use crate::report::Exponent;

/// An exponent is taken for a whole number this close to it, beside its interval.
const WHOLE: f64 = 0.25;
/// Exponents of the amplitude that an expression is written for.
const LARGEST_EXPONENT: f64 = 6.0;
/// A harmonic this many deviations large has a logarithm.
const LARGE: f64 = 4.0;
/// Rates and amplitudes that spread by less than this, in ln, tell no exponent.
const LEAST_SPREAD: f64 = 0.1;

/// A harmonic in one segment.
pub(crate) struct Wave {
    precession: f64,
    amplitude: f64,
    wave: Vector2<f64>,
    /// of either component
    variance: f64,
}

/// A harmonic in every segment, apart from the line that each segment's angle is told from; a sample of what is then left
/// is worth 1/`cost` of one.
pub(crate) fn waves(e: &Evaluation, of: Follows, n: f64, cost: f64, amplitudes: &[f64]) -> Vec<Wave> {
    let (mut squares, mut samples) = (0.0, 0.0);
    let mut out = Vec::new();
    for ((s, kept), amplitude) in e.segments.iter().zip(&e.kept).zip(amplitudes) {
        let end = s.turned.last().map_or(1.0, |t| t.abs().max(f64::MIN_POSITIVE));
        let wanted: Vec<usize> = (0..s.angle.len()).filter(|&i| kept[i]).collect();
        let row = |i: usize| {
            let (sin, cos) = (n * s.base(of)[i]).sin_cos();
            Vector4::new(cos, sin, 1.0, s.turned[i] / end)
        };
        let (mut normal, mut right, mut precession) = (Matrix4::zeros(), Vector4::zeros(), 0.0);
        for &i in &wanted {
            normal += row(i) * row(i).transpose();
            right += row(i) * s.angle[i];
            precession += s.precession[i];
        }
        let Some(inverse) = normal.try_inverse() else { continue };
        let solution = inverse * right;
        squares += wanted.iter().map(|&i| (s.angle[i] - row(i).dot(&solution)).powi(2)).sum::<f64>();
        samples += wanted.len() as f64;
        out.push(Wave {
            precession: precession / wanted.len() as f64,
            amplitude: *amplitude,
            wave: Vector2::new(solution[0], solution[1]),
            variance: 0.5 * (inverse[(0, 0)] + inverse[(1, 1)]),
        });
    }
    for wave in &mut out {
        wave.variance *= cost * squares / samples;
    }
    out
}

/// How a harmonic goes with what differs between runs.
#[derive(Default)]
pub(crate) struct Scaling {
    pub(crate) rate: Option<Exponent>,
    pub(crate) amplitude: Option<Exponent>,
    pub(crate) turns_with_direction: Option<bool>,
}

impl Scaling {
    /// Weighted least squares of ln|wave|. `directions` lets it differ between them. What the runs contradict of the law
    /// widens the intervals.
    pub(crate) fn of(waves: &[Wave], directions: bool) -> Self {
        let large = |w: &&Wave| w.precession != 0.0 && w.wave.norm_squared() > LARGE * LARGE * w.variance;
        let waves: Vec<&Wave> = waves.iter().filter(large).collect();
        let row = |w: &Wave| [1.0, w.precession.abs().ln(), w.amplitude.ln(), w.precession.signum()];
        let spread = |column: usize| {
            let values = waves.iter().map(|w| row(w)[column]);
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min) > LEAST_SPREAD
        };
        let columns: Vec<usize> = (0..4).filter(|&c| c == 0 || (spread(c) && (c < 3 || directions))).collect();
        let k = columns.len();
        let design = |w: &Wave| DVector::from_iterator(k, columns.iter().map(|&c| row(w)[c]));
        let (mut normal, mut right) = (DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k));
        for w in &waves {
            let weight = w.wave.norm_squared() / w.variance;
            let x = design(w);
            normal.ger(weight, &x, &x, 1.0);
            right.axpy(weight * w.wave.norm().ln(), &x, 1.0);
        }
        let sum = |forward: bool| -> Vector2<f64> {
            waves.iter().filter(|w| (w.precession > 0.0) == forward).map(|w| w.wave / w.variance).sum()
        };
        let (forward, backward) = (sum(true), sum(false));
        let both = forward.norm() > 0.0 && backward.norm() > 0.0;
        let turns_with_direction = both.then(|| forward.dot(&backward) < 0.0);
        let Some(inverse) = normal.try_inverse() else { return Self { turns_with_direction, ..Self::default() } };
        let solution = &inverse * right;
        let squares = waves
            .iter()
            .map(|w| (w.wave.norm().ln() - design(w).dot(&solution)).powi(2) * w.wave.norm_squared() / w.variance);
        let free = waves.len().saturating_sub(k) as f64;
        let excess = if free > 0.0 { squares.sum::<f64>() / free } else { 1.0 };
        let wide = StudentsT::new(0.0, 1.0, free).ok().filter(|_| excess > 1.0);
        let factor = wide.map_or(1.96, |t| t.inverse_cdf(0.975) * excess.sqrt());
        let exponent = |column: usize| {
            let at = columns.iter().position(|&c| c == column)?;
            Some(Exponent { value: solution[at], ci95: factor * inverse[(at, at)].max(0.0).sqrt() })
        };
        Self { rate: exponent(1), amplitude: exponent(2), turns_with_direction }
    }

    pub(crate) fn told(&self, law: Law) -> Law {
        Law {
            rate: self.rate.map(interval),
            amplitude: self.amplitude.map(interval),
            turns_with_direction: self.turns_with_direction,
            ..law
        }
    }
}

/// The whole number that an exponent is, as far as its interval tells.
#[allow(clippy::cast_possible_truncation, reason = "a small number")]
pub(crate) fn whole(e: Exponent) -> Option<i32> {
    let near = e.value.round();
    let told = e.ci95 < 0.5 && (e.value - near).abs() < WHOLE + e.ci95 && near.abs() <= LARGEST_EXPONENT;
    told.then_some(near as i32)
}

fn interval(e: Exponent) -> [f64; 2] {
    [e.value - e.ci95, e.value + e.ci95]
}
