//! Whether an angle that goes round once a turn is a pattern's or the integral of a rate, where nothing but `theta_deg` was
//! recorded and the stated angular gain could be either's: a whole-angle gyroscope's of 0.8, and the scale factor of a rate
//! gyroscope that is off by as much.
//!
//! Detection and drives of a pattern put second and fourth harmonics of its angle into that angle; the integral of a rate knows
//! nothing of its own angle. The harmonics decide by whether they predict parts of the runs that were left out, beside the bias,
//! scale factor and lag that both kinds may have. What wanders slowly is followed by a harmonic as far as it was fitted and no
//! further. Where no harmonic is told, both models leave the same, and that of a rate asks for less.

use super::identify::thinned;
use super::rate_deviations::T_PARTS;
use super::rate_gyroscope::stretches;
use super::rate_regression::{Stretch, Term, rows, variance};
use super::samples::{Reading, SensorRun, apart};
use super::sensor::Sensor;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::span;
use crate::recording::{Campaign, RunKind};

/// The angular gain of the integral of a rate is its scale factor, which is 1 within this as a rule: there is no question then.
const SCALE_FACTOR: f64 = 0.05;
/// … and hardly ever beyond these.
const SCALE_FACTORS: std::ops::Range<f64> = 0.5..2.0;
/// Harmonics of its angle that a pattern carries.
const HARMONICS: [f64; 2] = [2.0, 4.0];
/// Parts of a run, each left out once.
const PARTS: usize = 5;
/// How far a pattern turns at least for its harmonics to be told, rad.
const HALF_A_TURN: f64 = std::f64::consts::PI;

/// What says that an angle is the integral of a rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rate {
    /// the campaign: a gain near one or none at all, a column that is an integral, a run across the input axis
    Stated,
    /// the data, beside a stated gain that would be a pattern's as well
    ByItsErrors(f64),
    /// nothing: it is a pattern's
    No,
}

impl Rate {
    /// What says it, of a campaign whose runs have `theta_deg` alone and a period of one turn.
    pub(super) fn of(campaign: &Campaign) -> Self {
        let Some(gain) = campaign.angular_gain else { return Self::Stated };
        let states_it = |run: &crate::recording::Run| run.recording.theta_is_integral || run.kind == RunKind::CrossAxis;
        if (gain.abs() - 1.0).abs() < SCALE_FACTOR || campaign.runs.iter().any(states_it) {
            return Self::Stated;
        }
        // the commands of loops that hold a pattern
        let has_loops = campaign.runs.iter().any(|run| run.recording.vas_v.is_some() || run.recording.vqc_v.is_some());
        if has_loops || !SCALE_FACTORS.contains(&gain.abs()) || follows_its_own_angle(campaign, gain) {
            return Self::No;
        }
        Self::ByItsErrors(gain)
    }

    /// What has to be said of it.
    pub(super) fn said(self) -> Option<String> {
        let Self::ByItsErrors(gain) = self else { return None };
        Some(format!(
            "angular_gain = {gain} may be that of a vibration's pattern or the scale factor of a rate gyroscope: the second was taken, because \
             the error of theta_deg does not follow the second and fourth harmonics of theta_deg; period_deg = 180 states a pattern"
        ))
    }
}

/// Harmonics of the angle itself predict parts of the fitted runs that were left out.
fn follows_its_own_angle(campaign: &Campaign, gain: f64) -> bool {
    let period = campaign.period_deg.unwrap_or(360.0).to_radians();
    let runs = campaign.runs.iter().enumerate();
    let Ok(runs) = runs.map(|(i, run)| SensorRun::new(run.clone(), i, campaign.reference)).collect::<Result<_, _>>()
    else {
        return false;
    };
    let Ok((fitted, _)) = apart(runs) else { return false };
    let fitted = thinned(&fitted);
    if fitted.iter().all(|run| span(&run.reference_rad) * gain.abs() < HALF_A_TURN) {
        return false;
    }
    let Ok(sensor) = Sensor::new(Some(gain), period, &fitted) else { return false };
    let Some(stretches) = stretches(&fitted, &sensor, 0.0) else { return false };
    let gained = gained(&stretches, &fitted);
    let n = gained.len() as f64;
    let mean = gained.iter().sum::<f64>() / n;
    let deviation = (gained.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    mean + T_PARTS * deviation < 0.0
}

/// Logarithms by which harmonics of the angle change the mean square of each part that is left out.
fn gained(stretches: &[Stretch], runs: &[SensorRun]) -> Vec<f64> {
    let terms = [Term::Bias, Term::Scale, Term::Lag];
    let all = rows(stretches, &terms);
    let mut parts = Vec::new();
    let mut first = 0;
    for stretch in stretches {
        parts.extend(stretch.edges(PARTS).windows(2).map(|part| first + part[0]..first + part[1]));
        first += stretch.error.len();
    }
    let angles = runs.iter().flat_map(|run| match &run.reading {
        Reading::Angle(theta) => theta.as_slice(),
        Reading::Channels(_) => &[],
    });
    let with: Vec<Vec<f64>> = all
        .iter()
        .zip(angles)
        .map(|((row, _), theta)| {
            let harmonics = HARMONICS.iter().flat_map(|n| <[f64; 2]>::from((n * theta).sin_cos()));
            row.iter().copied().chain(harmonics).collect()
        })
        .collect();
    let left = |out: &std::ops::Range<usize>, unknowns: usize| {
        let mut equations = NormalEquations::new(unknowns);
        for (at, (row, (_, error))) in with.iter().zip(&all).enumerate() {
            if !out.contains(&at) {
                equations.add(&row[..unknowns], *error);
            }
        }
        let values = equations.solve();
        let left = out.clone().map(|at| all[at].1 - with[at].iter().zip(&values).map(|(a, b)| a * b).sum::<f64>());
        variance(&left.collect::<Vec<_>>()).ln()
    };
    let most = terms.len() + 2 * HARMONICS.len();
    parts.iter().filter(|part| part.len() > 1).map(|part| left(part, most) - left(part, terms.len())).collect()
}
