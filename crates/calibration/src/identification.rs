//! The main job: a campaign in, the identified instrument out. What kind of instrument it is decides which rooms it goes
//! through.

use crate::angle_sensor;
use crate::carrier;
use crate::data::channel_ranges::require_one_unit;
use crate::data::copies::without_copies;
use crate::error::Refusal;
use crate::free_decay;
use crate::identified::{Identification, Options, not_tried};
use crate::rate_table;
use crate::recording::{Campaign, Instrument, Reference, RunKind};
use crate::report::RunReport;
use crate::report::recorded::run_report;

/// Identifies the instrument of a campaign.
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub fn identify(campaign: Campaign, options: &Options<'_>) -> Result<Identification, Refusal> {
    run(campaign, options, false)
}

/// [`identify`], with the curves of a report's figures.
///
/// # Errors
/// As [`identify`].
pub fn identify_with_plots(campaign: Campaign, options: &Options<'_>) -> Result<Identification, Refusal> {
    run(campaign, options, true)
}

fn run(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    let mut campaign = carrier::demodulated(campaign)?;
    let mut warnings = std::mem::take(&mut campaign.warnings);
    let copies = without_copies(&mut campaign, &mut warnings);
    let mut identified = without_doubles(campaign, options, with_plots)?;
    identified.report.warnings.extend(warnings);
    let left_out = |r| RunReport { r#use: "left out".into(), agrees: Some(false), ..run_report(r) };
    identified.report.runs.extend(copies.iter().map(left_out));
    Ok(identified)
}

/// A campaign in which every recording is there once.
fn without_doubles(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    if free_decay::serves(&campaign) {
        let mut identified = free_decay::identify(campaign, options, with_plots)?;
        identified.report.warnings.extend(not_tried(&options.effects, "effects as text do not compete in free decays"));
        return Ok(identified);
    }
    let (campaign, decays) = free_decay::apart(campaign);
    let mut identified = looped(campaign, options, with_plots)?;
    if let Some(decays) = decays {
        free_decay::beside(&mut identified, decays, options);
    }
    Ok(identified)
}

/// An instrument whose loops are closed, or that has none.
fn looped(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    require_a_reference(&campaign)?;
    require_one_unit(&campaign)?;
    if angle_sensor::serves(&campaign) {
        return angle_sensor::identify(campaign, options, with_plots);
    }
    rate_table::identify(campaign, options, with_plots)
}

/// An identification has an angle and what it should be in every run that turns.
fn require_a_reference(campaign: &Campaign) -> Result<(), Refusal> {
    if let Some(run) = campaign.runs.iter().find(|r| r.kind == RunKind::Static) {
        let name = run.file.display().to_string();
        return Err(Refusal::new(&name, "a run at rest has no angular gain", "cvg_calibration::answer"));
    }
    if let Some(run) = campaign.runs.iter().find(|r| r.kind == RunKind::Virtual) {
        let name = run.file.display().to_string();
        return Err(Refusal::new(&name, "virtual precession has no reference", "cvg_calibration::answer"));
    }
    if let Some(run) = campaign.runs.iter().find(|r| r.kind == RunKind::CrossAxis)
        && !angle_sensor::is_rate_gyroscope(campaign)
    {
        let wanted =
            "runs with theta_deg alone, kind = \"rotation\" about the input axis among them, and period_deg = 360.0";
        let what = "a run across the input axis is one of a rate gyroscope";
        return Err(Refusal::new(&run.file.display().to_string(), what, wanted));
    }
    if campaign.pole_pairs.is_some() && campaign.instrument != Instrument::Sensor {
        let wanted = "instrument = \"sensor\" in [campaign], or no pole_pairs";
        return Err(Refusal::new("campaign", "pole_pairs is of an angle sensor, and this is a gyroscope", wanted));
    }
    if campaign.reference == Some(Reference::Absent) {
        let wanted = "rate_dps or table_deg, or instrument = \"sensor\"";
        return Err(Refusal::new(
            "campaign",
            "reference = \"none\": there is nothing to tell an angle error against",
            wanted,
        ));
    }
    Ok(())
}
