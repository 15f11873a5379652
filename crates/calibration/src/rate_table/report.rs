//! What was found on a rate table, as facts.

use cvg_model::effects::EffectId;
use cvg_model::effects::harmonic_n::scaling::DIRECTION;
use nalgebra::DMatrix;

use crate::data::quantised_drives::Quantisation;
use crate::diagnostics::influences::shares;
use crate::diagnostics::plots::PlotContext;
use crate::diagnostics::temperature::{LEAST_SPAN_K, Seen, temperature};
use crate::error::Refusal;
use crate::estimation::actuation::RingDown;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::unknown_drives::said_of_the_damping;
use crate::estimation::unseen_quadrature::said_of_the_quadrature;
use crate::identified::{Identification, not_taken};
use crate::model::hypothesis::{Member, Origin};
use crate::numerics::statistics::span;
use crate::rate_table::errors::{Errors, figures};
use crate::recording::Role;
use crate::report::benefit::no_better;
use crate::report::calibration::{Calibration, Provenance};
use crate::report::channels::channels;
use crate::report::gate::{self, Facts, unusual_gain};
use crate::report::inference::Inference;
use crate::report::proposals::proposals;
use crate::report::recorded::set_aside;
use crate::report::repeatability::of_the_gain;
use crate::report::runs::tell_apart;
use crate::report::stages::stages;
use crate::report::unexplained::{LEFT_OVER, described, left_over, residual_report, unexplained};
use crate::report::{EffectReport, Estimate, Input, Report, RunReport, SCHEMA, ScaleFactor, Status, Temperature, Tool};
use crate::selection::one_law::OneLaw;
use crate::selection::step::Step;

/// What the campaign says of itself, kept while its recordings are taken apart.
pub(super) struct Head {
    pub(super) device: String,
    pub(super) runs: Vec<RunReport>,
    pub(super) inputs: Vec<Input>,
    pub(super) amplitude_v: Option<[f64; 2]>,
}

/// A temperature that lies so far from those that were recorded is another one, K.
const EXTRAPOLATED_K: f64 = 10.0;

/// An identified campaign, before it is told.
pub(super) struct Found {
    pub(super) dataset: Dataset,
    pub(super) declared_fit: Fit,
    pub(super) fitted: Fitted,
    pub(super) covariance: DMatrix<f64>,
    /// the same with what effects that were not found may have moved
    pub(super) with_hidden: DMatrix<f64>,
    pub(super) steps: Vec<Step>,
    /// what explains by itself what has no cause
    pub(super) law: Option<OneLaw>,
    pub(super) scale_factor: Option<ScaleFactor>,
    pub(super) errors: Errors,
    /// drives that clip, which the commands tell and the angle does not
    pub(super) drives: Option<EffectReport>,
}

/// What nothing in the campaign tells, and what tells two things.
fn said_of_what_is_open(inference: &Inference<'_>, angular_gain: Estimate) -> Vec<String> {
    let Inference { dataset, fitted, .. } = inference;
    let hypothesis = &fitted.fit.hypothesis;
    let mut said: Vec<String> = inference.said_of_the_unbelieved().collect();
    said.extend(unusual_gain(angular_gain.value, dataset.screen.stated(), dataset.instrument));
    said.extend(inference.cubics_that_may_differ());
    said.extend(said_of_the_damping(dataset, fitted));
    said.extend(dataset.said_of_the_other_damping(hypothesis));
    said.extend(said_of_the_quadrature(dataset, fitted));
    said.extend(not_taken(&dataset.written, hypothesis));
    said
}

