//! An effect as text: `my-effect.toml` names a stage, parameters and a map, and becomes one more effect that a hypothesis
//! can have.
//!
//! Effects of the library are values without owners, so one that is read at run time lives as long as the program: every
//! text that is admitted is kept once, however often it is read.

pub(crate) mod export;
mod language;
pub(crate) mod laws;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use cvg_model::effects::written::{Step, Target, Variable, Written};
use cvg_model::effects::{
    Belief, Description, EffectId, MAX_PARAMETERS, Moment, Parameter, Role, Scaling, Shown, Stage, Values,
};
use cvg_model::{AxisForces, Envelope};
use serde::{Deserialize, Serialize};

use crate::error::Refusal;
use crate::recording::read_text;

/// The largest file, bytes.
const MAX_FILE: usize = 131_072;
/// The longest name.
const MAX_NAME: usize = 64;
/// Bounds of a parameter where none are stated, in its scale.
const USUAL_BOUND: f64 = 1000.0;
/// At neutral values a map changes this little of a vibration of 1 V.
const NEUTRAL: f64 = 1e-9;
/// The terms of the mechanics are linear to this share.
const LINEAR: f64 = 1e-9;

/// An effect as a file says it.
///
/// ```
/// use cvg_calibration::EffectText;
///
/// let text = r#"
/// id = "my-quintic"
/// stage = "readout"
/// [[parameter]]
/// name = "kappa5"
/// unit = "1/V^4"
/// neutral = 0.0
/// scale = 1e-3
/// [map]
/// "x'" = "x * (1 + 5/8 * kappa5 * abs(x)^4)"
/// "y'" = "y * (1 + 5/8 * kappa5 * abs(y)^4)"
/// "#;
/// let effect = EffectText::parse(text, "my-effect.toml")?.effect("my-effect.toml")?;
/// assert_eq!(effect.to_string(), "my-quintic");
/// # Ok::<(), cvg_calibration::Refusal>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectText {
    /// its name: small letters, digits and hyphens; none of the library's
    pub id: String,
    /// one line for people
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub summary: String,
    /// input, mechanics, actuation or readout
    pub stage: String,
    /// a readout effect acts on the vibration itself, before all of the library's; after them where this is not said
    #[serde(default, skip_serializing_if = "is_false")]
    pub first: bool,
    /// values of the first parameter at which a fit begins where the effect has no slope at its neutral values, in units of
    /// one over the amplitude
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub onsets: Vec<f64>,
    /// at most four
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameter: Vec<ParameterText>,
    /// what is given a value, and the expression of it
    pub map: BTreeMap<String, String>,
    /// what was seen, where the text is a proposal; nothing is computed from it
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
}

/// What was seen of something that no effect explains.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Law {
    /// pattern, table, time, direction or other
    pub follows: String,
    /// harmonic of the pattern, or order of the table
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n: Option<f64>,
    /// frequency, Hz
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// amplitude, deg
    pub size_deg: f64,
    /// 95 % interval of the exponent of the rate; absent where the runs have one
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<[f64; 2]>,
    /// 95 % interval of the exponent of the amplitude; absent where the runs have one
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<[f64; 2]>,
    /// 95 % interval of its change per kelvin, relative to itself, 1/K; absent where the runs have one temperature
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<[f64; 2]>,
    /// it changes its sign with the direction; absent where the runs have one
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turns_with_direction: Option<bool>,
    /// channels in which it shows under the declared model
    pub channels: Vec<String>,
    /// the stage that this means
    pub stage: String,
    /// why
    pub meaning: String,
}

/// A parameter of an effect as text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterText {
    /// its name in the expressions
    pub name: String,
    /// its unit, in the notation of the report
    pub unit: String,
    /// the value at which the effect is absent
    #[serde(default)]
    pub neutral: f64,
    /// a typical size
    pub scale: f64,
    /// the smallest value; a thousand scales below neutral where it is not said
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// the largest value
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// it stays at its neutral value
    #[serde(default, skip_serializing_if = "is_false")]
    pub held: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "as serde asks")]
fn is_false(value: &bool) -> bool {
    !*value
}

/// What is wanted of a file.
const FORM: &str = "an effect file: id, stage, [[parameter]] and [map]";

