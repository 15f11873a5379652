//! Misalignment of a rate gyroscope: what it reads of turns about an axis across its input axis.
//!
//! About an axis that should be at a right angle to the input axis, an input axis that is off by γ reads
//!
//! $$θ = b\\,t + k\\sin γ\\,α + \text{const}$$
//!
//! of a table's angle α. One such run identifies the component of the misalignment towards its axis, where it turns there and
//! back: at one rate γ and the bias are one number. About the input axis itself a misalignment is a factor cos γ of the scale
//! factor, and no recording of that axis separates the two.

use super::rate_alone::found;
use super::rate_gyroscope::tell_scale;
use super::rate_regression::{Stretch, Term};
use super::samples::SensorRun;
use super::sensor::Sensor;
use crate::error::Refusal;
use crate::facts::{Estimate, Misalignment, Report};
use crate::recording::{Campaign, Run, RunKind};

/// What reads this share of the scale factor, 30°, was turned about no axis across.
const ACROSS: f64 = 0.5;

/// Takes the runs across the input axis out of a campaign.
pub(super) fn take(campaign: &mut Campaign) -> Vec<Run> {
    let (across, others) = std::mem::take(&mut campaign.runs).into_iter().partition(|r| r.kind == RunKind::CrossAxis);
    campaign.runs = others;
    across
}

/// Adds to the report of a rate gyroscope what runs across its input axis say.
///
/// # Errors
/// Where a run has no rows.
pub(super) fn add(report: &mut Report, across: Vec<Run>) -> Result<(), Refusal> {
    let scale = report.angular_gain;
    for (number, run) in across.into_iter().enumerate() {
        let file = run.file.display().to_string();
        let (angle_deg, reason) = match misalignment(&SensorRun::new(run, number, None)?, scale) {
            Ok(angle) => (Some(angle), None),
            Err(reason) => (None, Some(reason)),
        };
        report.misalignment.push(Misalignment { file, angle_deg, reason });
    }
    Ok(())
}

/// γ, deg, of a gyroscope with this scale factor k, whose sense is that of −k.
fn misalignment(run: &SensorRun, k: Estimate) -> Result<Estimate, String> {
    let period = std::f64::consts::TAU;
    // of nothing of the reference: the whole angle is what is regressed
    let none = Sensor { gain: 0.0, free_gain: false, period, cycles: 1.0 };
    let stretch = Stretch::new(run, 0, &none, 0.0).ok_or("there is no angle")?;
    let stretch = [stretch];
    if !tell_scale(&stretch) {
        return Err(
            "the table turns at one rate, at which a misalignment and the bias are one: a run there and back".into()
        );
    }
    let [_, reads] = found(&stretch, &[Term::Bias, Term::Scale]).ok_or("there are too few rows")?;
    let share = |v: f64| -v / k.value;
    if share(reads.value).abs() > ACROSS {
        return Err(format!(
            "the output turns {:.3} times as far as the table: that is no axis across the input axis",
            reads.value
        ));
    }
    let angle = |v: f64| share(v).clamp(-1.0, 1.0).asin().to_degrees();
    let [one, other] = reads.ci95.map(angle);
    Ok(Estimate { value: angle(reads.value), ci95: [one.min(other), one.max(other)] })
}