impl Found {
    pub(super) fn report(
        self,
        head: Head,
        mut warnings: Vec<String>,
        with_plots: bool,
    ) -> Result<Identification, Refusal> {
        let Self { dataset, fitted, errors, .. } = &self;
        let mut channels_left = channels(dataset, &self.declared_fit, "declared", &errors.declared_on_fit);
        channels_left.extend(channels(dataset, &fitted.fit, "discovered", &errors.on_fit));
        let inference = Inference { dataset, fitted, by_fit: &self.covariance, covariance: &self.with_hidden };
        let own_ratios = self.context(&[]).own_detection_ratios();
        let detection_gain_ratio = inference.detection_ratio(&own_ratios, &mut warnings);
        let actuation_gain_ratio = inference.actuation_ratio(detection_gain_ratio, &mut warnings);
        let mut effects = inference.effects(&self.steps, &errors.discovered);
        effects.extend(dataset.quantisation.as_ref().and_then(Quantisation::report));
        effects.extend(self.drives.clone());
        warnings.extend(dataset.quantisation.as_ref().map(Quantisation::said));
        warnings.extend(self.drives.as_ref().map(|_| CLIPPED_DRIVES.to_owned()));
        warnings.extend(effects.iter().filter(|e| !e.confounded_with.is_empty()).map(confounded));
        let angular_gain = inference.angular_gain(&mut warnings);
        warnings.extend(said_of_what_is_open(&inference, angular_gain));
        let plots = with_plots.then(|| {
            let members = &fitted.fit.hypothesis.members;
            let told: Vec<usize> = (0..members.len()).filter(|&at| inference.identifiable(at, &members[at])).collect();
            self.context(&told).plots()
        });
        let left = unexplained(dataset, &errors.on_fit, &errors.dense_on_fit, &errors.discovered, errors.noise_floor);
        let proposals = proposals(dataset, &fitted.fit, &errors.on_fit, &channels_left, (&left, self.law.as_ref()));
        let mut unexplained = described(&fitted.fit.hypothesis, &self.steps);
        unexplained.extend(left);
        let facts = self.facts();
        let mut runs = self.runs(head.runs, &mut warnings);
        warnings.extend(self.extrapolated());
        warnings.extend(fitted.fit.hypothesis.members.iter().filter_map(large_without_cause));
        self.at_their_temperatures(&mut runs);
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
            decomposition: shares(&self.errors.declared_on_fit, &amplitudes),
            proposals,
            scale_factor: self.scale_factor,
            repeatability_ppm: of_the_gain(&runs, angular_gain).map(|told| told.deviation),
            runs,
            misalignment: Vec::new(),
            allan: None,
            temperature,
            decay: None,
            warnings,
        };
        report.warnings.extend(left_over(&report.heldout));
        self.allow_for_what_is_left(&mut report);
        one_interval_a_number(&mut report);
        each_run_with_what_all_share(&mut report);
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

    /// What the gate holds the report against.
    fn facts(&self) -> Facts {
        Facts {
            instrument: self.dataset.instrument,
            period_deg: self.dataset.start.period_rad.to_degrees(),
            tells_gain: true,
            stated: self.dataset.screen.stated(),
            held_out: self.errors.discovered.errors().count(),
            fitted_rms_deg: self.errors.on_fit.mean_square().sqrt().to_degrees(),
        }
    }

    /// Widens the intervals of the angular gain and of the detection gain ratio by what can be in them of what is left of the
    /// fitted data beyond noise: an error Δk·α leaves Δk/√12 of the way rms, and one of the ratio, ½Δg sin 2θ, leaves Δg/√8.
    /// Nothing that is held out has a say.
    fn allow_for_what_is_left(&self, report: &mut Report) {
        let left = self.errors.on_fit.mean_square().sqrt();
        let floors = left / self.errors.on_fit.noise_floor();
        if !(floors.is_finite() && floors > LEFT_OVER) {
            return;
        }
        let ways = self.dataset.tracks.iter().map(|t| span(&t.track.input_rad));
        let farthest = ways.fold(0.0, f64::max);
        if farthest > 0.0 {
            report.angular_gain = report.angular_gain.widened(12f64.sqrt() * left / farthest);
        }
        report.detection_gain_ratio = report.detection_gain_ratio.map(|ratio| ratio.widened(8f64.sqrt() * left));
        report.warnings.push(format!(
            "what is left of the fitted data is {floors:.1} times the noise floor: the intervals of the angular gain and of the \
             detection gain ratio allow for as much of it as can be in them"
        ));
    }

