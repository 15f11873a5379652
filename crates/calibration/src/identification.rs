//! The main job: a campaign in, the identified instrument out, with everything a reader needs to check it.

use cvg_model::effects::EffectId;
use nalgebra::DMatrix;

use crate::angle_sensor::{self, curve::Curve};
use crate::carrier;
use crate::data::copies::without_copies;
use crate::diagnostics::drives::clipping;
use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::influences::shares;
use crate::diagnostics::plots::{PlotContext, PlotData};
use crate::diagnostics::scale_factor::{gains, scale_factor};
use crate::diagnostics::temperature::{Seen, temperature};
use crate::error::Refusal;
use crate::estimation::actuation::RingDown;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, declared_hypothesis, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::free_decay;
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::recording::{Campaign, Reference, Role, RunKind};
use crate::report::calibration::{Calibration, Provenance};
use crate::report::channels::channels;
use crate::report::gate::{self, Facts};
use crate::report::inference::Inference;
use crate::report::proposals::proposals;
use crate::report::provenance;
use crate::report::runs::tell_apart;
use crate::report::stages::stages;
use crate::report::unexplained::{described, residual_report, unexplained};
use crate::report::{
    EffectReport, Estimate, Heldout, Input, Report, RunReport, SCHEMA, ScaleFactor, Status, Temperature, Tool,
};
use crate::selection::discovery::discover;
use crate::selection::last_step::last_step;
use crate::selection::step::Step;

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
    /// of an angle sensor, what its two channels draw
    pub channels: Option<Curve>,
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

