//! The regression of a rate gyroscope's angle error: its terms, the stretches of runs that it is made on, and the law that its
//! errors follow.

use super::samples::{Reading, SensorRun};
use super::selection::VARYING_RATE;
use super::sensor::{Sensor, centred};
use crate::numerics::interpolation;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{median, robust_deviation};

/// One of the terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Term {
    /// b, rad/s
    Bias,
    /// the bias of one run, rad/s
    BiasOf(usize),
    /// s, of the reference's angle
    Scale,
    /// how the bias goes with the temperature, rad/s/K
    BiasPerKelvin,
    /// how the scale factor goes with the temperature, 1/K
    ScalePerKelvin,
    /// l, s
    Lag,
    /// c, s², of the acceleration a lag ago: what a response is besides late
    Response,
}

/// How the errors of the angle are distributed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ErrorLaw {
    /// noise and slow wander: least squares
    Normal,
    /// excursions that come and go, as turns about the other axes make: least absolute deviations
    Laplace,
}

/// Reweighted fits of least absolute deviations, the smallest deviation that weighs, of the robust one (Schlossmacher 1973), and the
/// share of themselves by which values that have settled still change.
const REWEIGHTED: usize = 30;
const SMALLEST_DEVIATION: f64 = 1e-2;
const SETTLED: f64 = 1e-9;

/// Share of the way that one part of a run in time may hold: left out, one that held a turn between rests would take the scale factor
/// with it.
const MOST_OF_THE_WAY: f64 = 0.45;

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
    /// how much warmer it was for how long since the first row, K s; none where that is not asked for
    warmth: Option<Vec<f64>>,
    /// how much warmer it was for how much of the reference's turn, K rad; none where that is not asked for
    warm_turn: Option<Vec<f64>>,
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
            warmth: None,
            warm_turn: None,
            error,
        })
    }

    /// One with this error, whose rate and acceleration are nothing.
    #[cfg(test)]
    pub(super) fn of(t: Vec<f64>, reference: Vec<f64>, error: Vec<f64>) -> Self {
        let none = vec![0.0; t.len()];
        Self { run: 0, t, reference, rate: none.clone(), acceleration: none, warmth: None, warm_turn: None, error }
    }

    /// First rows of so many parts, and the end of the last: alike in time, or, where one of them would hold most of the way that the
    /// reference turns, each a share of the time and of the way in equal parts.
    pub(super) fn edges(&self, parts: usize) -> Vec<usize> {
        let rows = self.t.len();
        let in_time: Vec<usize> = (0..=parts).map(|part| (part * rows).div_ceil(parts)).collect();
        let shares = |values: &[f64]| -> Vec<f64> {
            let steps = values.windows(2).map(|w| (w[1] - w[0]).abs());
            let total = steps.clone().sum::<f64>().max(f64::MIN_POSITIVE);
            steps.map(|s| s / total).collect()
        };
        let (time, way) = (shares(&self.t), shares(&self.reference));
        let holds = |part: &[usize]| way[part[0].min(way.len())..part[1].min(way.len())].iter().sum::<f64>();
        if in_time.windows(2).all(|part| holds(part) < MOST_OF_THE_WAY) {
            return in_time;
        }
        let mut gone = 0.0;
        let mut edges = vec![0];
        for (at, (t, a)) in time.iter().zip(&way).enumerate() {
            gone += 0.5 * (t + a);
            while edges.len() < parts && gone * parts as f64 >= edges.len() as f64 {
                edges.push(at + 1);
            }
        }
        edges.resize(parts + 1, rows);
        edges
    }

    pub(super) fn part(&self, rows: std::ops::Range<usize>) -> Self {
        Self {
            run: self.run,
            t: self.t[rows.clone()].to_vec(),
            reference: self.reference[rows.clone()].to_vec(),
            rate: self.rate[rows.clone()].to_vec(),
            acceleration: self.acceleration[rows.clone()].to_vec(),
            warmth: self.warmth.as_ref().map(|warmth| warmth[rows.clone()].to_vec()),
            warm_turn: self.warm_turn.as_ref().map(|turn| turn[rows.clone()].to_vec()),
            error: self.error[rows].to_vec(),
        }
    }

    /// A term's regressor at every row; `None` where it is nothing.
    fn regressor(&self, term: Term) -> Option<&[f64]> {
        match term {
            Term::Bias => Some(&self.t),
            Term::BiasOf(run) => (self.run == run).then_some(&self.t),
            Term::Scale => Some(&self.reference),
            Term::BiasPerKelvin => self.warmth.as_deref(),
            Term::ScalePerKelvin => self.warm_turn.as_deref(),
            Term::Lag => Some(&self.rate),
            Term::Response => Some(&self.acceleration),
        }
    }

    /// Whether its rate varies by enough of the fastest one to tell what goes with the rate from what goes with the time.
    pub(super) fn varies(&self, fastest: f64) -> bool {
        variance(&self.rate).sqrt() > VARYING_RATE * fastest
    }

    /// The same beside how much warmer it was for how long, K s.
    pub(super) fn with_warmth(self, [warmth, warm_turn]: [Vec<f64>; 2]) -> Self {
        Self { warmth: Some(warmth), warm_turn: Some(warm_turn), ..self }
    }

    /// The same with another error.
    pub(super) fn with_error(self, error: Vec<f64>) -> Self {
        Self { error, ..self }
    }

    /// The same with `values` of `terms` taken out of its error.
    pub(super) fn without(&self, terms: &[Term], values: &[f64]) -> Self {
        Self { error: self.left(terms, values), ..self.clone() }
    }

    /// What `values` of `terms` leave of the error.
    pub(super) fn left(&self, terms: &[Term], values: &[f64]) -> Vec<f64> {
        let told = terms.iter().zip(values).filter_map(|(t, v)| Some((self.regressor(*t)?, v)));
        let mut explained = vec![0.0; self.error.len()];
        for (regressor, value) in told {
            explained.iter_mut().zip(regressor).for_each(|(sum, r)| *sum += value * r);
        }
        self.error.iter().zip(explained).map(|(e, x)| e - x).collect()
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
    weighted_rows(stretches, terms, |_| 1.0, |row, error| out.push((row.to_vec(), error)));
    out
}

