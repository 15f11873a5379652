//! What the held-out run refutes is taken back.
//!
//! The fitted runs ask for effects, and the held-out run only measures what they are worth. Where it is plainly worse off with
//! some of them than it was without, they are of the fitted runs alone: the model stands as it did before them, and that the held-out
//! run had a say in it is said.

use cvg_model::effects::{EffectId, Stage};

use crate::diagnostics::evaluate::evaluate;
use crate::error::Refusal;
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::Origin;
use crate::recording::Role;
use crate::selection::step::{Accepted, State, not_claimed, step_of};

/// Effects are refuted where the held-out rms is this many times as large as it was before them. Less can be an accident of one
/// run, and a choice between models that are nearly as good would make the held-out error one of the fit.
const REFUTED: f64 = 1.5;

/// Takes back the steps that the held-out run refutes. True where there were any: `fitted` and `steps` end before them, and
/// the last step is to be made again.
///
/// # Errors
/// As for the fit.
pub(crate) fn take_back_the_refuted(
    dataset: &mut Dataset,
    fitted: &mut Fitted,
    steps: &mut Vec<Accepted>,
) -> Result<bool, Refusal> {
    let after = held_out(dataset, &State::of(&fitted.fit));
    let before: Vec<f64> = steps.iter().map(|s| held_out(dataset, &s.states[0])).collect();
    let Some(kept) = (0..steps.len()).min_by(|&a, &b| before[a].total_cmp(&before[b])) else { return Ok(false) };
    if after <= REFUTED * before[kept] {
        return Ok(false);
    }
    let mut hypothesis = steps[kept].states[0].hypothesis.clone();
    // what came in before and went out after it is nobody's
    let of_a_step: Vec<bool> = (0..hypothesis.members.len())
        .map(|at| {
            hypothesis.members[at].origin == Origin::Declared || step_of(&hypothesis, at, &steps[..kept]).is_some()
        })
        .collect();
    let mut stays = of_a_step.iter();
    hypothesis.members.retain(|_| stays.next().is_some_and(|&s| s));
    let without = fit_with_ring_downs(dataset, &hypothesis)?;
    let left = held_out(dataset, &State::of(&without.fit));
    if after <= REFUTED * left {
        // fitted anew, the model without them is no better
        dataset.restore(fitted);
        return Ok(false);
    }
    let refuted: Vec<String> = steps.drain(kept..).map(|s| s.id.to_string()).collect();
    let what = format!(
        "{} taken back: the fitted runs ask for it, and the held-out error is {:.3e}° with it and {:.3e}° without; what is \
         stated of the held-out run has had this say",
        refuted.join(", "),
        after.to_degrees(),
        left.to_degrees()
    );
    dataset.warnings.push(what);
    *fitted = without;
    Ok(true)
}

/// rms of the held-out error of a state, rad.
fn held_out(dataset: &Dataset, state: &State) -> f64 {
    let held_out = evaluate(&dataset.tracks, &state.hypothesis, &state.starts, Role::Holdout, Window::Whole, None);
    held_out.mean_square().sqrt()
}

/// Takes its name from what turns the pattern against the rate, as anisodamping does, where the energy loop contradicts the anisodamping: what
/// the angle took for that is of the same law as what was found, and none of the library has both.
pub(crate) fn not_claimed_beside_another_damping(dataset: &Dataset, fitted: &mut Fitted, steps: &mut [Accepted]) {
    if !dataset.is_another_damping(&fitted.fit.hypothesis) {
        return;
    }
    let law = EffectId::Anisodamping.description().scaling;
    for at in 0..fitted.fit.hypothesis.members.len() {
        let member = &fitted.fit.hypothesis.members[at];
        let d = member.id.description();
        if member.origin == Origin::Discovered && d.stage == Stage::Mechanics && d.scaling == law {
            let why = "the energy command contradicts what the angle takes for anisodamping, which is of the same law";
            not_claimed(&mut fitted.fit.hypothesis, at, steps, why);
        }
    }
}
