//! Whether every run shows what an effect claims.
//!
//! An effect that is really there acts in every run as its definition says. Where a run shows a third of it, or twice as
//! much, the definition fits only by accident: then it may correct, but it does not explain.

use cvg_model::effects::{EffectId, Parameter, Role as ParameterRole};

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation, strongest_harmonics};
use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::facts::Follows;
use crate::model::hypothesis::Origin;
use crate::recording::Role;
use crate::selection::candidates::Candidate;
use crate::selection::step::{Accepted, State, member_of, not_claimed};
use crate::selection::trial::{Distinguishable, LEAST_GAIN, balance, validated};

/// A run may show this much more or less of an effect than it should, beside what its noise allows.
const TOLERATED_SHARE: f64 = 0.15;
/// What the noise of a run allows, in standard deviations.
const TOLERATED_DEVIATIONS: f64 = 5.0;
/// A harmonic without a cause at least this large beside an effect, at the same harmonic or as an overtone of the same shape,
/// makes one cause of both likelier.
const SHARED_HARMONIC: f64 = 0.1;
/// What a cause does to the angle, beside the error that is left there.
const SMALLEST_CLAIM: f64 = 0.3;
/// An effect is at one harmonic when that carries this share of its power.
const AT_ONE_HARMONIC: f64 = 0.5;

/// What a member of the hypothesis does to the angle of a run, and how much of it the run shows.
struct Share {
    run: String,
    value: f64,
    deviation: f64,
}

/// What effects do to the angle of the fitted runs together.
struct Contribution {
    with: Evaluation,
    /// the angle without the effects less that with them
    change: Evaluation,
}

impl Contribution {
    fn of(dataset: &Dataset, fit: &Fit, members: &[usize]) -> Self {
        let with = evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Whole, None);
        let mut reduced = fit.hypothesis.clone();
        let mut at = 0..;
        reduced.members.retain(|_| at.next().is_some_and(|at| !members.contains(&at)));
        let mut change = evaluate(&dataset.tracks, &reduced, &fit.starts, Role::Fit, Window::Whole, Some(&with));
        for (without, with) in change.segments.iter_mut().zip(&with.segments) {
            for (a, b) in without.angle.iter_mut().zip(&with.angle) {
                *a -= b;
            }
        }
        Self { with, change }
    }

    fn shares(&self, dataset: &Dataset) -> Vec<Share> {
        let count = self.with.errors().count();
        let cost = inflation(&autocorrelation(&self.with, WHITENESS_LAGS), count);
        self.with
            .segments
            .iter()
            .zip(&self.change.segments)
            .zip(&self.with.kept)
            .map(|((with, change), kept)| {
                let (mut power, mut left, mut squares, mut n) = (0.0, 0.0, 0.0, 0.0);
                for ((r, c), _) in with.angle.iter().zip(&change.angle).zip(kept).filter(|(_, k)| **k) {
                    power += c * c;
                    left += r * c;
                    squares += r * r;
                    n += 1.0;
                }
                Share {
                    run: dataset.tracks[with.track].track.name.clone(),
                    value: if power > 0.0 { 1.0 + left / power } else { 1.0 },
                    deviation: if power > 0.0 { (squares / n * cost / power).sqrt() } else { f64::INFINITY },
                }
            })
            .collect()
    }

    /// The harmonic of the pattern that carries most of the change, if one does.
    fn harmonic(&self) -> Option<u32> {
        let all: f64 = self.change.errors().map(|c| c * c).sum();
        [|_: f64| 1.0, |rate: f64| if rate == 0.0 { 0.0 } else { 1.0 / rate }]
            .into_iter()
            .filter_map(|scaling| strongest_harmonics(&self.change, Follows::Pattern, 12, scaling).into_iter().next())
            .find(|(_, power)| *power > AT_ONE_HARMONIC * all)
            .map(|(n, _)| n)
    }

    fn rms(&self) -> f64 {
        self.change.mean_square().sqrt()
    }
}

/// Asks every run for what was claimed. Where one contradicts a cause, a rival that all of them bear out takes its place; if
/// there is none, the cause becomes an empirical description.
///
/// # Errors
/// As for the fit.
pub(super) fn ask_every_run(dataset: &mut Dataset, fitted: &mut Fitted, steps: &mut [Accepted]) -> Result<(), Refusal> {
    for own in 0..steps.len() {
        let Some(at) = member_of(&fitted.fit.hypothesis, own, steps) else { continue };
        if fitted.fit.hypothesis.members[at].origin != Origin::Discovered {
            continue;
        }
        let Some(why) = inconsistency(dataset, &fitted.fit, at) else { continue };
        match rival_that_explains(dataset, fitted, at, &steps[own], leaves_no_more)? {
            Some((id, next)) => {
                *fitted = next;
                steps[own] = in_its_place(dataset, &fitted.fit, id, &steps[own]);
            }
            None => {
                not_claimed(&mut fitted.fit.hypothesis, at, steps, &why);
            }
        }
        dataset.restore(fitted);
    }
    Ok(())
}

/// A step with the one rival that took its place as the cause.
pub(super) fn in_its_place(dataset: &Dataset, fit: &Fit, id: EffectId, step: &Accepted) -> Accepted {
    let balance = balance(dataset, fit).map(f64::sqrt);
    Accepted {
        id,
        origin: Origin::Discovered,
        confounded_with: Vec::new(),
        gain: step.rivals.iter().find(|r| r.0 == id).map_or(step.gain, |r| r.1),
        rivals: step.rivals.iter().filter(|r| r.0 != id).copied().collect(),
        states: [step.states[0].clone(), State::of(fit)],
        energy_balance: step.energy_balance.zip(balance).map(|([before, _], after)| [before, after]),
        ..step.clone()
    }
}

