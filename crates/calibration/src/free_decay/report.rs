//! The report of free decays, in the form that all instruments share: what was found, how sure it is, what is left.

use cvg_model::effects::{EffectId, Shown};

use super::effects::{effects, name};
use super::errors::{Part, after, in_volts, raw};
use super::fit::{Fit, Unseen};
use super::identify::Head;
use super::model::{OFFSETS, Term};
use super::phase::Phase;
use super::runs::DecayRun;
use super::selection::{BELIEVED_GAIN, BELIEVED_PHASE_RAD, Chosen, Instead, one_rate};
use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::plots::plots_of;
use crate::diagnostics::residual::{
    WHITENESS_LAGS, WHITENESS_LEVEL, autocorrelation, inflation, ljung_box, reported_harmonics,
};
use crate::error::Refusal;
use crate::facts::Follows;
use crate::identified::{BiasCurve, Figures, Identification};
use crate::model::hypothesis::{Hypothesis, Member, Origin};
use crate::recording::Instrument;
use crate::report::benefit::no_help;
use crate::report::calibration::{Calibration, Provenance};
use crate::report::gate::{self, Facts};
use crate::report::recorded::set_aside;
use crate::report::stages::stages;
use crate::report::{
    DecayReport, EffectReport, Estimate, Heldout, Report, ResidualReport, RunReport, SCHEMA, Status, StepReport, Tool,
};

/// Held-out errors at the three stages.
#[derive(Debug, Clone)]
pub(crate) struct Errors {
    pub(crate) raw: Evaluation,
    pub(crate) declared: Evaluation,
    pub(crate) after: Evaluation,
}

/// Standard errors of a root mean square by which one that is larger is so by no chance.
const NO_CHANCE: f64 = 3.0;
/// More than this share is no chance, however long what is left remembers: one slow wave of it would excuse anything.
const MOST_BY_CHANCE: f64 = 0.1;

impl Errors {
    /// What was found leaves a larger held-out error than that, and by no chance.
    pub(crate) fn worse_than(&self, other: &Evaluation) -> bool {
        let count = self.held_out();
        let remembered = inflation(&autocorrelation(&self.after, WHITENESS_LAGS), count);
        let by_chance = (NO_CHANCE * (remembered / (2.0 * count.max(1) as f64)).sqrt()).min(MOST_BY_CHANCE);
        self.after.size().rms_deg > other.size().rms_deg * (1.0 + by_chance)
    }

    /// Stretches that the errors are counted on.
    pub(crate) fn held_out(&self) -> usize {
        self.after.errors().count()
    }
}

/// What an identification of decays found.
pub(crate) struct Finding {
    pub(crate) chosen: Chosen,
    /// what was chosen, fitted to all that may be fitted
    pub(crate) fit: Fit,
    /// the same with intervals by what was seen alone
    pub(crate) seen: Fit,
    /// the paper's terms alone, on the same
    pub(crate) declared: Fit,
    /// what explains the decays as well as a term that was chosen; the intervals hold it
    pub(crate) instead: Vec<Instead>,
    /// the phase between the channels that may be there although nothing shows it; the intervals hold it
    pub(crate) unseen: Option<Unseen>,
    pub(crate) phase: Option<Phase>,
    pub(crate) errors: Errors,
}

/// Points of one curve.
const CURVE_POINTS: usize = 2000;
/// Seconds of an hour, and degrees per hour of a rad/s.
const SECONDS_PER_HOUR: f64 = 3600.0;
/// rad
const MRAD: f64 = 1e-3;

