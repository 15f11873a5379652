//! Two causes that hide each other: where no single effect helps and more than noise is left, pairs of them are tried.
//!
//! Adding the best effect, one at a time, cannot find two whose shares in the angle nearly cancel (an actuation skew and a
//! detection skew at the same second harmonic): neither alone lowers the error. A search over pairs goes through many more
//! alternatives, so that a pair is believed only where it leaves nothing but noise.

use rayon::prelude::*;

use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::selection::candidates::{Candidate, candidates};
use crate::selection::one_step::OneStep;
use crate::selection::step::{Accepted, State};
use crate::selection::trial::{
    Before, CAREFUL, Distinguishable, FINALISTS, LEAST_GAIN, LEAST_LEAD, NOTHING_LEFT, QUICK, REFUTED, balance, count,
    extend, floor, mean_square, on_fit, price, refit, sample_cost, validated,
};

/// Two candidates refitted together.
struct Pair<'a> {
    causes: [&'a Candidate; 2],
    fit: Fit,
    gain: f64,
}

/// The pair of effects that explains all that is left, if there is one and no other pair does.
///
/// # Errors
/// As for the fit.
pub(super) fn best_pair(dataset: &mut Dataset, fitted: &Fitted) -> Result<Option<(Fitted, [Accepted; 2])>, Refusal> {
    let apart = Distinguishable::on(dataset);
    if dataset.excess() < NOTHING_LEFT || !apart.rates {
        return Ok(None);
    }
    let before = on_fit(dataset, &fitted.fit);
    let causes: Vec<Candidate> = candidates(dataset, &fitted.fit.hypothesis, &before, &before)
        .into_iter()
        .filter(|c| c.refine.is_none() && apart.can_be_named(c) && c.id.description().onsets.is_empty())
        .collect();
    let base = refit(dataset, fitted, &fitted.fit.hypothesis, CAREFUL);
    let worth = 1.0 / sample_cost(&before);
    let finalists: Vec<[usize; 2]> = promising(dataset, fitted, &causes).into_iter().take(FINALISTS).collect();
    let mut ranked: Vec<Pair<'_>> = finalists
        .into_par_iter()
        .map(|pair| {
            let pair = pair.map(|i| &causes[i]);
            let with = |h: &Hypothesis, cause: &Candidate| extend(h, cause, Origin::Discovered);
            let both = pair.iter().fold(fitted.fit.hypothesis.clone(), |h, cause| with(&h, cause));
            let begun = refit(dataset, fitted, &both, QUICK);
            let fit = refit(dataset, fitted, &begun.hypothesis, CAREFUL);
            let n = worth * count(&fit);
            let gain = n * (mean_square(&base) / mean_square(&fit)).ln() - both_prices(pair, causes.len(), n);
            Pair { causes: pair, fit, gain }
        })
        .filter(|pair| pair.gain >= LEAST_GAIN)
        .collect();
    ranked.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let told = |best: &Pair<'_>| ranked.get(1).is_none_or(|next| next.gain < best.gain - LEAST_LEAD);
    let Some(best) = ranked.first().filter(|best| told(best)) else { return Ok(None) };
    let balances = [balance(dataset, &base), balance(dataset, &best.fit)];
    if matches!(balances, [Some(before), Some(after)] if after > REFUTED * before) {
        return Ok(None);
    }
    let before_it = Before::of(dataset, fitted);
    let next = fit_with_ring_downs(dataset, &best.fit.hypothesis)?;
    let after = validated(dataset, &next);
    let is_noise = after <= (NOTHING_LEFT * floor(dataset, &next.fit)).powi(2);
    if !is_noise || !before_it.is_improved_by(after) {
        return Ok(None);
    }
    let step = |candidate: &Candidate| Accepted {
        id: candidate.id,
        origin: Origin::Discovered,
        gain: best.gain,
        rivals: Vec::new(),
        states: [&fitted.fit, &next.fit].map(State::of),
        confounded_with: Vec::new(),
        energy_balance: balances[0].zip(balances[1]).map(|(a, b)| [a.sqrt(), b.sqrt()]),
        inconsistency: None,
        contradicted: false,
    };
    let steps = best.causes.map(step);
    Ok(Some((next, steps)))
}

/// Every pair of different effects after one linear step, the most promising first.
fn promising(dataset: &Dataset, fitted: &Fitted, causes: &[Candidate]) -> Vec<[usize; 2]> {
    let one_step = OneStep::new(dataset, fitted, &causes.iter().collect::<Vec<_>>());
    let pairs = (0..causes.len()).flat_map(|i| (i + 1..causes.len()).map(move |j| [i, j]));
    let mut ranked: Vec<(f64, [usize; 2])> = pairs
        .filter(|[i, j]| causes[*i].id != causes[*j].id)
        .filter_map(|pair| Some((one_step.mean_square(&pair)?, pair)))
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|(_, pair)| pair).collect()
}

/// What both members of a pair cost, and the search over all pairs.
fn both_prices(pair: [&Candidate; 2], causes: usize, n: f64) -> f64 {
    let pairs = (causes * causes.saturating_sub(1) / 2).max(1) as f64;
    price(pair[0], n) + price(pair[1], n) + 2.0 * pairs.ln()
}