/// Whether a fit leaves no more than another under cross-validation.
fn leaves_no_more(dataset: &Dataset, fitted: &Fitted, other: &Fitted) -> bool {
    validated(dataset, fitted) <= validated(dataset, other)
}

/// The one rival of a member that every run bears out, fitted in its place, where it explains the samples as is asked for.
/// Of two that do, neither is the cause for sure.
pub(super) fn rival_that_explains(
    dataset: &mut Dataset,
    fitted: &Fitted,
    at: usize,
    step: &Accepted,
    explains: impl Fn(&Dataset, &Fitted, &Fitted) -> bool,
) -> Result<Option<(EffectId, Fitted)>, Refusal> {
    let apart = Distinguishable::on(dataset);
    let mut found = None;
    for (id, _) in step.rivals.iter().filter(|(_, gain)| *gain >= LEAST_GAIN) {
        let candidate = Candidate { id: *id, values: id.neutral(), refine: None, tried: 1.0 };
        let searched = |p: &Parameter| matches!(p.role, ParameterRole::Searched(_) | ParameterRole::Located(_));
        if id.description().parameters.iter().any(searched) || !apart.can_be_named(&candidate) {
            continue;
        }
        let mut hypothesis = fitted.fit.hypothesis.clone();
        hypothesis.members.remove(at);
        let place = hypothesis.admit(*id, Origin::Discovered);
        dataset.restore(fitted);
        let next = fit_with_ring_downs(dataset, &hypothesis)?;
        let borne_out = explains(dataset, &next, fitted) && inconsistency(dataset, &next.fit, place).is_none();
        if borne_out && found.replace((*id, next)).is_some() {
            found = None;
            break;
        }
    }
    Ok(found)
}

/// Why member `member` cannot be claimed as a cause, if the runs contradict it.
fn inconsistency(dataset: &Dataset, fit: &Fit, member: usize) -> Option<String> {
    let contribution = Contribution::of(dataset, fit, &[member]);
    if contribution.rms() < SMALLEST_CLAIM * contribution.with.mean_square().sqrt() {
        return Some("it does too little to be recognised".into());
    }
    let contradicting = contribution
        .shares(dataset)
        .into_iter()
        .find(|s| (s.value - 1.0).abs() > TOLERATED_SHARE + TOLERATED_DEVIATIONS * s.deviation);
    if let Some(s) = contradicting {
        return Some(format!("{} shows {:.2} ± {:.2} of it", s.run, s.value, s.deviation));
    }
    let claimed = contribution.harmonic()?;
    // of causes at one harmonic that cancel in part, what they do together
    let claim = Contribution::of(dataset, fit, &library_effects_at(dataset, fit, claimed)).rms();
    let unnamed = harmonics_without_a_cause(dataset, fit, SHARED_HARMONIC * claim);
    if unnamed.contains(&claimed) {
        return Some(format!("another part of harmonic {claimed} has no known cause"));
    }
    let [next, after] = series(claimed, &unnamed)?;
    Some(format!(
        "harmonics {next} and {after}, which have no known cause, go on from its harmonic {claimed}: one shape makes all of them"
    ))
}

/// The effects of the library that discovery added at a harmonic of the pattern, those that turned out to be descriptions as well.
fn library_effects_at(dataset: &Dataset, fit: &Fit, harmonic: u32) -> Vec<usize> {
    (0..fit.hypothesis.members.len())
        .filter(|&at| fit.hypothesis.members[at].origin != Origin::Declared)
        .filter(|&at| !fit.hypothesis.members[at].id.description().empirical)
        .filter(|&at| Contribution::of(dataset, fit, &[at]).harmonic() == Some(harmonic))
        .collect()
}

/// Harmonics of the pattern that are corrected without a known cause and are at least this large, rad rms.
fn harmonics_without_a_cause(dataset: &Dataset, fit: &Fit, least: f64) -> Vec<u32> {
    let members = fit.hypothesis.members.iter().enumerate();
    members
        .filter(|(_, m)| m.origin == Origin::Empirical && m.id == EffectId::HarmonicN)
        .filter(|(at, _)| Contribution::of(dataset, fit, &[*at]).rms() > least)
        .map(|(_, m)| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "orders are searched from 0 to 720"
            )]
            let order = m.values[0].round() as u32;
            order
        })
        .collect()
}

/// The two harmonics among `unnamed` that follow `claimed` in a series of overtones, the multiples of one of its
/// divisors. What the library's effects do to the angle is one harmonic; a dead zone or a kink makes a series.
fn series(claimed: u32, unnamed: &[u32]) -> Option<[u32; 2]> {
    (1..=claimed)
        .filter(|step| claimed.is_multiple_of(*step))
        .map(|step| [claimed + step, claimed + 2 * step])
        .find(|overtones| overtones.iter().all(|n| unnamed.contains(n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_zone_is_a_series_of_every_fourth_harmonic() {
        assert_eq!(series(4, &[8, 12, 16]), Some([8, 12]));
    }

    #[test]
    fn a_kink_is_a_series_of_every_second_harmonic() {
        assert_eq!(series(4, &[6, 8]), Some([6, 8]));
    }

    #[test]
    fn a_gap_ends_a_series() {
        assert_eq!(series(4, &[8, 16]), None);
        assert_eq!(series(4, &[7, 10]), None);
        assert_eq!(series(0, &[1, 2]), None);
    }
}
