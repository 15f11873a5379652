//! How the bias of a rate gyroscope goes with the temperature. What is fitted afterwards is fitted to the angle as it would have been at
//! one temperature.
//!
//! $$b(T) = b + c\\,(T - T_0), \quad e = c \int (T - T_0)\\,dt$$
//!
//! Where the temperature changes within the runs, c is regressed on the angle error of all rows beside a bias of each run's own, so that
//! a bias that does not repeat from run to run is not taken for it, and beside a scale factor that goes with the temperature itself. Where each run has a temperature of its own, it is regressed
//! beside one bias of all runs, and what the runs tell one without the other is its interval. Either has to predict what was left out, as a lag has.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::cross_validation::Folds;
use super::identify::thinned;
use super::rate_deviations::{T_PARTS, deviations, jackknife};
use super::rate_gyroscope::{LEAST_FALL, estimates, left_out_in_turn, splits, stretches};
use super::rate_regression::{ErrorLaw, Stretch, Term, estimate, variance};
use super::samples::{Reading, SensorRun};
use super::sensor::Sensor;
use crate::diagnostics::temperature::LEAST_SPAN_K;
use crate::model::hypothesis::Origin;
use crate::numerics::interpolation::accumulated;
use crate::numerics::statistics::{correlation, span};
use crate::report::named::RATE_OFFSET_TEMPERATURE;
use crate::report::{EffectReport, ParameterReport};

/// Runs go through the temperatures where the widest span of one is this share of that of all: engineering choice.
const WITHIN: f64 = 0.5;
/// A slope from runs of one temperature each that lies within what chance makes of one in 2,000 campaigns is none.
const BY_CHANCE: f64 = 5e-4;
/// Fewest such runs: beside scale factor, bias and slope one is spare.
const FEWEST_RUNS: usize = 4;
/// … and from which on a slope of the scale factor is told beside it.
const RUNS_FOR_BOTH: usize = 6;
/// A temperature that goes with the time so closely is not told from it.
const WITH_TIME: f64 = 0.9;

/// A bias that goes with the temperature.
#[derive(Debug, Clone)]
pub(super) struct BiasOverTemperature {
    reference_c: f64,
    /// c, rad/s/K, and the half width of its 95 % interval
    slope: f64,
    half_width: f64,
    evidence: String,
    /// the temperature went with the time in every run
    with_time: bool,
}

impl BiasOverTemperature {
    /// The slope of runs to fit, where what was left out asks for it and it is more than a chance.
    pub(super) fn told(
        stated_gain: Option<f64>,
        period: f64,
        runs: &[SensorRun],
        reference_c: Option<f64>,
    ) -> Option<Self> {
        // a temperature is slow
        let runs = &thinned(runs)[..];
        let temperatures: Vec<&Vec<f64>> = runs.iter().map(|r| r.temp_c.as_ref()).collect::<Option<_>>()?;
        let all: Vec<f64> = temperatures.iter().flat_map(|t| t.iter().copied()).collect();
        if !all.iter().all(|t| t.is_finite()) || span(&all) < LEAST_SPAN_K {
            return None;
        }
        let reference_c = reference_c.unwrap_or(all.iter().sum::<f64>() / all.len() as f64);
        let sensor = Sensor::new(Some(stated_gain.unwrap_or(1.0)), period, runs).ok()?;
        let warmed = |(stretch, run): (Stretch, &SensorRun)| {
            stretch.with_warmth([warmth(run, reference_c), warm_turn(run, reference_c)])
        };
        let stretches: Vec<Stretch> = stretches(runs, &sensor, 0.0)?.into_iter().zip(runs).map(warmed).collect();
        let widest = temperatures.iter().map(|t| span(t)).fold(0.0, f64::max);
        let (slope, half_width, how) = if widest >= LEAST_SPAN_K.max(WITHIN * span(&all)) {
            within(&stretches, &Folds::interleaved(runs))?
        } else {
            between(&stretches)?
        };
        let correlated = |r: &SensorRun| correlation(&r.t_s, r.temp_c.as_deref().unwrap_or_default()).abs() > WITH_TIME;
        Some(Self { reference_c, slope, half_width, evidence: how, with_time: runs.iter().all(correlated) })
    }

    /// A run as its angle would be at the temperature that parameters refer to.
    pub(super) fn taken_out(&self, run: &SensorRun) -> SensorRun {
        let mut undone = run.clone();
        if let (Reading::Angle(theta), true) = (&mut undone.reading, run.temp_c.is_some()) {
            let warmth = warmth(run, self.reference_c);
            theta.iter_mut().zip(warmth).for_each(|(theta, warmth)| *theta -= self.slope * warmth);
        }
        undone
    }

    /// By what the bias of a run was more than at the temperature that parameters refer to, in its mean, rad/s.
    pub(super) fn mean_of(&self, run: &SensorRun) -> f64 {
        let seconds = run.t_s[run.len() - 1] - run.t_s[0];
        let warmth = run.temp_c.as_ref().and_then(|_| warmth(run, self.reference_c).last().copied());
        self.slope * warmth.unwrap_or(0.0) / seconds.max(f64::MIN_POSITIVE)
    }

    pub(super) fn reference_c(&self) -> f64 {
        self.reference_c
    }

    pub(super) fn slope_rad_s_k(&self) -> f64 {
        self.slope
    }

