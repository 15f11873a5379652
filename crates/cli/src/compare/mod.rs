//! `cvg compare`: which parameters moved beyond what both answers leave open: before and after, two devices, today and last
//! month.

mod answer;
mod effect;

pub(crate) use answer::of_report;

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use self::answer::{Told, alike};
use self::effect::{goes_round, named};
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

/// Share of a value that is rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A parameter of both answers, or of one.
struct Pair {
    name: String,
    unit: String,
    of: [Option<Told>; 2],
}

/// Compares two answers.
pub(crate) fn compare(a: &Path, b: &Path, json: bool) -> Result<(), Failure> {
    let [of_a, of_b] = [answer::read(a)?, answer::read(b)?];
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
    let [of_a, of_b] = alike([of_a, of_b]);
    let pairs = paired(of_a, of_b);
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

fn paired(a: Vec<Told>, mut b: Vec<Told>) -> Vec<Pair> {
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
        let [a, b] = [a.as_ref()?.value, b.as_ref()?.value];
        // two that are the same in both but for the last digits of the arithmetic
        let d = if (b - a).abs() > ROUNDING * a.abs().max(b.abs()) { b - a } else { 0.0 };
        let round = named(&self.name).map_or(f64::INFINITY, |(id, name)| goes_round(id, name, &self.unit));
        Some(if round.is_finite() { d - round * (d / round).round() } else { d })
    }

    /// Half width of the difference's interval: that of either value towards the other, in quadrature.
    fn combined(&self) -> Option<f64> {
        let [a, b] = &self.of;
        let (a, b) = (a.as_ref()?, b.as_ref()?);
        let up = self.difference()? >= 0.0;
        let side = |p: &Parameter, up: bool| p.ci95.map(|[low, high]| if up { high - p.value } else { p.value - low });
        Some(side(a, up)?.hypot(side(b, !up)?))
    }

    /// Whether it moved beyond what both leave open; none where one of them has no interval. What only one of them tells of an effect
    /// came or went where its interval leaves out what it is without the effect.
    fn moved(&self) -> Option<bool> {
        match &self.of {
            [Some(_), Some(_)] => Some(self.difference()?.abs() > self.combined()?),
            [Some(alone), None] | [None, Some(alone)] => alone.is_more_than_nothing(),
            [None, None] => None,
        }
    }

    /// What came of it, in a word or two.
    fn verdict(&self) -> &'static str {
        match (&self.of, self.moved()) {
            ([Some(_), None], Some(true)) => "went: only in A",
            ([None, _], Some(true)) => "came: only in B",
            ([Some(_), None], _) => "only in A",
            ([None, _], _) => "only in B",
            (_, Some(true)) => "moved",
            (_, Some(false)) => "",
            (_, None) if self.difference() == Some(0.0) => "the same",
            (_, None) => "differs, no interval",
        }
    }

    fn as_value(&self) -> Value {
        let of = |p: &Option<Told>| p.as_ref().map(|p| json!({"value": p.value, "ci95": p.ci95}));
        json!({"name": self.name, "unit": self.unit, "a": of(&self.of[0]), "b": of(&self.of[1]),
               "difference": self.difference(), "combined95": self.combined(), "moved": self.moved()})
    }
}

fn in_words(pairs: &[Pair]) -> String {
    let columns = ["parameter", "A", "B", "B − A", "± 95 %", "unit", ""].map(str::to_owned);
    let or_none = |text: Option<String>| text.unwrap_or("—".to_owned());
    let mut rows = vec![columns];
    rows.extend(pairs.iter().map(|p| {
        let own = |p: &Told| p.ci95.map_or(significant(p.value), |ci95| interval(p.value, ci95)[0].clone());
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

    fn told(name: &str, unit: &str, value: f64, ci95: Option<[f64; 2]>) -> Told {
        let parameter = Parameter { name: name.into(), unit: unit.into(), value, ci95 };
        Told { absent: named(name).and_then(|(id, name)| effect::absent(id, name)), in_calibrations: true, parameter }
    }

    #[test]
    fn an_axis_goes_round_after_half_a_turn_and_a_phase_after_a_whole_one() {
        let moved = |name: &str, [a, b]: [f64; 2]| {
            let of = |value| Some(told(name, "deg", value, None));
            Pair { name: name.into(), unit: "deg".into(), of: [of(a), of(b)] }.difference().unwrap_or(f64::NAN)
        };
        assert!((moved("anisodamping.theta_tau", [89.9, -89.9]) - 0.2).abs() < 1e-9);
        assert!((moved("spring-cubic.phase", [179.9, -179.9]) - 0.2).abs() < 1e-9);
        assert!((moved("spring-cubic.phase", [89.9, -89.9]) + 179.8).abs() < 1e-9);
        assert!((moved("harmonic-n[4].phase", [179.9, -179.9]) - 0.2).abs() < 1e-9);
    }

    #[test]
    fn an_effect_of_one_answer_has_moved_where_its_interval_leaves_out_nothing() {
        let moved = |name: &str, ci95: [f64; 2]| {
            let pairs = paired(Vec::new(), vec![told(name, "1", 0.5 * (ci95[0] + ci95[1]), Some(ci95))]);
            assert_eq!(
                in_words(&pairs).lines().last().is_some_and(|l| l.ends_with(name)),
                pairs[0].moved() == Some(true)
            );
            pairs[0].moved()
        };
        assert_eq!(moved("detection-cubic.kappa", [0.003, 0.005]), Some(true));
        assert_eq!(moved("detection-cubic.kappa", [-0.001, 0.005]), Some(false));
        // what is nothing of a ratio is 1
        assert_eq!(moved("detection-gain-mismatch.detection_gain_ratio", [0.9, 1.1]), Some(false));
        assert_eq!(moved("detection-gain-mismatch.detection_gain_ratio", [1.01, 1.02]), Some(true));
        assert_eq!(moved("angle-table.cos_3", [0.1, 0.2]), Some(true));
        // an angle is none without its magnitude, and of a text nothing says what it is without it
        assert_eq!(moved("spring-cubic.phase", [10.0, 20.0]), None);
        assert_eq!(moved("my-quintic.kappa5", [0.1, 0.2]), None);
    }
}
