//! A step of the discovery: what came in, and what spoke for it. The held-out samples do not speak: they are read when all
//! steps are done.

use cvg_model::effects::EffectId;

use crate::diagnostics::evaluate::evaluate;
use crate::diagnostics::residual::pattern_harmonics;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::propagation::Start;
use crate::estimation::residuals::Window;
use crate::facts::ErrorSize;
use crate::facts::Harmonic;
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::recording::Role;

/// A fit as it stood, for samples that are read later.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub(super) hypothesis: Hypothesis,
    pub(super) starts: Vec<Vec<Start>>,
}

impl State {
    pub(super) fn of(fit: &Fit) -> Self {
        Self { hypothesis: fit.hypothesis.clone(), starts: fit.starts.clone() }
    }
}

/// One accepted step.
#[derive(Debug, Clone)]
pub(crate) struct Accepted {
    /// the effect
    pub(crate) id: EffectId,
    /// how it came in
    pub(crate) origin: Origin,
    /// gain in log-likelihood ×2 after the price of its parameters and of the search
    pub(crate) gain: f64,
    /// best rivals and their gains
    pub(crate) rivals: Vec<(EffectId, f64)>,
    /// the fit before it and after it
    pub(crate) states: [State; 2],
    /// effects of the library that explain the residual as well
    pub(crate) confounded_with: Vec<EffectId>,
    /// rms of what the energy balance leaves of ln a, before and after; where amplitude and commands were recorded
    pub(crate) energy_balance: Option<[f64; 2]>,
    /// why a cause of the library is not claimed
    pub(crate) inconsistency: Option<String>,
    /// the energy balance contradicts it, or a cause that explains the angle as well
    pub(crate) contradicted: bool,
}

impl Accepted {
    /// The step with what it did to the held-out error.
    pub(crate) fn read(self, dataset: &Dataset) -> Step {
        let [before, after] = self.states.map(|State { hypothesis, starts }| {
            evaluate(&dataset.tracks, &hypothesis, &starts, Role::Holdout, Window::Whole, None)
        });
        Step {
            id: self.id,
            origin: self.origin,
            gain: self.gain,
            rivals: self.rivals,
            heldout_rms_deg: [&before, &after].map(|e| e.mean_square().sqrt().to_degrees()),
            heldout: after.size(),
            harmonics: pattern_harmonics(&after),
            confounded_with: self.confounded_with,
            energy_balance: self.energy_balance,
            inconsistency: self.inconsistency,
        }
    }
}

/// One accepted step, and what it did to the held-out error.
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
}

/// Which step brought a member in: members that are the same effect stand in the order of their steps.
pub(crate) fn step_of(hypothesis: &Hypothesis, at: usize, steps: &[Accepted]) -> Option<usize> {
    let id = hypothesis.members[at].id;
    let earlier = hypothesis.members[..at].iter().filter(|m| m.id == id).count();
    steps.iter().enumerate().filter(|(_, s)| s.id == id).nth(earlier).map(|(i, _)| i)
}

/// Takes its name from a member: it describes what it was found for, and another cause makes that. Its step says why.
pub(super) fn not_claimed(hypothesis: &mut Hypothesis, at: usize, steps: &mut [Accepted], why: &str) {
    let step = step_of(hypothesis, at, steps);
    hypothesis.members[at].origin = Origin::Empirical;
    if let Some(step) = step {
        steps[step].origin = Origin::Empirical;
        steps[step].inconsistency = Some(why.to_owned());
    }
}

/// Which member a step brought in, the inverse of [`step_of`].
pub(super) fn member_of(hypothesis: &Hypothesis, step: usize, steps: &[Accepted]) -> Option<usize> {
    (0..hypothesis.members.len()).find(|&at| step_of(hypothesis, at, steps) == Some(step))
}
