//! A candidate on trial: the model refitted with it, what that gains, and what it leaves of data that was not fitted.

use cvg_model::effects::Role as ParameterRole;

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation};
use crate::estimation::amplitude_equation::energy_balance;
use crate::estimation::fit::{Effort, Fit, fit};
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::recording::Role;
use crate::selection::candidates::Candidate;

/// A candidate after its refit.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub(super) candidate: Candidate,
    pub(super) fit: Fit,
    /// gain in likelihood, price paid
    pub(super) gain: f64,
    /// mean square of what the energy balance leaves
    pub(super) balance: Option<f64>,
    /// the energy balance is worse with it than without
    pub(super) refuted: bool,
}

/// Candidates that are refitted in full after a quick round.
pub(super) const FINALISTS: usize = 4;
/// One step from the fitted hypothesis: what it promises ranks the candidates.
pub(super) const QUICK: Effort = Effort { steps: 1, thinned: 400, polish: false };
pub(super) const CAREFUL: Effort = Effort { steps: 6, thinned: 6_000, polish: false };

/// Mean square of what the energy balance leaves under a fit.
pub(super) fn balance(dataset: &Dataset, fit: &Fit) -> Option<f64> {
    energy_balance(&dataset.tracks, &fit.hypothesis, &fit.starts).map(|b| b.mean_square)
}

/// The hypothesis with a candidate in it.
pub(super) fn extend(hypothesis: &Hypothesis, candidate: &Candidate, origin: Origin) -> Hypothesis {
    let mut extended = hypothesis.clone();
    match candidate.refine {
        Some(member) => extended.members[member].refined = true,
        None => {
            let at = extended.admit(candidate.id, origin);
            extended.members[at].values = candidate.values;
        }
    }
    extended
}

/// The refitted hypothesis of a trial with the final origin of its new member.
pub(super) fn extend_from(trial: &Trial, origin: Origin) -> Hypothesis {
    let mut extended = trial.fit.hypothesis.clone();
    if trial.candidate.refine.is_none() {
        // the newest of equal members stands last among them
        if let Some(m) = extended.members.iter_mut().rev().find(|m| m.id == trial.candidate.id) {
            m.origin = origin;
        }
    }
    extended
}

pub(super) fn refit(dataset: &Dataset, fitted: &Fitted, hypothesis: &Hypothesis, effort: Effort) -> Fit {
    let unknowns: Vec<Unknown> = dataset.unknowns(hypothesis);
    let priors = dataset.priors(hypothesis, fitted.drive.as_ref());
    fit(&dataset.tracks, hypothesis, &unknowns, &priors, Role::Fit, effort)
}

pub(super) fn count(fit: &Fit) -> f64 {
    (fit.counted[0] + fit.counted[1]) as f64
}

/// Mean square after the last step; infinite where most of the data had to be set aside.
pub(super) fn mean_square(fit: &Fit) -> f64 {
    if fit.counted[0] <= fit.set_aside.iter().sum() {
        return f64::INFINITY;
    }
    fit.left() / count(fit).max(1.0)
}

/// ln n per parameter, and 2 ln of the alternatives tried.
pub(super) fn price(candidate: &Candidate, n: f64) -> f64 {
    let parameters = candidate.id.description().parameters;
    let adjusted = match candidate.refine {
        Some(_) => parameters.iter().filter(|p| p.role == ParameterRole::Refined).count(),
        None => parameters.iter().filter(|p| p.role != ParameterRole::Refined).count(),
    };
    adjusted as f64 * n.max(2.0).ln() + 2.0 * candidate.tried.ln()
}

pub(super) fn sample_cost(evaluation: &Evaluation) -> f64 {
    let correlation = autocorrelation(evaluation, WHITENESS_LAGS);
    inflation(&correlation, evaluation.errors().count())
}

/// White part of the held-out error, rad.
pub(super) fn floor(dataset: &Dataset, fit: &Fit) -> f64 {
    evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Holdout, Window::Dense, None).noise_floor()
}

/// A fit on the held-out data.
pub(super) fn on_heldout(dataset: &Dataset, fit: &Fit) -> Evaluation {
    evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Holdout, Window::Whole, None)
}

/// Held-out mean square of a fit, rad².
pub(super) fn heldout(dataset: &Dataset, fit: &Fit) -> f64 {
    on_heldout(dataset, fit).mean_square()
}
