//! What an identification ends with: the last step of the fit, what it still finds significant, and the covariance of
//! all that was fitted.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::diagnostics::covariance::of_blocks;
use crate::diagnostics::evaluate::evaluate;
use crate::error::Refusal;
use crate::estimation::fit::{Fit, scaled_inverse};
use crate::estimation::generalised_least_squares::{Refined, refine};
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::{Origin, Unknown};
use crate::recording::{Instrument, Role};
use crate::selection::step::{Accepted, member_of, not_claimed, step_of};
use crate::selection::trial::LEAST_GAIN;
use cvg_model::effects::Role as ParameterRole;

/// A last step that leaves more than this many times the mean square of a run is not made: it is linear, and
/// what it moves was not.
const WORSE: f64 = 1.1;

/// Ends a fit: effects that its noise can make are dropped, the last step is made, and the covariance of the unknowns is
/// what it leaves. An effect that may be nothing at all under that is no discovery: it corrects, and explains nothing.
///
/// # Errors
/// As for the fit.
pub(crate) fn last_step(
    dataset: &mut Dataset,
    fitted: &mut Fitted,
    steps: &mut Vec<Accepted>,
) -> Result<DMatrix<f64>, Refusal> {
    let covariance = end(dataset, fitted, steps)?;
    for own in 0..steps.len() {
        let Some(at) = member_of(&fitted.fit.hypothesis, own, steps) else { continue };
        let discovered = fitted.fit.hypothesis.members[at].origin == Origin::Discovered;
        if discovered && may_be_nothing(&fitted.fit, &covariance, at) {
            not_claimed(&mut fitted.fit.hypothesis, at, steps, "its interval holds zero");
        }
    }
    Ok(covariance)
}

/// The last step and the covariance after it.
fn end(dataset: &mut Dataset, fitted: &mut Fitted, steps: &mut Vec<Accepted>) -> Result<DMatrix<f64>, Refusal> {
    if dataset.instrument == Instrument::Sensor {
        // the amplitude is part of a sensor's fit
        return Ok(of_blocks(dataset, &fitted.fit));
    }
    loop {
        let Some(refined) = refined(dataset, fitted) else {
            return Ok(of_blocks(dataset, &fitted.fit));
        };
        let Some((member, step)) = least_significant(&refined, steps) else {
            let covariance = settled(dataset, fitted, refined);
            return Ok(doubted(&fitted.fit, steps, covariance));
        };
        let mut reduced = fitted.fit.hypothesis.clone();
        reduced.members.remove(member);
        steps.remove(step);
        *fitted = fit_with_ring_downs(dataset, &reduced)?;
    }
}

/// The last step, with what the commands do adjusted where the runs tell it. White weights hold the drive where much is
/// left, lest that drag it along; where it is only noise, and the runs agree, there is nothing to drag.
fn refined(dataset: &mut Dataset, fitted: &Fitted) -> Option<Refined> {
    let held = dataset.drive_is_free;
    let step = |dataset: &Dataset| {
        let unknowns = dataset.unknowns(&fitted.fit.hypothesis);
        let priors = dataset.priors(&fitted.fit.hypothesis, fitted.drive.as_ref());
        refine(&dataset.tracks, &Fit { unknowns, ..fitted.fit.clone() }, &priors)
    };
    if !held && dataset.tells_the_drive() {
        dataset.drive_is_free = true;
        if let Some(freed) = step(dataset).filter(|r| r.disagreement == 1.0) {
            return Some(freed);
        }
    }
    dataset.drive_is_free = held;
    step(dataset)
}

/// The least significant member that discovery added, and its step, where its gain in 2 ln likelihood, after the price of its
/// parameters, is less than discovery asks for. What has no cause has to exceed coloured noise, and corrects what the runs share;
/// a cause has to exceed what the runs disagree by as well.
fn least_significant(refined: &Refined, steps: &[Accepted]) -> Option<(usize, usize)> {
    let hypothesis = &refined.fit.hypothesis;
    let gain = |at: usize| {
        let empirical = hypothesis.members[at].id.description().empirical;
        significance(&refined.fit, if empirical { &refined.fit.covariance } else { &refined.covariance }, at)
    };
    (0..hypothesis.members.len())
        .filter_map(|at| Some((gain(at)?, at, step_of(hypothesis, at, steps)?)))
        .filter(|(gain, ..)| *gain < LEAST_GAIN)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, at, step)| (at, step))
}

/// What a member gains in 2 ln likelihood over its absence under a covariance of the unknowns, less ln n for each of its
/// parameters; `None` where none of them is fitted.
fn significance(fit: &Fit, covariance: &DMatrix<f64>, at: usize) -> Option<f64> {
    let (wald, parameters) = wald(fit, covariance, at)?;
    let n = (fit.counted[0] as f64).max(2.0);
    Some(wald - parameters as f64 * n.ln())
}

/// Whether the 95 % interval of a member, or the ellipse of its parameters, holds its absence.
fn may_be_nothing(fit: &Fit, covariance: &DMatrix<f64>, at: usize) -> bool {
    let probability = |(wald, parameters): (f64, usize)| Some(ChiSquared::new(parameters as f64).ok()?.cdf(wald));
    wald(fit, covariance, at).and_then(probability).is_some_and(|p| p < 0.95)
}

