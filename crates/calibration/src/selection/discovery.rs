//! Which effect of the library explains what the declared model leaves.
//!
//! Candidates compete by refitting the whole model with each of them, on all runs at once; what a candidate gains in
//! likelihood is set against its parameters and against how many candidates were tried. The winner must also lower the
//! error of blocked cross-validation; the held-out runs are not seen here. Effects come in one at a time; weak ones are dropped again. Where two causes of
//! the library explain a residual equally well, neither is claimed: an empirical harmonic stands in for both.

use cvg_model::effects::{EffectId, Stage};
use rayon::prelude::*;

use crate::diagnostics::evaluate::evaluate;
use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::Origin;
use crate::recording::Role;
use crate::selection::candidates::candidates;
use crate::selection::consistency::{ask_every_run, in_its_place, rival_that_explains};
use crate::selection::one_step::{Promise, promises};
use crate::selection::pairs::best_pair;
use crate::selection::powers::one_power_in_their_place;
use crate::selection::step::{Accepted, State, member_of, step_of};
use crate::selection::together::all_together;
use crate::selection::trial::{
    BY_AMPLITUDE, Before, CAREFUL, Distinguishable, FINALISTS, LEAST_GAIN, LEAST_LEAD, LEAST_VALIDATED_GAIN,
    NOTHING_LEFT, REFUTED, Trial, balance, count, explains_as_much, extend_from, mean_square, on_fit, price, refit,
    sample_cost, validated,
};

/// Most effects that are added.
const MOST_EFFECTS: usize = 8;
/// A description is as good as another that leaves this share of its mean square: an engineering choice, 5 % of what is left.
const NEARLY_AS_WELL: f64 = 1.1;

/// Adds effects to a fitted hypothesis until the residual asks for no more.
///
/// # Errors
/// As for the fit.
pub(crate) fn discover(
    dataset: &mut Dataset,
    mut fitted: Fitted,
    progress: &dyn Fn(&str),
) -> Result<(Fitted, Vec<Accepted>), Refusal> {
    let mut steps: Vec<Accepted> = Vec::new();
    while steps.len() < MOST_EFFECTS {
        progress(&format!("step {}: candidates compete", steps.len() + 1));
        if let Some((next, step)) = best_step(dataset, &fitted, |_| true)? {
            fitted = next;
            steps.push(step);
            continue;
        }
        dataset.restore(&fitted);
        if let Some((next, pair)) = best_pair(dataset, &fitted)? {
            fitted = next;
            steps.extend(pair);
            continue;
        }
        dataset.restore(&fitted);
        if let Some((next, all)) = all_together(dataset, &fitted, &steps)? {
            (fitted, steps) = (next, all);
            continue;
        }
        dataset.restore(&fitted);
        let Some((next, step)) = behind_the_anisodamping(dataset, &fitted)? else { break };
        fitted = next;
        steps.push(step);
    }
    dataset.restore(&fitted);
    drop_weak(dataset, &mut fitted, &mut steps)?;
    look_again(dataset, &mut fitted, &mut steps)?;
    ask_every_run(dataset, &mut fitted, &mut steps)?;
    one_power_in_their_place(dataset, &mut fitted, &mut steps)?;
    Ok((fitted, steps))
}

/// The cause of what the angle took for anisodamping, against what the energy loop had to put in: at some rates, or in one sense, a
/// force that goes with another command is an anisodamping to the angle, and leaves it nothing to ask for.
fn behind_the_anisodamping(dataset: &mut Dataset, fitted: &Fitted) -> Result<Option<(Fitted, Accepted)>, Refusal> {
    let before = Before::of(dataset, fitted);
    let Some(held) = dataset.with_the_anisodamping_held(fitted) else { return Ok(None) };
    let Some((next, mut step)) = best_step(dataset, &held, |origin| origin == Origin::Discovered)? else {
        return Ok(None);
    };
    dataset.balance_damping(&next.fit.hypothesis);
    let agrees = !dataset.contradicts_the_damping(&next.fit.hypothesis);
    let explains = agrees && before.is_as_large_as(validated(dataset, &next));
    step.states[0] = State::of(&fitted.fit);
    Ok(explains.then_some((next, step)))
}

