//! What the filter learned, in the form that all instruments share: numbers with intervals, what is not identifiable, and
//! which run would tell it.

use cvg_calibrator::replay::Replay;
use cvg_calibrator::{Correction, Parameter, Settings};
use cvg_model::effects::{EffectId, Shown, Values};

use super::identify::PACE_S;
use crate::error::Refusal;
use crate::model::hypothesis::{Hypothesis, Member, Origin};
use crate::recording::{Campaign, Instrument, Role};
use crate::report::calibration::{Calibration, Provenance};
use crate::report::polar::polar;
use crate::report::provenance;
use crate::report::recorded::run_report;
use crate::report::survey::{Innovation, NotIdentifiable, Survey, VirtualPrecession};
use crate::report::{EffectReport, Estimate, ParameterReport, Status, Tool};
use crate::survey::Surveyed;

/// What was learned, ready to be said.
struct Finding<'a> {
    learned: &'a Replay<f64>,
    /// in force, and believed beyond
    correction: Correction<f64>,
    settings: &'a Settings,
    detection_known: bool,
    /// by how much wider intervals are than the filter's own
    wider: f64,
}

/// Held-out predictions that leave so many times their noise lack something: a command of another size, later than it is said to be, or
/// what drifts. The filter takes it for noise of its own, and its intervals become as many times as wide: engineering choice.
const LACKING: f64 = 10.0;