/// Reports.
///
/// # Errors
/// [`Refusal`] where a number is none.
pub(crate) fn report(
    head: Head,
    finding: &Finding,
    fitted: &[DecayRun],
    held: &[DecayRun],
    with_plots: bool,
) -> Result<Identification, Refusal> {
    let Errors { raw: raw_errors, declared, after: found } = &finding.errors;
    let on_fit = whole(fitted, &finding.fit);
    let white =
        ljung_box(&autocorrelation(&in_volts(&on_fit), WHITENESS_LAGS), on_fit.errors().count()) >= WHITENESS_LEVEL;
    let effects = effects(finding, fitted);
    let mut warnings = head.warnings.clone();
    warnings.extend(remarks(finding, fitted, held, &head));
    // a slow rotation may tell everything but the gain
    let gain = Some(estimate(&finding.fit, Term::AngularGain))
        .filter(|e| finding.fit.model.has(Term::AngularGain) && gate::gain_is_told(e));
    if finding.fit.model.has(Term::AngularGain) && gain.is_none() {
        warnings.push("the campaign cannot tell the angular gain: `decay` has the precession rate itself".into());
    }
    let (hypothesis, stated) = (hypothesis(finding, &head), head.stated_gain);
    let mut steps = stages(Some(raw_errors), declared, found, &[]);
    steps.extend(effects.iter().filter(|e| e.origin != Origin::Declared).map(|e| step(e, finding)));
    let names: Vec<String> = if held.is_empty() { fitted } else { held }.iter().map(|r| r.name.clone()).collect();
    let plots = with_plots.then(|| plots_of(&names, Some(raw_errors), declared, found, &hypothesis));
    let mut report = Report {
        schema: SCHEMA.into(),
        status: Status::Answered,
        reason: None,
        tool: Tool::default(),
        inputs: head.inputs.clone(),
        device: head.device.clone(),
        instrument: "gyroscope".into(),
        angular_gain: gain.unwrap_or_else(Estimate::unknown),
        detection_gain_ratio: finding.fit.model.has(Term::GainRatio).then(|| {
            let e = estimate(&finding.fit, Term::GainRatio);
            Estimate { value: 1.0 + e.value, ci95: e.ci95.map(|end| 1.0 + end) }
        }),
        actuation_gain_ratio: None,
        effects,
        heldout: Heldout {
            raw: Some(raw_errors.size()),
            declared: declared.size(),
            discovered: found.size(),
            noise_floor_deg: found.noise_floor().to_degrees(),
        },
        steps,
        residual: ResidualReport { harmonics: reported_harmonics(found, Follows::Pattern, found), white },
        channels: Vec::new(),
        unexplained: Vec::new(),
        runs: runs(&head, fitted, held, &on_fit, found),
        decomposition: Vec::new(),
        proposals: Vec::new(),
        scale_factor: None,
        repeatability_ppm: None,
        misalignment: Vec::new(),
        allan: None,
        temperature: None,
        decay: Some(decay(finding, fitted, &head)),
        warnings,
    };
    let figures = Figures { bias: curves(&names, raw_errors, declared, found), ..Figures::default() };
    let provenance = Provenance { tool: Some(Tool::default()), inputs: head.inputs, ..Provenance::default() };
    let mut calibration = Calibration { device: head.device, hypothesis, provenance };
    let facts = Facts {
        instrument: Instrument::Gyroscope,
        period_deg: 180.0,
        tells_gain: gain.is_some(),
        stated,
        held_out: finding.errors.held_out(),
        fitted_rms_deg: on_fit.size().rms_deg,
    };
    gate::pass(&report, &calibration, facts)?;
    if finding.errors.worse_than(raw_errors) {
        let reason = no_help(&report.heldout);
        (report.status, report.reason) = (Status::Neutral, Some(reason.clone()));
        report.warnings.insert(0, reason);
        calibration.hypothesis.members.clear();
    }
    Ok(Identification { report, calibration, figures, steps: Vec::new(), plots })
}

pub(crate) fn estimate(fit: &Fit, term: Term) -> Estimate {
    Estimate::new(fit.model.value(term), fit.deviation(term))
}

/// Errors of whole runs under a model that was fitted to them.
pub(crate) fn whole(runs: &[DecayRun], fit: &Fit) -> Evaluation {
    after(&parts(runs, fit), &fit.model, None)
}

/// Their angle, less its best line.
pub(crate) fn whole_raw(runs: &[DecayRun], fit: &Fit) -> Evaluation {
    raw(&parts(runs, fit), &whole(runs, fit))
}

fn parts<'a>(runs: &'a [DecayRun], fit: &'a Fit) -> Vec<Part<'a>> {
    runs.iter().zip(&fit.starts).map(|(run, start)| Part { run, from: 0, start: Some(start) }).collect()
}

