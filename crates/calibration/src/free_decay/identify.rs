//! The main job for free decays: runs made ready, terms chosen on the fitted part, the held-out part read once, and the
//! values that leave the program fitted to all that may be fitted.

use super::agreement::{Verdict, verdict};
use super::errors::{Part, after, raw};
use super::fit::{Data, Fit, fit};
use super::model::{Start, Term};
use super::phase::phase;
use super::report::{Errors, Finding, estimate, report};
use super::runs::DecayRun;
use super::selection::{
    Chosen, beside_unseen_readout, choose, instead, is_declared, is_sound, one_rate, unseen_near_one_angle,
    unseen_phase,
};
use crate::error::Refusal;
use crate::identified::{Identification, Options};
use crate::recording::{Campaign, RunKind};
use crate::report::provenance;
use crate::report::recorded::run_report;
use crate::report::{Input, RunReport};

/// A campaign of decays alone.
pub(crate) fn serves(campaign: &Campaign) -> bool {
    !campaign.runs.is_empty() && campaign.runs.iter().all(|r| r.kind == RunKind::Decay)
}

/// A campaign without its decays, and its decays, where it has both.
pub(crate) fn apart(mut campaign: Campaign) -> (Campaign, Option<Campaign>) {
    if serves(&campaign) || campaign.runs.iter().all(|r| r.kind != RunKind::Decay) {
        return (campaign, None);
    }
    let runs = std::mem::take(&mut campaign.runs);
    let (decays, others) = runs.into_iter().partition(|r| r.kind == RunKind::Decay);
    let decays = Campaign { runs: decays, ..campaign.clone() };
    campaign.runs = others;
    (campaign, Some(decays))
}

/// Puts what decays tell beside what the other runs of a campaign told.
pub(crate) fn beside(identified: &mut Identification, decays: Campaign, options: &Options<'_>) {
    let runs: Vec<RunReport> = decays.runs.iter().map(run_report).collect();
    let report = &mut identified.report;
    match identify(decays, options, false) {
        Ok(of_decays) => {
            report.runs.extend(of_decays.report.runs);
            for input in of_decays.report.inputs {
                if !report.inputs.contains(&input) {
                    report.inputs.push(input);
                }
            }
            report.warnings.extend(of_decays.report.warnings);
            report.warnings.push(
                "the free decays were identified by themselves: what they tell stands under `decay`, and nothing of it is \
                 taken into the calibration"
                    .into(),
            );
            report.decay = of_decays.report.decay;
        }
        Err(refused) => {
            report.runs.extend(runs);
            report.warnings.push(format!("the free decays tell nothing: {refused}"));
        }
    }
}

/// What the campaign says of itself, kept while its recordings are taken apart.
pub(crate) struct Head {
    pub(crate) device: String,
    pub(crate) stated_gain: Option<f64>,
    pub(crate) references_hz: Vec<Option<f64>>,
    pub(crate) runs: Vec<RunReport>,
    pub(crate) inputs: Vec<Input>,
    pub(crate) warnings: Vec<String>,
}

impl Head {
    fn of(campaign: &Campaign) -> Self {
        Self {
            device: campaign.device.clone(),
            stated_gain: campaign.angular_gain,
            references_hz: campaign.runs.iter().map(|r| r.recording.reference_hz).collect(),
            runs: campaign.runs.iter().map(run_report).collect(),
            inputs: provenance::sums(&provenance::files(campaign)),
            warnings: campaign.all_warnings().map(str::to_owned).collect(),
        }
    }

