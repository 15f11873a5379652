//! Rate gyroscopes whose integrated output stands against a reference angle: bias, scale factor and lag.
//!
//! $$e = b\\,t + s\\,α + l\\,Ω + \text{const}$$
//!
//! Their errors walk: a fit of the angle weighs the late part of a run by all that came before it. Increments over a
//! second or more make a walk white, and Student's t gives bursts of motion little weight. Which estimator and which of
//! the three terms predict parts of a run that were left out is found by cross-validation; the loss is the mean of
//! ln variance, because the parts differ a hundredfold in how violently they move.

use super::samples::{Reading, SensorRun};
use super::selection::VARYING_RATE;
use super::sensor::{Sensor, centred};
use crate::estimation::linear::NormalEquations;
use crate::estimation::statistics::robust_deviation;

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
}

/// How the terms are estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Estimator {
    /// least squares on the angle
    Angle,
    /// Student-t regression of increments over so many seconds
    Increments(f64),
}

const ESTIMATORS: [Estimator; 3] = [Estimator::Angle, Estimator::Increments(1.0), Estimator::Increments(4.0)];
const SUBSETS: [&[Term]; 6] = [
    &[Term::Bias],
    &[Term::Scale],
    &[Term::Lag],
    &[Term::Scale, Term::Lag],
    &[Term::Bias, Term::Lag],
    &[Term::Bias, Term::Scale, Term::Lag],
];
/// Offered besides where the lag cannot be told without some part of the runs, as without the one turn back of a
/// recording. Electronics have a lag: where it can be told, bias and scale factor are not tried without it.
const WITHOUT_LAG: &[Term] = &[Term::Bias, Term::Scale];
/// Parts of a run, each left out once.
const PARTS: usize = 5;
/// Rows that a part needs to be fitted with.
const FEWEST_ROWS: usize = 10;
/// Degrees of freedom of Student's t (Lange, Little and Taylor 1989), and rounds of its reweighting at most.
const DEGREES_OF_FREEDOM: f64 = 3.0;
const REWEIGHTINGS: usize = 200;

/// A stretch of a run: what is regressed on.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    run: usize,
    t: Vec<f64>,
    reference: Vec<f64>,
    rate: Vec<f64>,
    error: Vec<f64>,
}

impl Stretch {
    fn new(run: &SensorRun, number: usize, sensor: &Sensor) -> Option<Self> {
        let Reading::Angle(theta) = &run.reading else { return None };
        let raw: Vec<f64> = theta.iter().zip(&run.reference_rad).map(|(t, a)| t - sensor.gain * a).collect();
        let error = centred(&raw, sensor.period);
        Some(Self {
            run: number,
            t: run.t_s.clone(),
            reference: run.reference_rad.clone(),
            rate: run.rate_rad_s.clone(),
            error,
        })
    }

    fn part(&self, rows: std::ops::Range<usize>) -> Self {
        Self {
            run: self.run,
            t: self.t[rows.clone()].to_vec(),
            reference: self.reference[rows.clone()].to_vec(),
            rate: self.rate[rows.clone()].to_vec(),
            error: self.error[rows].to_vec(),
        }
    }

    fn regressor(&self, term: Term, i: usize) -> f64 {
        match term {
            Term::Bias => self.t[i],
            Term::BiasOf(run) => f64::from(u8::from(self.run == run)) * self.t[i],
            Term::Scale => self.reference[i],
            Term::Lag => self.rate[i],
        }
    }

    /// Whether its rate varies by enough of the fastest one to tell what goes with the rate from what goes with the time.
    fn varies(&self, fastest: f64) -> bool {
        variance(&self.rate).sqrt() > VARYING_RATE * fastest
    }

    /// What `values` of `terms` leave of the error.
    pub(super) fn left(&self, terms: &[Term], values: &[f64]) -> Vec<f64> {
        (0..self.error.len())
            .map(|i| self.error[i] - terms.iter().zip(values).map(|(t, v)| v * self.regressor(*t, i)).sum::<f64>())
            .collect()
    }
}

fn variance(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).max(1e-16)
}

