//! The main job: a campaign in, the identified instrument out, with everything a reader needs to check it.

use cvg_model::effects::{EffectId, Role as ParameterRole, Shown, Stage};
use nalgebra::DMatrix;

use crate::angle_sensor;
use crate::carrier;
use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::plots::{PlotContext, PlotData};
use crate::diagnostics::residual::{
    Follows, WHITENESS_LAGS, WHITENESS_LEVEL, autocorrelation, ljung_box, reported_harmonics,
};
use crate::diagnostics::scale_factor::{gains, scale_factor};
use crate::error::Refusal;
use crate::estimation::actuation::RingDown;
use crate::estimation::fit::Fit;
use crate::estimation::identifiability::{confounded_with, separated_by};
use crate::estimation::joint_fit::{Dataset, Fitted, belief, declared_hypothesis, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::free_decay;
use crate::model::hypothesis::{Hypothesis, Member, Origin, Unknown};
use crate::recording::{Campaign, Instrument, Reference, Role, RunKind};
use crate::report::calibration::{Calibration, Provenance};
use crate::report::channels::channels;
use crate::report::gate::{self, Facts};
use crate::report::proposals::proposals;
use crate::report::provenance;
use crate::report::runs::tell_apart;
use crate::report::stages::stages;
use crate::report::unexplained::{described, unexplained};
use crate::report::{
    BeforeAfter, EffectReport, Estimate, Heldout, ParameterReport, Report, ResidualReport, RunReport, SCHEMA, Status,
    Tool,
};
use crate::selection::discovery::{Step, discover};
use crate::selection::last_step::last_step;

/// How an identification is run.
pub struct Options<'a> {
    /// look for undeclared effects
    pub discover: bool,
    /// effects written down as text ([`crate::EffectText::effect`]), which compete with the library's
    pub effects: Vec<EffectId>,
    /// told what is going on
    pub progress: &'a dyn Fn(&str),
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { discover: true, effects: Vec::new(), progress: &|_| {} }
    }
}

/// An identified instrument.
#[derive(Debug, Clone)]
pub struct Identification {
    /// the facts
    pub report: Report,
    /// what to compensate with
    pub calibration: Calibration,
    /// curves to look at
    pub figures: Figures,
    /// the steps of discovery
    pub steps: Vec<Step>,
    /// what a person wants to see besides, where it was asked for
    pub plots: Option<PlotData>,
}

/// Curves for a report, thinned to what a figure can show.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// held-out angle error against the pattern angle
    pub bias: Vec<BiasCurve>,
    /// ring-downs: name, angle in deg, amplitude over time
    pub ring_downs: Vec<RingDown>,
}

/// Angle error of one held-out stretch.
#[derive(Debug, Clone, Default)]
pub struct BiasCurve {
    /// run
    pub name: String,
    /// pattern angle within its period, deg
    pub pattern_deg: Vec<f64>,
    /// raw error, deg; empty where the raw angle does not turn
    pub raw_deg: Vec<f64>,
    /// after the declared model, deg
    pub declared_deg: Vec<f64>,
    /// after all, deg
    pub discovered_deg: Vec<f64>,
}