/// Takes rows times the roots of their weights, about the weighted means of their stretches.
fn weighted_rows(
    stretches: &[Stretch],
    terms: &[Term],
    weight: impl Fn(usize) -> f64,
    mut take: impl FnMut(&[f64], f64),
) {
    let mut first = 0;
    let mut row = vec![0.0; terms.len()];
    for s in stretches {
        let weights: Vec<f64> = (first..first + s.error.len()).map(&weight).collect();
        let all: f64 = weights.iter().sum();
        let mean = |values: &[f64]| weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>() / all;
        let regressors: Vec<_> = terms.iter().map(|t| s.regressor(*t).map(|r| (r, mean(r)))).collect();
        let middle = mean(&s.error);
        for (i, (w, error)) in weights.iter().zip(&s.error).enumerate() {
            let root = w.sqrt();
            for (entry, regressor) in row.iter_mut().zip(&regressors) {
                *entry = regressor.map_or(0.0, |(r, mean)| root * (r[i] - mean));
            }
            take(&row, root * (error - middle));
        }
        first += s.error.len();
    }
}

/// Least squares by these weights.
fn weighted(stretches: &[Stretch], terms: &[Term], weight: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut equations = NormalEquations::new(terms.len());
    weighted_rows(stretches, terms, weight, |row, error| equations.add(row, error));
    equations.solve()
}

pub(super) fn solved<'a>(rows: impl Iterator<Item = &'a Row>, unknowns: usize) -> Vec<f64> {
    let mut equations = NormalEquations::new(unknowns);
    rows.for_each(|(row, value)| equations.add(row, *value));
    equations.solve()
}

/// The most likely values of the terms.
pub(super) fn estimate(stretches: &[Stretch], terms: &[Term], law: ErrorLaw) -> Vec<f64> {
    let mut values = weighted(stretches, terms, |_| 1.0);
    if law == ErrorLaw::Normal {
        return values;
    }
    for _ in 0..REWEIGHTED {
        let left = about_their_medians(stretches, terms, &values);
        let least = SMALLEST_DEVIATION * robust_deviation(left.iter().copied());
        if least <= 0.0 {
            break;
        }
        let before = values;
        values = weighted(stretches, terms, |i| least / left[i].abs().max(least));
        if values.iter().zip(before).all(|(v, b)| (v - b).abs() <= SETTLED * v.abs()) {
            break;
        }
    }
    values
}

/// What values of the terms leave of the error, about the median of each stretch.
fn about_their_medians(stretches: &[Stretch], terms: &[Term], values: &[f64]) -> Vec<f64> {
    let about = |s: &Stretch| {
        let left = s.left(terms, values);
        let middle = median(&mut left.clone());
        left.into_iter().map(move |r| r - middle)
    };
    stretches.iter().flat_map(about).collect()
}