/// θ̇ of the input at the mean rate of the runs, deg/h; none where they were turned at different rates, whose mean is no run's.
fn precession(fit: &Fit, runs: &[DecayRun]) -> Estimate {
    let per_hour = SECONDS_PER_HOUR.to_degrees();
    if fit.model.has(Term::Precession) {
        let e = estimate(fit, Term::Precession);
        return Estimate { value: per_hour * e.value, ci95: e.ci95.map(|end| per_hour * end) };
    }
    let rate = runs.iter().map(DecayRun::mean_rate).sum::<f64>() / runs.len().max(1) as f64;
    if !one_rate(runs) {
        return Estimate::unknown();
    }
    let (k, deviation) = (fit.model.value(Term::AngularGain), fit.deviation(Term::AngularGain));
    Estimate::new(-per_hour * k * rate, per_hour * deviation * rate.abs())
}

fn decay(finding: &Finding, runs: &[DecayRun], head: &Head) -> DecayReport {
    let damping = estimate(&finding.fit, Term::Damping);
    let ahead = finding.phase.as_ref().map(|p| p.ahead_rad_s.as_slice()).unwrap_or_default();
    let frequencies = runs.iter().zip(ahead).filter_map(|(r, ahead)| {
        let reference = head.references_hz.get(r.number).copied().flatten()?;
        Some(reference + ahead / std::f64::consts::TAU)
    });
    let all: Vec<f64> = frequencies.collect();
    let told = finding.phase.as_ref().filter(|p| p.gain > super::selection::BELIEVED);
    DecayReport {
        damping_per_s: damping,
        tau_s: Estimate { value: 1.0 / damping.value, ci95: [1.0 / damping.ci95[1], 1.0 / damping.ci95[0]] },
        precession_dph: precession(&finding.fit, runs),
        precession_dph_declared: precession(&finding.declared, runs),
        carrier_hz: (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64),
        frequency_per_energy: told.map(|p| Estimate::new(p.per_energy.0, p.per_energy.1)),
        many_angles: finding.chosen.many_angles,
        rms_deg: [
            whole_raw(runs, &finding.fit).size().rms_deg,
            whole(runs, &finding.declared).size().rms_deg,
            whole(runs, &finding.fit).size().rms_deg,
        ],
    }
}

/// What a reader must know.
fn remarks(finding: &Finding, fitted: &[DecayRun], held: &[DecayRun], head: &Head) -> Vec<String> {
    let mut out = Vec::new();
    if !finding.chosen.many_angles {
        out.push(format!(
            "the pattern stands near one angle: what anisodamping adds to precession and to the decay cannot be separated from \
             them there, of the split only what lies at 45° to the pattern shows, and a scale of y that is 1 % larger than \
             that of x makes the precession {:+.2} % larger. The intervals hold an anisodamping of a tenth of 1/τ, gains and axes \
             that are 1.3 % off, and a spring as far as the frequency follows the energy; where none of these is there the \
             precession is known to ±{:.3} deg/h. Decays at several starting angles would tell",
            (2.0 * finding.fit.model.axis_rad).cos(),
            precession(&finding.seen, fitted).half_width()
        ));
    }
    for other in &finding.instead {
        out.push(format!(
            "{} explains these decays as well as {} of {:.3e}: the intervals hold both, and decays at another rate would tell",
            format_args!("{} of {:.3e}", name(other.by), other.model.value(other.by)),
            name(other.of),
            finding.fit.model.value(other.of)
        ));
    }
    out.extend(unseen(finding, fitted));
    if finding.fit.model.has(Term::Precession) {
        let known = fitted.iter().any(|r| r.rate_is_known);
        let why = if known { "the input rate is zero" } else { "the input rate is not stated" };
        out.push(format!("{why}: the angular gain is not identifiable, and `decay` has the precession rate itself"));
        if let Some(stated) = head.stated_gain {
            out.push(format!("the stated angular gain of {stated} was not used"));
        }
    } else if let Some(run) = fitted.iter().find(|r| !r.rate_is_known) {
        out.push(format!("{}: the input rate is not stated, and is taken as zero", run.name));
    }
    if finding.chosen.many_angles && !finding.fit.model.has(Term::GainRatio) {
        let why = if one_rate(fitted) {
            "at one rate unequal gains pass for anisodamping, but for a trace that is not seen"
        } else {
            "the decays show no sign of unequal gains"
        };
        out.push(format!("the campaign cannot tell the detection gain ratio: {why}"));
    }
    if finding.chosen.many_angles && one_rate(fitted) {
        out.push(format!(
            "all decays are at one rate, where what a readout does to the orbit passes for other mechanics: the intervals hold \
             gains and axes that are {:.1} % off and a phase of {:.0} mrad between the channels, of which only one trace is seen; \
             decays at another rate would tell them",
            100.0 * BELIEVED_GAIN,
            BELIEVED_PHASE_RAD / MRAD
        ));
    }
    out.push("a free decay has no drive: there is no actuation gain ratio".into());
    if held.is_empty() {
        out.push(
            "held-out errors are those of values fitted to the first three quarters of each decay; the values stated are \
             fitted to all of it"
                .into(),
        );
    }
    let spikes: usize = finding.fit.set_aside.iter().flatten().filter(|a| **a).count();
    out.extend(set_aside(spikes, "stretch"));
    for run in fitted.iter().chain(held).filter(|r| r.in_noise > 0) {
        let last = if run.in_noise == 1 { "last row of".to_owned() } else { format!("last {} of", run.in_noise) };
        let left_out = if run.in_noise == 1 { "was" } else { "were" };
        out.push(format!("{}: the {last} {} rows {left_out} left out, near the noise", run.name, run.rows));
    }
    out
}

