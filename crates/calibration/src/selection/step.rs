//! A step of the discovery: what came in, and what spoke for it.

use cvg_model::effects::EffectId;

use crate::diagnostics::evaluate::ErrorSize;
use crate::diagnostics::residual::Harmonic;
use crate::model::hypothesis::{Hypothesis, Origin};

/// One accepted step.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// the effect
    pub id: EffectId,
    /// how it came in
    pub origin: Origin,
    /// gain in log-likelihood ×2 after the price of its parameters and of the search
    pub gain: f64,
    /// best rivals and their gains
    pub rivals: Vec<(EffectId, f64)>,
    /// held-out rms before and after, deg
    pub heldout_rms_deg: [f64; 2],
    /// size of the held-out error after it
    pub heldout: ErrorSize,
    /// harmonics of the pattern in it
    pub harmonics: Vec<Harmonic>,
    /// effects of the library that explain the residual as well
    pub confounded_with: Vec<EffectId>,
    /// rms of what the energy balance leaves of ln a, before and after; where amplitude and commands were recorded
    pub energy_balance: Option<[f64; 2]>,
    /// why a cause of the library is not claimed
    pub inconsistency: Option<String>,
    /// the energy balance contradicts it, or a cause that explains the angle as well
    pub contradicted: bool,
}

/// Which step brought a member in: members that are the same effect stand in the order of their steps.
pub(crate) fn step_of(hypothesis: &Hypothesis, at: usize, steps: &[Step]) -> Option<usize> {
    let id = hypothesis.members[at].id;
    let earlier = hypothesis.members[..at].iter().filter(|m| m.id == id).count();
    steps.iter().enumerate().filter(|(_, s)| s.id == id).nth(earlier).map(|(i, _)| i)
}

/// Which member a step brought in, the inverse of [`step_of`].
pub(super) fn member_of(hypothesis: &Hypothesis, step: usize, steps: &[Step]) -> Option<usize> {
    (0..hypothesis.members.len()).find(|&at| step_of(hypothesis, at, steps) == Some(step))
}