/// The distance of a member's parameters from its absence under a covariance of the unknowns (Wald 1943), χ² with as many degrees
/// of freedom as the parameters that are returned beside it; `None` where none of them is fitted.
fn wald(fit: &Fit, covariance: &DMatrix<f64>, at: usize) -> Option<(f64, usize)> {
    let member = &fit.hypothesis.members[at];
    let parameters = member.id.description().parameters;
    let own: Vec<(usize, f64)> = fit
        .unknowns
        .iter()
        .enumerate()
        .filter_map(|(i, u)| match u {
            // where a line lies says nothing of how large it is
            Unknown::Effect(m, p) if *m == at && !matches!(parameters[*p].role, ParameterRole::Located(_)) => {
                Some((i, member.values[*p] - member.id.neutral::<f64>()[*p]))
            }
            _ => None,
        })
        .collect();
    if own.is_empty() {
        return None;
    }
    let block = DMatrix::from_fn(own.len(), own.len(), |i, j| covariance[(own[i].0, own[j].0)]);
    let value = DVector::from_iterator(own.len(), own.iter().map(|(_, v)| *v));
    Some((value.dot(&(scaled_inverse(&block, 0.0)? * &value)), own.len()))
}

/// Makes the last step, unless a run speaks against it: then the estimate stays, and by how much it would have moved counts as
/// its error (Hausman 1978).
fn settled(dataset: &Dataset, fitted: &mut Fitted, refined: Refined) -> DMatrix<f64> {
    let left = |fit: &Fit| -> Vec<f64> {
        let all = evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Whole, None);
        (0..dataset.tracks.len()).map(|track| all.mean_square_of(track)).collect()
    };
    let Refined { fit, mut covariance, .. } = refined;
    if left(&fit).iter().zip(left(&fitted.fit)).all(|(after, before)| *after <= WORSE * before) {
        fitted.fit = fit;
        return covariance;
    }
    let moved = DVector::from_iterator(
        fit.unknowns.len(),
        fit.unknowns.iter().map(|u| fit.hypothesis.get(*u) - fitted.fit.hypothesis.get(*u)),
    );
    covariance.ger(1.0, &moved, &moved, 1.0);
    let (hypothesis, starts) = (fitted.fit.hypothesis.clone(), fitted.fit.starts.clone());
    fitted.fit = Fit { hypothesis, starts, ..fit };
    covariance
}

/// A correction without a cause that the energy balance contradicts stands for something else: what the other unknowns
/// would move by without it counts as their error.
fn doubted(fit: &Fit, steps: &[Accepted], mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    let n = fit.unknowns.len();
    let before = covariance.clone();
    for (at, member) in fit.hypothesis.members.iter().enumerate().filter(|(_, m)| m.origin == Origin::Empirical) {
        let contradicted = step_of(&fit.hypothesis, at, steps).is_some_and(|step| steps[step].contradicted);
        let own: Vec<usize> = (0..n).filter(|&i| matches!(fit.unknowns[i], Unknown::Effect(m, _) if m == at)).collect();
        if !contradicted || own.is_empty() {
            continue;
        }
        let Some(inverse) = scaled_inverse(&before.select_rows(&own).select_columns(&own), 0.0) else { continue };
        let away = DVector::from_iterator(
            own.len(),
            own.iter().map(|&i| match fit.unknowns[i] {
                Unknown::Effect(_, p) => member.values[p] - member.id.neutral::<f64>()[p],
                _ => 0.0,
            }),
        );
        let moved = before.select_columns(&own) * inverse * away;
        for i in (0..n).filter(|i| !own.contains(i)) {
            covariance[(i, i)] += moved[i] * moved[i];
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::fit::at_rest;
    use crate::model::hypothesis::Hypothesis;
    use cvg_model::effects::EffectId;

    /// A skew of 0.01 that is known to `deviation`, and whether it may be nothing.
    fn a_skew_may_be_nothing(deviation: f64) -> bool {
        let mut hypothesis = Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        let at = hypothesis.admit(EffectId::DetectionSkew, Origin::Discovered);
        let unknowns = vec![Unknown::AngularGain, Unknown::Effect(at, 0)];
        hypothesis.set(unknowns[1], 0.01);
        let fit = at_rest(&[], &hypothesis, &unknowns);
        let covariance = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, deviation * deviation]));
        may_be_nothing(&fit, &covariance, at)
    }

    #[test]
    fn an_effect_may_be_nothing_where_its_interval_holds_zero() {
        assert!(a_skew_may_be_nothing(0.01 / 1.95));
        assert!(!a_skew_may_be_nothing(0.01 / 1.97));
    }

    #[test]
    fn of_two_parameters_their_ellipse_decides() {
        let mut hypothesis = Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        let at = hypothesis.admit(EffectId::Anisodamping, Origin::Discovered);
        let unknowns: Vec<Unknown> = (0..2).map(|p| Unknown::Effect(at, p)).collect();
        unknowns.iter().for_each(|u| hypothesis.set(*u, 1.9));
        let fit = at_rest(&[], &hypothesis, &unknowns);
        // neither axis leaves its interval, both together leave the ellipse of χ² = 5.99
        assert!(!may_be_nothing(&fit, &DMatrix::identity(2, 2), at));
        let along = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        assert!(may_be_nothing(&fit, &along, at));
    }
}