/// What a phase between the channels would do that nothing shows where all decays are at one rate.
fn unseen(finding: &Finding, runs: &[DecayRun]) -> Option<String> {
    let (unseen, model) = (finding.unseen.as_ref().filter(|_| one_rate(runs))?, &finding.fit.model);
    let at = |term: Term| model.terms.iter().position(|t| *t == term).map_or(0.0, |at| unseen.by[at]);
    let turning = if model.has(Term::AngularGain) { Term::AngularGain } else { Term::Precession };
    let percent = |of: f64, by: f64| 100.0 * MRAD * by / of;
    let [along, across] = [Term::SplitAlong, Term::SplitAcross].map(|t| (model.value(t), at(t)));
    let split = along.0.hypot(across.0);
    Some(format!(
        "all decays are at one rate, where a phase between the channels is hardly separated from other mechanics: 1 mrad of it, \
         unseen, would make the precession {:+.2} % and the split {:+.2} % larger; the decays leave room for {:.3} mrad, \
         which the intervals hold, and decays at another rate would tell it",
        percent(model.value(turning), at(turning)),
        percent(split, (along.0 * along.1 + across.0 * across.1) / split),
        unseen.size / MRAD,
    ))
}

fn hypothesis(finding: &Finding, head: &Head) -> Hypothesis {
    let model = &finding.fit.model;
    let gain =
        if model.has(Term::AngularGain) { model.value(Term::AngularGain) } else { head.stated_gain.unwrap_or(1.0) };
    let mut h = Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, gain);
    h.damping_per_s = model.value(Term::Damping);
    let m = model.mechanics(0.0);
    let mut add = |id: EffectId, values, origin| h.members.push(Member { id, values, origin, refined: true });
    if finding.chosen.many_angles {
        let [c, s] = m.anisodamping;
        add(EffectId::Anisodamping, [c, s, 0.0, 0.0], Origin::Declared);
    }
    if model.has(Term::SplitAlong) {
        let [c, s] = m.anisoelasticity;
        add(EffectId::Anisoelasticity, [c, s, 0.0, 0.0], Origin::Declared);
    }
    if model.has(Term::Skew) {
        add(EffectId::DetectionSkew, [model.value(Term::Skew), 0.0, 0.0, 0.0], Origin::Discovered);
    }
    if model.has(Term::Phase) {
        add(EffectId::DetectionPhase, [model.value(Term::Phase), 0.0, 0.0, 0.0], Origin::Discovered);
    }
    if model.has(Term::GainRatio) {
        let g = 1.0 + model.value(Term::GainRatio);
        add(EffectId::DetectionGainMismatch, [g, 0.0, 0.0, 0.0], Origin::Declared);
    }
    if model.has(Term::ReadoutCubic) {
        add(EffectId::DetectionCubic, [model.value(Term::ReadoutCubic), 0.0, 0.0, 0.0], Origin::Discovered);
    }
    if model.has(OFFSETS[0]) {
        let [x, y] = [Term::OffsetXc, Term::OffsetYc].map(|t| model.value(t));
        add(EffectId::DetectionOffset, [x, y, 0.0, 0.0], Origin::Discovered);
    }
    if model.has(Term::SpringFourCos) {
        let [cos, sin] = m.spring_four;
        add(EffectId::SpringCubic, [cos, sin, 0.0, 0.0], Origin::Discovered);
    }
    h.members.sort_by_key(|m| m.id);
    h
}

