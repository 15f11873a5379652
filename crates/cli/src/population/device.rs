//! A device of a fleet: its report, and what of it is held beside the reports of the others.

use std::collections::BTreeMap;
use std::path::PathBuf;

use cvg_model::effects::{EffectId, Shown};
use serde_json::Value;

use super::spread::Measured;
use crate::compare::{Parameter, of_report};

/// Standard deviations between the ends of a 95 % interval.
const ENDS: f64 = 2.0 * 1.96;
/// An interval of this width, in the angle of a magnitude's two parts, is all around; a thousandth of it for rounding.
const ALL_AROUND_DEG: f64 = 360.0 * 0.999;

/// What is kept of a report; the rest is many times as large, and thousands of devices are in memory at once.
const KEPT: [&str; 13] = [
    "device",
    "status",
    "reason",
    "angular_gain",
    "detection_gain_ratio",
    "actuation_gain_ratio",
    "scale_factor",
    "repeatability_ppm",
    "allan",
    "effects",
    "steps",
    "runs",
    "heldout",
];

/// A device of the fleet.
pub(crate) struct Device {
    /// its folder in the results
    pub(crate) folder: String,
    pub(crate) campaign: PathBuf,
    report: Value,
    /// which limit it fails
    pub(crate) outside: Option<String>,
}

/// An effect beyond the declared model.
pub(crate) struct Found {
    /// its identifier, with the number of a harmonic, and counted from the second of a kind on
    pub(crate) label: String,
    /// 2 ln likelihood that it gained after its price, where the report says so
    pub(crate) gain: Option<f64>,
    /// effects that explain the same, and by how much worse, in 2 ln likelihood
    pub(crate) rivals: Vec<(String, f64)>,
}

/// A number that is held beside those of the other devices.
pub(crate) struct Quantity {
    /// name; the parts of a magnitude and its angle have names of their own
    pub(crate) name: String,
    /// the parameter that it is of
    pub(crate) of: String,
    pub(crate) measured: Measured,
}

impl Device {
    pub(crate) fn new(folder: String, campaign: PathBuf, mut report: Value, outside: Option<String>) -> Self {
        if let Some(all) = report.as_object_mut() {
            all.retain(|key, _| KEPT.contains(&key.as_str()));
        }
        Self { folder, campaign, report, outside }
    }

    pub(crate) fn text(&self, of: &str) -> &str {
        self.report[of].as_str().unwrap_or_default()
    }

    pub(crate) fn has_answer(&self) -> bool {
        self.text("status") == "answered"
    }

    pub(crate) fn number(&self, at: &str) -> Option<f64> {
        self.report.pointer(at).and_then(Value::as_f64)
    }

    /// Effects beyond the declared model.
    pub(crate) fn effects(&self) -> Vec<Found> {
        let mut steps: Vec<&Value> = list(&self.report["steps"]).iter().collect();
        let mut taken: BTreeMap<String, usize> = BTreeMap::new();
        let found = list(&self.report["effects"]).iter().filter(|e| e["origin"] != "declared");
        found
            .filter_map(|effect| {
                let id = effect["id"].as_str()?;
                let at = steps.iter().position(|s| s["effect"] == id);
                let step = at.map(|at| steps.remove(at));
                let kind = numbered(id, effect);
                let count = taken.entry(kind.clone()).or_default();
                *count += 1;
                let label = if *count > 1 { format!("{kind} ({count})") } else { kind };
                let beaten = step.map(|s| list(&s["rivals"])).unwrap_or_default();
                let rivals = beaten.iter().filter_map(|r| Some((r["id"].as_str()?, r["beaten_by"].as_f64()?)));
                let confounded = list(&effect["confounded_with"]).iter().filter_map(|id| Some((id.as_str()?, 0.0)));
                Some(Found {
                    label,
                    gain: step.and_then(|s| s["gain"].as_f64()),
                    rivals: rivals.chain(confounded).map(|(id, by)| (id.to_owned(), by)).collect(),
                })
            })
            .collect()
    }

