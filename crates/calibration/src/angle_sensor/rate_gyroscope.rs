//! Rate gyroscopes whose integrated output stands against a reference angle: bias, scale factor and lag.
//!
//! $$e = b\\,t + s\\,α + l\\,\overline{Ω}_l + \text{const}$$
//!
//! of the angle, each run about its own mean, by least squares or by least absolute deviations, whichever law makes the errors
//! likelier. What such a gyroscope is wrong by besides comes of turns about its other axes, which end where they began as often
//! as not: the error of the angle stays near a line with excursions from it, and a run is held best by all of its rows. Increments, which would make a random walk white, tell bias and scale factor worse here, and so
//! does a choice among subsets of the terms by five parts that were left out: it is decided by the one part in which the
//! others move most. The bias and the scale factor are therefore always estimated where they can be told apart. The lag is a
//! matter of single turns, and blocks left out in turn say whether it helps. Where all of it shows at one place, as in a run
//! that turns back once, nothing tells it from a slip there: the jump is then kept out of the bias and is no lag of the
//! instrument.

use rayon::prelude::*;

use super::cross_validation::Folds;
use super::rate_deviations::{T_PARTS, deviations, of_a_walk};
use super::rate_regression::{ErrorLaw, Row, Stretch, Term, ago, estimate, mean_rates, rows, solved, variance};
use super::samples::SensorRun;
use super::sensor::Sensor;

/// A lag is kept where the rms of blocks that were left out in turn falls by at least this share.
pub(super) const LEAST_FALL: f64 = 0.01;
/// … and a response is said where it falls by this share beside the lag.
const RESPONSE_FALL: f64 = 0.3;
/// Share of the reference's variance beside a line in time, below which a scale factor is not told from a bias.
const TOLD_FROM_A_LINE: f64 = 1e-4;
/// Parts of a run, each left out once.
const PARTS: usize = 5;
/// Standard errors by which left-out parts have to be predicted worse than by nothing for a fit to be refused.
const HARMS: f64 = 2.0;
/// A lag is told where every part that is left out leaves this share of what tells it.
const LEFT_BY_A_PART: f64 = 0.01;
/// Student's 95 % point for the blocks of a run.
const BY_CHANCE: f64 = 1.68;
/// Rounds in which a lag settles, each with a smaller rest.
const MOST_ROUNDS: usize = 8;
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
        return (splits.par_iter().map(|s| estimate(&s.train, terms, law)).collect(), true);
    };
    let least = LEFT_BY_A_PART * beside_the_others(all, terms, at);
    let others: Vec<Term> = terms.iter().copied().filter(|t| *t != Term::Lag).collect();
    let fits: Vec<(Vec<f64>, bool)> = splits
        .par_iter()
        .map(|s| {
            if beside_the_others(&s.train, terms, at) > least {
                return (estimate(&s.train, terms, law), true);
            }
            let mut values = estimate(&s.train, &others, law);
            values.insert(at, 0.0);
            (values, false)
        })
        .collect();
    let told = fits.iter().all(|(_, told)| *told);
    (fits.into_iter().map(|(values, _)| values).collect(), told)
}

