//! The regression of a rate gyroscope's angle error: its terms, and the stretches of runs that it is made on.

use super::samples::{Reading, SensorRun};
use super::selection::VARYING_RATE;
use super::sensor::{Sensor, centred};
use crate::numerics::interpolation;
use crate::numerics::linear::NormalEquations;

/// One of the three terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Term {
    /// b, rad/s
    Bias,
    /// the bias of one run, rad/s
    BiasOf(usize),
    /// s, of the reference's angle
    Scale,
    /// l, s
    Lag,
    /// c, s², of the acceleration a lag ago: what a response is besides late
    Response,
}

/// A stretch of a run: what is regressed on.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub(super) run: usize,
    pub(super) t: Vec<f64>,
    reference: Vec<f64>,
    /// mean rate since a lag ago
    pub(super) rate: Vec<f64>,
    /// acceleration of the reference a lag ago, rad/s²
    acceleration: Vec<f64>,
    pub(super) error: Vec<f64>,
}

impl Stretch {
    /// What is regressed on, of a gyroscope about as late as this, s.
    pub(super) fn new(run: &SensorRun, number: usize, sensor: &Sensor, lag_s: f64) -> Option<Self> {
        let Reading::Angle(theta) = &run.reading else { return None };
        let raw: Vec<f64> = theta.iter().zip(&run.reference_rad).map(|(t, a)| t - sensor.gain * a).collect();
        let error = centred(&raw, sensor.period);
        Some(Self {
            run: number,
            t: run.t_s.clone(),
            reference: run.reference_rad.clone(),
            rate: mean_rates(run, lag_s),
            acceleration: ago(&run.t_s, &run.acceleration_rad_s2, lag_s),
            error,
        })
    }

    /// One with this error, whose rate and acceleration are nothing.
    #[cfg(test)]
    pub(super) fn of(t: Vec<f64>, reference: Vec<f64>, error: Vec<f64>) -> Self {
        let none = vec![0.0; t.len()];
        Self { run: 0, t, reference, rate: none.clone(), acceleration: none, error }
    }

    pub(super) fn part(&self, rows: std::ops::Range<usize>) -> Self {
        Self {
            run: self.run,
            t: self.t[rows.clone()].to_vec(),
            reference: self.reference[rows.clone()].to_vec(),
            rate: self.rate[rows.clone()].to_vec(),
            acceleration: self.acceleration[rows.clone()].to_vec(),
            error: self.error[rows].to_vec(),
        }
    }

    fn regressor(&self, term: Term, i: usize) -> f64 {
        match term {
            Term::Bias => self.t[i],
            Term::BiasOf(run) => f64::from(u8::from(self.run == run)) * self.t[i],
            Term::Scale => self.reference[i],
            Term::Lag => self.rate[i],
            Term::Response => self.acceleration[i],
        }
    }

    /// Whether its rate varies by enough of the fastest one to tell what goes with the rate from what goes with the time.
    pub(super) fn varies(&self, fastest: f64) -> bool {
        variance(&self.rate).sqrt() > VARYING_RATE * fastest
    }

    /// The same with `values` of `terms` taken out of its error.
    pub(super) fn without(&self, terms: &[Term], values: &[f64]) -> Self {
        Self { error: self.left(terms, values), ..self.clone() }
    }

    /// What `values` of `terms` leave of the error.
    pub(super) fn left(&self, terms: &[Term], values: &[f64]) -> Vec<f64> {
        (0..self.error.len())
            .map(|i| self.error[i] - terms.iter().zip(values).map(|(t, v)| v * self.regressor(*t, i)).sum::<f64>())
            .collect()
    }
}

/// Mean rate of a run's reference over so long before each row, rad/s.
pub(super) fn mean_rates(run: &SensorRun, since_s: f64) -> Vec<f64> {
    let (angle, rate) = (|i: usize| run.reference_rad[i], |i: usize| run.rate_rad_s[i]);
    (0..run.len()).map(|i| interpolation::mean_rate_before(&run.t_s, angle, rate, i, since_s)).collect()
}

/// What `values` at `t_s` were so long ago, s.
pub(super) fn ago(t_s: &[f64], values: &[f64], since_s: f64) -> Vec<f64> {
    t_s.iter().map(|t| interpolation::at(t_s, t - since_s, |i| values[i])).collect()
}

pub(super) fn variance(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).max(1e-16)
}

/// A row of the regression: regressors and error, each about its stretch's mean.
pub(super) type Row = (Vec<f64>, f64);

pub(super) fn rows(stretches: &[Stretch], terms: &[Term]) -> Vec<Row> {
    let mut out = Vec::new();
    for s in stretches {
        let n = s.error.len();
        let mean = |f: &dyn Fn(usize) -> f64| (0..n).map(f).sum::<f64>() / n as f64;
        let means: Vec<f64> = terms.iter().map(|t| mean(&|i| s.regressor(*t, i))).collect();
        let middle = mean(&|i| s.error[i]);
        out.extend((0..n).map(|i| {
            let row = terms.iter().zip(&means).map(|(t, m)| s.regressor(*t, i) - m).collect();
            (row, s.error[i] - middle)
        }));
    }
    out
}

pub(super) fn solved<'a>(rows: impl Iterator<Item = &'a Row>, unknowns: usize) -> Vec<f64> {
    let mut equations = NormalEquations::new(unknowns);
    rows.for_each(|(row, value)| equations.add(row, *value));
    equations.solve()
}

pub(super) fn estimate(stretches: &[Stretch], terms: &[Term]) -> Vec<f64> {
    solved(rows(stretches, terms).iter(), terms.len())
}