/// Points of one curve.
const CURVE_POINTS: usize = 2000;
/// Share of its prior's width to which an unknown must narrow to count as told by the data.
const MIN_CONTRACTION: f64 = 0.1;
/// Gain ratios known no better than this, as the half width of the interval, are no answer.
const WIDEST_DETECTION_RATIO: f64 = 0.1;
const WIDEST_ACTUATION_RATIO: f64 = 0.02;

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
    let campaign = carrier::demodulated(campaign)?;
    if free_decay::serves(&campaign) {
        let mut identified = free_decay::identify(campaign, options, with_plots)?;
        identified.report.warnings.extend(not_tried(options, "free decays"));
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
    if angle_sensor::serves(&campaign) {
        let mut identified = angle_sensor::identify(campaign, options, with_plots)?;
        identified.report.warnings.extend(not_tried(options, "an angle sensor"));
        return Ok(identified);
    }
    let device = campaign.device.clone();
    let mut runs: Vec<RunReport> = campaign.runs.iter().map(run_report).collect();
    let inputs = provenance::sums(&provenance::files(&campaign));
    let amplitude_v = provenance::amplitudes(&campaign);
    (options.progress)("preparing the runs");
    let mut dataset = Dataset::new(campaign)?;
    dataset.written.clone_from(&options.effects);
    (options.progress)("fitting the declared model");
    let paper = declared_hypothesis(&dataset.start);
    let declared = fit_with_ring_downs(&mut dataset, &paper)?;
    let declared_fit = declared.fit.clone();
    let (mut fitted, mut steps) =
        if options.discover { discover(&mut dataset, declared, options.progress)? } else { (declared, Vec::new()) };
    (options.progress)("weighing by what the noise remembers");
    let covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
    let scale_factor = scale_factor(&gains(&mut dataset, &fitted));
    (options.progress)("measuring the held-out error");
    let heldout = |h: &Hypothesis, fit: &Fit, like: Option<&Evaluation>| {
        evaluate(&dataset.tracks, h, &fit.starts, Role::Holdout, Window::Whole, like)
    };
    let after = heldout(&fitted.fit.hypothesis, &fitted.fit, None);
    let before = heldout(&declared_fit.hypothesis, &declared_fit, Some(&after));
    let ideal = Hypothesis { members: Vec::new(), force_scale: 0.0, ..fitted.fit.hypothesis.clone() };
    let raw = heldout(&ideal, &fitted.fit, Some(&after));

    let on_fit = evaluate(&dataset.tracks, &fitted.fit.hypothesis, &fitted.fit.starts, Role::Fit, Window::Whole, None);
    let dense = |role| evaluate(&dataset.tracks, &fitted.fit.hypothesis, &fitted.fit.starts, role, Window::Dense, None);
    let noise_floor = dense(Role::Holdout).noise_floor();
    let correlation = autocorrelation(&on_fit, WHITENESS_LAGS);
    let count = on_fit.errors().count();
    let white = ljung_box(&correlation, count) >= WHITENESS_LEVEL;

    let declared_on_fit =
        evaluate(&dataset.tracks, &declared_fit.hypothesis, &declared_fit.starts, Role::Fit, Window::Whole, None);
    let mut left = channels(&dataset, &declared_fit, "declared", &declared_on_fit);
    left.extend(channels(&dataset, &fitted.fit, "discovered", &on_fit));
    let mut warnings = std::mem::take(&mut dataset.warnings);
    let knowledge = Knowledge { dataset: &dataset, fitted: &fitted, covariance: &covariance };
    let detection_gain_ratio = knowledge.detection_ratio(&mut warnings);
    let actuation_gain_ratio = knowledge.actuation_ratio(&mut warnings);
    let effects = knowledge.effects(&steps, &after);
    for e in effects.iter().filter(|e| !e.confounded_with.is_empty()) {
        warnings.push(format!(
            "{} is confounded with {} in this campaign; {} would separate them",
            e.id,
            e.confounded_with.join(", "),
            e.separated_by.as_deref().unwrap_or("another run")
        ));
    }
    let plots = with_plots.then(|| {
        let members = &fitted.fit.hypothesis.members;
        let told: Vec<usize> = (0..members.len()).filter(|&at| knowledge.identifiable(at, &members[at])).collect();
        let scene = PlotContext {
            dataset: &dataset,
            fit: &fitted.fit,
            covariance: &covariance,
            raw: Some(&raw),
            declared: &before,
            discovered: &after,
            on_fit: &on_fit,
            members: &told,
        };
        scene.plots()
    });
    let spikes: Vec<usize> =
        fitted.fit.set_aside.iter().enumerate().map(|(track, fit)| fit + after.spikes_of(track)).collect();
    let all_spikes: usize = spikes.iter().sum();
    if all_spikes > 0 {
        warnings.push(format!("{all_spikes} samples were set aside as spikes"));
    }
    warnings.extend(tell_apart(&mut runs, &dataset, &fitted.fit, (&on_fit, &after)));
    for ((run, t), spikes) in dataset.screen.of(&mut runs).into_iter().zip(&dataset.tracks).zip(spikes) {
        run.spikes = spikes;
        run.rate_dps = Some(t.track.mean_rate().to_degrees());
        run.r#use = match (t.track.samples(Role::Fit) > 0, t.track.samples(Role::Holdout) > 0) {
            (true, true) => "fit, last quarter held out".into(),
            (true, false) => "fit".into(),
            _ => "holdout".into(),
        };
    }
    for (run, r) in runs.iter_mut().filter(|r| r.kind == "ringdown").zip(&fitted.ring_downs) {
        run.tau_s = Some(Estimate::new(r.tau_s, r.tau_error_s));
    }
    let mut unexplained = unexplained(&dataset, &on_fit, &dense(Role::Fit), &after, noise_floor);
    let proposals = proposals(&dataset, &fitted.fit, &on_fit, &left, &unexplained);
    unexplained.splice(0..0, described(&fitted.fit.hypothesis, &steps));
    let facts = Facts {
        instrument: dataset.instrument,
        period_deg: dataset.start.period_rad.to_degrees(),
        tells_gain: true,
        stated: dataset.screen.stated(),
        held_out: after.errors().count(),
        fitted_rms_deg: on_fit.mean_square().sqrt().to_degrees(),
    };
    let mut report = Report {
        schema: SCHEMA.into(),
        status: Status::Answered,
        reason: None,
        tool: Tool::default(),
        inputs,
        device: device.clone(),
        instrument: match dataset.instrument {
            Instrument::Gyroscope => "gyroscope".into(),
            Instrument::Sensor => "sensor".into(),
        },
        angular_gain: knowledge.angular_gain(),
        detection_gain_ratio,
        actuation_gain_ratio,
        effects,
        heldout: Heldout {
            raw: Some(raw.size()),
            declared: before.size(),
            discovered: after.size(),
            noise_floor_deg: noise_floor.to_degrees(),
        },
        steps: stages(Some(&raw), &before, &after, &steps),
        residual: ResidualReport {
            harmonics: [Follows::Pattern, Follows::Table]
                .into_iter()
                .flat_map(|of| reported_harmonics(&after, of, &after))
                .collect(),
            white,
        },
        channels: left,
        unexplained,
        runs,
        decomposition: Vec::new(),
        proposals,
        scale_factor,
        allan: None,
        decay: None,
        warnings,
    };
    let provenance = Provenance { tool: Some(Tool::default()), inputs: report.inputs.clone(), amplitude_v };
    let mut calibration = Calibration { device, hypothesis: fitted.fit.hypothesis, provenance };
    gate::pass(&report, &calibration, facts)?;
    if let Some(reason) = no_better(&report.heldout, after.errors().count()) {
        (report.status, report.reason) = (Status::Neutral, Some(reason.clone()));
        report.warnings.insert(0, reason);
        calibration.hypothesis = ideal;
    }
    Ok(Identification {
        report,
        figures: figures(&dataset, Some(&raw), &before, &after, fitted.ring_downs),
        calibration,
        steps,
        plots,
    })
}

