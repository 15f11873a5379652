//! `cvg compare`: which parameters moved beyond what both answers leave open: before and after, two devices, today and last
//! month.

use std::fmt::Write as _;
use std::path::Path;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::read_text;
use cvg_model::effects::{EffectId, Shown};
use serde_json::{Value, json};

use crate::report::numbers::{interval, significant, with_half_width};
use crate::{Failure, output};

/// A parameter of one answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// its place in the report, keys joined by dots
    pub name: String,
    /// its unit
    pub unit: String,
    /// its value
    pub value: f64,
    /// ends of its 95 % interval, where it has one
    pub ci95: Option<[f64; 2]>,
}

/// A parameter of both answers, or of one.
struct Pair {
    name: String,
    unit: String,
    of: [Option<Parameter>; 2],
}

/// Estimates at the top of a report, and the unit of each.
const ESTIMATES: [(&str, &str); 7] = [
    ("/angular_gain", "1"),
    ("/detection_gain_ratio", "1"),
    ("/actuation_gain_ratio", "1"),
    ("/scale_factor/nonlinearity_ppm", "ppm"),
    ("/scale_factor/asymmetry_ppm", "ppm"),
    ("/allan/angle_random_walk_deg_sqrt_h", "deg/√h"),
    ("/allan/bias_instability_dph", "deg/h"),
];

/// Compares two answers.
pub(crate) fn compare(a: &Path, b: &Path, json: bool) -> Result<(), Failure> {
    let [of_a, of_b] = [answer(a)?, answer(b)?];
    if of_a.instrument != of_b.instrument {
        return Err(Failure::input(format!(
            "{} is of a {}, {} of a {}: their parameters are not the same quantities; wanted two answers about one kind of \
             instrument",
            a.display(),
            of_a.instrument,
            b.display(),
            of_b.instrument
        )));
    }
    if of_a.device != of_b.device {
        output::tell(format_args!("A is of {}, B of {}", of_a.device, of_b.device));
    }
    let pairs = paired(of_a.parameters, of_b.parameters);
    if json {
        let list: Vec<Value> = pairs.iter().map(Pair::as_value).collect();
        let moved = pairs.iter().filter(|p| p.moved() == Some(true)).count();
        let facts =
            json!({"a": a.display().to_string(), "b": b.display().to_string(), "moved": moved, "parameters": list});
        let text = serde_json::to_string_pretty(&facts).map_err(Failure::input)?;
        return output::answer(&format!("{text}\n"));
    }
    output::answer(&in_words(&pairs))
}

/// What is compared: the parameters of an instrument.
struct Answer {
    device: String,
    instrument: String,
    parameters: Vec<Parameter>,
}