/// Regression rows: regressors and value.
type Rows = Vec<(Vec<f64>, f64)>;

fn rows(stretches: &[Stretch], terms: &[Term], estimator: Estimator) -> Rows {
    let mut out = Rows::new();
    for s in stretches {
        let n = s.error.len();
        match estimator {
            Estimator::Angle => {
                let means: Vec<f64> =
                    terms.iter().map(|t| (0..n).map(|i| s.regressor(*t, i)).sum::<f64>() / n as f64).collect();
                let mean = s.error.iter().sum::<f64>() / n as f64;
                out.extend((0..n).map(|i| {
                    let row = terms.iter().zip(&means).map(|(t, m)| s.regressor(*t, i) - m).collect();
                    (row, s.error[i] - mean)
                }));
            }
            Estimator::Increments(seconds) => {
                let mut steps: Vec<f64> = s.t.windows(2).map(|w| w[1] - w[0]).collect();
                let interval = crate::estimation::statistics::median(&mut steps).max(1e-12);
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count")]
                let width = ((seconds / interval).round() as usize).max(1);
                out.extend((0..n.saturating_sub(width)).step_by((width / 2).max(1)).map(|i| {
                    let row = terms.iter().map(|t| s.regressor(*t, i + width) - s.regressor(*t, i)).collect();
                    (row, s.error[i + width] - s.error[i])
                }));
            }
        }
    }
    out
}

fn estimate(stretches: &[Stretch], terms: &[Term], estimator: Estimator) -> Vec<f64> {
    let rows = rows(stretches, terms, estimator);
    let solve = |weights: Option<&[f64]>| {
        let mut equations = NormalEquations::new(terms.len());
        for (i, (row, value)) in rows.iter().enumerate() {
            let root = weights.map_or(1.0, |w| w[i].sqrt());
            let weighted: Vec<f64> = row.iter().map(|v| v * root).collect();
            equations.add(&weighted, value * root);
        }
        equations.solve()
    };
    let mut values = solve(None);
    if estimator == Estimator::Angle || rows.len() < 4 * terms.len() {
        return values;
    }
    let left = |values: &[f64]| -> Vec<f64> {
        rows.iter().map(|(row, y)| y - row.iter().zip(values).map(|(a, b)| a * b).sum::<f64>()).collect()
    };
    let mut scale = robust_deviation(left(&values).into_iter()) + 1e-15;
    for _ in 0..REWEIGHTINGS {
        let residuals = left(&values);
        let weights: Vec<f64> =
            residuals.iter().map(|q| (DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + (q / scale).powi(2))).collect();
        let next = solve(Some(&weights));
        let square: f64 = weights.iter().zip(&residuals).map(|(w, q)| w * q * q).sum::<f64>() / residuals.len() as f64;
        let next_scale = square.sqrt() + 1e-15;
        let largest = values.iter().fold(1e-9, |m: f64, v| m.max(v.abs()));
        let moved = next.iter().zip(&values).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let settled = moved < 1e-8 * largest && (next_scale / scale - 1.0).abs() < 1e-5;
        (values, scale) = (next, next_scale);
        if settled {
            break;
        }
    }
    values
}

/// An identified rate gyroscope.
#[derive(Debug, Clone)]
pub(crate) struct RateGyroscope {
    pub(crate) sensor: Sensor,
    /// undoing the terms predicts parts of the runs that were left out
    pub(crate) answered: bool,
    /// terms with their values and standard deviations by the jackknife over parts
    pub(crate) terms: Vec<(Term, f64, f64)>,
    /// the bias does not repeat from run to run: it is taken to be zero elsewhere
    pub(crate) bias_varies: bool,
    /// geometric mean of the left-out rms, rad, with the terms and without
    pub(crate) predicted: f64,
    pub(crate) predicted_raw: f64,
    /// k and its standard deviation, from all terms together
    pub(crate) gain: (f64, f64),
}

/// A left-out part and what is fitted without it.
struct Split {
    train: Vec<Stretch>,
    test: Stretch,
}

