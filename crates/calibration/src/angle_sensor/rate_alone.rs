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

impl RateGyroscope {
    /// What this run tells by itself; `None` where it has too few rows to leave parts of them out.
    pub(crate) fn alone(&self, run: &SensorRun) -> Option<Alone> {
        let stretch = [Stretch::new(run, 0, &self.sensor, self.latency_s())?];
        if tell_scale(&stretch) {
            let [bias, scale] = found(&stretch, &[Term::Bias, Term::Scale, Term::Lag])?;
            return Some(Alone { bias, gain: scale.turned(self.sensor.gain) });
        }
        let beside = |own: Term| {
            let every = [Term::Bias, Term::Scale, Term::Lag];
            let of_all = every.map(|term| if term == own { 0.0 } else { self.value(term) });
            let [estimate] = found(&[stretch[0].without(&every, &of_all)], &[own])?;
            Some(estimate)
        };
        Some(Alone { bias: beside(Term::Bias)?, gain: beside(Term::Scale)?.turned(self.sensor.gain) })
    }
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
