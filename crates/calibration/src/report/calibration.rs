//! `calibration.toml`: what was identified, in the form in which it is put to use. Versioned, and closed with a checksum
//! over every byte before it: a damaged or edited file is refused.

use std::fmt::Write as _;
use std::path::Path;

use cvg_model::effects::{EffectId, Parameter};
use serde::{Deserialize, Serialize};

use crate::error::Refusal;
use crate::facts::LARGEST_RATIO_OF_A_SENSOR;
use crate::model::angle_table::AngleTable;
use crate::model::hypothesis::{ChannelClip, Hypothesis, Member, Origin};
use crate::model::written::EffectText;
use crate::recording::{Instrument, read_text};
use crate::report::{Input, Tool};

/// Identifier of the format.
pub const SCHEMA: &str = "cvg.calibration/1";
/// Periods that a vibration's angle and a sensor's have, deg.
const PERIODS_DEG: [f64; 2] = [180.0, 360.0];
/// What the last line starts with.
const CHECKSUM: &str = "checksum = \"crc32:";

/// An identified instrument, ready to be compensated.
///
/// ```
/// use cvg_calibration::recording::Instrument;
/// use cvg_calibration::{Hypothesis, calibration::{Calibration, Provenance}};
///
/// let hypothesis = Hypothesis::ideal(Instrument::Gyroscope, core::f64::consts::PI, 0.78);
/// let calibration = Calibration { device: "dfp-7".into(), hypothesis, provenance: Provenance::default() };
/// let text = calibration.to_text();
/// assert_eq!(Calibration::from_text(&text, "calibration.toml")?.device, "dfp-7");
/// // what was changed afterwards is refused
/// assert!(Calibration::from_text(&text.replace("0.78", "0.79"), "calibration.toml").is_err());
/// # Ok::<(), cvg_calibration::Refusal>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// name of the instrument
    pub device: String,
    /// what is known of it
    pub hypothesis: Hypothesis,
    /// what it was made of
    pub provenance: Provenance,
}

/// What a calibration was made of, and for which recordings it is meant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Provenance {
    /// the program
    pub tool: Option<Tool>,
    /// the files that were read
    pub inputs: Vec<Input>,
    /// smallest and largest amplitude of the readout, in its unit, as the medians of runs; none where only an angle was read
    pub amplitude_v: Option<[f64; 2]>,
    /// unit of the readout, where it is not V: what is said in V is in it
    pub readout_unit: Option<String>,
    /// where in the sensor's period the rows stood that a table was made of, from and to, deg of its own angle; none where that is all of
    /// it, or there is no table
    pub covered_deg: Option<[f64; 2]>,
    /// how much of the radius goes with the angle in the rows that a sensor's readout was made of, with it undone, as a share; none where
    /// there are no channels
    pub radius_left: Option<f64>,
    /// there was no reference, and nothing stated how often the angle goes round with it: the hypothesis' angular gain stands for nothing
    pub gain_unknown: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: String,
    device: String,
    instrument: String,
    period_deg: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    angular_gain: Option<f64>,
    follows_input: bool,
    force_scale_per_v_s: f64,
    control_latency_s: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    rate_bias_rad_s: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    rate_bias_per_k_rad_s: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    amplitude_v: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    readout_unit: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    covered_deg: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius_left: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    temperature_c: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tool: Option<Tool>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    input: Vec<Input>,
    #[serde(default)]
    effect: Vec<EffectEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    angle_table: Option<AngleTable>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    clip: Option<ChannelClip>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "as serde asks")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectEntry {
    id: String,
    origin: Origin,
    parameters: std::collections::BTreeMap<String, f64>,
    /// the effect itself, where it is not the library's
    #[serde(default, skip_serializing_if = "Option::is_none")]
    text: Option<String>,
}

impl Calibration {
    /// The file's text.
    pub fn to_text(&self) -> String {
        let h = &self.hypothesis;
        let file = File {
            schema: SCHEMA.into(),
            device: self.device.clone(),
            instrument: h.instrument.name().into(),
            period_deg: h.period_rad.to_degrees().round(),
            angular_gain: (!self.provenance.gain_unknown).then_some(h.angular_gain),
            follows_input: h.follows_input,
            force_scale_per_v_s: h.force_scale,
            control_latency_s: h.control_latency_s,
            effect: h
                .members
                .iter()
                .map(|m| EffectEntry {
                    id: m.id.to_string(),
                    origin: m.origin,
                    parameters: m
                        .id
                        .description()
                        .parameters
                        .iter()
                        .zip(m.values)
                        .map(|(p, v)| (p.name.to_string(), v))
                        .collect(),
                    text: match m.id {
                        EffectId::WrittenFirst(written) | EffectId::Written(written) => Some(written.text.to_owned()),
                        _ => None,
                    },
                })
                .collect(),
            rate_bias_rad_s: h.rate_bias_rad_s,
            rate_bias_per_k_rad_s: h.rate_bias_per_k_rad_s,
            amplitude_v: self.provenance.amplitude_v,
            readout_unit: self.provenance.readout_unit.clone(),
            covered_deg: self.provenance.covered_deg,
            radius_left: self.provenance.radius_left,
            temperature_c: h.reference_c,
            tool: self.provenance.tool.clone(),
            input: self.provenance.inputs.clone(),
            angle_table: h.angle_table.clone(),
            clip: h.clip,
        };
        let mut text = String::from("# Identified by cvg. Edited by hand, it is refused.\n");
        // every field is a plain value: serialisation has nothing to fail on
        text.push_str(&toml::to_string(&file).unwrap_or_default());
        let sum = crc32fast::hash(text.as_bytes());
        let _ = writeln!(text, "\n# {CHECKSUM}{sum:08x}\"");
        text
    }