/// The parameters of a report, of the report in a folder, or of a calibration.
fn answer(path: &Path) -> Result<Answer, Failure> {
    let bad = |what: String| {
        let wanted = "report.json, a folder with one, or calibration.toml, as cvg identify writes them";
        Failure::input(format!("{}: {what}; wanted {wanted}", path.display()))
    };
    let file = if path.is_dir() { path.join("report.json") } else { path.to_owned() };
    if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let calibration = Calibration::read(&file)?;
        return Ok(Answer {
            instrument: calibration.hypothesis.instrument.name().to_owned(),
            parameters: of_calibration(&calibration),
            device: calibration.device,
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
    Ok(Answer { device: text("device"), instrument: text("instrument"), parameters: of_report(&report) })
}

/// The parameters of a report.
pub(crate) fn of_report(report: &Value) -> Vec<Parameter> {
    let mut out: Vec<Parameter> = ESTIMATES
        .iter()
        .filter_map(|(at, unit)| parameter(at.trim_start_matches('/').replace('/', "."), unit, report.pointer(at)?))
        .collect();
    let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
    for effect in list(&report["effects"]) {
        let id = effect["id"].as_str().unwrap_or_default();
        let parameters = list(&effect["parameters"]);
        // effects of a searched number may be there more than once
        let number = parameters.iter().find(|p| p["name"] == "n").and_then(|p| p["value"].as_f64());
        let id = number.map_or(id.to_owned(), |n| format!("{id}[{n}]"));
        let name = |p: &Value| format!("{id}.{}", p["name"].as_str().unwrap_or_default());
        out.extend(parameters.iter().filter_map(|p| parameter(name(p), p["unit"].as_str().unwrap_or("1"), p)));
    }
    for run in list(&report["runs"]) {
        let file = run["file"].as_str().unwrap_or_default();
        out.extend(parameter(format!("{file}.tau_s"), "s", &run["tau_s"]));
    }
    out
}

fn parameter(name: String, unit: &str, value: &Value) -> Option<Parameter> {
    let ends = [&value["ci95"][0], &value["ci95"][1]].map(Value::as_f64);
    let ci95 = ends[0].zip(ends[1]).map(|(low, high)| [low, high]);
    Some(Parameter { name, unit: unit.to_owned(), value: value["value"].as_f64()?, ci95 })
}

fn of_calibration(calibration: &Calibration) -> Vec<Parameter> {
    let h = &calibration.hypothesis;
    let bare = |name: String, unit: &str, value: f64| Parameter { name, unit: unit.to_owned(), value, ci95: None };
    let gain = (!calibration.provenance.gain_unknown).then(|| bare("angular_gain".into(), "1", h.angular_gain));
    let mut out: Vec<Parameter> = gain.into_iter().collect();
    for m in &h.members {
        let parameters = m.id.description().parameters.iter().zip(m.values);
        out.extend(parameters.map(|(p, v)| bare(format!("{}.{}", m.id, p.name), p.unit, v)));
    }
    out
}

fn paired(a: Vec<Parameter>, mut b: Vec<Parameter>) -> Vec<Pair> {
    let mut out: Vec<Pair> = Vec::new();
    for one in a {
        let other = b.iter().position(|p| p.name == one.name).map(|at| b.remove(at));
        out.push(Pair { name: one.name.clone(), unit: one.unit.clone(), of: [Some(one), other] });
    }
    out.extend(b.into_iter().map(|p| Pair { name: p.name.clone(), unit: p.unit.clone(), of: [None, Some(p)] }));
    out
}

impl Pair {
    fn difference(&self) -> Option<f64> {
        let [a, b] = &self.of;
        let d = b.as_ref()?.value - a.as_ref()?.value;
        let round = self.goes_round();
        Some(if round.is_finite() { d - round * (d / round).round() } else { d })
    }

    /// After how much a parameter is the same again, in its unit: a phase after a turn, an axis after half of one, all else never.
    fn goes_round(&self) -> f64 {
        if self.unit != "deg" {
            return f64::INFINITY;
        }
        let shown = |(id, name): (&str, &str)| {
            let effect = EffectId::ALL.iter().find(|effect| effect.description().id == id)?;
            let division = |shown: &Shown| match shown {
                Shown::Polar { angle, division, .. } if *angle == name => Some(*division),
                _ => None,
            };
            effect.description().shown.iter().find_map(division)
        };
        360.0 / self.name.split_once('.').and_then(shown).unwrap_or(1.0)
    }

    /// Half width of the difference's interval: that of either value towards the other, in quadrature.
    fn combined(&self) -> Option<f64> {
        let [a, b] = &self.of;
        let (a, b) = (a.as_ref()?, b.as_ref()?);
        let up = self.difference()? >= 0.0;
        let side = |p: &Parameter, up: bool| p.ci95.map(|[low, high]| if up { high - p.value } else { p.value - low });
        Some(side(a, up)?.hypot(side(b, !up)?))
    }

    /// Whether it moved beyond what both leave open; none where one of them has no interval, or did not tell it.
    fn moved(&self) -> Option<bool> {
        Some(self.difference()?.abs() > self.combined()?)
    }

    /// What came of it, in a word or two.
    fn verdict(&self) -> &'static str {
        match (&self.of, self.moved()) {
            ([Some(_), None], _) => "only in A",
            ([None, _], _) => "only in B",
            (_, Some(true)) => "moved",
            (_, Some(false)) => "",
            (_, None) if self.difference() == Some(0.0) => "the same",
            (_, None) => "differs, no interval",
        }
    }

    fn as_value(&self) -> Value {
        let of = |p: &Option<Parameter>| p.as_ref().map(|p| json!({"value": p.value, "ci95": p.ci95}));
        json!({"name": self.name, "unit": self.unit, "a": of(&self.of[0]), "b": of(&self.of[1]),
               "difference": self.difference(), "combined95": self.combined(), "moved": self.moved()})
    }
}

fn in_words(pairs: &[Pair]) -> String {
    let columns = ["parameter", "A", "B", "B − A", "± 95 %", "unit", ""].map(str::to_owned);
    let or_none = |text: Option<String>| text.unwrap_or("—".to_owned());
    let mut rows = vec![columns];
    rows.extend(pairs.iter().map(|p| {
        let own = |p: &Parameter| p.ci95.map_or(significant(p.value), |ci95| interval(p.value, ci95)[0].clone());
        let of = |i: usize| or_none(p.of[i].as_ref().map(own));
        let [d, c] = match (p.difference(), p.combined()) {
            (Some(d), Some(c)) => with_half_width(d, c),
            (d, _) => [or_none(d.map(significant)), or_none(None)],
        };
        [p.name.clone(), of(0), of(1), d, c, p.unit.clone(), p.verdict().to_owned()]
    }));
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..7).map(width).collect();
    let mut s = String::new();
    for row in &rows {
        let cells: Vec<String> = row
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(c, (cell, &w))| {
                let pad = " ".repeat(w - cell.chars().count());
                if c == 0 || c > 4 { format!("{cell}{pad}") } else { format!("{pad}{cell}") }
            })
            .collect();
        let _ = writeln!(s, "{}", cells.join("  ").trim_end());
    }
    let moved: Vec<&str> = pairs.iter().filter(|p| p.moved() == Some(true)).map(|p| p.name.as_str()).collect();
    let _ = match moved.as_slice() {
        [] if pairs.iter().all(|p| p.moved().is_none()) => {
            writeln!(s, "no number has an interval in both reports, without which nothing says whether something moved")
        }
        [] => writeln!(s, "nothing moved beyond the combined 95 % intervals"),
        names => writeln!(s, "moved beyond the combined 95 % intervals: {}", names.join(", ")),
    };
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_goes_round_after_half_a_turn_and_a_phase_after_a_whole_one() {
        let moved = |name: &str, [a, b]: [f64; 2]| {
            let of = |value| Some(Parameter { name: name.into(), unit: "deg".into(), value, ci95: None });
            Pair { name: name.into(), unit: "deg".into(), of: [of(a), of(b)] }.difference().unwrap_or(f64::NAN)
        };
        assert!((moved("anisodamping.theta_tau", [89.9, -89.9]) - 0.2).abs() < 1e-9);
        assert!((moved("spring-cubic.phase", [179.9, -179.9]) - 0.2).abs() < 1e-9);
        assert!((moved("spring-cubic.phase", [89.9, -89.9]) + 179.8).abs() < 1e-9);
    }
}
