//! From the raw angle to the last effect: the held-out error at every step, with what speaks for the step.

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::reported_harmonics;
use crate::facts::Follows;
use crate::model::hypothesis::Origin;
use crate::report::{Rival, StepReport};
use crate::selection::step::Step;

/// The steps of a report. The noise of every one is that of the last: what the others have besides is no noise.
pub(crate) fn stages(
    raw: Option<&Evaluation>,
    declared: &Evaluation,
    discovered: &Evaluation,
    steps: &[Step],
) -> Vec<StepReport> {
    let plain = |stage: &str, e: &Evaluation| StepReport {
        stage: stage.into(),
        effect: None,
        heldout: e.size(),
        harmonics: reported_harmonics(e, Follows::Pattern, discovered),
        signature: None,
        gain: None,
        rivals: Vec::new(),
        energy_balance: None,
        inconsistency: None,
    };
    let before = raw.map(|e| plain("raw", e)).into_iter().chain([plain("declared", declared)]);
    before.chain(steps.iter().map(found)).collect()
}

fn found(step: &Step) -> StepReport {
    let rival =
        |(id, gain): &(cvg_model::effects::EffectId, f64)| Rival { id: id.to_string(), beaten_by: step.gain - gain };
    StepReport {
        stage: if step.origin == Origin::Discovered { "discovered".into() } else { "empirical".into() },
        effect: Some(step.id.to_string()),
        heldout: step.heldout,
        harmonics: step.harmonics.clone(),
        signature: Some(step.id.description().signature.into()),
        gain: Some(step.gain),
        rivals: step.rivals.iter().map(rival).collect(),
        energy_balance: step.energy_balance,
        inconsistency: step.inconsistency.clone(),
    }
}