fn splits(all: &[Stretch]) -> Vec<Split> {
    let mut out = Vec::new();
    for (number, run) in all.iter().enumerate() {
        let n = run.error.len();
        for part in 0..PARTS {
            let (from, to) = ((part * n).div_ceil(PARTS), ((part + 1) * n).div_ceil(PARTS));
            let others = all.iter().enumerate().filter(|(i, _)| *i != number).map(|(_, s)| s.clone());
            let around = [0..from, to..n].into_iter().filter(|r| r.len() > FEWEST_ROWS).map(|r| run.part(r));
            out.push(Split { train: others.chain(around).collect(), test: run.part(from..to) });
        }
    }
    out.retain(|s| s.test.error.len() > 1 && !s.train.is_empty());
    out
}

impl RateGyroscope {
    /// Identifies bias, scale factor and lag; `None` where no run has an angle or rows enough.
    pub(crate) fn identify(stated_gain: Option<f64>, period: f64, runs: &[SensorRun]) -> Option<Self> {
        let sensor = Sensor::new(Some(stated_gain.unwrap_or(1.0)), period, runs).ok()?;
        let all: Vec<Stretch> = runs.iter().enumerate().filter_map(|(i, r)| Stretch::new(r, i, &sensor)).collect();
        let splits = splits(&all);
        if splits.len() < 2 {
            return None;
        }
        let losses = |terms: &[Term], fits: &[Vec<f64>]| -> Vec<f64> {
            splits.iter().zip(fits).map(|(s, v)| variance(&s.test.left(terms, v)).ln()).collect()
        };
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let raw = losses(&[], &vec![Vec::new(); splits.len()]);
        let fastest = fastest(&all);
        let tells_lag = |s: &Stretch| s.varies(fastest);
        let without_lag = splits.iter().any(|s| !s.train.iter().any(tells_lag)).then_some(&WITHOUT_LAG);
        let candidates = SUBSETS.iter().chain(without_lag).flat_map(|t| ESTIMATORS.iter().map(move |e| (*t, *e))).map(
            |(terms, estimator)| {
                let fits: Vec<Vec<f64>> = splits.iter().map(|s| estimate(&s.train, terms, estimator)).collect();
                let loss = losses(terms, &fits);
                (terms, estimator, fits, loss)
            },
        );
        let (terms, estimator, fits, loss) = candidates.min_by(|a, b| mean(&a.3).total_cmp(&mean(&b.3)))?;
        let gained: Vec<f64> = loss.iter().zip(&raw).map(|(a, b)| a - b).collect();
        let n = gained.len() as f64;
        let scatter = gained.iter().map(|g| (g - mean(&gained)).powi(2)).sum::<f64>() / (n - 1.0);
        let answered = mean(&gained) < -(scatter / n).sqrt();
        let mut values = estimate(&all, terms, estimator);
        let bias_varies = forget_a_bias_that_varies(&all, terms, estimator, &mut values);
        let deviations = jackknife(&fits, terms.len());
        let every = [Term::Bias, Term::Scale, Term::Lag];
        let every_fit: Vec<Vec<f64>> = splits.iter().map(|s| estimate(&s.train, &every, estimator)).collect();
        let chosen = terms.iter().position(|t| *t == Term::Scale).filter(|_| answered);
        let scale = chosen.map_or(0.0, |i| values[i]);
        Some(Self {
            sensor,
            answered,
            terms: terms.iter().zip(values).zip(deviations).map(|((t, v), d)| (*t, v, d)).collect(),
            bias_varies,
            predicted: (0.5 * mean(&loss)).exp(),
            predicted_raw: (0.5 * mean(&raw)).exp(),
            gain: (sensor.gain + scale, jackknife(&every_fit, 3)[1]),
        })
    }

    /// Value of a term; 0 where it was not chosen or nothing helps.
    pub(crate) fn value(&self, term: Term) -> f64 {
        let chosen = self.terms.iter().find(|t| t.0 == term && self.answered);
        chosen.map_or(0.0, |t| t.1)
    }

    /// Error of a run with the terms taken out.
    pub(crate) fn left(&self, run: &SensorRun) -> Vec<f64> {
        let Some(stretch) = Stretch::new(run, 0, &self.sensor) else { return Vec::new() };
        let every = [Term::Bias, Term::Scale, Term::Lag];
        stretch.left(&every, &every.map(|t| self.value(t)))
    }
}

