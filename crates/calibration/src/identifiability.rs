//! What a campaign cannot tell apart, and which extra run would.

use cvg_model::effects::{EffectId, Stage};
use nalgebra::DMatrix;

use crate::hypothesis::{Hypothesis, Unknown};

/// Correlation beyond which two effects count as confounded.
pub const CONFOUNDED: f64 = 0.95;

/// An estimate is vague when its deviation exceeds this share of a plainly visible change.
const VAGUE: f64 = 0.1;

/// Effects whose estimates move together with those of `id`: from the covariance of the fit, the inverse of the Fisher
/// information.
pub(crate) fn confounded_with(
    id: EffectId,
    hypothesis: &Hypothesis,
    unknowns: &[Unknown],
    covariance: &DMatrix<f64>,
) -> Vec<EffectId> {
    let of = |u: &Unknown| match u {
        Unknown::Effect(member, _) => Some(hypothesis.members[*member].id),
        _ => None,
    };
    // An estimate that is sharp all the same is not confounded, however it moves with another.
    let vague = |i: usize, u: &Unknown| match u {
        Unknown::Effect(member, p) => {
            let scale = hypothesis.members[*member].id.description().parameters[*p].scale;
            covariance[(i, i)].sqrt() > VAGUE * scale
        }
        _ => false,
    };
    let mut out = Vec::new();
    for (i, _) in unknowns.iter().enumerate().filter(|(i, u)| of(u) == Some(id) && vague(*i, u)) {
        for (j, other) in unknowns.iter().enumerate().filter_map(|(j, u)| of(u).map(|o| (j, o))) {
            let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if other != id && scale > 0.0 && (covariance[(i, j)] / scale).abs() > CONFOUNDED && !out.contains(&other) {
                out.push(other);
            }
        }
    }
    out
}

/// The run that would separate two effects, from how their shares in the angle scale.
pub fn separated_by(one: EffectId, other: EffectId) -> &'static str {
    let (a, b) = (one.description(), other.description());
    if a.stage == Stage::Actuation || b.stage == Stage::Actuation {
        "ring-downs at 0° and 90°"
    } else if a.scaling.rate != b.scaling.rate || a.scaling.odd_in_rate != b.scaling.odd_in_rate {
        "a rotation run at another rate, or in the opposite direction"
    } else if a.scaling.amplitude != b.scaling.amplitude {
        "a rotation run at another amplitude"
    } else if a.stage == Stage::Input || b.stage == Stage::Input {
        "a rotation run with the table angle recorded (table_deg), or at another rate"
    } else {
        "a longer rotation run at another rate and amplitude"
    }
}
