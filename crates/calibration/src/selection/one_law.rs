//! One law in the place of many descriptions: harmonics and formulas that describe what has no cause may be the sight of one law that no
//! effect of the library has. It is looked for when all else is found, claims nothing and corrects nothing: it is proposed.

use cvg_model::effects::{EffectId, Stage};

use super::candidates::Candidate;
use super::discovery::tried_carefully;
use super::one_step::promises;
use super::trial::{
    Before, CAREFUL, FINALISTS, LEAST_GAIN, LEAST_LEAD, NOTHING_LEFT, Trial, explains_as_much, extend_from, on_fit,
    refit, validated,
};
use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::model::hypothesis::{Hypothesis, Member, Origin};
use crate::model::written::EffectText;
use crate::model::written::laws::{NAMELESS, Nameless, Shape};

/// A law that explains by itself what has no cause.
#[derive(Debug, Clone)]
pub(crate) struct OneLaw {
    /// as an effect as text, with what was seen of it
    pub(crate) text: EffectText,
    /// members of the hypothesis in whose place it is
    pub(crate) explained: Vec<usize>,
}

/// A member of the library that describes and has no cause.
fn describes(member: &Member) -> bool {
    member.origin == Origin::Empirical && member.id.in_library()
}

/// One that follows the pattern; what follows the table or the time stands beside a law of the resonator or of its readout, unless that
/// explains it too.
fn describes_the_pattern(member: &Member) -> bool {
    let own = matches!(member.id.description().stage, Stage::Mechanics | Stage::Readout);
    describes(member) && own && member.id != EffectId::TimePeriodic
}

/// The law that explains as much as everything that describes and has no cause, with fewer numbers or far more of it.
///
/// # Errors
/// As for the fit.
pub(crate) fn one_law(dataset: &mut Dataset, fitted: &Fitted) -> Result<Option<OneLaw>, Refusal> {
    let of = |describes: fn(&Member) -> bool| -> Vec<usize> {
        let members = fitted.fit.hypothesis.members.iter().enumerate();
        members.filter(|(_, m)| describes(m)).map(|(at, _)| at).collect()
    };
    let mut scopes = vec![of(describes), of(describes_the_pattern)];
    scopes.dedup();
    if scopes[scopes.len() - 1].is_empty() && dataset.excess() < NOTHING_LEFT {
        return Ok(None);
    }
    let numbers = |h: &Hypothesis| h.effect_unknowns().len();
    // asked about what was found when that was fitted, and by fits with a law about another instrument
    let damping = dataset.damping_balance;
    for explained in scopes {
        let found = best_law(dataset, fitted, &explained);
        dataset.restore(fitted);
        dataset.damping_balance = damping;
        let Some(found) = found? else { continue };
        let is_simpler = numbers(&found.fit.hypothesis) < numbers(&fitted.fit.hypothesis);
        let explains = explains_as_much(dataset, &found.fit, &fitted.fit);
        if explains && (is_simpler || !explains_as_much(dataset, &fitted.fit, &found.fit)) {
            return Ok(Some(OneLaw { text: found.text, explained }));
        }
    }
    Ok(None)
}

/// A law after its fit.
struct Found {
    fit: Fit,
    text: EffectText,
}

/// The law that explains most in the place of some members, if it earns that.
fn best_law(dataset: &mut Dataset, fitted: &Fitted, in_place_of: &[usize]) -> Result<Option<Found>, Refusal> {
    let mut bare = fitted.fit.hypothesis.clone();
    let mut at = 0..;
    bare.members.retain(|_| at.next().is_none_or(|at| !in_place_of.contains(&at)));
    let bare = fit_with_ring_downs(dataset, &bare)?;
    let laws: Vec<&Nameless> = NAMELESS.iter().filter(|law| is_told(law, dataset)).collect();
    let candidate = |law: &&Nameless| Candidate {
        id: law.effect,
        values: law.effect.neutral(),
        refine: None,
        tried: laws.len() as f64,
    };
    let candidates: Vec<Candidate> = laws.iter().map(candidate).collect();
    let ranked = promises(dataset, &bare, &candidates);
    let base = refit(dataset, &bare, &bare.fit.hypothesis, CAREFUL);
    let trials = tried_carefully(dataset, &bare, &ranked[..FINALISTS.min(ranked.len())], &base);
    let Some(best) = trials.first().filter(|best| best.gain >= LEAST_GAIN) else { return Ok(None) };
    let before = Before::of(dataset, &bare);
    let left_before = on_fit(dataset, &bare.fit).mean_square();
    let next = fit_with_ring_downs(dataset, &extend_from(best, Origin::Empirical))?;
    if !before.is_improved_by(validated(dataset, &next)) {
        return Ok(None);
    }
    let of = |id: EffectId| laws.iter().find(|law| law.effect == id);
    let Some((law, member)) = of(best.candidate.id).zip(next.fit.hypothesis.member(best.candidate.id)) else {
        return Ok(None);
    };
    let is_level = |t: &Trial, power: u32| {
        let alike = of(t.candidate.id).is_some_and(|l| l.shape == law.shape && l.power == Some(power));
        alike && t.gain > best.gain - LEAST_LEAD
    };
    let removed = (left_before - on_fit(dataset, &next.fit).mean_square()).max(0.0).sqrt();
    let size_deg = (removed * std::f64::consts::SQRT_2).to_degrees();
    let text = law.proposed(&member.values, size_deg, |power| !trials.iter().any(|t| is_level(t, power)));
    Ok(Some(Found { fit: next.fit, text }))
}

/// Whether the runs differ in what the law goes with.
fn is_told(law: &Nameless, dataset: &Dataset) -> bool {
    match law.shape {
        Shape::RateSquared | Shape::Kinked => dataset.speeds_differ(),
        Shape::Gain | Shape::DeadZone | Shape::CrosstalkOfAChannel | Shape::CrosstalkOfAll | Shape::Product => {
            !dataset.alike().amplitude
        }
    }
}
