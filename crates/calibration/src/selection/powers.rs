//! A cubic and a quintic of the readout together may be one law of another power of the amplitude, as may one of them with a harmonic beside it:
//! between two amplitudes, or over the sine of a channel, they follow X(1 + k|X|ᵖ) for any p. Where one such law explains as much with fewer
//! parameters, they are not claimed.

use cvg_model::effects::{EffectId, harmonic_n};

use super::step::{Accepted, not_claimed};
use super::trial::explains_as_much;
use crate::error::Refusal;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::model::hypothesis::{Member, Origin};
use crate::model::written::laws::{NAMELESS, Shape};

/// The powers of the library.
const PAIR: [EffectId; 2] = [EffectId::DetectionCubic, EffectId::DetectionQuintic];

/// Takes the name from a cubic or a quintic that was found, where one other power of the amplitude explains as much as they and the harmonics
/// without a cause that they were found to lack.
///
/// # Errors
/// As for the fit.
pub(super) fn one_power_in_their_place(
    dataset: &mut Dataset,
    fitted: &mut Fitted,
    steps: &mut [Accepted],
) -> Result<(), Refusal> {
    let is_power = |m: &Member| PAIR.contains(&m.id) && m.origin == Origin::Discovered;
    let is_one_of = |m: &Member| {
        let at_every_rate = m.id == EffectId::HarmonicN && m.values[3] == harmonic_n::scaling::CONSTANT;
        is_power(m) || at_every_rate && m.origin == Origin::Empirical
    };
    let members = &fitted.fit.hypothesis.members;
    let claimed: Vec<usize> = (0..members.len()).filter(|at| is_power(&members[*at])).collect();
    // one parameter in the place of one is no simpler
    if claimed.is_empty() || members.iter().filter(|m| is_one_of(m)).count() < 2 {
        return Ok(());
    }
    let mut without = fitted.fit.hypothesis.clone();
    without.members.retain(|m| !is_one_of(m));
    let others = NAMELESS.iter().filter(|law| law.shape == Shape::Gain);
    for (p, effect) in others.filter_map(|law| Some((law.power?, law.effect))) {
        let mut rival = without.clone();
        rival.admit(effect, Origin::Discovered);
        let rival = fit_with_ring_downs(dataset, &rival)?;
        let explains = explains_as_much(dataset, &rival.fit, &fitted.fit);
        dataset.restore(fitted);
        if !explains {
            continue;
        }
        let why = format!("X(1 + k|X|^{p}) by itself explains as much as it and what was found beside it");
        claimed.into_iter().for_each(|at| not_claimed(&mut fitted.fit.hypothesis, at, steps, &why));
        return Ok(());
    }
    Ok(())
}