/// Says that effects as text had no part in an answer.
fn not_tried(options: &Options<'_>, of: &str) -> Option<String> {
    let ids: Vec<&str> = options.effects.iter().map(|e| e.description().id).collect();
    (!ids.is_empty()).then(|| {
        format!(
            "{} had no part in this: effects as text compete in a gyroscope's rotation runs, not in {of}",
            ids.join(", ")
        )
    })
}

/// An identification has an angle and what it should be in every run that turns.
fn require_a_reference(campaign: &Campaign) -> Result<(), Refusal> {
    if let Some(run) = campaign.runs.iter().find(|r| r.kind == RunKind::Static) {
        let name = run.file.display().to_string();
        return Err(Refusal::new(&name, "a run at rest has no angular gain", "cvg_calibration::answer"));
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

/// Why what was found is of no use, where it is not: on `samples` held-out samples the error is larger with it than without,
/// by more than the standard error of a root mean square.
fn no_better(heldout: &Heldout, samples: usize) -> Option<String> {
    let raw = heldout.raw?.rms_deg;
    let rms = heldout.discovered.rms_deg;
    let by_chance = 1.0 / (2.0 * samples.max(1) as f64).sqrt();
    (rms > raw * (1.0 + by_chance)).then(|| no_help(heldout))
}

/// Why a calibration leaves the angle as it is.
pub(crate) fn no_help(heldout: &Heldout) -> String {
    let without = heldout.raw.map_or(String::new(), |raw| format!(", {:.3e}° without", raw.rms_deg));
    format!(
        "nothing that was found helps on held-out data: {:.3e}° rms with it{without}; the calibration leaves the angle as \
         it is",
        heldout.discovered.rms_deg
    )
}

pub(crate) fn run_report(run: &crate::recording::Run) -> RunReport {
    let d = &run.recording.dropped;
    RunReport {
        file: run.file.display().to_string(),
        kind: run.kind.name().into(),
        r#use: if run.kind == RunKind::Static { "at rest".into() } else { "fit".into() },
        rows: run.recording.reference_hz.map_or(run.recording.len(), |_| rows_read(d)),
        dropped: dropped(d),
        rate_dps: None,
        spikes: 0,
        tau_s: None,
        angular_gain: None,
        bias_dps: None,
        rms_deg: None,
        agrees: None,
    }
}

/// Rows that a recording had before it was demodulated.
fn rows_read(d: &crate::recording::Dropped) -> usize {
    usize::try_from(d.rows_kept).unwrap_or(usize::MAX)
}

/// Why rows of a file are not in its recording.
fn dropped(d: &crate::recording::Dropped) -> Vec<String> {
    [
        (d.empty_or_nan, "empty or not a number"),
        (d.repeated_time, "repeated time stamp"),
        (d.truncated_last_line, "cut-off last line"),
    ]
    .into_iter()
    .filter(|(tally, _)| !tally.is_zero())
    .map(|(tally, reason)| {
        let first = tally.first.map(|p| format!(", first at {p}")).unwrap_or_default();
        format!("{} × {reason}{first}", tally.count)
    })
    .collect()
}

fn figures(
    dataset: &Dataset,
    raw: Option<&Evaluation>,
    before: &Evaluation,
    after: &Evaluation,
    ring_downs: Vec<RingDown>,
) -> Figures {
    let degrees = |e: &Evaluation, s: usize, kept: &[usize]| -> Vec<f64> {
        kept.iter().map(|&i| e.segments[s].angle[i].to_degrees()).collect()
    };
    let bias = (0..after.segments.len())
        .map(|s| {
            let segment = &after.segments[s];
            let stride = (segment.angle.len() / CURVE_POINTS).max(1);
            let kept: Vec<usize> = (0..segment.angle.len()).step_by(stride).filter(|&i| after.kept[s][i]).collect();
            let period = dataset.start.period_rad;
            BiasCurve {
                name: dataset.tracks[segment.track].track.name.clone(),
                pattern_deg: kept.iter().map(|&i| segment.direction[i].rem_euclid(period).to_degrees()).collect(),
                raw_deg: raw.map(|r| degrees(r, s, &kept)).unwrap_or_default(),
                declared_deg: degrees(before, s, &kept),
                discovered_deg: degrees(after, s, &kept),
            }
        })
        .collect();
    Figures { bias, ring_downs }
}

/// What a fit knows, with how sure it is.
struct Knowledge<'a> {
    dataset: &'a Dataset,
    fitted: &'a Fitted,
    covariance: &'a DMatrix<f64>,
}

impl Knowledge<'_> {
    fn hypothesis(&self) -> &Hypothesis {
        &self.fitted.fit.hypothesis
    }

    fn index(&self, unknown: Unknown) -> Option<usize> {
        self.fitted.fit.unknowns.iter().position(|u| *u == unknown)
    }

    fn deviation(&self, unknown: Unknown) -> f64 {
        self.index(unknown).map_or(0.0, |i| self.covariance[(i, i)].max(0.0).sqrt())
    }

    fn estimate(&self, unknown: Unknown) -> Estimate {
        Estimate::new(self.hypothesis().get(unknown), self.deviation(unknown))
    }

    /// The angular gain. A precession p sin 4θ slows the mean of −kΩ to √((kΩ)² − p²), an error of the readout does not:
    /// where a residual at 4θ is corrected as either without a known cause, what the other would make of k is allowed for.
    fn angular_gain(&self) -> Estimate {
        let estimate = self.estimate(Unknown::AngularGain);
        let slowest = self.dataset.tracks.iter().map(|t| t.track.mean_speed()).fold(f64::INFINITY, f64::min);
        let nominal = (estimate.value * slowest).abs().max(f64::MIN_POSITIVE);
        let causeless = self.hypothesis().members.iter().filter(|m| m.origin == Origin::Empirical);
        let slowed: f64 = causeless
            .filter(|m| m.id.description().stage == Stage::Mechanics)
            .map(|m| 0.5 * m.values.iter().map(|v| v * v).sum::<f64>() / (nominal * nominal))
            .sum();
        estimate.widened(slowed * estimate.value.abs())
    }

    /// The first parameter of the first member `id`, if it was fitted.
    fn first(&self, id: EffectId) -> Option<Unknown> {
        let unknown = Unknown::Effect(self.hypothesis().position(id)?, 0);
        self.index(unknown).map(|_| unknown)
    }

    fn detection_ratio(&self, warnings: &mut Vec<String>) -> Option<Estimate> {
        let estimate = self.first(EffectId::DetectionGainMismatch).map(|u| self.estimate(u));
        let told = estimate.filter(|e| e.half_width() < WIDEST_DETECTION_RATIO);
        if told.is_none() {
            warnings.push("the campaign cannot tell the detection gain ratio".into());
        }
        told
    }

    fn actuation_ratio(&self, warnings: &mut Vec<String>) -> Option<Estimate> {
        if self.dataset.instrument == Instrument::Sensor {
            warnings.push("a sensor has no drive: there is no actuation gain ratio".into());
            return None;
        }
        let unknown = self.first(EffectId::ActuationGainMismatch);
        let told = unknown
            .filter(|u| self.deviation(*u) < MIN_CONTRACTION * belief::ACTUATION_RATIO)
            .map(|u| self.estimate(u))
            .or_else(|| self.fitted.drive.as_ref().map(|d| Estimate::new(d.ratio(), d.ratio() * d.ratio_error)))
            .filter(|e| e.half_width() < WIDEST_ACTUATION_RATIO);
        match (&told, &self.fitted.drive) {
            (None, _) => warnings.push(
                "the campaign cannot tell the actuation gain ratio: ring-downs at 0° and 90° with vas_v would".into(),
            ),
            (Some(_), None) => warnings.push(
                "the actuation gain ratio comes from rotation runs alone: ring-downs at 0° and 90° would confirm it"
                    .into(),
            ),
            (Some(estimate), Some(drive)) => {
                let deviation = (estimate.half_width() / 1.96).hypot(drive.ratio() * drive.ratio_error);
                if (estimate.value - drive.ratio()).abs() > 4.0 * deviation {
                    warnings.push(format!(
                        "ring-downs (Equation 11) give an actuation gain ratio of {:.5}, all runs together {:.5}",
                        drive.ratio(),
                        estimate.value
                    ));
                }
            }
        }
        told
    }

    /// A member's deviations are well below what was believed without data.
    fn identifiable(&self, at: usize, member: &Member) -> bool {
        let scale = match member.id {
            EffectId::Anisodamping => belief::ANISODAMPING_PER_S,
            EffectId::Anisoelasticity => belief::ANISOELASTICITY_RAD_S,
            EffectId::ActuationGainMismatch => belief::ACTUATION_RATIO,
            _ => f64::INFINITY,
        };
        let fitted = (0..member.id.description().parameters.len())
            .map(|p| Unknown::Effect(at, p))
            .filter(|u| self.index(*u).is_some())
            .collect::<Vec<_>>();
        !fitted.is_empty() && fitted.iter().all(|u| self.deviation(*u) < MIN_CONTRACTION * scale)
    }

    fn effects(&self, steps: &[Step], after: &Evaluation) -> Vec<EffectReport> {
        let with = after.size().rms_deg;
        let mut steps: Vec<&Step> = steps.iter().collect();
        let alike = self.dataset.alike();
        self.hypothesis()
            .members
            .iter()
            .enumerate()
            .filter(|(at, m)| self.identifiable(*at, m))
            .map(|(at, m)| {
                let step = steps.iter().position(|s| s.id == m.id).map(|i| steps.remove(i));
                let mut rivals = confounded_with(m.id, self.hypothesis(), &self.fitted.fit.unknowns, self.covariance);
                for r in step.map(|s| s.confounded_with.as_slice()).unwrap_or_default() {
                    if !rivals.contains(r) {
                        rivals.push(*r);
                    }
                }
                let mut without = self.hypothesis().clone();
                without.members.remove(at);
                let before = step.map_or_else(
                    || {
                        let e = evaluate(
                            &self.dataset.tracks,
                            &without,
                            &self.fitted.fit.starts,
                            Role::Holdout,
                            Window::Whole,
                            Some(after),
                        );
                        e.size().rms_deg
                    },
                    |s| s.heldout_rms_deg[0],
                );
                let after_deg = step.map_or(with, |s| s.heldout_rms_deg[1]);
                EffectReport {
                    id: m.id.to_string(),
                    origin: m.origin,
                    parameters: self.parameters(at, m),
                    heldout_rms_deg: before.is_finite().then_some(BeforeAfter { before, after: after_deg }),
                    evidence: evidence(m, step),
                    separated_by: rivals.first().map(|r| separated_by(m.id, *r, alike).to_string()),
                    confounded_with: rivals.iter().map(ToString::to_string).collect(),
                }
            })
            .collect()
    }

    /// A member's parameters as they are shown, polar ones with intervals by propagation.
    fn parameters(&self, at: usize, member: &Member) -> Vec<ParameterReport> {
        let d = member.id.description();
        let mut out = Vec::new();
        for shown in d.shown {
            match *shown {
                Shown::Plain(p) => {
                    let parameter = &d.parameters[p];
                    let hidden = parameter.role == ParameterRole::Refined && !member.refined;
                    if !hidden {
                        let unknown = Unknown::Effect(at, p);
                        out.push(ParameterReport {
                            name: parameter.name.into(),
                            unit: parameter.unit.into(),
                            value: member.values[p],
                            ci95: self.index(unknown).map(|_| self.estimate(unknown).ci95),
                        });
                    }
                }
                Shown::Polar { cos, sin, magnitude, unit, angle, division } => {
                    let (c, s) = (member.values[cos], member.values[sin]);
                    let size = c.hypot(s).max(f64::MIN_POSITIVE);
                    let (vc, vs, vcs) = self.block(at, cos, sin);
                    let deviation = ((c * c * vc + s * s * vs + 2.0 * c * s * vcs).max(0.0)).sqrt() / size;
                    let turn = ((s * s * vc + c * c * vs - 2.0 * c * s * vcs).max(0.0)).sqrt() / (size * size);
                    let phase = (s.atan2(c) / division).to_degrees();
                    let phase_deviation = (turn / division).to_degrees();
                    let entry = |name: &str, unit: &str, e: Estimate| ParameterReport {
                        name: name.into(),
                        unit: unit.into(),
                        value: e.value,
                        ci95: Some(e.ci95),
                    };
                    out.push(entry(magnitude, unit, Estimate::new(c.hypot(s), deviation)));
                    out.push(entry(angle, "deg", Estimate::new(phase, phase_deviation)));
                }
            }
        }
        out
    }

    /// Variances and covariance of two parameters of a member.
    fn block(&self, at: usize, one: usize, other: usize) -> (f64, f64, f64) {
        match (self.index(Unknown::Effect(at, one)), self.index(Unknown::Effect(at, other))) {
            (Some(i), Some(j)) => (self.covariance[(i, i)], self.covariance[(j, j)], self.covariance[(i, j)]),
            _ => (0.0, 0.0, 0.0),
        }
    }
}

/// One sentence on why an effect is believed.
fn evidence(member: &Member, step: Option<&Step>) -> String {
    let d = member.id.description();
    let Some(step) = step else {
        return match member.origin {
            Origin::Declared => format!("declared by the paper's model ({})", d.signature),
            _ => format!("needed to centre the readout before there is an angle ({})", d.signature),
        };
    };
    let rivals =
        step.rivals.iter().map(|(id, gain)| format!("{id} by {:.0}", step.gain - gain)).collect::<Vec<_>>().join(", ");
    let beaten = if rivals.is_empty() { String::new() } else { format!("; beat {rivals}") };
    let balance = step.energy_balance.map_or_else(String::new, |[before, after]| {
        format!("; the energy balance leaves {:.1} ppm of the amplitude instead of {:.1}", 1e6 * after, 1e6 * before)
    });
    let inconsistency =
        step.inconsistency.as_ref().map_or_else(String::new, |why| format!("; not claimed as a cause: {why}"));
    format!(
        "{}; gained {:.0} in 2 ln likelihood after its price{beaten}; held-out rms {:.5}° to {:.5}°{balance}{inconsistency}",
        d.signature, step.gain, step.heldout_rms_deg[0], step.heldout_rms_deg[1]
    )
}
