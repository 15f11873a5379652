//! Rate gyroscopes whose integrated output stands against a reference angle: bias, scale factor and lag.
//!
//! $$e = b\\,t + s\\,α + l\\,Ω + \text{const}$$
//!
//! of the angle, each run about its own mean, by least squares or by least absolute deviations, whichever law makes the errors
//! likelier. What such a gyroscope is wrong by besides comes of turns about its other axes, which end where they began as often
//! as not: the error of the angle stays near a line with excursions from it, and a run is held best by all of its rows. Increments, which would make a random walk white, tell bias and scale factor worse here, and so
//! does a choice among subsets of the terms by five parts that were left out: it is decided by the one part in which the
//! others move most. The bias and the scale factor are therefore always estimated where they can be told apart. The lag is a
//! matter of single turns, and blocks left out in turn say whether it helps. Where all of it shows at one place, as in a run
//! that turns back once, nothing tells it from a slip there: the jump is then kept out of the bias and is no lag of the
//! instrument.

use super::cross_validation::Folds;
use super::rate_regression::{ErrorLaw, Row, Stretch, Term, estimate, rows, solved, variance};
use super::samples::SensorRun;
use super::sensor::Sensor;

/// A lag is kept where the rms of blocks that were left out in turn falls by at least this share.
const LEAST_FALL: f64 = 0.01;
/// Share of the reference's variance beside a line in time, below which a scale factor is not told from a bias.
const TOLD_FROM_A_LINE: f64 = 1e-4;
/// Parts of a run, each left out once.
const PARTS: usize = 5;
/// Student's 97.5 % point for one fewer than five parts.
pub(super) const T_PARTS: f64 = 2.776;
/// Standard errors by which left-out parts have to be predicted worse than by nothing for a fit to be refused.
const HARMS: f64 = 2.0;
/// A lag is told where every part that is left out leaves this share of what tells it.
const LEFT_BY_A_PART: f64 = 0.01;
/// Rows that a part needs to be fitted with.
const FEWEST_ROWS: usize = 10;

/// How much of a term stands beside the others, as a sum of squares of its regressor.
fn beside_the_others(stretches: &[Stretch], terms: &[Term], at: usize) -> f64 {
    let apart = |(mut row, _): Row| {
        let own = row.remove(at);
        (row, own)
    };
    let rows: Vec<Row> = rows(stretches, terms).into_iter().map(apart).collect();
    let by_others = solved(rows.iter(), terms.len() - 1);
    rows.iter().map(|(row, own)| (own - row.iter().zip(&by_others).map(|(a, b)| a * b).sum::<f64>()).powi(2)).sum()
}

/// Estimates from every split, with a lag of zero where what is left of the runs does not tell one; and whether each tells it.
pub(super) fn estimates(all: &[Stretch], splits: &[Split], terms: &[Term], law: ErrorLaw) -> (Vec<Vec<f64>>, bool) {
    let Some(at) = terms.iter().position(|t| *t == Term::Lag) else {
        return (splits.iter().map(|s| estimate(&s.train, terms, law)).collect(), true);
    };
    let least = LEFT_BY_A_PART * beside_the_others(all, terms, at);
    let others: Vec<Term> = terms.iter().copied().filter(|t| *t != Term::Lag).collect();
    let mut told = true;
    let fits = splits.iter().map(|s| {
        if beside_the_others(&s.train, terms, at) > least {
            return estimate(&s.train, terms, law);
        }
        told = false;
        let mut values = estimate(&s.train, &others, law);
        values.insert(at, 0.0);
        values
    });
    (fits.collect(), told)
}