fn step(e: &EffectReport, finding: &Finding) -> StepReport {
    let added = finding.chosen.added.iter().find(|a| super::effects::name(a.term) == e.id);
    StepReport {
        stage: if e.origin == Origin::Discovered { "discovered".into() } else { "empirical".into() },
        effect: Some(e.id.clone()),
        heldout: finding.errors.after.size(),
        harmonics: reported_harmonics(&finding.errors.after, Follows::Pattern, &finding.errors.after),
        signature: None,
        gain: added.map(|a| a.gain),
        rivals: added.map(super::effects::rivals).unwrap_or_default(),
        energy_balance: None,
        inconsistency: None,
    }
}

fn runs(
    head: &Head,
    fitted: &[DecayRun],
    held: &[DecayRun],
    on_fit: &Evaluation,
    found: &Evaluation,
) -> Vec<RunReport> {
    let mut out = head.runs.clone();
    let quarter = if held.is_empty() { "fit, last quarter held out" } else { "fit" };
    let of_held = if held.is_empty() { None } else { Some(found) };
    let all = fitted
        .iter()
        .map(|r| (r, on_fit, quarter))
        .chain(held.iter().filter_map(|r| of_held.map(|e| (r, e, "holdout"))));
    for (run, errors, part) in all {
        let Some(r) = out.get_mut(run.number) else { continue };
        r.r#use = part.into();
        r.rate_dps = run.rate_is_known.then(|| run.mean_rate().to_degrees());
        let own = errors.segments.iter().zip(&errors.kept).find(|(s, _)| s.track == run.number);
        if let Some((s, kept)) = own {
            let own = Evaluation { segments: vec![s.clone()], kept: vec![kept.clone()] };
            r.rms_deg = Some(own.size().rms_deg);
            r.spikes = kept.iter().filter(|k| !**k).count();
        }
    }
    out
}

fn curves(names: &[String], raw: &Evaluation, declared: &Evaluation, found: &Evaluation) -> Vec<BiasCurve> {
    found
        .segments
        .iter()
        .enumerate()
        .map(|(at, s)| {
            let stride = (s.angle.len() / CURVE_POINTS).max(1);
            let shown: Vec<usize> = (0..s.angle.len()).step_by(stride).filter(|&i| found.kept[at][i]).collect();
            let of = |e: &Evaluation| shown.iter().map(|&i| e.segments[at].angle[i].to_degrees()).collect();
            BiasCurve {
                name: names.get(at).cloned().unwrap_or_default(),
                pattern_deg: shown.iter().map(|&i| s.direction[i].to_degrees().rem_euclid(180.0)).collect(),
                raw_deg: of(raw),
                declared_deg: of(declared),
                discovered_deg: of(found),
            }
        })
        .collect()
}

/// How the library shows the parameters of an effect.
pub(crate) fn shown(id: EffectId) -> Option<(&'static str, &'static str, &'static str, f64)> {
    match id.description().shown {
        [Shown::Polar { magnitude, unit, angle, division, .. }] => Some((magnitude, unit, angle, *division)),
        _ => None,
    }
}