/// By how many times its noise the channel that is followed worst is left, if that is more than chance makes of it.
fn lacking(heldout: &[Innovation]) -> Option<(&Innovation, f64)> {
    let left = heldout.iter().map(|i| (i, i.rms_rad / i.noise_rad.max(f64::MIN_POSITIVE)));
    left.filter(|(_, times)| *times > LACKING).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Reports.
///
/// # Errors
/// [`Refusal`] where nothing is told, or what is told is no calibration.
pub(crate) fn report(
    campaign: &Campaign,
    settings: &Settings,
    learned: &Replay<f64>,
    heldout: Vec<Innovation>,
) -> Result<Surveyed, Refusal> {
    let status = learned.status();
    let no_answer = |problem: &str, wanted: &str| Refusal::no_answer(&campaign.device, problem, wanted);
    let correction = if status.detection_known { learned.believed() } else { Some(*learned.correction()) };
    let Some(correction) = correction else {
        return Err(no_answer("what these recordings tell is no instrument", "other runs"));
    };
    let wider = lacking(&heldout).map_or(1.0, |(_, times)| times);
    let found = Finding { learned, correction, settings, detection_known: status.detection_known, wider };
    if !(status.detection_known || learned.told(Parameter::ForceRatio)) {
        return Err(no_answer(
            "the pattern hardly moved: readout and drives are not identifiable",
            "half a minute and more of virtual precession to and fro, and ten seconds of turning by hand",
        ));
    }
    let runs = campaign.runs.iter().map(run_report).collect();
    let inputs = provenance::sums(&provenance::files(campaign));
    let mut out = Survey::new(campaign.device.clone(), "gyroscope", inputs, runs);
    for (run, of) in out.runs.iter_mut().zip(&campaign.runs) {
        run.r#use = if of.role == Role::Holdout { "holdout".into() } else { "fit".into() };
    }
    out.warnings = campaign.all_warnings().map(str::to_owned).collect();
    out.warnings.extend(remarks(campaign, settings.control_s));
    out.warnings.extend(lacking(&heldout).map(|(innovation, times)| {
        format!(
            "the equation of motion leaves {times:.0} times the noise of the {}: a command is of another size than virtual_dps or drive_per_s_v \
             say, or later, or something drifts; every interval is as many times as wide",
            innovation.channel
        )
    }));
    out.effects = found.effects();
    (out.detection_gain_ratio, out.actuation_gain_ratio) = (found.detection_ratio(), found.actuation_ratio());
    out.virtual_precession = Some(VirtualPrecession {
        seconds: learned.seconds(),
        detection_known: status.detection_known,
        bias_deg: status.bias_rad.to_degrees(),
        parameters: found.parameters(),
        not_identifiable: found.not_identifiable(),
        heldout,
    });
    let calibration = if status.detection_known {
        Some(found.calibration(campaign)?)
    } else {
        out.status = Status::Neutral;
        out.reason = Some(format!(
            "at rest only the product of detection and actuation shows: the two cannot be separated, and nothing is undone \
             ({:.2}° of bias may be left)",
            status.bias_rad.to_degrees()
        ));
        None
    };
    Ok(Surveyed { report: out, calibration, curve: None })
}

/// What the campaign left unsaid.
fn remarks(campaign: &Campaign, interval_s: f64) -> Vec<String> {
    let mut out = Vec::new();
    if campaign.drive_per_s_v.is_none() {
        out.push(
            "drive_per_s_v is not given in [campaign]: a volt of command is taken to make 1 V/s of the envelope".into(),
        );
    }
    if campaign.control_hz.is_none() && interval_s > PACE_S {
        out.push("control_hz is not given in [campaign]: forces are taken to follow the pattern between rows".into());
    }
    for run in campaign.runs.iter().filter(|r| r.recording.virtual_dps.is_none()) {
        out.push(format!("{}: without virtual_dps nothing is taken to have been commanded", run.file.display()));
    }
    if campaign.angular_gain.is_none() {
        out.push("no run tells the angular gain: a table or a known rate would".into());
    }
    out
}

fn entry(name: &str, unit: &str, value: f64, deviation: Option<f64>) -> ParameterReport {
    let ci95 = deviation.map(|d| Estimate::new(value, d).ci95);
    ParameterReport { name: name.into(), unit: unit.into(), value, ci95 }
}

impl Finding<'_> {
    fn deviation(&self, of: &[(Parameter, f64)]) -> f64 {
        self.wider * self.learned.variance(of).sqrt()
    }

    /// G_Dy/G_Dx.
    fn detection_ratio(&self) -> Option<Estimate> {
        let deviation = self.deviation(&[(Parameter::DetectionRatio, 1.0)]);
        self.detection_known.then(|| Estimate::new(1.0 + self.correction.detection_ratio(), deviation))
    }

    /// G_Ax/G_Ay: the drives as they are seen through the readout, less what is not known of that.
    fn actuation_ratio(&self) -> Option<Estimate> {
        if !(self.detection_known && self.learned.told(Parameter::ForceRatio)) {
            return None;
        }
        let d = self.correction.drives();
        let deviation = self.deviation(&[(Parameter::ForceRatio, 1.0), (Parameter::DetectionRatio, -1.0)]);
        // drives that are late push as hard
        Some(Estimate::new(d.xx.re.hypot(d.xx.im) / d.yy.re.hypot(d.yy.im), deviation))
    }

    /// Effects of the library, with their values and deviations. Those of mechanics, offsets and skewed drives are too
    /// narrow, and not given.
    fn members(&self) -> Vec<(EffectId, Values<f64>, Vec<Option<f64>>)> {
        use Parameter as P;
        let (c, a) = (&self.correction, self.settings.amplitude_v);
        let own = |p: P| self.deviation(&[(p, 1.0)]);
        let told = |of: &[P]| of.iter().all(|p| self.learned.told(*p));
        let mut out = Vec::new();
        let mut add = |id, values: [f64; 2], deviations: &[Option<f64>]| {
            out.push((id, [values[0], values[1], 0.0, 0.0], deviations.to_vec()));
        };
        if told(&[P::AnisodampingCos, P::AnisodampingSin]) {
            let both = [P::AnisodampingCos, P::AnisodampingSin].map(|p| 2.0 * c.known(p));
            add(EffectId::Anisodamping, both, &[None, None]);
        }
        if told(&[P::SplitCos, P::SplitSin]) {
            add(EffectId::Anisoelasticity, [P::SplitCos, P::SplitSin].map(|p| c.known(p)), &[None, None]);
        }
        if told(&[P::Cubic]) {
            let kappa = 4.0 / (3.0 * a * a);
            add(EffectId::DetectionCubic, [kappa * c.known(P::Cubic), 0.0], &[Some(kappa * own(P::Cubic))]);
        }
        if told(&[P::OffsetX, P::OffsetY]) {
            add(EffectId::DetectionOffset, [P::OffsetX, P::OffsetY].map(|p| a * c.known(p)), &[None, None]);
        }
        if !self.detection_known {
            return out;
        }
        let ratio = 1.0 + c.detection_ratio();
        if let Some(e) = self.actuation_ratio() {
            add(EffectId::ActuationGainMismatch, [e.value, 0.0], &[Some(e.half_width() / 1.96)]);
        }
        if told(&[P::ForceSkew, P::ForceRotation]) {
            let d = c.drives();
            add(EffectId::ActuationSkew, [(d.yx.re + d.xy.re) / d.xx.re, 0.0], &[None]);
        }
        add(EffectId::DetectionSkew, [c.detection_skew() / ratio, 0.0], &[Some(own(P::DetectionSkew))]);
        add(EffectId::DetectionGainMismatch, [ratio, 0.0], &[Some(own(P::DetectionRatio))]);
        add(EffectId::DetectionPhase, [c.detection_phase(), 0.0], &[Some(own(P::DetectionPhase))]);
        out.sort_by_key(|(id, ..)| *id);
        out
    }

    fn effects(&self) -> Vec<EffectReport> {
        let report = |(id, values, deviations): (EffectId, Values<f64>, Vec<Option<f64>>)| EffectReport {
            id: id.description().id.into(),
            origin: if id.description().declared { Origin::Declared } else { Origin::Discovered },
            parameters: shown(id, &values, &deviations),
            heldout_rms_deg: None,
            evidence: evidence(id).into(),
            confounded_with: Vec::new(),
            separated_by: None,
        };
        self.members().into_iter().filter(does_something).map(report).collect()
    }

    /// What no effect of the library says.
    fn parameters(&self) -> Vec<ParameterReport> {
        use Parameter as P;
        let (c, d) = (&self.correction, self.correction.drives());
        let own = |p: P| Some(self.deviation(&[(p, 1.0)]));
        let mut out = Vec::new();
        if self.learned.told(P::ForceScale) {
            out.push(entry("drive_per_s_v", "1/s", self.settings.drive_per_s * d.xx.re, None));
            out.push(entry("damping_per_s", "1/s", c.known(P::Damping), None));
        }
        if !self.detection_known {
            out.push(entry("product_ratio", "1", d.yy.re / d.xx.re, own(P::ForceRatio)));
            out.push(entry("product_skew", "1", d.yx.re + d.xy.re, own(P::ForceSkew)));
        }
        if self.learned.told(P::ForceRotation) {
            out.push(entry("drive_rotation", "rad", -d.xy.re, None));
        }
        if self.learned.told(P::ForcePhase) {
            out.push(entry("drive_phase", "rad", d.xx.im.atan2(d.xx.re), None));
        }
        out
    }

    fn not_identifiable(&self) -> Vec<NotIdentifiable> {
        let mut out = Vec::new();
        let mut say = |what: &str, by: &str| out.push(NotIdentifiable { what: what.into(), separated_by: by.into() });
        if !self.detection_known {
            say(
                "the share of the detection in the product of detection and actuation",
                "ten seconds of turning by hand, 30 to 90 deg/s, in any way that sweeps the pattern by half a turn; or a run \
                 with a second split of the frequencies",
            );
        }
        if !self.learned.told(Parameter::ForceScale) {
            say(
                "the scale of the forces, and with it damping and split in units of time",
                "virtual precession to and fro at rest",
            );
        }
        say("the angular gain, the common gain of the detection, a constant rate", "a rotation at a known rate");
        out
    }

    fn calibration(&self, campaign: &Campaign) -> Result<Calibration, Refusal> {
        let mut h =
            Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, campaign.angular_gain.unwrap_or(1.0));
        h.damping_per_s = self.correction.known(Parameter::Damping);
        let d = self.correction.drives();
        h.force_scale = self.settings.drive_per_s * (d.xx.re * d.yy.re).sqrt();
        let member = |(id, values, _)| Member { id, values, origin: Origin::Declared, refined: true };
        h.members = self.members().into_iter().map(member).collect();
        let low_high = campaign.runs.iter().filter_map(|r| provenance::amplitude(&r.recording));
        let (low, high) = low_high.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let provenance = Provenance {
            tool: Some(Tool::default()),
            inputs: provenance::sums(&provenance::files(campaign)),
            amplitude_v: (high > 0.0).then_some([low, high]),
            ..Provenance::default()
        };
        let calibration = Calibration { device: campaign.device.clone(), hypothesis: h, provenance };
        Calibration::from_text(&calibration.to_text(), "the calibration").map_err(|why| {
            Refusal::no_answer(&campaign.device, format!("what was found is no calibration: {why}"), "other runs")
        })?;
        Ok(calibration)
    }
}