impl EffectText {
    /// Reads an effect file.
    ///
    /// # Errors
    /// Where it cannot be read, is no effect file, or an expression is wrong.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let name = path.display().to_string();
        let text = read_text(path).map_err(|e| Refusal::new(&name, format!("cannot be read: {e}"), FORM))?;
        Self::parse(&text, &name)
    }

    /// Reads the text of an effect file; `name` is the file's, for messages. Every text gets an answer.
    ///
    /// # Errors
    /// As [`EffectText::read`].
    pub fn parse(text: &str, name: &str) -> Result<Self, Refusal> {
        if text.len() > MAX_FILE {
            return Err(Refusal::new(name, format!("larger than {MAX_FILE} bytes"), FORM));
        }
        let effect: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            Refusal::new(name, format!("line {line}: {}", e.message().replace('\n', " ")), FORM)
        })?;
        effect.compiled().map_err(|problem| Refusal::new(name, problem, FORM))?;
        Ok(effect)
    }

    /// The file's text.
    pub fn to_text(&self) -> String {
        // every field is a plain value: serialisation has nothing to fail on
        toml::to_string(self).unwrap_or_default()
    }

    /// Its expressions are right and its numbers finite.
    pub(crate) fn is_sound(&self) -> bool {
        self.compiled().is_ok() && self.law.as_ref().is_none_or(|law| law.size_deg.is_finite())
    }

    /// The effect, to be given to an identification; `source` says where it was written. It is kept as long as the program
    /// runs, and only once.
    ///
    /// # Errors
    /// Where it is the library's by name, has an effect at its neutral values, or is a term of the mechanics that is not
    /// linear in its parameters.
    pub fn effect(&self, source: &str) -> Result<EffectId, Refusal> {
        let refuse = |problem: String, wanted: &str| Err(Refusal::new(source, problem, wanted));
        let compiled = self.compiled().map_err(|problem| Refusal::new(source, problem, FORM))?;
        if EffectId::from_id(&self.id).is_some() {
            return refuse(format!("`{}` is an effect of the library", self.id), "an id of its own");
        }
        let kept = admitted(self, compiled, source);
        let effect = if self.first { EffectId::WrittenFirst(kept) } else { EffectId::Written(kept) };
        if let Some(problem) = self.unfit(effect) {
            return refuse(problem, "a map that is none at the neutral values, and terms that are linear");
        }
        Ok(effect)
    }

    /// Why an effect cannot take part in a fit.
    fn unfit(&self, effect: EffectId) -> Option<String> {
        let neutral: Values<f64> = effect.neutral();
        let drive = AxisForces { x_c: 0.3, x_s: -0.2, y_c: 0.1, y_s: 0.4 };
        let at = Moment { t_s: 1.3, table_rad: 0.7, precession_rad_s: -2.0, warmer_k: 4.0, drive };
        for e in probes() {
            let size = e.pendulum().e.sqrt();
            let left = match effect.description().stage {
                Stage::Input => (effect.input_rate(&neutral, 1.0, &at) - 1.0).abs(),
                Stage::Mechanics => difference(&effect.mechanics(&neutral, &e, &at), &Envelope::zero()) / size,
                Stage::Actuation => {
                    let f = AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s };
                    let out = effect.actuate(&neutral, f, &at);
                    difference(&Envelope::new(out.x_c, out.x_s, out.y_c, out.y_s), &e) / size
                }
                Stage::Readout => difference(&effect.read(&neutral, e, &at), &e) / size,
            };
            if left.is_nan() || left > NEUTRAL {
                return Some(format!("`{}` is not absent at the neutral values of its parameters", self.id));
            }
        }
        let linear =
            effect.description().stage != Stage::Mechanics || probes().iter().all(|e| self.is_linear(effect, e));
        (!linear).then(|| format!("`{}` is a term of the mechanics that is not linear in its parameters", self.id))
    }

    /// The terms of the mechanics at all values together are the sum of those at one value each.
    fn is_linear(&self, effect: EffectId, e: &Envelope<f64>) -> bool {
        let values: Values<f64> = std::array::from_fn(|i| {
            self.parameter.get(i).map_or(0.0, |p| p.scale * (0.7 - 1.9 * i as f64) * if p.held { 0.0 } else { 1.0 })
        });
        let at = Moment { warmer_k: 4.0, ..Moment::origin() };
        let sum = (0..MAX_PARAMETERS).fold(Envelope::zero(), |sum, i| {
            let unit: Values<f64> = std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
            sum + effect.mechanics(&unit, e, &at) * values[i]
        });
        let all = effect.mechanics(&values, e, &at);
        let size = all.pendulum().e.sqrt();
        difference(&all, &sum) <= LINEAR * size && !self.parameter.iter().any(|p| p.held)
    }

    fn compiled(&self) -> Result<Compiled, String> {
        is_name(&self.id, "-", |c| c.is_ascii_lowercase() || c.is_ascii_digit())
            .map_err(|what| format!("id `{}`: {what}; small letters, digits and hyphens", shortened(&self.id)))?;
        let stage = STAGES.iter().find(|(name, _)| *name == self.stage).map(|(_, stage)| *stage).ok_or_else(|| {
            format!("stage `{}` is none of input, mechanics, actuation, readout", shortened(&self.stage))
        })?;
        if self.first && stage != Stage::Readout {
            return Err("first is of readout effects".into());
        }
        if self.parameter.len() > MAX_PARAMETERS {
            return Err(format!("more than {MAX_PARAMETERS} parameters"));
        }
        if self.onsets.len() > MAX_PARAMETERS || !self.onsets.iter().all(|v| v.is_finite()) {
            return Err(format!("onsets are at most {MAX_PARAMETERS} numbers"));
        }
        for (at, p) in self.parameter.iter().enumerate() {
            p.check()?;
            if self.parameter[..at].iter().any(|other| other.name == p.name) {
                return Err(format!("there are two parameters `{}`", p.name));
            }
        }
        let names: Vec<&str> = self.parameter.iter().map(|p| p.name.as_str()).collect();
        let targets = language::targets(stage);
        let mut maps = Vec::new();
        for (key, text) in &self.map {
            let Some((_, target, complex)) = targets.iter().find(|(name, ..)| name == key) else {
                let known: Vec<&str> = targets.iter().map(|(name, ..)| *name).collect();
                let key = shortened(key);
                return Err(format!("the map of a {} has no `{key}`; it has {}", self.stage, known.join(", ")));
            };
            let expression = language::parse(text, stage, &names)
                .map_err(|p| format!("map \"{key}\", character {}: {}", p.at, p.what))?;
            if expression.complex && !complex {
                return Err(format!("map \"{key}\": a real number is wanted: use abs, re or im of a complex one"));
            }
            maps.push((*target, expression.steps));
        }
        maps.sort_by_key(|(target, _)| *target);
        one_for_each(&maps, stage)?;
        Ok(Compiled { stage, maps })
    }
}