fn run(mut campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    let mut warnings = Vec::new();
    let copies = without_copies(&mut campaign, &mut warnings);
    let mut identified = without_doubles(campaign, options, with_plots)?;
    identified.report.warnings.extend(warnings);
    let left_out = |r| RunReport { r#use: "left out".into(), agrees: Some(false), ..run_report(r) };
    identified.report.runs.extend(copies.iter().map(left_out));
    Ok(identified)
}

/// A campaign in which every recording is there once.
fn without_doubles(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    let campaign = carrier::demodulated(campaign)?;
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
    if angle_sensor::serves(&campaign) {
        return angle_sensor::identify(campaign, options, with_plots);
    }
    let head = Head {
        device: campaign.device.clone(),
        runs: campaign.runs.iter().map(run_report).collect(),
        inputs: provenance::sums(&provenance::files(&campaign)),
        amplitude_v: provenance::amplitudes(&campaign),
    };
    (options.progress)("preparing the runs");
    let mut dataset = Dataset::new(campaign)?;
    dataset.written.clone_from(&options.effects);
    (options.progress)("fitting the declared model");
    let paper = declared_hypothesis(&dataset.start);
    dataset.require_driven_rotations(&paper)?;
    let explained = |dataset: &mut Dataset, declared: &Hypothesis| {
        let declared = fit_with_ring_downs(dataset, declared)?;
        let declared_fit = declared.fit.clone();
        let (fitted, steps) =
            if options.discover { discover(dataset, declared, options.progress)? } else { (declared, Vec::new()) };
        Ok::<_, Refusal>((declared_fit, fitted, steps))
    };
    let (mut declared_fit, mut fitted, mut steps) = explained(&mut dataset, &paper)?;
    if dataset.without_foreign_ring_downs(&fitted.fit.hypothesis)? {
        (options.progress)("beginning anew without the ring-downs of another device");
        (declared_fit, fitted, steps) = explained(&mut dataset, &paper)?;
    }
    if let Some(found) = options.discover.then(|| clipping(&dataset, &fitted.fit.hypothesis)).flatten() {
        (options.progress)("beginning anew with drives that clip");
        dataset.clipping = Some((found.inverse_level.value, found.inverse_level.half_width() / 1.96));
        // from where the fit without it ended: what drives can't put out moves it little
        let mut clipped = declared_fit.hypothesis.clone();
        let member = clipped.admit(EffectId::DriveSaturation, Origin::Declared);
        clipped.members[member].values[0] = found.inverse_level.value;
        (declared_fit, fitted, steps) = explained(&mut dataset, &clipped)?;
    }
    (options.progress)("weighing by what the noise remembers");
    let covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
    let scale_factor = scale_factor(&gains(&mut dataset, &fitted));
    (options.progress)("measuring the held-out error");
    let errors = Errors::of(&dataset, &declared_fit, &fitted.fit);
    let steps = steps.into_iter().map(|step| step.read(&dataset)).collect();
    let warnings = std::mem::take(&mut dataset.warnings);
    let drives = dataset.clipping.and_then(|_| clipping(&dataset, &fitted.fit.hypothesis)?.report());
    let found = Found { dataset, declared_fit, fitted, covariance, steps, scale_factor, errors, drives };
    found.report(head, warnings, with_plots)
}

/// What the campaign says of itself, kept while its recordings are taken apart.
struct Head {
    device: String,
    runs: Vec<RunReport>,
    inputs: Vec<Input>,
    amplitude_v: Option<[f64; 2]>,
}

/// What is left of the angle, at every stage: of the held-out samples, and of the fitted ones.
struct Errors {
    /// with nothing undone, and what that is
    raw: Evaluation,
    ideal: Hypothesis,
    declared: Evaluation,
    discovered: Evaluation,
    declared_on_fit: Evaluation,
    on_fit: Evaluation,
    /// of short windows, where nothing slow shows
    dense_on_fit: Evaluation,
    noise_floor: f64,
}

impl Errors {
    fn of(dataset: &Dataset, declared: &Fit, found: &Fit) -> Self {
        let left = |h: &Hypothesis, fit: &Fit, role, window, like: Option<&Evaluation>| {
            evaluate(&dataset.tracks, h, &fit.starts, role, window, like)
        };
        let heldout = |h: &Hypothesis, fit: &Fit, like| left(h, fit, Role::Holdout, Window::Whole, like);
        let ideal = Hypothesis { members: Vec::new(), force_scale: 0.0, ..found.hypothesis.clone() };
        let discovered = heldout(&found.hypothesis, found, None);
        Self {
            raw: heldout(&ideal, found, Some(&discovered)),
            ideal,
            declared: heldout(&declared.hypothesis, declared, Some(&discovered)),
            declared_on_fit: left(&declared.hypothesis, declared, Role::Fit, Window::Whole, None),
            on_fit: left(&found.hypothesis, found, Role::Fit, Window::Whole, None),
            dense_on_fit: left(&found.hypothesis, found, Role::Fit, Window::Dense, None),
            noise_floor: left(&found.hypothesis, found, Role::Holdout, Window::Dense, None).noise_floor(),
            discovered,
        }
    }

    fn heldout(&self) -> Heldout {
        Heldout {
            raw: Some(self.raw.size()),
            declared: self.declared.size(),
            discovered: self.discovered.size(),
            noise_floor_deg: self.noise_floor.to_degrees(),
        }
    }
}

/// A temperature that lies so far from those that were recorded is another one, K.
const EXTRAPOLATED_K: f64 = 10.0;

/// An identified campaign, before it is told.
struct Found {
    dataset: Dataset,
    declared_fit: Fit,
    fitted: Fitted,
    covariance: DMatrix<f64>,
    steps: Vec<Step>,
    scale_factor: Option<ScaleFactor>,
    errors: Errors,
    /// drives that clip, which the commands tell and the angle does not
    drives: Option<EffectReport>,
}

impl Found {
    fn report(self, head: Head, mut warnings: Vec<String>, with_plots: bool) -> Result<Identification, Refusal> {
        let Self { dataset, fitted, errors, .. } = &self;
        let mut channels_left = channels(dataset, &self.declared_fit, "declared", &errors.declared_on_fit);
        channels_left.extend(channels(dataset, &fitted.fit, "discovered", &errors.on_fit));
        let inference = Inference { dataset, fitted, covariance: &self.covariance };
        let own_ratios = self.context(&[]).own_detection_ratios();
        let detection_gain_ratio = inference.detection_ratio(&own_ratios, &mut warnings);
        let actuation_gain_ratio = inference.actuation_ratio(detection_gain_ratio, &mut warnings);
        let mut effects = inference.effects(&self.steps, &errors.discovered);
        effects.extend(self.drives.clone());
        warnings.extend(self.drives.as_ref().map(|_| CLIPPED_DRIVES.to_owned()));
        warnings.extend(effects.iter().filter(|e| !e.confounded_with.is_empty()).map(confounded));
        let angular_gain = inference.angular_gain(&mut warnings);
        let plots = with_plots.then(|| {
            let members = &fitted.fit.hypothesis.members;
            let told: Vec<usize> = (0..members.len()).filter(|&at| inference.identifiable(at, &members[at])).collect();
            self.context(&told).plots()
        });
        let left = unexplained(dataset, &errors.on_fit, &errors.dense_on_fit, &errors.discovered, errors.noise_floor);
        let proposals = proposals(dataset, &fitted.fit, &errors.on_fit, &channels_left, &left);
        let mut unexplained = described(&fitted.fit.hypothesis, &self.steps);
        unexplained.extend(left);
        let facts = Facts {
            instrument: dataset.instrument,
            period_deg: dataset.start.period_rad.to_degrees(),
            tells_gain: true,
            stated: dataset.screen.stated(),
            held_out: errors.discovered.errors().count(),
            fitted_rms_deg: errors.on_fit.mean_square().sqrt().to_degrees(),
        };
        let mut runs = self.runs(head.runs, &mut warnings);
        warnings.extend(self.extrapolated());
        let temperature = self.temperature(&mut runs, detection_gain_ratio.is_some().then_some(&own_ratios));
        let amplitudes: Vec<f64> = dataset.tracks.iter().map(|t| t.track.mean_amplitude()).collect();
        let mut report = Report {
            schema: SCHEMA.into(),
            status: Status::Answered,
            reason: None,
            tool: Tool::default(),
            inputs: head.inputs,
            device: head.device,
            instrument: self.dataset.instrument.name().into(),
            angular_gain,
            detection_gain_ratio,
            actuation_gain_ratio,
            effects,
            heldout: self.errors.heldout(),
            steps: stages(Some(&self.errors.raw), &self.errors.declared, &self.errors.discovered, &self.steps),
            residual: residual_report(&self.errors.on_fit, &self.errors.discovered),
            channels: channels_left,
            unexplained,
            runs,
            decomposition: shares(&self.errors.declared_on_fit, &amplitudes),
            proposals,
            scale_factor: self.scale_factor,
            allan: None,
            temperature,
            decay: None,
            warnings,
        };
        report.warnings.extend(left_over(&report.heldout));
        let mut calibration = self.calibration(&report, head.amplitude_v);
        gate::pass(&report, &calibration, facts)?;
        if let Some(reason) = no_better(&report.heldout, facts.held_out) {
            (report.status, report.reason) = (Status::Neutral, Some(reason.clone()));
            report.warnings.insert(0, reason);
            calibration.hypothesis = self.errors.ideal.clone();
        }
        let Self { dataset, fitted, steps, errors, .. } = self;
        let figures = figures(&dataset, Some(&errors.raw), &errors.declared, &errors.discovered, fitted.ring_downs);
        Ok(Identification { report, figures, calibration, steps, plots })
    }

    fn calibration(&self, report: &Report, amplitude_v: Option<[f64; 2]>) -> Calibration {
        let (tool, inputs) = (Some(Tool::default()), report.inputs.clone());
        let provenance = Provenance { tool, inputs, amplitude_v, readout_unit: None };
        let mut hypothesis = self.fitted.fit.hypothesis.clone();
        // what drives can't put out is not undone
        hypothesis.members.retain(|m| m.id != EffectId::DriveSaturation);
        Calibration { device: report.device.clone(), hypothesis, provenance }
    }

    fn context<'a>(&'a self, members: &'a [usize]) -> PlotContext<'a> {
        PlotContext {
            dataset: &self.dataset,
            fit: &self.fitted.fit,
            covariance: &self.covariance,
            raw: Some(&self.errors.raw),
            declared: &self.errors.declared,
            discovered: &self.errors.discovered,
            on_fit: &self.errors.on_fit,
            members,
        }
    }

    /// Parameters that follow the temperature and are stated at one that was not recorded, nor nearly.
    fn extrapolated(&self) -> Option<String> {
        let h = &self.fitted.fit.hypothesis;
        let reference_c = h.reference_c.filter(|_| h.members.iter().any(|m| m.id.by_temperature()))?;
        let of = |pick: fn(f64, f64) -> f64, from: f64| {
            self.dataset.tracks.iter().flat_map(|t| t.track.temperatures_c()).fold(from, pick)
        };
        let (low, high) = (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY));
        let beyond = (low - reference_c).max(reference_c - high);
        (beyond > EXTRAPOLATED_K).then(|| {
            format!(
                "what follows the temperature is stated at {reference_c:.1} °C (temperature_c) and was recorded between \
                 {low:.1} and {high:.1} °C: it is extrapolated by {beyond:.0} K, beyond its interval; temp_c in °C, or \
                 temperature_c where it was recorded"
            )
        })
    }

    /// How what the runs tell goes with their temperatures.
    fn temperature(&self, runs: &mut [RunReport], ratios: Option<&Vec<Option<[f64; 2]>>>) -> Option<Temperature> {
        if runs.iter().filter(|r| r.temp_c.is_some()).count() < 2 {
            return None;
        }
        let told = self.dataset.screen.of(runs).into_iter().zip(&self.dataset.tracks).enumerate();
        let seen: Vec<Seen> = told
            .filter_map(|(at, (run, t))| {
                let ratio = ratios.and_then(|own| own[at]);
                run.detection_gain_ratio = ratio.filter(|_| run.temp_c.is_some()).map(|[value, _]| value);
                Some(Seen::of(run, t.track.one_way_rate().map(f64::to_degrees), run.temp_c?))
            })
            .collect();
        temperature(&seen, self.fitted.fit.hypothesis.sense())
    }

    /// What each run tells by itself, and how it was used.
    fn runs(&self, mut runs: Vec<RunReport>, warnings: &mut Vec<String>) -> Vec<RunReport> {
        let (fit, after) = (&self.fitted.fit, &self.errors.discovered);
        let spikes: Vec<usize> =
            fit.set_aside.iter().enumerate().map(|(track, fit)| fit + after.spikes_of(track)).collect();
        let all_spikes: usize = spikes.iter().sum();
        if all_spikes > 0 {
            warnings.push(format!("{all_spikes} samples were set aside as spikes"));
        }
        warnings.extend(tell_apart(&mut runs, &self.dataset, fit, (&self.errors.on_fit, after)));
        for ((run, t), spikes) in self.dataset.screen.of(&mut runs).into_iter().zip(&self.dataset.tracks).zip(spikes) {
            run.spikes = spikes;
            run.rate_dps = Some(t.track.mean_rate().to_degrees());
            run.r#use = match (t.track.samples(Role::Fit) > 0, t.track.samples(Role::Holdout) > 0) {
                (true, true) => "fit, last quarter held out".into(),
                (true, false) => "fit".into(),
                _ => "holdout".into(),
            };
        }
        let (foreign, own): (Vec<_>, Vec<_>) = runs
            .iter_mut()
            .filter(|r| r.kind == "ringdown")
            .partition(|r| self.dataset.ring_downs_left_out.contains(&r.file));
        for run in foreign {
            (run.r#use, run.agrees) = ("left out".into(), Some(false));
        }
        for (run, r) in own.into_iter().zip(&self.fitted.ring_downs) {
            run.tau_s = Some(Estimate::new(r.tau_s, r.tau_error_s));
            warnings.extend(uneven(&run.file, r));
        }
        runs
    }
}

