//! What one run of a rate gyroscope tells by itself: its bias and its scale factor, with intervals from its parts.
//!
//! A run that turns there and back tells both at once, and what a lag makes beside them is kept out of either. Of a run that
//! turns one way at one rate they are one number: each is told as it is where the other is that of all runs.

use super::rate_deviations::{T_PARTS, deviations};
use super::rate_gyroscope::{RateGyroscope, estimates, splits, tell_scale};
use super::rate_regression::{ErrorLaw, Stretch, Term, estimate};
use super::samples::SensorRun;
use crate::report::Estimate;

/// Bias, rad/s, and scale factor of a run in its own right.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Alone {
    pub(crate) bias: Estimate,
    pub(crate) gain: Estimate,
}

/// Runs whose mean speeds differ by less than this share turn at one speed.
pub(super) const SAME_SPEED: f64 = 0.02;

impl RateGyroscope {
    /// What this run tells by itself, beside those that were fitted; `None` where it has too few rows to leave parts of them out.
    ///
    /// At one rate bias and scale factor are one number: b + (k − k₀) Ω. Either is told as far as the other is known, and is no better
    /// known than that: from runs at the same speed in both directions where there are some, because a scale factor that goes with the
    /// rate is the same for them, else from all.
    pub(crate) fn alone(&self, run: &SensorRun, fitted: &[SensorRun]) -> Option<Alone> {
        let stretch = [Stretch::new(run, 0, &self.sensor, self.latency_s())?];
        if tell_scale(&stretch) {
            let [bias, scale] = found(&stretch, &[Term::Bias, Term::Scale, Term::Lag])?;
            return Some(Alone { bias, gain: scale.turned(self.sensor.gain) });
        }
        let [bias, scale] =
            self.at_the_speed_of(run, fitted).unwrap_or([Term::Bias, Term::Scale].map(|t| self.of_all(t)));
        let beside = |own: Term, other: (Term, f64)| {
            let [estimate] =
                found(&[stretch[0].without(&[other.0, Term::Lag], &[other.1, self.value(Term::Lag)])], &[own])?;
            Some(estimate)
        };
        let (bias_value, bias_half, scale_half) = (bias.value, bias.half_width(), scale.half_width());
        let bias = beside(Term::Bias, (Term::Scale, scale.value))?;
        let bias = no_better_than(scale_half * speed(run), bias);
        let gain = beside(Term::Scale, (Term::Bias, bias_value))?;
        let gain = no_better_than(bias_half / speed(run).max(f64::MIN_POSITIVE), gain);
        Some(Alone { bias, gain: gain.turned(self.sensor.gain) })
    }

    /// Bias, rad/s, and scale factor beyond the nominal one, of the runs that turn as fast as this one, where they turn both ways.
    fn at_the_speed_of(&self, run: &SensorRun, fitted: &[SensorRun]) -> Option<[Estimate; 2]> {
        let is_alike = |other: &&SensorRun| (speed(other) / speed(run) - 1.0).abs() < SAME_SPEED;
        let alike = fitted.iter().filter(is_alike).enumerate();
        let alike: Vec<Stretch> = alike
            .map(|(number, run)| Stretch::new(run, number, &self.sensor, self.latency_s()))
            .collect::<Option<_>>()?;
        tell_scale(&alike).then(|| found(&alike, &[Term::Bias, Term::Scale, Term::Lag])).flatten()
    }

    /// A term of all runs.
    pub(super) fn of_all(&self, term: Term) -> Estimate {
        let (value, half) = (self.value(term), T_PARTS * self.deviation(term));
        Estimate { value, ci95: [value - half, value + half] }
    }

    /// Standard deviation of a term of all runs.
    pub(super) fn deviation(&self, term: Term) -> f64 {
        let of_terms = self.terms.iter().find(|t| t.0 == term).map_or(0.0, |t| t.2);
        if term == Term::Scale { self.gain.1.unwrap_or(0.0) } else { of_terms }
    }

    /// Error of a run with its own bias, scale factor and lag taken out.
    pub(super) fn beside_its_own(&self, run: &SensorRun, left: Vec<f64>) -> Vec<f64> {
        let Some(stretch) = Stretch::new(run, 0, &self.sensor, self.latency_s()) else { return left };
        let mut terms = vec![Term::Bias];
        if tell_scale(std::slice::from_ref(&stretch)) {
            terms.push(Term::Scale);
        }
        let stretch = [stretch.with_error(left)];
        let values = estimate(&stretch, &terms, ErrorLaw::Normal);
        stretch[0].left(&terms, &values)
    }
}

/// An estimate that something else, known to half an interval of `half`, is a part of.
fn no_better_than(half: f64, own: Estimate) -> Estimate {
    own.widened(own.half_width().hypot(half) - own.half_width())
}

/// Mean speed, rad/s.
fn speed(run: &SensorRun) -> f64 {
    run.rate_rad_s.iter().map(|w| w.abs()).sum::<f64>() / run.len().max(1) as f64
}

/// The first of these terms.
pub(super) fn found<const N: usize>(stretch: &[Stretch], terms: &[Term]) -> Option<[Estimate; N]> {
    let splits = splits(stretch);
    if splits.len() < 2 {
        return None;
    }
    let law = ErrorLaw::likelier(stretch, terms);
    let values = estimate(stretch, terms, law);
    let spread = deviations(stretch, terms, &values, &estimates(stretch, &splits, terms, law).0);
    Some(std::array::from_fn(|i| {
        let half = T_PARTS * spread[i];
        Estimate { value: values[i], ci95: [values[i] - half, values[i] + half] }
    }))
}