const STAGES: [(&str, Stage); 4] = [
    ("input", Stage::Input),
    ("mechanics", Stage::Mechanics),
    ("actuation", Stage::Actuation),
    ("readout", Stage::Readout),
];

/// The name of a stage in an effect file.
fn stage_name(stage: Stage) -> &'static str {
    STAGES.iter().find(|(_, s)| *s == stage).map_or("readout", |(name, _)| name)
}

/// Vibrations of about 1 V at which a text is tried.
fn probes() -> [Envelope<f64>; 3] {
    [
        Envelope::new(0.8, 0.003, 0.6, -0.002),
        Envelope::new(-0.31, -0.001, 0.94, 0.004),
        Envelope::new(0.27, 0.005, -0.55, 0.001),
    ]
}

fn difference(a: &Envelope<f64>, b: &Envelope<f64>) -> f64 {
    let d = *a - *b;
    (d.x_c.powi(2) + d.x_s.powi(2) + d.y_c.powi(2) + d.y_s.powi(2)).sqrt()
}

/// Nothing is given a value twice.
fn one_for_each(maps: &[(Target, Vec<Step>)], stage: Stage) -> Result<(), String> {
    let has = |target: Target| maps.iter().any(|(t, _)| *t == target);
    if maps.is_empty() {
        return Err("the map is empty".into());
    }
    let twice = (has(Target::X) && (has(Target::Xc) || has(Target::Xs)))
        || (has(Target::Y) && (has(Target::Yc) || has(Target::Ys)))
        || (has(Target::Theta) && maps.len() > 1 && stage != Stage::Mechanics);
    if twice { Err("the map gives one thing a value twice".into()) } else { Ok(()) }
}

