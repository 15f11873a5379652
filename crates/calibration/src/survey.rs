//! What a campaign tells, whatever it is of: an identification where there is an angle and what it should be, and a survey
//! where there is not.

use crate::angle_sensor::curve::Curve;
use crate::angle_sensor::{likeness, reference_free};
use crate::carrier;
use crate::diagnostics::at_rest;
use crate::diagnostics::temperature::{Seen, temperature};
use crate::error::Refusal;
use crate::identification::identify_with_plots;
use crate::identified::{Identification, Options, not_tried};
use crate::recording::{Campaign, Run};
use crate::report::calibration::Calibration;
use crate::report::recorded::run_report;
use crate::report::survey::Survey;
use crate::report::worded::once_a_kind;
use crate::report::{Allan, Estimate, RunReport, provenance};
use crate::virtual_precession;

/// What a campaign told.
#[derive(Debug, Clone)]
pub enum Answer {
    /// an instrument, identified against a reference
    Identified(Box<Identification>),
    /// what can be told without one
    Surveyed(Box<Surveyed>),
}

/// What was told without a reference.
#[derive(Debug, Clone)]
pub struct Surveyed {
    /// the facts
    pub report: Survey,
    /// what to compensate with, where something was identified
    pub calibration: Option<Calibration>,
    /// what the channels draw, where they turn
    pub curve: Option<Curve>,
}

/// What the runs at rest of a campaign told.
struct Rest {
    allan: Allan,
    runs: Vec<RunReport>,
    warnings: Vec<String>,
}

/// Answers a campaign: runs at rest by the Allan deviation of their angle, a sensor without a reference by its radius, virtual
/// precession and unknown rotation by the filter that flies, all else by [`crate::identify()`].
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub fn answer(campaign: Campaign, options: &Options<'_>) -> Result<Answer, Refusal> {
    let mut answer = told(campaign, options)?;
    match &mut answer {
        Answer::Identified(identified) => once_a_kind(&mut identified.report.warnings, &identified.report.runs),
        Answer::Surveyed(surveyed) => once_a_kind(&mut surveyed.report.warnings, &surveyed.report.runs),
    }
    Ok(answer)
}

fn told(campaign: Campaign, options: &Options<'_>) -> Result<Answer, Refusal> {
    // first of all: what looks at the rows of a recording copies them
    let mut campaign = carrier::demodulated(campaign)?;
    if virtual_precession::serves(&campaign) {
        let mut surveyed = virtual_precession::identify(&campaign, options)?;
        surveyed
            .report
            .warnings
            .extend(not_tried(&options.effects, "effects as text do not compete in virtual precession"));
        return Ok(Answer::Surveyed(Box::new(surveyed)));
    }
    let hint = likeness::hint(&campaign);
    let files = provenance::files(&campaign);
    let at_rest = at_rest::take(&mut campaign);
    let rest = if at_rest.is_empty() { None } else { Some(rest(&at_rest, &campaign, options)?) };
    let surveyed = campaign.runs.is_empty() || reference_free::serves(&campaign);
    if surveyed {
        return survey(campaign, rest, provenance::sums(&files), options);
    }
    let mut identified = identify_with_plots(campaign, options).map_err(|mut refusal| {
        if let Some(hint) = hint {
            refusal.wanted = format!("{}; {hint}", refusal.wanted);
        }
        refusal
    })?;
    let report = &mut identified.report;
    report.warnings.extend(hint.map(str::to_owned));
    if let Some(rest) = rest {
        report.inputs = provenance::sums(&files);
        report.runs.extend(rest.runs);
        report.warnings.extend(rest.warnings);
        report.allan = Some(rest.allan);
    }
    Ok(Answer::Identified(Box::new(identified)))
}

fn rest(runs: &[Run], campaign: &Campaign, options: &Options<'_>) -> Result<Rest, Refusal> {
    (options.progress)("the Allan deviation at rest");
    let (allan, rates, mut warnings) = at_rest::allan(runs, campaign.instrument, campaign.period_deg)?;
    warnings.splice(0..0, runs.iter().flat_map(|r| r.recording.warnings.iter().cloned()));
    let told = |(run, rate): (&Run, Estimate)| RunReport { bias_dps: Some(rate), ..run_report(run) };
    Ok(Rest { allan, runs: runs.iter().zip(rates).map(told).collect(), warnings })
}

fn survey(
    campaign: Campaign,
    rest: Option<Rest>,
    inputs: Vec<crate::report::Input>,
    options: &Options<'_>,
) -> Result<Answer, Refusal> {
    let instrument = campaign.instrument.name();
    let runs = campaign.runs.iter().map(run_report).collect();
    let ratios = reference_free::own_ratios(&campaign);
    let mut report = Survey::new(campaign.device.clone(), instrument, inputs, runs);
    report.runs.iter_mut().zip(ratios).for_each(|(run, ratio)| run.detection_gain_ratio = ratio);
    report.warnings = campaign.all_warnings().map(str::to_owned).collect();
    let why = "effects as text compete where an angle is measured against a reference, and here is none";
    report.warnings.extend(not_tried(&options.effects, why));
    let (mut calibration, mut curve) = (None, None);
    if !campaign.runs.is_empty() {
        (options.progress)("fitting what the channels draw");
        let told = reference_free::identify(campaign)?;
        (report.status, report.reason) = (told.status, told.reason);
        (report.detection_gain_ratio, report.effects) = (told.detection_gain_ratio, told.effects);
        report.radius = Some(told.radius);
        report.warnings.extend(told.warnings);
        (calibration, curve) = (Some(told.calibration), Some(told.curve));
    }
    if let Some(rest) = rest {
        report.runs.extend(rest.runs);
        report.warnings.extend(rest.warnings);
        report.allan = Some(rest.allan);
    }
    let seen: Vec<Seen> = report.runs.iter().filter_map(|r| Some(Seen::of(r, None, r.temp_c?))).collect();
    report.temperature = temperature(&seen, 1.0);
    Ok(Answer::Surveyed(Box::new(Surveyed { report, calibration, curve })))
}
