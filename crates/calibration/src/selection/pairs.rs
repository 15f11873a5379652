//! Two causes that hide each other: where no single effect helps and more than noise is left, pairs of them are tried.
//!
//! Adding the best effect, one at a time, cannot find two whose shares in the angle nearly cancel (an actuation skew and a
//! detection skew at the same second harmonic): neither alone lowers the error. A search over pairs goes through many more
//! alternatives, so that a pair is believed only where it leaves nothing but noise.

use rayon::prelude::*;

use crate::diagnostics::evaluate::evaluate;
use crate::diagnostics::residual::pattern_harmonics;
use crate::error::Refusal;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::Origin;
use crate::recording::Role;
use crate::selection::candidates::{Candidate, candidates};
use crate::selection::discovery::{Distinguishable, LEAST_GAIN, LEAST_LEAD, NOTHING_LEFT, REFUTED, Step};
use crate::selection::trial::{
    CAREFUL, FINALISTS, QUICK, Trial, balance, count, extend, floor, heldout, mean_square, on_heldout, price, refit,
    sample_cost,
};

/// Two candidates refitted together; the trial is that of the second.
struct Pair {
    first: Candidate,
    trial: Trial,
}

/// The pair of effects that explains all that is left, if there is one and no other pair does.
///
/// # Errors
/// As for the fit.
pub(super) fn best_pair(dataset: &mut Dataset, fitted: &Fitted) -> Result<Option<(Fitted, [Step; 2])>, Refusal> {
    let apart = Distinguishable::on(dataset);
    if dataset.excess() < NOTHING_LEFT || !apart.rates {
        return Ok(None);
    }
    let left = |fit| evaluate(&dataset.tracks, &fitted.fit.hypothesis, fit, Role::Fit, Window::Whole, None);
    let before = left(&fitted.fit.starts);
    let causes: Vec<Candidate> = candidates(dataset, &fitted.fit.hypothesis, &before, &before)
        .into_iter()
        .filter(|c| c.refine.is_none() && apart.can_be_named(c))
        .collect();
    let base = refit(dataset, fitted, &fitted.fit.hypothesis, QUICK);
    let mut ranked = on_trial(dataset, fitted, &causes, mean_square(&base));
    ranked.truncate(FINALISTS);
    let base = refit(dataset, fitted, &fitted.fit.hypothesis, CAREFUL);
    let worth = 1.0 / sample_cost(&before);
    let mut ranked: Vec<Pair> = ranked
        .into_par_iter()
        .map(|pair| {
            let fit = refit(dataset, fitted, &pair.trial.fit.hypothesis, CAREFUL);
            let n = worth * count(&fit);
            let gain = n * (mean_square(&base) / mean_square(&fit)).ln() - both_prices(&pair, causes.len(), n);
            Pair { trial: Trial { fit, gain, ..pair.trial }, ..pair }
        })
        .filter(|pair| pair.trial.gain >= LEAST_GAIN)
        .collect();
    ranked.sort_by(|a, b| b.trial.gain.total_cmp(&a.trial.gain));
    let told = |best: &Pair| ranked.get(1).is_none_or(|next| next.trial.gain < best.trial.gain - LEAST_LEAD);
    let Some(best) = ranked.first().filter(|best| told(best)) else { return Ok(None) };
    let balances = [balance(dataset, &base), balance(dataset, &best.trial.fit)];
    if matches!(balances, [Some(before), Some(after)] if after > REFUTED * before) {
        return Ok(None);
    }
    let next = fit_with_ring_downs(dataset, &best.trial.fit.hypothesis)?;
    let after = on_heldout(dataset, &next.fit);
    if after.mean_square() > (NOTHING_LEFT * floor(dataset, &next.fit)).powi(2) {
        return Ok(None);
    }
    let rms = [heldout(dataset, &fitted.fit), after.mean_square()].map(|square| square.sqrt().to_degrees());
    let step = |candidate: &Candidate| Step {
        id: candidate.id,
        origin: Origin::Discovered,
        gain: best.trial.gain,
        rivals: Vec::new(),
        heldout_rms_deg: rms,
        heldout: after.size(),
        harmonics: pattern_harmonics(&after),
        confounded_with: Vec::new(),
        energy_balance: balances[0].zip(balances[1]).map(|(a, b)| [a.sqrt(), b.sqrt()]),
        inconsistency: None,
        contradicted: false,
    };
    let steps = [step(&best.first), step(&best.trial.candidate)];
    Ok(Some((next, steps)))
}

/// Every pair of different effects after one step, the most promising first.
fn on_trial(dataset: &Dataset, fitted: &Fitted, causes: &[Candidate], base: f64) -> Vec<Pair> {
    let pairs: Vec<(&Candidate, &Candidate)> = (0..causes.len())
        .flat_map(|i| causes[i + 1..].iter().map(move |other| (&causes[i], other)))
        .filter(|(a, b)| a.id != b.id)
        .collect();
    let mut ranked: Vec<Pair> = pairs
        .into_par_iter()
        .filter_map(|(first, second)| {
            let one = extend(&fitted.fit.hypothesis, first, Origin::Discovered);
            let fit = refit(dataset, fitted, &extend(&one, second, Origin::Discovered), QUICK);
            let gain = (base / mean_square(&fit)).ln();
            let trial = Trial { candidate: second.clone(), fit, gain, balance: None, refuted: false };
            gain.is_finite().then(|| Pair { first: first.clone(), trial })
        })
        .collect();
    ranked.sort_by(|a, b| b.trial.gain.total_cmp(&a.trial.gain));
    ranked
}

/// What both members of a pair cost, and the search over all pairs.
fn both_prices(pair: &Pair, causes: usize, n: f64) -> f64 {
    let pairs = (causes * causes.saturating_sub(1) / 2).max(1) as f64;
    price(&pair.first, n) + price(&pair.trial.candidate, n) + 2.0 * pairs.ln()
}