impl ParameterText {
    fn check(&self) -> Result<(), String> {
        let name = shortened(&self.name);
        is_name(&self.name, "_", char::is_alphanumeric).map_err(|what| format!("parameter `{name}`: {what}"))?;
        if self.name.starts_with(|c: char| c.is_numeric()) || language::is_reserved(&self.name) {
            return Err(format!("parameter `{name}`: the language uses this name, or it begins with a digit"));
        }
        if self.unit.len() > MAX_NAME {
            return Err(format!("parameter `{name}`: a unit of more than {MAX_NAME} bytes"));
        }
        let [lower, upper] = self.bounds();
        let sound = self.scale > 0.0 && [self.scale, lower, upper].iter().all(|v| v.is_finite());
        if !sound || !(lower..=upper).contains(&self.neutral) {
            return Err(format!("parameter `{name}`: wanted scale > 0 and lower <= neutral <= upper, all finite"));
        }
        Ok(())
    }

    fn bounds(&self) -> [f64; 2] {
        let usual = USUAL_BOUND * self.scale;
        [self.lower.unwrap_or(self.neutral - usual), self.upper.unwrap_or(self.neutral + usual)]
    }
}

fn is_name(text: &str, also: &str, sign: impl Fn(char) -> bool) -> Result<(), String> {
    if text.is_empty() || text.len() > MAX_NAME {
        return Err(format!("wanted 1 to {MAX_NAME} bytes"));
    }
    match text.chars().find(|c| !sign(*c) && !also.contains(*c)) {
        Some(c) => Err(format!("`{}` has no place in it", c.escape_default())),
        None => Ok(()),
    }
}

/// The beginning of a text, for a message.
fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MAX_NAME).collect()
}

/// An effect file whose expressions were read.
struct Compiled {
    stage: Stage,
    maps: Vec<(Target, Vec<Step>)>,
}

/// The effect of a text that this program already has, or a new one that it keeps from now on.
fn admitted(text: &EffectText, compiled: Compiled, source: &str) -> &'static Written {
    static KNOWN: Mutex<Vec<&'static Written>> = Mutex::new(Vec::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let whole = text.to_text();
    if let Some(written) = known.iter().find(|w| w.text == whole) {
        return written;
    }
    let asks_for = |wanted: fn(&Variable) -> bool| {
        let mut steps = compiled.maps.iter().flat_map(|(_, steps)| steps);
        steps.any(|step| matches!(step, Step::Variable(variable) if wanted(variable)))
    };
    let in_time = asks_for(|v| *v == Variable::Time);
    let by_temperature = asks_for(|v| *v == Variable::Warmer);
    let on_commands = asks_for(Variable::is_of_the_drive);
    let maps: Vec<(Target, &'static [Step])> =
        compiled.maps.into_iter().map(|(target, steps)| (target, &*steps.leak())).collect();
    let written = &*Box::leak(Box::new(Written {
        description: description(text, compiled.stage, source),
        maps: maps.leak(),
        in_time,
        by_temperature,
        on_commands,
        text: whole.leak(),
    }));
    known.push(written);
    written
}

fn description(text: &EffectText, stage: Stage, source: &str) -> Description {
    let kept = |s: &str| -> &'static str { s.to_owned().leak() };
    let parameters: Vec<Parameter> = text
        .parameter
        .iter()
        .map(|p| {
            let [lower, upper] = p.bounds();
            let role = if p.held { Role::Chosen(vec![p.neutral].leak()) } else { Role::Fitted };
            let (name, unit) = (kept(&p.name), kept(&p.unit));
            Parameter { name, unit, lower, upper, neutral: p.neutral, scale: p.scale, role, belief: Belief::Vague }
        })
        .collect();
    let title = if text.summary.is_empty() { "an effect of the user" } else { kept(&text.summary) };
    Description {
        id: kept(&text.id),
        title,
        stage,
        declared: false,
        empirical: false,
        in_sensors: matches!(stage, Stage::Readout | Stage::Input),
        shown: (0..parameters.len()).map(Shown::Plain).collect::<Vec<_>>().leak(),
        parameters: parameters.leak(),
        onsets: text.onsets.clone().leak(),
        signature: kept(&format!("written by the user in {source}")),
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: kept(source),
    }
}

#[cfg(test)]
mod tests;
