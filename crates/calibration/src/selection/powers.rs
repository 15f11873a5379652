//! A cubic and a quintic of the readout together may be one law of another power of the amplitude, as may one of them with a harmonic beside it:
//! between two amplitudes, or over the sine of a channel, they follow X(1 + k|X|ᵖ) for any p. Where one such law explains as much with fewer
//! parameters, they are not claimed.

use std::sync::LazyLock;

use cvg_model::effects::{EffectId, harmonic_n};

use super::step::{Accepted, not_claimed};
use super::trial::{LEAST_LEAD, REFUTED, balance, count, on_fit, sample_cost};
use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::model::hypothesis::{Member, Origin};
use crate::model::written::EffectText;

/// The powers of the library, and others that are tried in their place.
const PAIR: [EffectId; 2] = [EffectId::DetectionCubic, EffectId::DetectionQuintic];
const POWERS: [u32; 4] = [1, 3, 6, 8];

/// The readout X(1 + k|X|ᵖ) of both channels, by its power.
static OTHERS: LazyLock<Vec<(u32, EffectId)>> = LazyLock::new(|| {
    let admitted = |p: u32| {
        let text = format!(
            "id = \"amplitude-to-the-{p}\"\nstage = \"readout\"\n[[parameter]]\nname = \"k\"\nunit = \"1/V^{p}\"\nscale = 1e-3\n\
             [map]\n\"x'\" = \"x * (1 + k * abs(x)^{p})\"\n\"y'\" = \"y * (1 + k * abs(y)^{p})\"\n"
        );
        let effect = EffectText::parse(&text, "powers").and_then(|text| text.effect("powers"));
        effect.ok().map(|id| (p, id))
    };
    POWERS.into_iter().filter_map(admitted).collect()
});

/// Whether a fit leaves no more of the angle than another, by what the samples can tell, and the energy balance does not refute it. Both are
/// looked at behind one scale of the noise, which each fit measures for itself.
fn explains_as_much(dataset: &Dataset, rival: &Fit, other: &Fit) -> bool {
    let balances = balance(dataset, other).zip(balance(dataset, rival));
    if balances.is_some_and(|(before, after)| after > REFUTED * before) {
        return false;
    }
    let [left, other_left] = [rival, other].map(|fit| on_fit(dataset, fit));
    let worth = count(other) / sample_cost(&other_left);
    worth * (left.mean_square() / other_left.mean_square()).ln() < LEAST_LEAD
}

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
    for &(p, id) in OTHERS.iter() {
        let mut rival = without.clone();
        rival.admit(id, Origin::Discovered);
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
