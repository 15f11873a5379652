//! The errors of every stage on the held-out rows, which are read here for the first time, and the gate that they decide: nothing is undone
//! where what was found does not help there.

use std::collections::BTreeSet;

use super::another_pass;
use super::report::{Errors, Finding};
use super::samples::SensorRun;
use crate::diagnostics::evaluate::Evaluation;
use crate::estimation::residuals::Residual;
use crate::numerics::statistics::median;
use crate::recording::Instrument;
use crate::report::Heldout;
use crate::report::gate;

/// Errors of a rate gyroscope that differ by less than this share are one: rows held out at one rate have a best line that takes
/// a bias and a scale factor along, whatever they are, and are no test of either.
const SAME_ERROR: f64 = 1e-3;
/// Reference steps below which differences of neighbours are noise, rad; and how near stations count as one, rad.
const DENSE_STEP: f64 = 0.035;
const SAME_STATION: f64 = 1e-3;
/// Pairs of repeated stations that a noise floor needs.
const FEWEST_PAIRS: usize = 10;
/// Why nothing is undone, where a memory explains what was found as well.
const NOT_TOLD: &str = "in the rows that were fitted a memory of the noise explains what was found as well, and no held-out run that is a \
                        pass of its own tells that it is the sensor's";

/// The errors of every stage on the held-out rows, and of what is undone on the fitted ones.
pub(super) struct Evaluated {
    pub(super) raw: Option<Evaluation>,
    pub(super) declared: Evaluation,
    pub(super) discovered: Evaluation,
    pub(super) on_fit: Evaluation,
    /// why nothing is undone, where nothing is: every stage is the raw one then
    pub(super) reason: Option<String>,
}

impl Evaluated {
    /// Reads the held-out rows.
    pub(super) fn of(finding: &Finding<'_>, fitted: &[SensorRun], held: &[SensorRun]) -> Self {
        let evaluate = |errors: &Errors<'_>, runs: &[SensorRun], like: Option<&Evaluation>| {
            let segments = runs.iter().map(|r| segment(r, errors(r), finding)).collect();
            Evaluation::of_segments(segments, like)
        };
        let mut discovered = evaluate(&finding.discovered, held, None);
        let raw = finding.raw.as_ref().map(|raw| evaluate(raw, held, Some(&discovered)));
        let mut declared = evaluate(&finding.declared, held, Some(&discovered));
        let told = gate::gain_is_told(&finding.angular_gain) || !finding.effects.is_empty();
        let untold = (finding.instrument == Instrument::Gyroscope && !told)
            .then(|| "neither a bias, a scale factor nor a lag is told: nothing is undone".to_owned());
        let not_told = || {
            let is_told = || raw.as_ref().is_some_and(|raw| another_pass::tells(fitted, held, raw, &discovered));
            (finding.in_doubt && !is_told()).then(|| NOT_TOLD.to_owned())
        };
        let reason = finding.reason.clone().or(untold).or_else(not_told).or_else(|| {
            let [left, nothing] = [discovered.size(), raw.as_ref()?.size()].map(|size| size.rms_deg);
            let alike = if finding.instrument == Instrument::Gyroscope { SAME_ERROR } else { 0.0 };
            (left > (1.0 + alike) * nothing).then(|| {
                format!(
                    "what was found does not help on held-out data: it leaves {left:.4}°, and nothing undone leaves \
                     {nothing:.4}°"
                )
            })
        });
        let neutral = reason.is_some();
        if neutral && let Some(raw) = &raw {
            (discovered, declared) = (raw.clone(), raw.clone());
        }
        let undone = finding.raw.as_ref().filter(|_| neutral).unwrap_or(&finding.discovered);
        Self { on_fit: evaluate(undone, fitted, None), raw, declared, discovered, reason }
    }

    pub(super) fn heldout(&self, held: &[SensorRun]) -> Heldout {
        Heldout {
            raw: self.raw.as_ref().map(Evaluation::size),
            declared: self.declared.size(),
            discovered: self.discovered.size(),
            noise_floor_deg: noise_floor(&self.discovered, held).to_degrees(),
        }
    }

    /// Samples that are set aside as spikes, in any of these runs.
    pub(super) fn spikes(&self, runs: impl Iterator<Item = usize>) -> usize {
        let numbers: BTreeSet<usize> = runs.collect();
        numbers.iter().map(|&n| self.on_fit.spikes_of(n) + self.discovered.spikes_of(n)).sum()
    }
}

/// A run's errors as the residual diagnostics take them.
fn segment(run: &SensorRun, errors: Vec<f64>, finding: &Finding<'_>) -> Residual {
    let gain = finding.hypothesis.sense() * finding.hypothesis.angular_gain;
    Residual {
        track: run.number,
        samples: run.len(),
        t_s: run.t_s.clone(),
        turned: run.reference_rad.iter().map(|a| a - run.reference_rad[0]).collect(),
        table: run.reference_rad.clone(),
        direction: (finding.direction)(run),
        precession: run.rate_rad_s.iter().map(|w| gain * w).collect(),
        angle: errors,
        amplitude: vec![0.0; run.len()],
    }
}

/// The white part of the error where the rows stand densely; else the repeatability of stations that were met more than
/// once; else all that is left. It is never more than that.
fn noise_floor(after: &Evaluation, held: &[SensorRun]) -> f64 {
    let all = after.mean_square().sqrt();
    let mut steps: Vec<f64> =
        held.iter().flat_map(|r| r.reference_rad.windows(2).map(|w| (w[1] - w[0]).abs())).collect();
    if median(&mut steps) < DENSE_STEP {
        return after.noise_floor().min(all);
    }
    let mut stations: Vec<(f64, f64)> = after
        .segments
        .iter()
        .flat_map(|s| s.table.iter().zip(&s.angle).map(|(a, e)| (a.rem_euclid(std::f64::consts::TAU), *e)))
        .collect();
    stations.sort_by(|a, b| a.0.total_cmp(&b.0));
    let pairs: Vec<f64> = stations
        .windows(2)
        .filter(|w| w[1].0 - w[0].0 < SAME_STATION)
        .map(|w| 0.5 * (w[1].1 - w[0].1).powi(2))
        .collect();
    if pairs.len() < FEWEST_PAIRS {
        return all;
    }
    (pairs.iter().sum::<f64>() / pairs.len() as f64).sqrt().min(all)
}
