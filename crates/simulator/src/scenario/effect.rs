//! An effect as a scenario file writes it: `{ id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 27.0 }`.
//!
//! Parameters go by the names the library gives them; a pair that is shown as magnitude and angle may be written that
//! way too, the angle in degrees. What is not written is absent from the effect, except what a search would set (a
//! harmonic number, a frequency): that has to be written.

use cvg_model::effects::{EffectId, Parameter, Role, Shown, Values};
use serde::{Deserialize, Serialize};

/// An effect of the library with the values of its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table", into = "toml::Table")]
pub struct EffectSetting {
    /// which effect
    pub id: EffectId,
    /// values in the order of its parameters
    pub values: Values<f64>,
}

impl EffectSetting {
    /// The effect `id` at `values`.
    ///
    /// # Errors
    /// A value outside the bounds that the library gives its parameter, or a value for no parameter.
    pub fn new(id: EffectId, values: Values<f64>) -> Result<Self, String> {
        let parameters = id.description().parameters;
        for (parameter, value) in parameters.iter().zip(values) {
            if !(value >= parameter.lower && value <= parameter.upper) {
                return Err(format!(
                    "{id}: {} = {value} is outside [{}, {}] {}",
                    parameter.name, parameter.lower, parameter.upper, parameter.unit
                ));
            }
        }
        if values.iter().skip(parameters.len()).any(|v| *v != 0.0) {
            return Err(format!("{id} has {} parameters and was given more values", parameters.len()));
        }
        Ok(Self { id, values })
    }

    /// Parameters with their values.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static Parameter, f64)> {
        self.id.description().parameters.iter().zip(self.values)
    }
}

impl TryFrom<toml::Table> for EffectSetting {
    type Error = String;

    fn try_from(mut table: toml::Table) -> Result<Self, String> {
        let id = match table.remove("id") {
            Some(toml::Value::String(id)) => id,
            Some(other) => return Err(format!("an effect's id is a name, not {other}")),
            None => return Err("an effect without id".to_owned()),
        };
        let id = EffectId::from_id(&id).ok_or_else(|| {
            let known: Vec<_> = EffectId::ALL.iter().map(|e| e.description().id).collect();
            format!("no effect is called {id:?}; the library has {}", known.join(", "))
        })?;
        let mut values: Values<f64> = id.neutral();
        for shown in id.description().shown {
            polar(shown, &mut table, &mut values)?;
        }
        for (parameter, value) in id.description().parameters.iter().zip(&mut values) {
            match number(&mut table, parameter.name)? {
                Some(written) => *value = written,
                None if matches!(parameter.role, Role::Searched(_) | Role::Located(_)) => {
                    return Err(format!("{id} needs {}", parameter.name));
                }
                None => {}
            }
        }
        if let Some(unknown) = table.keys().next() {
            let known: Vec<_> = id.description().parameters.iter().map(|p| p.name).collect();
            return Err(format!("{id} has no parameter {unknown:?}; it has {}", known.join(", ")));
        }
        Self::new(id, values)
    }
}

/// Takes a pair written as magnitude and angle (deg) out of the table.
fn polar(shown: &Shown, table: &mut toml::Table, values: &mut Values<f64>) -> Result<(), String> {
    if let Shown::Polar { cos, sin, magnitude, angle, division, .. } = *shown {
        let written_angle = number(table, angle)?;
        match number(table, magnitude)? {
            Some(size) => {
                let (s, c) = (division * written_angle.unwrap_or(0.0).to_radians()).sin_cos();
                for (place, value) in [(cos, size * c), (sin, size * s)] {
                    if let Some(v) = values.get_mut(place) {
                        *v = value;
                    }
                }
            }
            None if written_angle.is_some() => return Err(format!("{angle} is given without {magnitude}")),
            None => {}
        }
    }
    Ok(())
}

/// Takes a number out of the table.
fn number(table: &mut toml::Table, name: &str) -> Result<Option<f64>, String> {
    match table.remove(name) {
        None => Ok(None),
        Some(toml::Value::Float(value)) => Ok(Some(value)),
        #[allow(clippy::cast_precision_loss, reason = "whole numbers in scenarios are small")]
        Some(toml::Value::Integer(value)) => Ok(Some(value as f64)),
        Some(other) => Err(format!("{name} has to be a number, not {other}")),
    }
}

impl From<EffectSetting> for toml::Table {
    fn from(setting: EffectSetting) -> Self {
        let mut table = Self::new();
        table.insert("id".to_owned(), toml::Value::String(setting.id.description().id.to_owned()));
        for (parameter, value) in setting.parameters() {
            table.insert(parameter.name.to_owned(), toml::Value::Float(value));
        }
        table
    }
}
