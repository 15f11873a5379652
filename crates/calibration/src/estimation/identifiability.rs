//! What a campaign cannot tell apart, and which extra run would.

use cvg_model::effects::{EffectId, Stage};
use nalgebra::DMatrix;

use crate::model::hypothesis::{Hypothesis, Unknown};

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

/// What the fitted runs have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Alike {
    /// they turn one way
    pub(crate) direction: bool,
    /// at one speed
    pub(crate) speed: bool,
    /// at one amplitude
    pub(crate) amplitude: bool,
    /// there are no ring-downs
    pub(crate) no_ring_downs: bool,
    /// the table's own angle was not recorded in all of them
    pub(crate) no_table: bool,
}

/// The run that would separate two effects: what the campaign lacks of that in which their shares scale apart.
pub(crate) fn separated_by(one: EffectId, other: EffectId, alike: Alike) -> &'static str {
    let (a, b) = (one.description(), other.description());
    let (actuation, input) = ([a, b].map(|d| d.stage == Stage::Actuation), [a, b].map(|d| d.stage == Stage::Input));
    let by_rate = a.scaling.rate != b.scaling.rate || a.scaling.odd_in_rate != b.scaling.odd_in_rate;
    if actuation.contains(&true) && alike.no_ring_downs {
        "ring-downs at 0° and 90°"
    } else if (by_rate || actuation.contains(&true)) && alike.direction && alike.speed {
        "rotation runs at another rate and in the opposite direction"
    } else if (by_rate || actuation.contains(&true)) && alike.speed {
        "a rotation run at another rate"
    } else if by_rate && alike.direction {
        "a rotation run in the opposite direction"
    } else if a.scaling.amplitude != b.scaling.amplitude && alike.amplitude {
        "a rotation run at another amplitude"
    } else if input.contains(&true) && alike.no_table {
        "a rotation run with the table angle recorded (table_deg), or at another rate"
    } else if input.contains(&true) {
        "a rotation run at another rate"
    } else {
        "longer rotation runs"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_recorded_already_is_not_asked_for() {
        let differ = Alike { direction: false, speed: false, amplitude: false, no_ring_downs: false, no_table: true };
        let advice = |alike| separated_by(EffectId::TableHarmonic, EffectId::HarmonicN, alike);
        assert_eq!(advice(differ), "a rotation run with the table angle recorded (table_deg), or at another rate");
        assert_eq!(advice(Alike { no_table: false, ..differ }), "a rotation run at another rate");
    }
}
