//! What the names of an effect's parameters say of them: where they are nothing, and after how much they are the same again.

use cvg_calibration::report::named::BESIDE_THE_LIBRARY;
use cvg_model::effects::{EffectId, Shown};

/// The effect and the parameter of a name, without the number that a search set.
pub(super) fn named(name: &str) -> Option<(&str, &str)> {
    let (effect, parameter) = name.rsplit_once('.')?;
    Some((effect.split('[').next()?, parameter))
}

/// What a parameter is where its effect is not there; none of an angle, and of what neither the library nor reports know.
pub(super) fn absent(id: &str, name: &str) -> Option<f64> {
    let beside = || BESIDE_THE_LIBRARY.iter().find(|beside| beside.id == id).map(|_| rail(name).unwrap_or(0.0));
    let Some(effect) = EffectId::from_id(id) else { return beside() };
    let d = effect.description();
    d.shown.iter().find_map(|shown| match *shown {
        Shown::Plain(at) => (d.parameters[at].name == name).then_some(d.parameters[at].neutral),
        Shown::Polar { magnitude, .. } => (magnitude == name).then_some(0.0),
    })
}

/// Where a rail of a converter is that is not there.
fn rail(name: &str) -> Option<f64> {
    match name.rsplit_once('_')?.1 {
        "low" => Some(f64::NEG_INFINITY),
        "high" => Some(f64::INFINITY),
        _ => None,
    }
}

/// After how much a parameter is the same again, in its unit: a phase after a turn, an axis after half of one, all else never.
pub(super) fn goes_round(id: &str, name: &str, unit: &str) -> f64 {
    if unit != "deg" {
        return f64::INFINITY;
    }
    let division = |shown: &Shown| match shown {
        Shown::Polar { angle, division, .. } if *angle == name => Some(*division),
        _ => None,
    };
    let effect = EffectId::ALL.iter().find(|effect| effect.description().id == id);
    360.0 / effect.and_then(|effect| effect.description().shown.iter().find_map(division)).unwrap_or(1.0)
}