    /// What has to be said of it.
    pub(super) fn said(&self) -> Option<String> {
        self.with_time.then(|| {
            "the temperature went with the time in every run: what is undone as following the temperature may be a drift; a run that \
             warms and cools tells them apart"
                .into()
        })
    }

    /// The effect, in the words of the report.
    pub(super) fn effect(&self) -> EffectReport {
        EffectReport {
            id: RATE_OFFSET_TEMPERATURE.id.into(),
            origin: Origin::Discovered,
            parameters: vec![ParameterReport {
                name: "rate_offset_per_k".into(),
                unit: "rad/s/K".into(),
                value: self.slope,
                ci95: Some([self.slope - self.half_width, self.slope + self.half_width]),
            }],
            heldout_rms_deg: None,
            evidence: self.evidence.clone(),
            confounded_with: Vec::new(),
            separated_by: None,
        }
    }
}

/// Kelvin seconds beyond a temperature since the first row.
fn warmth(run: &SensorRun, reference_c: f64) -> Vec<f64> {
    let warmer: Vec<f64> = run.temp_c.iter().flatten().map(|t| t - reference_c).collect();
    accumulated(&run.t_s, &warmer)
}

/// Kelvin radians of the reference's turn beyond a temperature since the first row.
fn warm_turn(run: &SensorRun, reference_c: f64) -> Vec<f64> {
    let warmer: Vec<f64> = run.temp_c.iter().flatten().map(|t| t - reference_c).collect();
    accumulated(&run.reference_rad, &warmer)
}

/// Slope, half width and evidence from runs that go through the temperatures.
fn within(stretches: &[Stretch], folds: &Folds) -> Option<(f64, f64, String)> {
    let beside: Vec<Term> =
        (0..stretches.len()).map(Term::BiasOf).chain([Term::Scale, Term::Lag, Term::ScalePerKelvin]).collect();
    let terms = [beside.as_slice(), &[Term::BiasPerKelvin]].concat();
    let last = terms.len() - 1;
    let left_out = |terms: &[Term]| left_out_in_turn(stretches, folds, terms).sqrt();
    let [with, without] = [left_out(&terms), left_out(&beside)];
    if with >= (1.0 - LEAST_FALL) * without {
        return None;
    }
    let law = ErrorLaw::likelier(stretches, &terms);
    let splits = splits(stretches);
    let [(fits, _), (fits_without, _)] = [&terms, &beside].map(|terms| estimates(stretches, &splits, terms, law));
    let gained = splits.iter().zip(fits.iter().zip(&fits_without)).map(|(split, (with, without))| {
        let left = |terms: &[Term], values: &[f64]| variance(&split.test.left(terms, values)).ln();
        left(&terms, with) - left(&beside, without)
    });
    let values = estimate(stretches, &terms, law);
    let half_width = T_PARTS * deviations(stretches, &terms, &values, &fits)[last];
    let told = gained.sum::<f64>() < 0.0 && values[last].abs() > half_width;
    let rows = stretches.iter().map(|s| s.t.len()).sum::<usize>().max(1) as f64;
    let rms = |square_root: f64| (square_root / rows.sqrt()).to_degrees();
    told.then(|| {
        let evidence = format!(
            "blocks that were left out in turn are off by {:.4}° with it and {:.4}° without, beside a bias of each run's own, a scale factor \
             that goes with the temperature, and lag; interval by jackknife and as of a random walk",
            rms(with),
            rms(without)
        );
        (values[last], half_width, evidence)
    })
}

/// The same from runs of one temperature each.
fn between(stretches: &[Stretch]) -> Option<(f64, f64, String)> {
    if stretches.len() < FEWEST_RUNS {
        return None;
    }
    let mut beside = vec![Term::Bias, Term::Scale, Term::Lag];
    // a scale factor that goes with the temperature is told from a bias that does by runs to spare
    beside.extend((stretches.len() >= RUNS_FOR_BOTH).then_some(Term::ScalePerKelvin));
    let terms = [beside.as_slice(), &[Term::BiasPerKelvin]].concat();
    let law = ErrorLaw::likelier(stretches, &terms);
    let without = |left_out: usize| -> Vec<Stretch> {
        stretches.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, s)| s.clone()).collect()
    };
    let (mut fits, mut gained) = (Vec::new(), 0.0);
    for (number, run) in stretches.iter().enumerate() {
        let others = without(number);
        let left = |terms: &[Term], values: &[f64]| variance(&run.left(terms, values)).ln();
        let fit = estimate(&others, &terms, law);
        gained += left(&terms, &fit) - left(&beside, &estimate(&others, &beside, law));
        fits.push(fit);
    }
    let last = terms.len() - 1;
    let (slope, deviation) = (estimate(stretches, &terms, law)[last], jackknife(&fits, terms.len())[last]);
    let student = StudentsT::new(0.0, 1.0, (stretches.len() - last) as f64).ok()?;
    let told = gained < 0.0 && slope.abs() > student.inverse_cdf(1.0 - 0.5 * BY_CHANCE) * deviation;
    told.then(|| {
        let evidence = format!(
            "each run, left out, is predicted by the others with {:.2} of the error that they leave without it; interval by jackknife over runs",
            (0.5 * gained / stretches.len() as f64).exp()
        );
        (slope, student.inverse_cdf(0.975) * deviation, evidence)
    })
}