fn fastest(all: &[Stretch]) -> f64 {
    all.iter().flat_map(|s| &s.rate).fold(0.0, |m: f64, r| m.max(r.abs()))
}

/// A bias is carried over to another run only where it repeats between runs: where the others' mean predicts a run's
/// worse than nothing does, it is zero, and the other terms are estimated with each run's own. Beside a scale factor that
/// asks for a run whose rate varies: at one rate a bias of its own and a scale factor are the same.
fn forget_a_bias_that_varies(all: &[Stretch], terms: &[Term], estimator: Estimator, values: &mut [f64]) -> bool {
    let Some(at) = terms.iter().position(|t| *t == Term::Bias).filter(|_| all.len() > 1) else { return false };
    let fastest = fastest(all);
    if terms.contains(&Term::Scale) && !all.iter().any(|s| s.varies(fastest)) {
        return false;
    }
    let biases = all.iter().map(|s| Term::BiasOf(s.run));
    let own: Vec<Term> = biases.chain(terms.iter().copied().filter(|t| *t != Term::Bias)).collect();
    let found = estimate(all, &own, estimator);
    let (each, others) = found.split_at(all.len());
    let sum: f64 = each.iter().sum();
    let mean_of_others = |b: f64| (sum - b) / (each.len() - 1) as f64;
    let by_others: f64 = each.iter().map(|b| (b - mean_of_others(*b)).powi(2)).sum();
    if by_others < each.iter().map(|b| b * b).sum::<f64>() {
        return false;
    }
    let mut others = others.iter();
    for (i, value) in values.iter_mut().enumerate() {
        *value = if i == at { 0.0 } else { others.next().copied().unwrap_or(0.0) };
    }
    true
}

/// Standard deviations of estimates each made without one part (Künsch 1989).
fn jackknife(fits: &[Vec<f64>], unknowns: usize) -> Vec<f64> {
    let n = fits.len() as f64;
    (0..unknowns)
        .map(|i| {
            let mean = fits.iter().map(|f| f[i]).sum::<f64>() / n;
            ((n - 1.0) / n * fits.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>()).sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Role;

    /// Turned there and back at a constant rate: 2 % of scale factor and a bias.
    fn there_and_back() -> SensorRun {
        let rows = 3000_u32;
        let t_s: Vec<f64> = (0..rows).map(|i| f64::from(i) * 0.005).collect();
        let rate = |t: f64| if t < 10.0 { 0.7 } else { -0.7 };
        let reference_rad: Vec<f64> = t_s.iter().map(|&t| if t < 10.0 { 0.7 * t } else { 14.0 - 0.7 * t }).collect();
        let walk = |i: usize| 1e-6 * (i as f64 * 0.37).sin() + 1e-6 * (i as f64 * 0.0113).cos();
        // half a sample late; and an encoder's last digit, from which no lag is to be made
        let late = |t: f64| 0.98 * 0.0025 * rate(t);
        let angle = t_s.iter().zip(&reference_rad).enumerate();
        let angle = angle.map(|(i, (t, a))| 0.98 * a + 0.006 * t + walk(i) - late(*t));
        let digit = |i: usize| 1e-9 * (i as f64 * 7.7).sin();
        SensorRun {
            name: "turn".into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            rate_rad_s: t_s.iter().enumerate().map(|(i, &t)| rate(t) + digit(i)).collect(),
            acceleration_rad_s2: vec![0.0; t_s.len()],
            reading: Reading::Angle(angle.collect()),
            reference_rad,
            t_s,
        }
    }

    #[test]
    fn scale_and_bias_of_a_turn_there_and_back_are_told() {
        let found = RateGyroscope::identify(None, std::f64::consts::TAU, &[there_and_back()]).expect("rows enough");
        assert!(found.answered, "{found:?}");
        assert!((found.gain.0 - 0.98).abs() < 1e-4 && (found.value(Term::Bias) - 0.006).abs() < 1e-4, "{found:?}");
    }
}