    /// What is distributed over the devices: the parameters of the report.
    pub(crate) fn parameters(&self) -> Vec<Parameter> {
        if self.has_answer() { of_report(&self.report) } else { Vec::new() }
    }

    /// What is held beside the other devices: each parameter once, a magnitude and its angle as the two parts that they are
    /// of, and what is left of the angle. Numbers that a search set are none.
    pub(crate) fn quantities(&self) -> Vec<Quantity> {
        let parameters = self.parameters();
        let mut out: Vec<Quantity> = Vec::new();
        for p in &parameters {
            let last = p.name.rsplit('.').next().unwrap_or_default();
            let is_again = last != p.name && parameters.iter().any(|other| other.name == last);
            let Some([low, high]) = p.ci95.filter(|_| !is_again && p.unit != "deg") else { continue };
            if out.iter().any(|q| q.of == p.name) {
                continue;
            }
            let measured = Measured { value: p.value, error: (high - low).abs() / ENDS };
            match angle_of(p, &parameters) {
                Some((angle, division)) => out.extend(parts(p, measured, angle, division)),
                None => out.push(Quantity { name: p.name.clone(), of: p.name.clone(), measured }),
            }
        }
        let rms = |stage: &str| self.number(&format!("/heldout/{stage}")).filter(|v| *v > 0.0);
        let (floor, left) = (rms("noise_floor_deg"), rms("discovered/rms_deg"));
        let mut sized = |name: &str, value: Option<f64>| {
            let of = |v: f64| Quantity {
                name: name.to_owned(),
                of: name.to_owned(),
                measured: Measured { value: v.ln(), error: 0.0 },
            };
            out.extend(value.filter(|_| self.has_answer()).map(of));
        };
        sized("ln heldout.noise_floor_deg", floor);
        sized("ln heldout.discovered.rms_deg over its noise", left.zip(floor).map(|(l, f)| l / f));
        out
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_default()
}

/// An effect's identifier with the number that a search set, as its parameters have it.
fn numbered(id: &str, effect: &Value) -> String {
    let number = list(&effect["parameters"]).iter().find(|p| p["name"] == "n").and_then(|p| p["value"].as_f64());
    number.map_or(id.to_owned(), |n| format!("{id}[{n}]"))
}

/// The angle that belongs to a magnitude, and by what it is divided.
fn angle_of<'p>(p: &Parameter, all: &'p [Parameter]) -> Option<(&'p Parameter, f64)> {
    let (effect, name) = p.name.rsplit_once('.')?;
    let id = EffectId::from_id(effect.split('[').next()?)?;
    let (angle, division) = id.description().shown.iter().find_map(|shown| match *shown {
        Shown::Polar { magnitude, angle, division, .. } if magnitude == name => Some((angle, division)),
        _ => None,
    })?;
    Some((all.iter().find(|other| other.name == format!("{effect}.{angle}"))?, division))
}

/// Cosine and sine part of a magnitude and its angle, as the fit has them. An angle that may be anything says nothing of how far
/// off they are sideways: as far as along the angle.
fn parts(p: &Parameter, size: Measured, angle: &Parameter, division: f64) -> [Quantity; 2] {
    let turned = (division * angle.value).to_radians();
    let width = angle.ci95.map_or(0.0, |[low, high]| (high - low).abs() / ENDS);
    let by_the_angle = size.value * division * width.to_radians();
    let across = if division * width * ENDS < ALL_AROUND_DEG { by_the_angle } else { by_the_angle.max(size.error) };
    let (sin, cos) = turned.sin_cos();
    let part = |name: &str, along: f64, sideways: f64| Quantity {
        name: format!("{} ({name} part)", p.name),
        of: p.name.clone(),
        measured: Measured { value: size.value * along, error: (along * size.error).hypot(sideways * across) },
    };
    [part("cosine", cos, sin), part("sine", sin, cos)]
}