    /// Says that a run is left out.
    fn leave_out(&mut self, run: &DecayRun) {
        let why = "it does not agree with the other decays, which agree without it";
        self.warnings.push(format!("{}: left out: {why}", run.name));
        if let Some(r) = self.runs.get_mut(run.number) {
            (r.agrees, r.r#use) = (Some(false), "left out".into());
        }
    }
}

/// Part of a run, in four parts, that is held out where no run is.
const FITTED_QUARTERS: usize = 3;

/// Identifies a campaign that [`serves`].
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub(crate) fn identify(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    let mut head = Head::of(&campaign);
    (options.progress)("preparing the decays");
    let runs: Vec<DecayRun> =
        campaign.runs.iter().enumerate().map(|(i, r)| DecayRun::new(i, r)).collect::<Result<_, _>>()?;
    drop(campaign);
    let (held, fitted): (Vec<DecayRun>, Vec<DecayRun>) = runs.into_iter().partition(|r| r.held);
    if fitted.is_empty() {
        return Err(Refusal::new("campaign", "no decay is left to fit", "a run with use = \"fit\""));
    }
    let Agreed { fitted, counts, mut chosen, times_as_wide } = agreed(fitted, &held, &mut head, options)?;
    let whole: Vec<usize> = fitted.iter().map(DecayRun::len).collect();
    (options.progress)("measuring the held-out error");
    let declared = Errors::of(&held, &fitted, &counts, &chosen.declared, &chosen.declared);
    let mut errors = Errors::of(&held, &fitted, &counts, &chosen.declared, &chosen.discovered);
    if errors.worse_than(&errors.declared) {
        head.warnings.push(format!(
            "what the paper's model lacks was not taken: on held-out data it leaves {:.4e}°, and without it {:.4e}° are left",
            errors.after.size().rms_deg,
            errors.declared.size().rms_deg
        ));
        chosen.added.retain(|a| is_declared(a.term));
        chosen.discovered = chosen.declared.clone();
        errors = declared;
    }
    (options.progress)("fitting what was chosen to all stretches");
    let all = Data { runs: &fitted, counts: &whole };
    let of_all = |f: &Fit| {
        let of_all = if held.is_empty() { fit(&f.model, &f.starts, all) } else { f.clone() };
        of_all.widened(times_as_wide)
    };
    let mut final_fit = of_all(&chosen.discovered);
    sound(&final_fit, &head.device)?;
    decays(&final_fit, &head.device)?;
    (options.progress)("fitting what explains the decays as well");
    let instead = instead(&chosen.added, &final_fit, all);
    // where a phase explains them as well by itself, what lies between is held by that
    let is_held = !chosen.many_angles || instead.iter().any(|other| other.by == Term::Phase);
    let unseen = if is_held || !one_rate(&fitted) { None } else { unseen_phase(&final_fit, all) };
    let phase = phase(&final_fit.model, &final_fit.starts, &fitted);
    let detuning = phase.as_ref().map_or(0.0, |p| p.per_energy.0.abs() + 2.0 * p.per_energy.1);
    let hidden = if chosen.many_angles { Vec::new() } else { unseen_near_one_angle(&final_fit, detuning, all) };
    final_fit = instead.iter().fold(final_fit, |f, other| f.or(&other.model));
    let seen = final_fit.clone();
    final_fit = beside_unseen_readout(final_fit, chosen.many_angles, all);
    final_fit = unseen.iter().chain(&hidden).fold(final_fit, Fit::beside);
    let final_declared =
        if chosen.added.iter().all(|a| is_declared(a.term)) { final_fit.clone() } else { of_all(&chosen.declared) };
    let finding = Finding { chosen, fit: final_fit, seen, declared: final_declared, instead, unseen, phase, errors };
    report(head, &finding, &fitted, &held, with_plots)
}

/// Runs that agree, with what was chosen from them.
struct Agreed {
    fitted: Vec<DecayRun>,
    /// stretches that may be fitted before errors are measured
    counts: Vec<usize>,
    chosen: Chosen,
    /// intervals are to be so many times as wide, for what the runs differ in
    times_as_wide: f64,
}

/// Chooses the terms, and leaves out runs that do not agree with the rest.
fn agreed(
    mut fitted: Vec<DecayRun>,
    held: &[DecayRun],
    head: &mut Head,
    options: &Options<'_>,
) -> Result<Agreed, Refusal> {
    loop {
        let quarters = if held.is_empty() { FITTED_QUARTERS } else { 4 };
        let counts: Vec<usize> = fitted.iter().map(|r| r.len() * quarters / 4).collect();
        let data = Data { runs: &fitted, counts: &counts };
        (options.progress)("fitting the equation of motion");
        let chosen = choose(data, options.discover, options.progress);
        sound(&chosen.discovered, &head.device)?;
        let times_as_wide = match verdict(&chosen.discovered, data, options.progress)? {
            Verdict::Agree => 1.0,
            Verdict::Wide(times, why) => {
                head.warnings
                    .push(format!("{why}: the decays do not agree, and intervals are {times:.0} times as wide"));
                times
            }
            Verdict::Out(odd) => {
                let (out, rest): (Vec<_>, Vec<_>) =
                    fitted.into_iter().enumerate().partition(|(at, _)| odd.contains(at));
                out.iter().for_each(|(_, run)| head.leave_out(run));
                fitted = rest.into_iter().map(|(_, run)| run).collect();
                continue;
            }
        };
        return Ok(Agreed { fitted, counts, chosen, times_as_wide });
    }
}

fn sound(fit: &Fit, device: &str) -> Result<(), Refusal> {
    if is_sound(fit) {
        return Ok(());
    }
    Err(Refusal::no_answer(
        device,
        "the equation of motion does not follow these decays",
        "decays without loops or forces, longer ones, or at several starting angles",
    ))
}

/// Refuses what is not seen to decay: damping that may be nothing.
fn decays(fit: &Fit, device: &str) -> Result<(), Refusal> {
    let e = estimate(fit, Term::Damping);
    if e.ci95[0] > 0.0 {
        return Ok(());
    }
    Err(Refusal::no_answer(
        device,
        format!("these are no decays that are seen: 1/τ is {:.3e} ± {:.1e} 1/s", e.value, e.half_width()),
        "decays without loops or forces, long enough that the amplitude falls, and of the carrier that decays",
    ))
}

impl Errors {
    /// The errors of the held-out runs, or of the last quarter of all.
    fn of(held: &[DecayRun], fitted: &[DecayRun], counts: &[usize], declared: &Fit, discovered: &Fit) -> Self {
        let found = after(&parts(held, fitted, counts, discovered), &discovered.model, None);
        let declared = after(&parts(held, fitted, counts, declared), &declared.model, Some(&found));
        Self { raw: raw(&parts(held, fitted, counts, discovered), &found), declared, after: found }
    }
}

/// The held-out runs, or what follows the first `counts` stretches of the fitted ones.
fn parts<'a>(held: &'a [DecayRun], fitted: &'a [DecayRun], counts: &[usize], fit: &'a Fit) -> Vec<Part<'a>> {
    if !held.is_empty() {
        return held.iter().map(|run| Part { run, from: 0, start: None }).collect();
    }
    let of = |((run, from), start): ((&'a DecayRun, &usize), &'a Start)| Part { run, from: *from, start: Some(start) };
    fitted.iter().zip(counts).zip(&fit.starts).map(of).collect()
}