/// What stands without a cause is put on trial again beside all that came in after it: a cause that a larger effect hid
/// takes its place where it leaves no more under cross-validation.
fn look_again(dataset: &mut Dataset, fitted: &mut Fitted, steps: &mut [Accepted]) -> Result<(), Refusal> {
    if steps.len() < 2 {
        // beside nothing else the trial would be the one that it had
        return Ok(());
    }
    for own in 0..steps.len() {
        let at = member_of(&fitted.fit.hypothesis, own, steps);
        let Some(at) = at.filter(|_| steps[own].origin == Origin::Empirical) else { continue };
        if !steps[own].contradicted
            && let Some((id, next)) = rival_that_explains(dataset, fitted, at, &steps[own], explains_as_well)?
        {
            *fitted = next;
            steps[own] = in_its_place(dataset, &fitted.fit, id, &steps[own]);
            dataset.restore(fitted);
            continue;
        }
        dataset.restore(fitted);
        let mut without = fitted.fit.hypothesis.clone();
        without.members.remove(at);
        let left = validated(dataset, fitted);
        let without = fit_with_ring_downs(dataset, &without)?;
        match best_step(dataset, &without, |origin| origin == Origin::Discovered)? {
            Some((next, step)) if validated(dataset, &next) <= left => {
                *fitted = next;
                steps[own] = step;
            }
            _ => dataset.restore(fitted),
        }
    }
    Ok(())
}

/// Whether a fit explains as much as another, and leaves no more under cross-validation, within a standard error of its mean square.
fn explains_as_well(dataset: &Dataset, fitted: &Fitted, other: &Fitted) -> bool {
    let worth = count(&fitted.fit) / sample_cost(&on_fit(dataset, &other.fit));
    let allowed = 1.0 + (2.0 / worth.max(1.0)).sqrt();
    explains_as_much(dataset, &fitted.fit, &other.fit)
        && validated(dataset, fitted) <= allowed * validated(dataset, other)
}

/// The best extension of a fitted hypothesis that earns its place; none where it would come in with an origin that is not wanted.
fn best_step(
    dataset: &mut Dataset,
    fitted: &Fitted,
    wanted: impl Fn(Origin) -> bool,
) -> Result<Option<(Fitted, Accepted)>, Refusal> {
    let before = on_fit(dataset, &fitted.fit);
    let dense =
        dataset.tracks.iter().any(|p| p.track.is_thinned()).then(|| {
            evaluate(&dataset.tracks, &fitted.fit.hypothesis, &fitted.fit.starts, Role::Fit, Window::Dense, None)
        });
    let candidates = candidates(dataset, &fitted.fit.hypothesis, &before, dense.as_ref().unwrap_or(&before));
    let ranked = promises(dataset, fitted, &candidates);
    if dataset.excess() < NOTHING_LEFT && ranked.first().is_none_or(|best| best.gain < 0.0) {
        return Ok(None);
    }
    let base = refit(dataset, fitted, &fitted.fit.hypothesis, CAREFUL);
    let mut trials = tried_carefully(dataset, fitted, &ranked[..FINALISTS.min(ranked.len())], &base);
    if dataset.excess() >= NOTHING_LEFT && trials.iter().all(|t| t.gain < LEAST_GAIN) {
        // where the fit had to set much aside, one step from it promises little of the cause
        trials = tried_carefully(dataset, fitted, &ranked, &base);
    }
    let apart = Distinguishable::on(dataset);
    let balance_before = balance(dataset, &base);
    let before_it = Before::of(dataset, fitted);
    loop {
        amplitude_evidence(dataset, &mut trials, balance_before, apart);
        let chosen = choose(&trials, apart).filter(|(_, origin, _)| wanted(*origin));
        let Some((chosen, origin, confounded_with)) = chosen else { return Ok(None) };
        let chosen = chosen.clone();
        let next = fit_with_ring_downs(dataset, &extend_from(&chosen, origin))?;
        trials.retain(|t| t.candidate != chosen.candidate);
        if !before_it.is_improved_by(validated(dataset, &next)) {
            // gained where it was fitted only, or too little to name: the next one's turn
            dataset.restore(fitted);
            continue;
        }
        let step = Accepted {
            id: chosen.candidate.id,
            origin,
            gain: chosen.gain,
            rivals: trials.iter().map(|t| (t.candidate.id, t.gain)).take(3).collect(),
            states: [&fitted.fit, &next.fit].map(State::of),
            confounded_with,
            energy_balance: balance_before.zip(chosen.balance).map(|(a, b)| [a.sqrt(), b.sqrt()]),
            inconsistency: chosen.refuted.then(|| "the energy balance contradicts it".to_owned()),
            contradicted: chosen.refuted || trials.iter().any(|t| t.refuted && t.gain > chosen.gain - LEAST_LEAD),
        };
        return Ok(Some((next, step)));
    }
}

