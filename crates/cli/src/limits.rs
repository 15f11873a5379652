//! `--limits`: pass or fail on any number of the report.
//!
//! A number is named by its place in report.json, keys joined by dots. An element of a list is named by its number from 0,
//! or by its `id`, `name`, `file`, `of` or `channel`: `effects.detection-cubic.parameters.kappa.value`, `unexplained[0].rms_deg`.

use std::path::Path;

use cvg_calibration::recording::read_text;
use cvg_model::effects::EffectId;
use serde_json::Value;
use toml::Table;

use crate::{Failure, output, report_keys};

/// What an element of a list is called by.
const NAMES: [&str; 5] = ["id", "name", "file", "of", "channel"];
/// What a limit says of a device that does not show the effect, or of what else a report need not have.
const NOT_FOUND: &str = "not_found";
/// What every report has, if only as what is not identifiable.
const ALWAYS: [&str; 5] = ["actuation_gain_ratio", "angular_gain", "detection_gain_ratio", "heldout", "residual"];
const WANTED: &str =
    "a number of report.json with min, max or both, as in \"heldout.discovered.rms_deg\" = { max = 0.01 }";

/// Limits of a report.
#[derive(Debug, Default)]
pub struct Limits(Vec<Limit>);

/// One number, and what it has to be between.
#[derive(Debug, Clone)]
struct Limit {
    path: String,
    min: Option<f64>,
    max: Option<f64>,
    /// a device whose report lacks it passes
    unless_found: bool,
}

/// What stands at a place of a report.
enum Found {
    Number(f64),
    /// a number that the data do not allow
    Null,
    /// an element of a list, or a section, that this report lacks
    Absent,
}

impl Limits {
    /// Reads a limits file.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let name = path.display();
        let text = read_text(path)
            .map_err(|e| Failure::within(format!("--limits {name}: cannot be read: {e}"), &name.to_string()))?;
        Self::of_text(&text, &name.to_string())
    }

    /// The limits that a text says; `name` is what it is called where something is wrong with it.
    pub(crate) fn of_text(text: &str, name: &str) -> Result<Self, Failure> {
        let bad = |what: String| Failure::within(format!("{name}: {what}; wanted {WANTED}"), name);
        let table: Table = text.parse().map_err(|e: toml::de::Error| {
            let what = e.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            bad(what).at(text, e.span().map(|span| span.start))
        })?;
        let mut limits = Self::default();
        limits.add(&table, "").map_err(bad)?;
        if limits.0.is_empty() { Err(bad("there is no limit".into())) } else { Ok(limits) }
    }

    /// The limits in a table; `above` is where it stands.
    fn add(&mut self, table: &Table, above: &str) -> Result<(), String> {
        for (key, value) in table {
            let path = if above.is_empty() { key.clone() } else { format!("{above}.{key}") };
            let Some(inner) = value.as_table() else { return Err(format!("`{path}` is no table")) };
            let is_end = |k: &str| ["min", "max", NOT_FOUND].contains(&k);
            let ends = inner.iter().all(|(k, v)| is_end(k) && !v.is_table());
            if let Some((unknown, _)) = inner.iter().find(|(k, v)| !is_end(k) && !v.is_table()) {
                return Err(format!("`{path}`: there is no `{unknown}`, but min, max and {NOT_FOUND}"));
            }
            if !ends {
                self.add(inner, &path)?;
                continue;
            }
            let number = |key: &str| {
                let wrong = || format!("`{path}`: `{key}` is no number");
                let as_number = |v: &toml::Value| {
                    #[allow(clippy::cast_precision_loss, reason = "limits are small numbers")]
                    let number = v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
                    number.filter(|n| !n.is_nan()).ok_or_else(wrong)
                };
                inner.get(key).map(as_number).transpose()
            };
            let (min, max) = (number("min")?, number("max")?);
            let unless_found = match inner.get(NOT_FOUND).map(toml::Value::as_str) {
                None => false,
                Some(Some("pass")) => true,
                Some(_) => return Err(format!("`{path}`: `{NOT_FOUND}` is not \"pass\"")),
            };
            if unless_found && ALWAYS.iter().any(|section| path.split(['.', '[']).next() == Some(section)) {
                return Err(format!("`{path}` is in every report, and `{NOT_FOUND}` is for what may be absent"));
            }
            if min.is_none() && max.is_none() {
                return Err(format!("`{path}` has neither min nor max"));
            }
            if min.zip(max).is_some_and(|(min, max)| min > max) {
                return Err(format!("`{path}`: min is above max"));
            }
            self.0.push(Limit { path, min, max, unless_found });
        }
        Ok(())
    }

    /// Holds the names against those that a report has; `written` are effects beside those of the library.
    ///
    /// # Errors
    /// Bad use where a limit names no number that a report may have, with the name that is nearest.
    pub(crate) fn require_known(&self, written: &[EffectId]) -> Result<(), Failure> {
        let unknown = self.0.iter().map(|limit| dotted(&limit.path)).find(|path| !report_keys::is_known(path, written));
        unknown.map_or(Ok(()), |path| Err(unnamed(&path, written)))
    }

    /// Judges a report.
    ///
    /// # Errors
    /// Bad use where a limit names no number of the report.
    pub(crate) fn judge(&self, device: &str, report: &Value) -> Result<Judgement, Failure> {
        let verdicts = self.verdicts(report)?;
        let lines = verdicts.iter().map(|verdict| verdict.line(device)).collect();
        Ok(Judgement { lines, outside: outside(device, &verdicts) })
    }

    /// Holds a report against each limit.
    ///
    /// # Errors
    /// Bad use where a limit names no number of the report.
    pub(crate) fn verdicts(&self, report: &Value) -> Result<Vec<Verdict>, Failure> {
        let held = |limit: &Limit| {
            let Limit { path, min, max, unless_found } = limit.clone();
            let found = find(report, &dotted(&path));
            let (passes, value, shown) = match found {
                Found::Number(value) => (limit.holds(value), Some(value), value.to_string()),
                Found::Null => (false, None, "not identifiable".into()),
                // a run that is not there is misspelt
                Found::Absent if path.starts_with("runs.") && !unless_found => return Err(unnamed(&path, &[])),
                // the names of effects that a user wrote were held against their files
                Found::Absent if path.starts_with("effects.") || report_keys::is_known(&dotted(&path), &[]) => {
                    (unless_found, None, "not found".into())
                }
                Found::Absent => return Err(unnamed(&path, &[])),
            };
            Ok(Verdict { path, value, shown, min, max, passes })
        };
        self.0.iter().map(held).collect()
    }
}

