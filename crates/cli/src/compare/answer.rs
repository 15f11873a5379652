//! What an answer tells, by the names of reports: from a report, or from a calibration.

use std::ops::Deref;
use std::path::Path;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::read_text;
use cvg_calibration::report::named::{ACCELERATION_LAG, ANGLE_TABLE, DETECTION_CLIP, RATE_OFFSET_TEMPERATURE};
use cvg_calibration::{Hypothesis, Member};
use cvg_model::effects::{EffectId, Role, Shown};
use serde_json::Value;

use super::Parameter;
use super::effect::absent;
use crate::Failure;

/// Estimates at the top of a report, the unit of each, and whether a calibration has it too.
const ESTIMATES: [(&str, &str, bool); 8] = [
    ("/angular_gain", "1", true),
    ("/detection_gain_ratio", "1", true),
    ("/actuation_gain_ratio", "1", true),
    ("/scale_factor/nonlinearity_ppm", "ppm", false),
    ("/scale_factor/asymmetry_ppm", "ppm", false),
    ("/repeatability_ppm", "ppm", false),
    ("/allan/angle_random_walk_deg_sqrt_h", "deg/√h", false),
    ("/allan/bias_instability_dph", "deg/h", false),
];

/// A parameter that an answer tells.
#[derive(Clone)]
pub(super) struct Told {
    pub(super) parameter: Parameter,
    /// what it is where a report does not have it; none where a report that does not have it may not be able to tell it
    pub(super) absent: Option<f64>,
    /// calibrations have it too
    pub(super) in_calibrations: bool,
}

impl Deref for Told {
    type Target = Parameter;

    fn deref(&self) -> &Parameter {
        &self.parameter
    }
}

impl Told {
    /// Whether its interval leaves out what it is where it is not there; none without an interval, or where nothing says what that is.
    pub(super) fn is_more_than_nothing(&self) -> Option<bool> {
        let ([low, high], absent) = (self.ci95?, self.absent?);
        Some(!(low..=high).contains(&absent))
    }
}

/// What is compared: what is told of an instrument.
pub(super) struct Answer {
    pub(super) device: String,
    pub(super) instrument: String,
    is_calibration: bool,
    told: Vec<Told>,
}

/// The parameters of two answers that both can tell. A calibration has no intervals, and what it lacks may be what it does not undo.
pub(super) fn alike(answers: [Answer; 2]) -> [Vec<Told>; 2] {
    let any = answers.iter().any(|answer| answer.is_calibration);
    answers.map(|answer| {
        let kept = answer.told.into_iter().filter(|told| told.in_calibrations || !any);
        kept.map(|told| Told { absent: told.absent.filter(|_| !any), ..told }).collect()
    })
}

/// The parameters of a report, of the report in a folder, or of a calibration.
pub(super) fn read(path: &Path) -> Result<Answer, Failure> {
    let bad = |what: String| {
        let wanted = "report.json, a folder with one, or calibration.toml, as cvg identify writes them";
        Failure::input(format!("{}: {what}; wanted {wanted}", path.display()))
    };
    let file = if path.is_dir() { path.join("report.json") } else { path.to_owned() };
    if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let calibration = Calibration::read(&file)?;
        return Ok(Answer {
            instrument: calibration.hypothesis.instrument.name().to_owned(),
            told: of_calibration(&calibration),
            device: calibration.device,
            is_calibration: true,
        });
    }
    let text = read_text(&file).map_err(|e| bad(format!("cannot be read: {e}")))?;
    let report: Value = serde_json::from_str(&text).map_err(|e| bad(format!("is no report: {e}")))?;
    if !report["schema"].as_str().is_some_and(|s| s.starts_with("cvg.report/")) {
        return Err(bad("is no report".into()));
    }
    if report["status"] == "refused" {
        return Err(bad("has no answer (refused)".into()));
    }
    let text = |key: &str| report[key].as_str().unwrap_or_default().to_owned();
    Ok(Answer { device: text("device"), instrument: text("instrument"), told: told(&report), is_calibration: false })
}

/// The parameters of a report.
pub(crate) fn of_report(report: &Value) -> Vec<Parameter> {
    told(report).into_iter().map(|told| told.parameter).collect()
}

fn told(report: &Value) -> Vec<Told> {
    let beside = |parameter, in_calibrations| Told { parameter, absent: None, in_calibrations };
    let estimates = ESTIMATES.iter().filter_map(|(at, unit, in_calibrations)| {
        let name = at.trim_start_matches('/').replace('/', ".");
        Some(beside(parameter(name, unit, report.pointer(at)?)?, *in_calibrations))
    });
    let effects = list(&report["effects"]).iter().flat_map(of_effect);
    let runs = list(&report["runs"]).iter().filter_map(|run| {
        let file = run["file"].as_str().unwrap_or_default();
        Some(beside(parameter(format!("{file}.tau_s"), "s", &run["tau_s"])?, false))
    });
    estimates.chain(effects).chain(runs).collect()
}