    fn calibration(&self, report: &Report, amplitude_v: Option<[f64; 2]>) -> Calibration {
        let (tool, inputs) = (Some(Tool::default()), report.inputs.clone());
        let provenance = Provenance { tool, inputs, amplitude_v, ..Provenance::default() };
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
        let reference_c = h.reference_c?;
        let of = |pick: fn(f64, f64) -> f64, from: f64| {
            self.dataset.tracks.iter().flat_map(|t| t.track.temperatures_c()).fold(from, pick)
        };
        let (low, high) = (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY));
        let beyond = (low - reference_c).max(reference_c - high);
        if !h.members.iter().any(|m| m.id.by_temperature()) {
            return (beyond.is_finite() && beyond > LEAST_SPAN_K).then(|| {
                format!(
                    "the runs were recorded between {low:.1} and {high:.1} °C, and what follows the temperature is not told: what is stated is \
                     of these temperatures and not of the {reference_c:.1} °C of temperature_c; runs at other temperatures, with temp_c, would tell"
                )
            });
        }
        (beyond > EXTRAPOLATED_K).then(|| {
            format!(
                "what follows the temperature is stated at {reference_c:.1} °C (temperature_c) and was recorded between \
                 {low:.1} and {high:.1} °C: it is extrapolated by {beyond:.0} K, beyond its interval; temp_c in °C, or \
                 temperature_c where it was recorded"
            )
        })
    }

    /// Gives each run the angular gain and the drift at its own temperature, where what it tells was taken back to one of all.
    fn at_their_temperatures(&self, runs: &mut [RunReport]) {
        let h = &self.fitted.fit.hypothesis;
        let Some((member, reference_c)) = h.member(EffectId::ScaleTemperature).zip(h.reference_c) else { return };
        for (run, t) in self.dataset.screen.of(runs).into_iter().zip(&self.dataset.tracks) {
            let (n, sum) = t.track.temperatures_c().fold((0.0, 0.0), |(n, sum), c| (n + 1.0, sum + c - reference_c));
            let share = member.values[0] * sum / f64::max(n, 1.0);
            let scaled = |gain: Estimate| Estimate {
                value: (1.0 + share) * gain.value,
                ci95: gain.ci95.map(|end| (1.0 + share) * end),
            };
            run.angular_gain = run.angular_gain.map(scaled);
            // one way, a drift and a share of the gain are one number
            let drift_dps = t.track.one_way_rate().map_or(0.0, |rate| (share * h.precession(rate)).to_degrees());
            run.bias_dps = run.bias_dps.map(|bias| bias.turned(drift_dps));
        }
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
        warnings.extend(set_aside(all_spikes, "sample"));
        warnings.extend(tell_apart(&mut runs, &self.dataset, fit, (&self.errors.on_fit, after)));
        let screen = &self.dataset.screen;
        let spikes = spikes.into_iter().zip(screen.spikes()).map(|(set_aside, mended)| set_aside + mended);
        for ((run, t), spikes) in screen.of(&mut runs).into_iter().zip(&self.dataset.tracks).zip(spikes) {
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

/// A correction without a known cause, rad, from which on a report warns of it: electronics that work are off by a degree at most.
const LARGE_WITHOUT_CAUSE: f64 = 0.0175;

/// Says that a harmonic is corrected that is too large to be an error of electronics that work.
fn large_without_cause(member: &Member) -> Option<String> {
    let [n, cos, sin, scaling] = member.values;
    let is_one = member.id == EffectId::HarmonicN && member.origin == Origin::Empirical && scaling <= DIRECTION;
    let amplitude = cos.hypot(sin);
    (is_one && amplitude > LARGE_WITHOUT_CAUSE).then(|| {
        format!(
            "an error of {:.2}° at {n:.0}θ is corrected without a known cause: electronics that work are off by a degree at most; \
             what makes it may be in every value",
            amplitude.to_degrees()
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

/// A run's own angular gain is what it adds to that of all runs, while the rest of the model is held: its interval holds
/// what is not known of that too.
fn each_run_with_what_all_share(report: &mut Report) {
    let shared = report.angular_gain.half_width();
    for own in report.runs.iter_mut().filter_map(|run| run.angular_gain.as_mut()) {
        let half = own.half_width();
        *own = own.widened(half.hypot(shared) - half);
    }
}

/// A ratio of gains that stands for itself and as the parameter of an effect has the same interval in both places.
fn one_interval_a_number(report: &mut Report) {
    let ratios = [
        (EffectId::DetectionGainMismatch, report.detection_gain_ratio),
        (EffectId::ActuationGainMismatch, report.actuation_gain_ratio),
    ];
    for (id, ratio) in ratios.into_iter().filter_map(|(id, ratio)| Some((id, ratio?))) {
        let of = report.effects.iter_mut().filter(|e| e.id == id.description().id);
        for parameter in of.filter_map(|e| e.parameters.first_mut()) {
            parameter.ci95 = Some(ratio.ci95);
        }
    }
}