/// Sum of squares of interleaved blocks that were left out in turn, rad².
fn left_out_in_turn(stretches: &[Stretch], folds: &Folds, terms: &[Term]) -> f64 {
    let rows: Vec<(Row, usize)> = rows(stretches, terms).into_iter().zip(folds.fold.iter().copied()).collect();
    let square_of = |out: usize| {
        let values = solved(rows.iter().filter(|r| r.1 != out).map(|r| &r.0), terms.len());
        let left = |(row, error): &Row| error - row.iter().zip(&values).map(|(a, b)| a * b).sum::<f64>();
        rows.iter().filter(|r| r.1 == out).map(|r| left(&r.0).powi(2)).sum::<f64>()
    };
    (0..folds.count).map(square_of).sum()
}

/// A scale factor is told from a bias.
pub(super) fn tell_scale(stretches: &[Stretch]) -> bool {
    let line = rows(stretches, &[Term::Bias, Term::Scale]);
    let moment = |i: usize, j: usize| line.iter().map(|(r, _)| r[i] * r[j]).sum::<f64>();
    let beside_a_line = moment(1, 1) - moment(0, 1).powi(2) / moment(0, 0).max(f64::MIN_POSITIVE);
    beside_a_line > TOLD_FROM_A_LINE * moment(1, 1)
}

/// The terms that these stretches tell, of which `folds` leaves out blocks.
fn told(stretches: &[Stretch], folds: &Folds) -> Vec<Term> {
    let mut terms = vec![Term::Bias];
    if tell_scale(stretches) {
        terms.push(Term::Scale);
    }
    let with_lag = [terms.as_slice(), &[Term::Lag]].concat();
    let left = |terms: &[Term]| left_out_in_turn(stretches, folds, terms).sqrt();
    if left(&with_lag) < (1.0 - LEAST_FALL) * left(&terms) { with_lag } else { terms }
}

/// An identified rate gyroscope.
#[derive(Debug, Clone)]
pub(crate) struct RateGyroscope {
    pub(crate) sensor: Sensor,
    /// undoing the terms does not predict parts of the runs that were left out clearly worse than nothing does
    pub(crate) answered: bool,
    /// terms with their values and standard deviations by the jackknife over parts
    pub(crate) terms: Vec<(Term, f64, f64)>,
    /// what would be a lag, s, where all of it shows in one part of the runs
    pub(crate) lag_of_one_place: Option<f64>,
    /// the bias does not repeat from run to run: it is taken to be zero elsewhere
    pub(crate) bias_varies: bool,
    /// geometric mean of the left-out rms, rad, with the terms and without
    pub(crate) predicted: f64,
    pub(crate) predicted_raw: f64,
    /// k and its standard deviation, from all terms together; `None` where a scale factor is not told from a bias
    pub(crate) gain: (f64, Option<f64>),
}

/// A left-out part and what is fitted without it.
pub(super) struct Split {
    train: Vec<Stretch>,
    test: Stretch,
}