    /// Reads a calibration from its text; `name` is the file's, for messages.
    ///
    /// # Errors
    /// Where the checksum, the version, an effect or a parameter is not right.
    pub fn from_text(text: &str, name: &str) -> Result<Self, Refusal> {
        let refuse = |problem: String, wanted: &str| Err(Refusal::new(name, problem, wanted));
        let marker = format!("\n# {CHECKSUM}");
        let Some((body, sum)) = text.rsplit_once(&marker) else {
            return refuse("the closing checksum is missing".into(), "an unedited calibration.toml as cvg wrote it");
        };
        let actual = crc32fast::hash(body.as_bytes());
        if sum != format!("{actual:08x}\"\n") {
            return refuse(
                format!("the file was changed after it was written (its checksum is {actual:08x})"),
                "an unedited calibration.toml as cvg wrote it",
            );
        }
        let schema = body.lines().find_map(|l| l.strip_prefix("schema = ")).unwrap_or_default().trim_matches('"');
        if schema != SCHEMA {
            return refuse(format!("its format is \"{schema}\""), &format!("\"{SCHEMA}\": identify again"));
        }
        let file: File = toml::from_str(body).map_err(|e| {
            let line = e.span().map_or(0, |span| body[..span.start.min(body.len())].matches('\n').count() + 1);
            Refusal::new(
                name,
                format!("line {line}: {}", e.message().replace('\n', " ")),
                "a calibration as cvg wrote it",
            )
        })?;
        let instrument = match file.instrument.as_str() {
            "gyroscope" => Instrument::Gyroscope,
            "sensor" => Instrument::Sensor,
            other => return refuse(format!("unknown instrument \"{other}\""), "gyroscope or sensor"),
        };
        if !PERIODS_DEG.contains(&file.period_deg) {
            return refuse(format!("its angle has a period of {} deg", file.period_deg), "180 or 360");
        }
        let mut hypothesis =
            Hypothesis::ideal(instrument, file.period_deg.to_radians(), file.angular_gain.unwrap_or(1.0));
        hypothesis.follows_input = file.follows_input;
        hypothesis.force_scale = file.force_scale_per_v_s;
        hypothesis.control_latency_s = file.control_latency_s;
        for e in &file.effect {
            hypothesis.members.push(member(e, instrument, name)?);
        }
        hypothesis.members.sort_by_key(|m| m.id);
        let cycles = std::f64::consts::TAU / hypothesis.period_rad;
        if file.angle_table.as_ref().is_some_and(|t| t.cos.len() != t.sin.len() || !t.is_invertible(cycles)) {
            return refuse("angle_table is no table that can be undone".into(), "a calibration as cvg wrote it");
        }
        hypothesis.angle_table = file.angle_table;
        hypothesis.clip = file.clip;
        hypothesis.reference_c = file.temperature_c;
        hypothesis.rate_bias_rad_s = file.rate_bias_rad_s;
        hypothesis.rate_bias_per_k_rad_s = file.rate_bias_per_k_rad_s;
        let provenance = Provenance {
            tool: file.tool,
            inputs: file.input,
            amplitude_v: file.amplitude_v,
            readout_unit: file.readout_unit,
            covered_deg: file.covered_deg,
            radius_left: file.radius_left,
            gain_unknown: file.angular_gain.is_none(),
        };
        Ok(Self { device: file.device, hypothesis, provenance })
    }

    /// Reads a calibration file.
    ///
    /// # Errors
    /// Where the file cannot be read, or is refused.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let name = path.display().to_string();
        let text =
            read_text(path).map_err(|e| Refusal::new(&name, format!("cannot be read: {e}"), "a calibration.toml"))?;
        Self::from_text(&text, &name)
    }
}

/// A value is one that the parameter can have. The library's bounds are of volts, and of two channels that were made alike; what a
/// sensor's channels are in, millivolts or the counts of a converter, nobody says.
fn is_within(id: EffectId, parameter: &Parameter, instrument: Instrument, value: f64) -> bool {
    let sensor = instrument == Instrument::Sensor;
    let bounds = match id {
        _ if sensor && parameter.unit.contains('V') => f64::NEG_INFINITY..=f64::INFINITY,
        EffectId::DetectionGainMismatch if sensor => LARGEST_RATIO_OF_A_SENSOR.recip()..=LARGEST_RATIO_OF_A_SENSOR,
        _ => parameter.lower..=parameter.upper,
    };
    value.is_finite() && bounds.contains(&value)
}

fn member(entry: &EffectEntry, instrument: Instrument, name: &str) -> Result<Member, Refusal> {
    let id = match &entry.text {
        Some(text) => EffectText::parse(text, name)?.effect(name)?,
        None => EffectId::from_id(&entry.id).ok_or_else(|| {
            Refusal::new(name, format!("unknown effect \"{}\"", entry.id), "an effect of the library")
        })?,
    };
    if id.description().id != entry.id {
        return Err(Refusal::new(
            name,
            format!("\"{}\" has the text of {id}", entry.id),
            "a calibration as cvg wrote it",
        ));
    }
    let parameters = id.description().parameters;
    let mut values = id.neutral::<f64>();
    for (key, value) in &entry.parameters {
        let at = parameters.iter().position(|p| p.name == key);
        let sound = at.is_some_and(|i| is_within(id, &parameters[i], instrument, *value));
        let (Some(i), true) = (at, sound) else {
            return Err(Refusal::new(
                name,
                format!("{}: {key} = {value} is not a parameter within its bounds", entry.id),
                "the library's names and bounds",
            ));
        };
        values[i] = *value;
    }
    Ok(Member { id, values, origin: entry.origin, refined: true })
}