/// Values as reports show them: each that has a deviation here, and a pair as a magnitude and an angle.
fn shown(id: EffectId, values: &Values<f64>, deviations: &[Option<f64>]) -> Vec<ParameterReport> {
    let d = id.description();
    let mut out = Vec::new();
    for shown in d.shown {
        match *shown {
            Shown::Plain(at) => {
                out.extend(
                    deviations
                        .get(at)
                        .map(|d_at| entry(d.parameters[at].name, d.parameters[at].unit, values[at], *d_at)),
                );
            }
            Shown::Polar { cos, sin, magnitude, unit, angle, division } => {
                let (size, turned) = polar([values[cos], values[sin]], (0.0, 0.0, 0.0), division);
                out.extend([entry(magnitude, unit, size.value, None), entry(angle, "deg", turned.value, None)]);
            }
        }
    }
    out
}

/// An effect that is worth nothing within the intervals of its parameters is none.
fn does_something((id, values, deviations): &(EffectId, Values<f64>, Vec<Option<f64>>)) -> bool {
    let is_neutral = |((deviation, value), neutral): ((&Option<f64>, &f64), f64)| {
        deviation
            .is_some_and(|d| Estimate::new(*value, d).ci95[0] <= neutral && neutral <= Estimate::new(*value, d).ci95[1])
    };
    !deviations.iter().zip(values).zip(id.neutral()).all(is_neutral)
}

/// What speaks for an effect.
fn evidence(id: EffectId) -> &'static str {
    match id {
        EffectId::DetectionGainMismatch | EffectId::DetectionSkew => {
            "the measured energy of a pattern that rotation turned: rotation draws none (Equation 6)"
        }
        EffectId::DetectionPhase => "the measured quadrature of a pattern that rotation turned",
        EffectId::ActuationGainMismatch | EffectId::ActuationSkew => {
            "precession and energy against the forces that were commanded, the readout undone"
        }
        EffectId::Anisodamping => "energy and angle of a pattern turned by known forces, both ways",
        EffectId::Anisoelasticity => "the forces that hold the quadrature, over the angle",
        EffectId::DetectionCubic => "four times the angle in the measured angle and energy",
        _ => "the angle itself in the measured angle and energy",
    }
}