impl ErrorLaw {
    /// The likelier of the two for what the terms leave.
    pub(super) fn likelier(stretches: &[Stretch], terms: &[Term]) -> Self {
        use std::f64::consts::{E, PI};
        let least_squares = estimate(stretches, terms, Self::Normal);
        let squares: Vec<f64> = rows(stretches, terms)
            .iter()
            .map(|(row, error)| (error - row.iter().zip(&least_squares).map(|(a, b)| a * b).sum::<f64>()).powi(2))
            .collect();
        let absolute = about_their_medians(stretches, terms, &estimate(stretches, terms, Self::Laplace));
        let n = squares.len().max(1) as f64;
        // mean log-likelihoods at the most likely scale
        let normal = -0.5 * (2.0 * PI * E * squares.iter().sum::<f64>() / n).ln();
        let laplace = -(2.0 * E * absolute.iter().map(|r| r.abs()).sum::<f64>() / n).ln();
        if laplace > normal { Self::Laplace } else { Self::Normal }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;
    use crate::recording::Role;

    const BIAS_RAD_S: f64 = 1e-3;

    /// A gyroscope at rest with a bias and `error`, rad.
    fn at_rest(error: &[f64]) -> [Stretch; 1] {
        let t_s: Vec<f64> = (0..error.len()).map(|i| i as f64 * 0.1).collect();
        let run = SensorRun {
            name: "rest".into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            rate_rad_s: vec![0.0; error.len()],
            acceleration_rad_s2: vec![0.0; error.len()],
            temp_c: None,
            recorded: None,
            reading: Reading::Angle(t_s.iter().zip(error).map(|(t, e)| BIAS_RAD_S * t + e).collect()),
            reference_rad: vec![0.0; error.len()],
            t_s,
        };
        let sensor =
            Sensor::new(Some(1.0), std::f64::consts::TAU, std::slice::from_ref(&run)).expect("a gain is stated");
        [Stretch::new(&run, 0, &sensor, 0.0).expect("it reads an angle")]
    }

    #[test]
    fn normal_noise_asks_for_least_squares() {
        for seed in 1..20 {
            let noise = remembered(0.0, 1_000, seed);
            assert_eq!(
                ErrorLaw::likelier(&at_rest(&noise.iter().map(|e| 1e-3 * e).collect::<Vec<_>>()), &[Term::Bias]),
                ErrorLaw::Normal
            );
        }
    }

    #[test]
    fn excursions_do_not_move_the_line_through_most_rows() {
        let mut error: Vec<f64> = remembered(0.0, 1_000, 7).iter().map(|e| 1e-4 * e).collect();
        // a turn about another axis and back, in the last fifth
        error[820..960].iter_mut().for_each(|e| *e += 0.02);
        let all = at_rest(&error);
        assert_eq!(ErrorLaw::likelier(&all, &[Term::Bias]), ErrorLaw::Laplace);
        let off = |law| (estimate(&all, &[Term::Bias], law)[0] - BIAS_RAD_S).abs();
        assert!(off(ErrorLaw::Laplace) < 2e-6, "{:e}", off(ErrorLaw::Laplace));
        assert!(off(ErrorLaw::Normal) > 1e-4, "{:e}", off(ErrorLaw::Normal));
    }

    #[test]
    fn runs_have_levels_of_their_own() {
        let mut runs = [at_rest(&vec![0.0; 300]), at_rest(&vec![5.0; 300])].concat();
        for (i, run) in runs.iter_mut().enumerate() {
            run.error.iter_mut().zip(remembered(0.0, 300, 3 + i as u64)).for_each(|(e, n)| *e += 1e-5 * n);
        }
        for law in [ErrorLaw::Normal, ErrorLaw::Laplace] {
            assert!((estimate(&runs, &[Term::Bias], law)[0] - BIAS_RAD_S).abs() < 1e-6, "{law:?}");
        }
    }

    #[test]
    fn a_turn_between_rests_is_in_more_than_one_part() {
        let t: Vec<f64> = (0..1000).map(|i| 0.01 * f64::from(i)).collect();
        let of = |turn: &dyn Fn(f64) -> f64| {
            let stretch = Stretch::of(t.clone(), t.iter().map(|t| turn(*t)).collect(), vec![0.0; t.len()]);
            stretch.edges(5)
        };
        assert_eq!(of(&|t| 0.5 * t), [0, 200, 400, 600, 800, 1000], "alike in time where it turns evenly");
        // all of the turn from 2.2 s to 3.8 s, within the second fifth
        let edges = of(&|t| (t - 2.2).clamp(0.0, 1.6));
        let turn = |part: &[usize]| (part[1].min(380) as f64 - part[0].max(220) as f64).max(0.0) / 160.0;
        let most = edges.windows(2).map(turn).fold(0.0, f64::max);
        assert!(edges.is_sorted() && edges.len() == 6 && most < 0.5, "{edges:?}: {most} of the turn in one part");
    }
}