/// A place with the numbers of its elements between dots.
fn dotted(path: &str) -> String {
    path.replace('[', ".").replace(']', "")
}

fn unnamed(path: &str, written: &[EffectId]) -> Failure {
    let nearest = report_keys::nearest(&dotted(path), written).filter(|nearest| *nearest != dotted(path));
    let meant = nearest.map_or(String::new(), |nearest| format!("; `{nearest}` is near"));
    Failure::input(format!("--limits: `{path}` names no number of the report{meant}; wanted {WANTED}"))
}

impl Limit {
    fn holds(&self, value: f64) -> bool {
        self.min.is_none_or(|min| value >= min) && self.max.is_none_or(|max| value <= max)
    }
}

/// What the limits say of a device.
#[derive(Debug, Default)]
pub(crate) struct Judgement {
    /// a line for each limit
    lines: Vec<String>,
    /// why it fails, where it does
    pub(crate) outside: Option<String>,
}

impl Judgement {
    /// A device of which there is no number to judge.
    pub(crate) fn failed(why: &str) -> Self {
        Self { lines: Vec::new(), outside: Some(why.to_owned()) }
    }

    /// Says each verdict on standard error.
    pub(crate) fn tell(&self) {
        for line in &self.lines {
            output::tell(format_args!("{line}"));
        }
    }
}

/// A number of a report, held against its limit.
#[derive(Debug, Clone)]
pub struct Verdict {
    /// its place in report.json, as the limit names it
    pub path: String,
    /// none where the report does not tell it
    pub value: Option<f64>,
    /// the number, or why there is none
    pub shown: String,
    /// the least that passes
    pub min: Option<f64>,
    /// the most that passes
    pub max: Option<f64>,
    /// whether it is within
    pub passes: bool,
}

impl Verdict {
    /// The line that `cvg identify --limits` says.
    #[must_use]
    pub fn line(&self, device: &str) -> String {
        let word = if self.passes { "pass" } else { "FAIL" };
        let end = |word: &str, v: Option<f64>| v.map(|v| format!("{word} {v}"));
        let ends = [end("min", self.min), end("max", self.max)].into_iter().flatten().collect::<Vec<_>>().join(", ");
        format!("{word}  {device}  {} = {}  ({ends})", self.path, self.shown)
    }
}

/// Why a device fails, where it does.
pub(crate) fn outside(device: &str, verdicts: &[Verdict]) -> Option<String> {
    let failed: Vec<&str> = verdicts.iter().filter(|v| !v.passes).map(|v| v.path.as_str()).collect();
    (!failed.is_empty()).then(|| format!("{device}: outside its limits: {}", failed.join(", ")))
}

/// What stands at a place. Keys may hold dots themselves, as files do: the shortest key that leads on is taken.
fn find(value: &Value, path: &str) -> Found {
    if path.is_empty() {
        return match value {
            Value::Number(n) => n.as_f64().map_or(Found::Absent, Found::Number),
            Value::Null => Found::Null,
            _ => Found::Absent,
        };
    }
    for end in path.match_indices('.').map(|(at, _)| at).chain([path.len()]) {
        let (key, rest) = (&path[..end], path[end..].trim_start_matches('.'));
        let Some(next) = step(value, key) else { continue };
        match find(next, rest) {
            Found::Absent => {}
            found => return found,
        }
    }
    Found::Absent
}

fn step<'v>(value: &'v Value, key: &str) -> Option<&'v Value> {
    match value {
        Value::Object(map) => map.get(key),
        Value::Array(list) => match key.parse::<usize>() {
            Ok(at) => list.get(at),
            Err(_) => list.iter().find(|e| NAMES.iter().any(|n| e.get(n).and_then(Value::as_str) == Some(key))),
        },
        _ => None,
    }
}
