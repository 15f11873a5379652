//! The inverse of the readout effects that an identification found, applied at run time.
//!
//! A readout effect acts in the order of [`EffectId::ALL`], the order in which the signal meets it; so it is undone in
//! the reverse order. Nothing here names an effect: what can be inverted is what the library defines.

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Stage, Values};
use cvg_model::{Envelope, Float};

use crate::ConfigError;

/// Up to `N` readout effects with their parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensation<T, const N: usize> {
    /// in the order of [`EffectId::ALL`], then as given; the unused places are at the end
    effects: [Option<(EffectId, Values<T>)>; N],
}

impl<T: Float, const N: usize> Compensation<T, N> {
    /// No effect: the readout as it is.
    pub fn none() -> Self {
        Self { effects: [None; N] }
    }

    /// The inverse of `effects`.
    ///
    /// # Errors
    /// More than `N` effects; an effect that does not act on the readout; a parameter that is not finite or outside
    /// its bounds in the library; a value other than 0 in a place that no parameter uses.
    pub fn new(effects: &[(EffectId, Values<T>)]) -> Result<Self, ConfigError> {
        for (id, values) in effects {
            check(*id, values)?;
        }
        let mut sorted = Self::none();
        let mut free = sorted.effects.iter_mut();
        for &id in EffectId::ALL {
            for entry in effects.iter().filter(|(e, _)| *e == id) {
                let place = free.next().ok_or(ConfigError {
                    parameter: "effects",
                    expected: "no more than the compensation has room for",
                })?;
                *place = Some(*entry);
            }
        }
        Ok(sorted)
    }

    /// The effects undone, in the order in which the signal meets them.
    pub fn effects(&self) -> impl DoubleEndedIterator<Item = &(EffectId, Values<T>)> {
        self.effects.iter().flatten()
    }

    /// The vibration behind the readout `e` at the moment `at`.
    ///
    /// Where an effect has no inverse (a readout that no vibration can give) the result is the library's nearest, or
    /// not finite; the trackers downstream report that as invalid.
    #[inline]
    pub fn apply(&self, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let mut z = e;
        for (id, values) in self.effects().rev() {
            z = id.unread(values, z, at);
        }
        z
    }
}

fn check<T: Float>(id: EffectId, values: &Values<T>) -> Result<(), ConfigError> {
    let description = id.description();
    if description.stage != Stage::Readout {
        return Err(ConfigError { parameter: description.id, expected: "an effect of the readout" });
    }
    for (value, parameter) in values.iter().zip(description.parameters) {
        let v = value.to_f64();
        if !(v >= parameter.lower && v <= parameter.upper) {
            return Err(ConfigError { parameter: parameter.name, expected: "finite and within its bounds" });
        }
    }
    let unused = MAX_PARAMETERS.saturating_sub(description.parameters.len());
    if values.iter().rev().take(unused).any(|v| *v != T::zero()) {
        return Err(ConfigError { parameter: description.id, expected: "given no more values than it has parameters" });
    }
    Ok(())
}