pub(super) fn splits(all: &[Stretch]) -> Vec<Split> {
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
    /// Identifies bias, scale factor and lag; `None` where a run has no angle or all of them too few rows.
    pub(crate) fn identify(stated_gain: Option<f64>, period: f64, runs: &[SensorRun]) -> Option<Self> {
        let sensor = Sensor::new(Some(stated_gain.unwrap_or(1.0)), period, runs).ok()?;
        let all: Vec<Stretch> =
            runs.iter().enumerate().map(|(i, r)| Stretch::new(r, i, &sensor)).collect::<Option<_>>()?;
        let splits = splits(&all);
        if splits.len() < 2 {
            return None;
        }
        let terms = told(&all, &Folds::interleaved(runs));
        let law = ErrorLaw::likelier(&all, &terms);
        let (fits, tells_lag) = estimates(&all, &splits, &terms, law);
        let log_variance = |left: Vec<f64>| variance(&left).ln();
        let loss: Vec<f64> = splits.iter().zip(&fits).map(|(s, v)| log_variance(s.test.left(&terms, v))).collect();
        let raw: Vec<f64> = splits.iter().map(|s| log_variance(s.test.error.clone())).collect();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let gained: Vec<f64> = loss.iter().zip(&raw).map(|(a, b)| a - b).collect();
        let n = gained.len() as f64;
        let scatter = gained.iter().map(|g| (g - mean(&gained)).powi(2)).sum::<f64>() / (n - 1.0);
        let answered = mean(&gained) < HARMS * (scatter / n).sqrt();
        let mut values = estimate(&all, &terms, law);
        let bias_varies = forget_a_bias_that_varies(&all, &terms, law, &mut values);
        let deviations = jackknife(&fits, terms.len());
        let every = [Term::Bias, Term::Scale, Term::Lag];
        let (every_fit, _) = estimates(&all, &splits, &every, law);
        let tells_scale = terms.iter().position(|t| *t == Term::Scale);
        let scale = tells_scale.filter(|_| answered).map_or(0.0, |i| values[i]);
        let found = terms.iter().zip(values).zip(deviations).map(|((t, v), d)| (*t, v, d));
        let (lags, terms): (Vec<_>, Vec<_>) = found.partition(|t| t.0 == Term::Lag && !tells_lag);
        Some(Self {
            sensor,
            answered,
            terms,
            lag_of_one_place: lags.first().map(|t| -t.1 / (sensor.gain + scale)),
            bias_varies,
            predicted: (0.5 * mean(&loss)).exp(),
            predicted_raw: (0.5 * mean(&raw)).exp(),
            gain: (sensor.gain + scale, tells_scale.map(|_| jackknife(&every_fit, 3)[1])),
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
fn forget_a_bias_that_varies(all: &[Stretch], terms: &[Term], law: ErrorLaw, values: &mut [f64]) -> bool {
    let Some(at) = terms.iter().position(|t| *t == Term::Bias).filter(|_| all.len() > 1) else { return false };
    let fastest = fastest(all);
    if terms.contains(&Term::Scale) && !all.iter().any(|s| s.varies(fastest)) {
        return false;
    }
    let biases = all.iter().map(|s| Term::BiasOf(s.run));
    let own: Vec<Term> = biases.chain(terms.iter().copied().filter(|t| *t != Term::Bias)).collect();
    let found = estimate(all, &own, law);
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
pub(super) fn jackknife(fits: &[Vec<f64>], unknowns: usize) -> Vec<f64> {
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
    use crate::angle_sensor::samples::Reading;
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
    fn at_one_rate_a_scale_factor_is_not_told_from_a_bias() {
        let SensorRun { mut reading, mut t_s, mut reference_rad, mut rate_rad_s, mut acceleration_rad_s2, .. } =
            there_and_back();
        let there = t_s.iter().filter(|t| **t < 10.0).count();
        let Reading::Angle(angle) = &mut reading else { unreachable!() };
        for column in [&mut t_s, &mut reference_rad, &mut rate_rad_s, &mut acceleration_rad_s2, angle] {
            column.truncate(there);
        }
        let run = SensorRun { reading, t_s, reference_rad, rate_rad_s, acceleration_rad_s2, ..there_and_back() };
        let found = RateGyroscope::identify(None, std::f64::consts::TAU, &[run]).expect("rows enough");
        assert!(found.terms.len() == 1 && found.terms[0].0 == Term::Bias, "{found:?}");
        // 0.006 of the bias and 2 % of 0.7 rad/s together
        assert!((found.value(Term::Bias) - (0.006 - 0.014)).abs() < 1e-4, "{found:?}");
        assert!(found.gain.1.is_none(), "{found:?}");
    }

    #[test]
    fn scale_and_bias_of_a_turn_there_and_back_are_told() {
        let found = RateGyroscope::identify(None, std::f64::consts::TAU, &[there_and_back()]).expect("rows enough");
        assert!(found.answered, "{found:?}");
        assert!((found.gain.0 - 0.98).abs() < 1e-4 && (found.value(Term::Bias) - 0.006).abs() < 1e-4, "{found:?}");
    }
}
