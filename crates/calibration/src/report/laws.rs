//! How a harmonic goes with what differs between runs: its size in every segment, the exponents of rate and amplitude, and its change with
//! the temperature.

use nalgebra::{DMatrix, DVector, Matrix4, Vector2, Vector4};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::temperature::LEAST_SPAN_K;
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

/// In what a segment was recorded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Conditions {
    /// mean amplitude, V
    pub(crate) amplitude: f64,
    /// mean temperature over the one that parameters refer to, K; 0 where none was recorded
    pub(crate) warmer_k: f64,
}

/// A harmonic in one segment.
pub(crate) struct Wave {
    precession: f64,
    conditions: Conditions,
    wave: Vector2<f64>,
    /// of either component
    variance: f64,
}

/// A harmonic in every segment, apart from the line that each segment's angle is told from; a sample of what is then left
/// is worth 1/`cost` of one.
pub(crate) fn waves(e: &Evaluation, of: Follows, n: f64, cost: f64, conditions: &[Conditions]) -> Vec<Wave> {
    let (mut squares, mut samples) = (0.0, 0.0);
    let mut out = Vec::new();
    for ((s, kept), conditions) in e.segments.iter().zip(&e.kept).zip(conditions) {
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
            conditions: *conditions,
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
    /// relative change per kelvin, 1/K
    pub(crate) temperature: Option<Exponent>,
    pub(crate) turns_with_direction: Option<bool>,
}

impl Scaling {
    /// Weighted least squares of ln|wave|. `directions` lets it differ between them. What the runs contradict of the law
    /// widens the intervals.
    pub(crate) fn of(waves: &[Wave], directions: bool) -> Self {
        let large = |w: &&Wave| w.precession != 0.0 && w.wave.norm_squared() > LARGE * LARGE * w.variance;
        let waves: Vec<&Wave> = waves.iter().filter(large).collect();
        let row = |w: &Wave| {
            let Conditions { amplitude, warmer_k } = w.conditions;
            [1.0, w.precession.abs().ln(), amplitude.ln(), warmer_k, w.precession.signum()]
        };
        let least = [0.0, LEAST_SPREAD, LEAST_SPREAD, LEAST_SPAN_K, LEAST_SPREAD];
        let spread = |column: usize| {
            let values = waves.iter().map(|w| row(w)[column]);
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min) > least[column]
        };
        let columns: Vec<usize> = (0..5).filter(|&c| c == 0 || (spread(c) && (c < 4 || directions))).collect();
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
        Self { rate: exponent(1), amplitude: exponent(2), temperature: exponent(3), turns_with_direction }
    }

    pub(crate) fn told(&self, law: Law) -> Law {
        Law {
            rate: self.rate.map(interval),
            amplitude: self.amplitude.map(interval),
            temperature: self.temperature.map(interval),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 1e-3 (rate/5)⁻¹ a² e^{0.02 (T − T₀)}, which turns with the direction.
    fn wave(precession: f64, amplitude: f64, warmer_k: f64) -> Wave {
        let size = 5e-3 / precession * amplitude.powi(2) * (0.02 * warmer_k).exp();
        let conditions = Conditions { amplitude, warmer_k };
        Wave { precession, conditions, wave: Vector2::new(0.6 * size, 0.8 * size), variance: 1e-14 }
    }

    #[test]
    fn exponents_and_the_change_with_the_temperature_are_told_where_the_runs_differ() {
        let is = |told: Option<Exponent>, expected: f64| {
            told.is_some_and(|e| (e.value - expected).abs() < 1e-6 + e.ci95 && e.ci95 < 0.01)
        };
        let runs = [(5.0, 1.0, 0.0), (-5.0, 0.7, 8.0), (2.0, 0.7, -6.0), (-2.0, 1.0, 4.0), (3.0, 0.8, 12.0)];
        let waves: Vec<Wave> = runs.iter().map(|(rate, a, t)| wave(*rate, *a, *t)).collect();
        let told = Scaling::of(&waves, false);
        assert!(is(told.rate, -1.0) && is(told.amplitude, 2.0) && is(told.temperature, 0.02));
        assert_eq!(told.turns_with_direction, Some(true));
        // within a kelvin nothing is told of it
        let cool: Vec<Wave> = runs.iter().map(|(rate, a, t)| wave(*rate, *a, 0.05 * t)).collect();
        assert!(Scaling::of(&cool, false).temperature.is_none());
    }
}