/// The parameters of an effect of a report. A declared effect that a report lacks may be one that its campaign cannot tell.
fn of_effect(effect: &Value) -> Vec<Told> {
    let id = effect["id"].as_str().unwrap_or_default();
    let parameters = list(&effect["parameters"]);
    let number = parameters.iter().find(|p| p["name"] == "n").and_then(|p| p["value"].as_f64());
    let whole = numbered(id, number);
    let told = parameters.iter().filter_map(|p| {
        let name = p["name"].as_str().unwrap_or_default();
        Some(Told {
            parameter: parameter(format!("{whole}.{name}"), p["unit"].as_str().unwrap_or("1"), p)?,
            absent: absent(id, name).filter(|_| effect["origin"] != "declared"),
            in_calibrations: id != ACCELERATION_LAG.id,
        })
    });
    told.collect()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_default()
}

/// An effect's name; those of a searched number may be there more than once.
fn numbered(id: &str, number: Option<f64>) -> String {
    number.map_or(id.to_owned(), |n| format!("{id}[{n}]"))
}

fn parameter(name: String, unit: &str, value: &Value) -> Option<Parameter> {
    let ends = [&value["ci95"][0], &value["ci95"][1]].map(Value::as_f64);
    let ci95 = ends[0].zip(ends[1]).map(|(low, high)| [low, high]);
    Some(Parameter { name, unit: unit.to_owned(), value: value["value"].as_f64()?, ci95 })
}

/// What a calibration undoes, as a report would name it.
fn of_calibration(calibration: &Calibration) -> Vec<Told> {
    let h = &calibration.hypothesis;
    let mut out: Vec<(String, &str, f64)> = Vec::new();
    if !calibration.provenance.gain_unknown {
        out.push(("angular_gain".into(), "1", h.angular_gain));
    }
    let ratio = |id: EffectId| h.members.iter().find(|m| m.id == id).map(|m| m.values[0]);
    let ratios = [
        ("detection_gain_ratio", EffectId::DetectionGainMismatch),
        ("actuation_gain_ratio", EffectId::ActuationGainMismatch),
    ];
    out.extend(ratios.into_iter().filter_map(|(name, id)| Some((name.to_owned(), "1", ratio(id)?))));
    out.extend(h.members.iter().flat_map(of_member));
    out.extend(beside_the_library(h));
    let told = out.into_iter().map(|(name, unit, value)| Told {
        parameter: Parameter { name, unit: unit.to_owned(), value, ci95: None },
        absent: None,
        in_calibrations: true,
    });
    told.collect()
}

/// The values of an effect as reports show them: a pair as a magnitude and an angle, and none that no fit has moved.
fn of_member(m: &Member) -> Vec<(String, &'static str, f64)> {
    let d = m.id.description();
    let number = d.parameters.iter().position(|p| p.name == "n").map(|at| m.values[at]);
    let name = |of: &str| format!("{}.{of}", numbered(d.id, number));
    let shown = d.shown.iter().flat_map(|shown| match *shown {
        Shown::Plain(at) => {
            let p = &d.parameters[at];
            let is_held = p.role == Role::Refined && m.values[at] == p.neutral;
            if is_held { Vec::new() } else { vec![(name(p.name), p.unit, m.values[at])] }
        }
        Shown::Polar { cos, sin, magnitude, unit, angle, division } => {
            let (c, s) = (m.values[cos], m.values[sin]);
            vec![(name(magnitude), unit, c.hypot(s)), (name(angle), "deg", (s.atan2(c) / division).to_degrees())]
        }
    });
    shown.collect()
}

/// What is undone beside the effects of the library: a table, rails, a rate gyroscope's bias.
fn beside_the_library(h: &Hypothesis) -> Vec<(String, &'static str, f64)> {
    let mut out = Vec::new();
    for (n, (cos, sin)) in h.angle_table.iter().flat_map(|table| table.cos.iter().zip(&table.sin)).enumerate() {
        let name = |of: &str| format!("{}.{of}_{}", ANGLE_TABLE.id, n + 1);
        out.extend([(name("cos"), "rad", *cos), (name("sin"), "rad", *sin)]);
    }
    let rails = h.clip.iter().flat_map(|clip| clip.rails_v.as_flattened()).zip(DETECTION_CLIP.parameters);
    let rails = rails.filter(|(rail, _)| rail.is_finite());
    out.extend(rails.map(|(rail, (name, unit))| (format!("{}.{name}", DETECTION_CLIP.id), *unit, *rail)));
    let per_kelvin = RATE_OFFSET_TEMPERATURE.parameters.iter().map(|p| (RATE_OFFSET_TEMPERATURE.id, p));
    let bias = EffectId::RateOffset.description();
    let bias = [(bias.id, bias.parameters[0].name, bias.parameters[0].unit, h.rate_bias_rad_s)];
    let per_kelvin = per_kelvin.map(|(id, (name, unit))| (id, *name, *unit, h.rate_bias_per_k_rad_s));
    let biases = bias.into_iter().chain(per_kelvin).filter(|(.., value)| *value != 0.0);
    out.extend(biases.map(|(id, name, unit, value)| (format!("{id}.{name}"), unit, value)));
    out
}
