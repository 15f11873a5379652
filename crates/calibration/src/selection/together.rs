//! Causes that hide each other: where single effects and pairs end above the noise, all causes that the campaign could name are
//! fitted together, and what the others do without leaves again, the weakest first (backward elimination).
//!
//! Adding the best effect, one at a time, goes astray where half a dozen of one size are missing: under each of them the residual
//! keeps the others' memory, in which samples are worth little, and what takes a share of several at once looks like the cause.
//! So many parameters describe much that is none of them: they are believed only where they leave nothing but noise.
//!
//! What goes astray may also end at the noise, with a correction that has no cause in the place of several that have. The angle
//! does not ask for more then, but where the energy balance contradicts that correction, it does.

use cvg_model::effects::Role as ParameterRole;

use crate::error::Refusal;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::selection::candidates::{Candidate, candidates};
use crate::selection::discovery::drop_weak;
use crate::selection::step::{Accepted, State};
use crate::selection::trial::{
    BY_AMPLITUDE, Before, CAREFUL, Distinguishable, NOTHING_LEFT, QUICK, REFUTED, balance, count, extend, floor,
    on_fit, refit, validated,
};

/// Fits of everything, each from where the last one ended.
const FITS: usize = 3;
/// Causes of more parameters than this come in where those of fewer are not enough.
const SIMPLE: usize = 2;

/// The causes that explain all that single steps left, or described against the energy balance; none where they leave more than
/// noise.
///
/// # Errors
/// As for the fit.
pub(super) fn all_together(
    dataset: &mut Dataset,
    fitted: &Fitted,
    steps: &[Accepted],
) -> Result<Option<(Fitted, Vec<Accepted>)>, Refusal> {
    let apart = Distinguishable::on(dataset);
    let driven = dataset.tracks.iter().all(|t| t.track.records_the_loops());
    let much_is_left = dataset.excess() >= NOTHING_LEFT;
    let contradicted = steps.iter().any(|s| s.origin == Origin::Empirical && s.contradicted);
    if !(much_is_left || contradicted) || !apart.rates || !driven {
        return Ok(None);
    }
    let before_it = Before::of(dataset, fitted);
    let balance_before = balance(dataset, &fitted.fit);
    // unequal drives are one more cause
    dataset.drive_is_free_at_once = true;
    for most in [SIMPLE, usize::MAX] {
        let Some((mut next, mut came)) = everything(dataset, fitted, most)? else { continue };
        drop_weak(dataset, &mut next, &mut came)?;
        let left = validated(dataset, &next);
        let balances = balance_before.zip(balance(dataset, &next.fit));
        let refuted = balances.is_some_and(|(before, after)| after > REFUTED * before);
        let closes = balances.is_some_and(|(before, after)| after < BY_AMPLITUDE * before);
        let explains =
            if much_is_left { before_it.is_improved_by(left) } else { closes && before_it.is_as_large_as(left) };
        // the same causes again would go in circles
        let anew = came.iter().any(|c| steps.iter().all(|s| s.id != c.id));
        if anew && !refuted && is_noise(dataset, &next) && explains {
            return Ok(Some((next, came)));
        }
    }
    dataset.drive_is_free_at_once = false;
    Ok(None)
}

/// The declared model with every cause of at most `most` parameters, where that leaves noise.
fn everything(dataset: &mut Dataset, fitted: &Fitted, most: usize) -> Result<Option<(Fitted, Vec<Accepted>)>, Refusal> {
    dataset.restore(fitted);
    let mut declared = fitted.fit.hypothesis.clone();
    // what came in before stands for what was missing then
    declared.members.retain(|m| m.origin == Origin::Declared);
    let causes: Vec<Candidate> = causes(dataset, &declared, fitted)
        .into_iter()
        .filter(|c| c.id.description().parameters.len() <= most)
        .collect();
    let all = causes.iter().fold(declared, |h, cause| extend(&h, cause, Origin::Discovered));
    dataset.drive_is_free = dataset.tells_the_drive();
    let begun = refit(dataset, fitted, &all, QUICK);
    let mut hypothesis = refit(dataset, fitted, &begun.hypothesis, CAREFUL).hypothesis;
    for _ in 0..FITS {
        let next = fit_with_ring_downs(dataset, &hypothesis)?;
        if is_noise(dataset, &next) {
            let left = [fitted, &next].map(|f| validated(dataset, f));
            let gain = count(&next.fit) * (left[0] / left[1]).ln();
            let came = causes.iter().map(|cause| step(dataset, cause, [fitted, &next], gain)).collect();
            return Ok(Some((next, came)));
        }
        hypothesis = next.fit.hypothesis;
    }
    Ok(None)
}

fn is_noise(dataset: &Dataset, fitted: &Fitted) -> bool {
    validated(dataset, fitted) <= (NOTHING_LEFT * floor(dataset, &fitted.fit)).powi(2)
}

/// One of the causes that came in together: what they gained, they gained together, in samples that were not fitted.
fn step(dataset: &Dataset, cause: &Candidate, [before, after]: [&Fitted; 2], gain: f64) -> Accepted {
    let balances = [before, after].map(|f| balance(dataset, &f.fit).map(f64::sqrt));
    Accepted {
        id: cause.id,
        origin: Origin::Discovered,
        gain,
        rivals: Vec::new(),
        states: [before, after].map(|f| State::of(&f.fit)),
        confounded_with: Vec::new(),
        energy_balance: balances[0].zip(balances[1]).map(|(before, after)| [before, after]),
        inconsistency: None,
        contradicted: false,
    }
}

/// Every cause that the campaign could name and that no search has to place, unless it is in already.
pub(super) fn causes(dataset: &Dataset, hypothesis: &Hypothesis, fitted: &Fitted) -> Vec<Candidate> {
    let apart = Distinguishable::on(dataset);
    let left = on_fit(dataset, &fitted.fit);
    let placed = |c: &Candidate| {
        let parameters = c.id.description().parameters;
        parameters.iter().any(|p| matches!(p.role, ParameterRole::Searched(_) | ParameterRole::Located(_)))
    };
    candidates(dataset, hypothesis, &left, &left)
        .into_iter()
        .filter(|c| c.refine.is_none() && !placed(c) && c.id.description().onsets.is_empty())
        .filter(|c| !c.id.description().empirical && apart.can_be_named(c))
        .collect()
}