/// Sum of squares of interleaved blocks that were left out in turn, rad².
pub(super) fn left_out_in_turn(stretches: &[Stretch], folds: &Folds, terms: &[Term]) -> f64 {
    let rows: Vec<(usize, Row)> = rows(stretches, terms).into_iter().enumerate().collect();
    let square_of = |out: usize| {
        let values = solved(rows.iter().filter(|r| !folds.leaves_out(out, r.0)).map(|r| &r.1), terms.len());
        let left = |(row, error): &Row| error - row.iter().zip(&values).map(|(a, b)| a * b).sum::<f64>();
        rows.iter().filter(|r| folds.leaves_out(out, r.0)).map(|r| left(&r.1).powi(2)).sum::<f64>()
    };
    (0..folds.count()).map(square_of).sum()
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

/// A lag, among these terms, that a random walk of the angle makes as well: of one that goes with a few steps of the rate,
/// blocks that are left out in between say nothing.
fn lag_by_chance(stretches: &[Stretch], terms: &[Term]) -> bool {
    let values = estimate(stretches, terms, ErrorLaw::likelier(stretches, terms));
    let spread = of_a_walk(stretches, terms, &values);
    terms.iter().zip(values).zip(spread).any(|((term, v), d)| *term == Term::Lag && v.abs() <= BY_CHANCE * d)
}

/// c, where blocks that are left out are predicted far better with it: a filter of the gyroscope's own, of which a lag is the
/// first order, shows on ramps of the rate.
fn response(stretches: &[Stretch], folds: &Folds) -> Option<f64> {
    let terms = [Term::Bias, Term::Scale, Term::Lag, Term::Response];
    let left = |terms: &[Term]| left_out_in_turn(stretches, folds, terms).sqrt();
    (left(&terms) < (1.0 - RESPONSE_FALL) * left(&terms[..3])).then(|| estimate(stretches, &terms, ErrorLaw::Normal)[3])
}

/// An identified rate gyroscope.
#[derive(Debug, Clone)]
pub(crate) struct RateGyroscope {
    pub(crate) sensor: Sensor,
    /// undoing the terms does not predict parts of the runs that were left out clearly worse than nothing does
    pub(crate) answered: bool,
    /// terms with their values and standard deviations of the larger of two answers
    pub(crate) terms: Vec<(Term, f64, f64)>,
    /// what would be a lag, s, where all of it shows in one part of the runs
    pub(crate) lag_of_one_place: Option<f64>,
    /// c where most of what is left goes with the acceleration, s²: it is said and not undone
    pub(crate) response: Option<f64>,
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
    pub(super) test: Stretch,
}

pub(super) fn splits(all: &[Stretch]) -> Vec<Split> {
    let mut out = Vec::new();
    for (number, run) in all.iter().enumerate() {
        let n = run.error.len();
        let edges = run.edges(PARTS);
        for part in edges.windows(2) {
            let (from, to) = (part[0], part[1]);
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
        let as_recorded = stretches(runs, &sensor, 0.0)?;
        let parts = splits(&as_recorded);
        if parts.len() < 2 {
            return None;
        }
        let folds = Folds::interleaved(runs);
        let mut terms = told(&as_recorded, &folds);
        let (_, shows_lag) = estimates(&as_recorded, &parts, &terms, ErrorLaw::Normal);
        if shows_lag && lag_by_chance(&as_recorded, &terms) {
            terms.retain(|term| *term != Term::Lag);
        }
        let shows_lag = shows_lag && terms.contains(&Term::Lag);
        let all = if shows_lag { as_late_as_it_is(as_recorded, runs, &sensor) } else { as_recorded };
        let splits = splits(&all);
        let law = ErrorLaw::likelier(&all, &terms);
        let (fits, tells_lag) = estimates(&all, &splits, &terms, law);
        let log_variance = |left: Vec<f64>| variance(&left).ln();
        let loss: Vec<f64> = splits.iter().zip(&fits).map(|(s, v)| log_variance(s.test.left(&terms, v))).collect();
        let raw: Vec<f64> = splits.iter().map(|s| log_variance(s.test.error.clone())).collect();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let gained: Vec<f64> = loss.iter().zip(&raw).map(|(a, b)| a - b).collect();
        let n = gained.len() as f64;
        let scatter = gained.iter().map(|g| (g - mean(&gained)).powi(2)).sum::<f64>() / (n - 1.0);
        let mut values = estimate(&all, &terms, law);
        let spread = deviations(&all, &terms, &values, &fits);
        // what predicts worse than nothing does, if not clearly, has at least to be told from nothing
        let is_told = |(value, deviation): (&f64, &f64)| value.abs() > T_PARTS * deviation;
        let answered = mean(&gained) < HARMS * (scatter / n).sqrt()
            && (mean(&gained) < 0.0 || values.iter().zip(&spread).any(is_told));
        let bias_varies = forget_a_bias_that_varies(&all, &terms, law, &mut values);
        let every = [Term::Bias, Term::Scale, Term::Lag];
        let (every_fit, _) = estimates(&all, &splits, &every, law);
        let tells_scale = terms.iter().position(|t| *t == Term::Scale);
        let scale = tells_scale.filter(|_| answered).map_or(0.0, |i| values[i]);
        let found = terms.iter().zip(values).zip(spread).map(|((t, v), d)| (*t, v, d));
        let response = tells_lag.then(|| response(&all, &folds)).flatten();
        let (lags, terms): (Vec<_>, Vec<_>) = found.partition(|t| t.0 == Term::Lag && !tells_lag);
        Some(Self {
            sensor,
            answered,
            terms,
            response: response.filter(|_| lags.is_empty()),
            lag_of_one_place: lags.first().map(|t| -t.1 / (sensor.gain + scale)),
            bias_varies,
            predicted: (0.5 * mean(&loss)).exp(),
            predicted_raw: (0.5 * mean(&raw)).exp(),
            gain: (
                sensor.gain + scale,
                tells_scale.map(|_| deviations(&all, &every, &estimate(&all, &every, law), &every_fit)[1]),
            ),
        })
    }

    /// Allows, in every term, for a share of what another answer has otherwise, as a half width.
    pub(super) fn allow_for(&mut self, other: &Self, share: f64) {
        let allowed = |own: f64, theirs: f64| share * (own - theirs) / T_PARTS;
        for (term, value, deviation) in &mut self.terms {
            *deviation = deviation.hypot(allowed(*value, other.value(*term)));
        }
        if let Some(deviation) = &mut self.gain.1 {
            *deviation = deviation.hypot(allowed(self.gain.0, other.gain.0));
        }
    }

    /// By how much the angle is late, s; 0 where that is not told.
    pub(crate) fn latency_s(&self) -> f64 {
        -self.value(Term::Lag) / self.gain.0
    }

    /// Value of a term; 0 where it was not chosen or nothing helps.
    pub(crate) fn value(&self, term: Term) -> f64 {
        let chosen = self.terms.iter().find(|t| t.0 == term && self.answered);
        chosen.map_or(0.0, |t| t.1)
    }

    /// Time constant of the low-pass of first order that responds alike, s; negative where the response overshoots.
    pub(crate) fn time_constant_s(&self) -> Option<f64> {
        let spread = 2.0 * self.response? / self.gain.0;
        Some(spread.abs().sqrt().copysign(spread))
    }

    /// Error of a run with the terms taken out, and what else has a name: the response, and a lag of one place.
    pub(crate) fn without_a_name(&self, run: &SensorRun) -> Vec<f64> {
        let late = ago(&run.t_s, &run.acceleration_rad_s2, self.latency_s());
        let response = self.response.unwrap_or(0.0);
        let lag_s = self.lag_of_one_place.unwrap_or(0.0);
        let behind = mean_rates(run, lag_s).into_iter().map(|rate| -lag_s * self.gain.0 * rate);
        let named = late.into_iter().map(|a| response * a).zip(behind).map(|(a, b)| a + b);
        self.left(run).into_iter().zip(named).map(|(left, named)| left - named).collect()
    }

    /// Error of a run with the terms taken out.
    pub(crate) fn left(&self, run: &SensorRun) -> Vec<f64> {
        let Some(stretch) = Stretch::new(run, 0, &self.sensor, self.latency_s()) else { return Vec::new() };
        let every = [Term::Bias, Term::Scale, Term::Lag];
        stretch.left(&every, &every.map(|t| self.value(t)))
    }
}

pub(super) fn stretches(runs: &[SensorRun], sensor: &Sensor, lag_s: f64) -> Option<Vec<Stretch>> {
    runs.iter().enumerate().map(|(number, run)| Stretch::new(run, number, sensor, lag_s)).collect()
}

/// The same stretches with the mean rate over the lag in the place of each rate, for as long as that leaves less: the rate of
/// the moment would leave l²Ω̇/2 on ramps.
fn as_late_as_it_is(first: Vec<Stretch>, runs: &[SensorRun], sensor: &Sensor) -> Vec<Stretch> {
    let terms = [Term::Bias, Term::Scale, Term::Lag];
    let fitted = |all: &[Stretch]| {
        let values = estimate(all, &terms, ErrorLaw::Normal);
        let left: f64 = all.iter().map(|s| s.error.len() as f64 * variance(&s.left(&terms, &values))).sum();
        (-values[2] / (sensor.gain + values[1]), left)
    };
    let (mut lag_s, mut least) = fitted(&first);
    let mut best = first;
    for _ in 0..MOST_ROUNDS {
        let Some(all) = stretches(runs, sensor, lag_s) else { break };
        let (next, left) = fitted(&all);
        if left >= least {
            break;
        }
        (best, lag_s, least) = (all, next, left);
    }
    best
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

#[cfg(test)]
mod tests {
    use super::super::samples::Reading;
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
            temp_c: None,
            recorded: None,
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