/// Candidates refitted in full from where one step led, beside a base that was refitted as well, best first.
pub(super) fn tried_carefully(dataset: &Dataset, fitted: &Fitted, promises: &[Promise], base: &Fit) -> Vec<Trial> {
    let careful = |p: &Promise| {
        let fit = refit(dataset, fitted, &p.hypothesis, CAREFUL);
        Trial { candidate: p.candidate.clone(), fit, gain: p.gain, balance: None, refuted: false }
    };
    let mut trials: Vec<Trial> = promises.par_iter().map(careful).collect();
    let Some(best) = trials.iter().min_by(|a, b| mean_square(&a.fit).total_cmp(&mean_square(&b.fit))) else {
        return trials;
    };
    // Autocorrelation that even the best candidate leaves makes samples worth less.
    let worth = 1.0 / sample_cost(&on_fit(dataset, &best.fit));
    for t in &mut trials {
        let n = worth * count(&t.fit);
        t.gain = n * (mean_square(base) / mean_square(&t.fit)).ln() - price(&t.candidate, n);
    }
    // an effect as text may have no value where the refit led it
    trials.retain(|t| t.gain.is_finite());
    trials.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    trials
}

/// Asks the energy balance about the trials that may be chosen, and at one rate about those they have to be told from.
fn amplitude_evidence(dataset: &Dataset, trials: &mut [Trial], before: Option<f64>, apart: Distinguishable) {
    let least = trials.first().map_or(0.0, |t| t.gain - LEAST_LEAD);
    for t in trials.iter_mut().filter(|t| t.balance.is_none() && (t.gain > least || !apart.rates)) {
        t.balance = balance(dataset, &t.fit);
        t.refuted = before.zip(t.balance).is_some_and(|(before, after)| after > REFUTED * before);
    }
}