/// What is left of ln a about an exponential decay, rms, from which on a report says so; gains with 1/f noise of 0.2 ‰ leave less.
const UNEVEN: f64 = 5e-4;

/// Says that a ring-down is none that one damping makes.
fn uneven(file: &str, ring_down: &RingDown) -> Option<String> {
    (ring_down.uneven > UNEVEN).then(|| {
        format!(
            "{file}: the amplitude does not decay exponentially, {:.2} % rms is left of it beyond noise: something changed \
             on its way, or the readout bends; the interval of its time constant, and of the actuation gain ratio, covers as much",
            100.0 * ring_down.uneven
        )
    })
}

/// Held-out errors of more than this many noise floors have a cause that was not found; the blind trial's largest is 1.1.
const LEFT_OVER: f64 = 3.0;

/// Says that more than noise is left.
fn left_over(heldout: &Heldout) -> Option<String> {
    let floors = heldout.discovered.rms_deg / heldout.noise_floor_deg;
    (floors.is_finite() && floors > LEFT_OVER).then(|| {
        format!(
            "what is left on held-out data is {floors:.1} times the noise floor: an effect that nothing here explains, a \
             recording that changed on its way, or noise that wanders; what is left may be in every value as well"
        )
    })
}

/// What drives that clip mean for the rest.
const CLIPPED_DRIVES: &str = "the drives clip: the fit counts with what they put out at the level that was found, and no calibration \
                              undoes it; a smaller amplitude, or limits of the commands below that level, would avoid it";

/// Says what an effect cannot be told from, and what would.
fn confounded(e: &EffectReport) -> String {
    format!(
        "{} is confounded with {} in this campaign; {} would separate them",
        e.id,
        e.confounded_with.join(", "),
        e.separated_by.as_deref().unwrap_or("another run")
    )
}

/// Says that effects as text had no part in an answer, and why.
pub(crate) fn not_tried(effects: &[EffectId], why: &str) -> Option<String> {
    let ids: Vec<&str> = effects.iter().map(|e| e.description().id).collect();
    (!ids.is_empty()).then(|| format!("{} had no part in this: {why}", ids.join(", ")))
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
        temp_c: run.recording.temp_c.as_deref().and_then(mean_finite),
        detection_gain_ratio: None,
        agrees: None,
    }
}

/// Mean of what is finite.
fn mean_finite(values: &[f64]) -> Option<f64> {
    let (sum, count) = values.iter().filter(|v| v.is_finite()).fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    (count > 0).then(|| sum / count as f64)
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
    Figures { bias, ring_downs, channels: None }
}