/// The winner among refitted candidates, and in what capacity it comes in.
fn choose(trials: &[Trial], apart: Distinguishable) -> Option<(&Trial, Origin, Vec<EffectId>)> {
    let best = trials.first().filter(|t| t.gain >= LEAST_GAIN)?;
    let empirical = |t: &&Trial| t.refuted || !apart.can_be_named(&t.candidate);
    let described =
        trials.iter().find(empirical).map(|first| if apart.rates { first } else { plainest(first, trials) });
    let level = |t: &&Trial| !empirical(t) && t.gain >= best.gain - LEAST_LEAD && t.gain >= LEAST_GAIN;
    // of causes that explain the angle equally well, the one that closes the energy balance
    let told_from = |t: &Trial, other: &Trial| t.balance.zip(other.balance).is_some_and(|(a, b)| a < BY_AMPLITUDE * b);
    let leader = trials.iter().find(level);
    let Some(library) = leader.map(|l| trials.iter().filter(level).find(|t| told_from(t, l)).unwrap_or(l)) else {
        return Some((described.unwrap_or(best), Origin::Empirical, Vec::new()));
    };
    let rivals: Vec<&Trial> = trials
        .iter()
        .filter(|t| !empirical(t) && t.candidate.id != library.candidate.id && t.gain > library.gain - LEAST_LEAD)
        .filter(|t| !told_from(library, t))
        .collect();
    // At one rate only the energy balance tells a slow push on the pattern, by the mechanics or the drives, from a fault of the readout.
    let by_amplitude = trials.iter().filter(|t| t.candidate != library.candidate).all(|t| told_from(library, t));
    let pushes = matches!(library.candidate.id.description().stage, Stage::Mechanics | Stage::Actuation);
    let told = apart.rates || by_amplitude || !pushes;
    // a rotation that the reference does not hold is a cause as well, of which no more can be said
    let unrecorded = |t: &&Trial| {
        empirical(t) && t.candidate.id.description().stage == Stage::Input && t.gain > library.gain - LEAST_LEAD
    };
    if let Some(unrecorded) = trials.iter().find(unrecorded).filter(|t| !told_from(library, t)) {
        return Some((unrecorded, Origin::Empirical, vec![library.candidate.id]));
    }
    let rivals: Vec<EffectId> = rivals.into_iter().map(|t| t.candidate.id).collect();
    if rivals.is_empty() && told {
        return Some((library, Origin::Discovered, rivals));
    }
    // Two causes explain it: claim neither, unless nothing empirical describes it.
    match described.filter(|d| d.gain >= LEAST_GAIN) {
        Some(described) => {
            let causes = trials
                .iter()
                .filter(|t| !empirical(t) && t.gain > described.gain.min(library.gain) - LEAST_LEAD)
                .map(|t| t.candidate.id)
                .collect();
            Some((described, Origin::Empirical, causes))
        }
        None => Some((library, Origin::Discovered, rivals)),
    }
}

/// What describes the samples of one rate without a claim to be their cause: a harmonic or a line rather than an effect of the library that these
/// runs can't show to act, where it describes them nearly as well. At another rate that effect would do something else.
fn plainest<'a>(first: &'a Trial, trials: &'a [Trial]) -> &'a Trial {
    if first.refuted {
        return first;
    }
    let most = NEARLY_AS_WELL * mean_square(&first.fit);
    let describes = |t: &&Trial| t.candidate.id.description().empirical && t.gain >= LEAST_GAIN;
    trials.iter().filter(describes).find(|t| mean_square(&t.fit) <= most).unwrap_or(first)
}

/// Drops effects whose place the final data does not support.
pub(super) fn drop_weak(dataset: &mut Dataset, fitted: &mut Fitted, steps: &mut Vec<Accepted>) -> Result<(), Refusal> {
    if steps.len() < 2 {
        return Ok(());
    }
    loop {
        let with = refit(dataset, fitted, &fitted.fit.hypothesis, CAREFUL);
        let worth = 1.0 / sample_cost(&on_fit(dataset, &fitted.fit));
        let n = worth * count(&with);
        let weakest = (0..fitted.fit.hypothesis.members.len())
            .filter(|&i| steps.iter().any(|s| s.id == fitted.fit.hypothesis.members[i].id))
            .map(|i| {
                let mut reduced = fitted.fit.hypothesis.clone();
                let member = reduced.members.remove(i);
                let without = refit(dataset, fitted, &reduced, CAREFUL);
                let parameters = member.id.description().parameters.len() as f64;
                (n * (mean_square(&without) / mean_square(&with)).ln() - parameters * n.ln(), i)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match weakest {
            Some((gain, i)) if gain < LEAST_GAIN => {
                let step = step_of(&fitted.fit.hypothesis, i, steps);
                let mut reduced = fitted.fit.hypothesis.clone();
                reduced.members.remove(i);
                let before = validated(dataset, fitted);
                let without = fit_with_ring_downs(dataset, &reduced)?;
                if (1.0 - LEAST_VALIDATED_GAIN) * validated(dataset, &without) > before {
                    // weak by itself, but what it leaves where it was not fitted asks for it
                    dataset.restore(fitted);
                    return Ok(());
                }
                *fitted = without;
                if let Some(step) = step {
                    steps.remove(step);
                }
            }
            _ => return Ok(()),
        }
    }
}
