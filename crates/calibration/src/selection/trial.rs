//! A candidate on trial: the model refitted with it, what that gains, and what it leaves of fitted data under cross-validation.
//! The held-out runs are not seen here.

use cvg_model::effects::{Role as ParameterRole, Stage};

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation};
use crate::estimation::amplitude_equation::energy_balance;
use crate::estimation::cross_validation::cross_validated;
use crate::estimation::fit::{Effort, Fit, fit};
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::residuals::Window;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::recording::Role;
use crate::selection::candidates::Candidate;

/// Gain in log-likelihood (×2, after the price of parameters and of the search) that a new effect must bring.
pub(super) const LEAST_GAIN: f64 = 12.0;
/// By how much it must beat a rival of the library to be told apart from it.
pub(super) const LEAST_LEAD: f64 = 8.0;
/// The share of the cross-validated mean square that it must remove.
pub(super) const LEAST_VALIDATED_GAIN: f64 = 0.05;
/// The same beside forces that are open within a step of the drives, which turn the pattern by any even harmonic: more than what is left is
/// theirs (engineering choice).
const BESIDE_OPEN_FORCES: f64 = 0.5;
/// What it removes from the cross-validated error must be this large beside the noise floor: smaller ones are often what a
/// larger effect leaves when its place in the chain of the readout is not quite the library's.
const LEAST_SHARE_OF_FLOOR: f64 = 0.5;
/// A cause under which the energy balance leaves this many times the mean square is refuted.
pub(super) const REFUTED: f64 = 1.5;
/// A cause under which the energy balance leaves this share or less of what it leaves under a rival is told from that.
pub(super) const BY_AMPLITUDE: f64 = 0.8;
/// A residual within this factor of its white part, of which no candidate promises to take anything, is left alone.
pub(super) const NOTHING_LEFT: f64 = 1.2;

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

/// What cross-validation left before a step, and how much of it has to go.
#[derive(Debug, Clone, Copy)]
pub(super) struct Before {
    /// cross-validated mean square, rad²
    mean_square: f64,
    /// of it, and in rad²
    least_share: f64,
    least_removed: f64,
}

impl Before {
    pub(super) fn of(dataset: &Dataset, fitted: &Fitted) -> Self {
        let least_removed = (LEAST_SHARE_OF_FLOOR * floor(dataset, &fitted.fit)).powi(2);
        let least_share = if dataset.quantisation.is_some() { BESIDE_OPEN_FORCES } else { LEAST_VALIDATED_GAIN };
        Self { mean_square: validated(dataset, fitted), least_share, least_removed }
    }

    /// Whether no more is left.
    pub(super) fn is_as_large_as(self, after: f64) -> bool {
        after <= self.mean_square
    }

    /// Whether what is left after a step is less by enough to name what it added.
    pub(super) fn is_improved_by(self, after: f64) -> bool {
        after <= (1.0 - self.least_share) * self.mean_square && self.mean_square - after >= self.least_removed
    }
}

/// Whether a fit leaves no more of the angle than another, by what the samples can tell, and the energy balance does not refute it. Both are
/// looked at behind one scale of the noise, which each fit measures for itself.
pub(super) fn explains_as_much(dataset: &Dataset, rival: &Fit, other: &Fit) -> bool {
    let balances = balance(dataset, other).zip(balance(dataset, rival));
    if balances.is_some_and(|(before, after)| after > REFUTED * before) {
        return false;
    }
    let [left, other_left] = [rival, other].map(|fit| on_fit(dataset, fit));
    let worth = count(other) / sample_cost(&other_left);
    worth * (left.mean_square() / other_left.mean_square()).ln() < LEAST_LEAD
}

/// White part of the error, rad.
pub(super) fn floor(dataset: &Dataset, fit: &Fit) -> f64 {
    evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Dense, None).noise_floor()
}

/// What a fit leaves of its samples.
pub(super) fn on_fit(dataset: &Dataset, fit: &Fit) -> Evaluation {
    evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Whole, None)
}

/// Cross-validated mean square of a fit, rad².
pub(super) fn validated(dataset: &Dataset, fitted: &Fitted) -> f64 {
    let priors = dataset.priors(&fitted.fit.hypothesis, fitted.drive.as_ref());
    cross_validated(&dataset.tracks, &fitted.fit, &priors, CAREFUL.thinned)
}

/// What the fitted runs can tell apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distinguishable {
    /// runs at two or more rates, or in both directions
    pub(super) rates: bool,
    /// at two or more speeds
    speeds: bool,
    /// the loops' commands and the quadrature they left were recorded, which move the pattern too
    mechanics: bool,
}

impl Distinguishable {
    pub(super) fn on(dataset: &Dataset) -> Self {
        Self {
            rates: dataset.tracks_differ(),
            speeds: dataset.speeds_differ(),
            mechanics: dataset.tracks.iter().all(|t| t.track.records_the_loops()),
        }
    }

    /// Whether these runs could show a candidate to be a cause, and not only describe what is left.
    pub(super) fn can_be_named(self, candidate: &Candidate) -> bool {
        let d = candidate.id.description();
        // at one speed a delay is a step between the directions
        let delayed = d.scaling.rate > 0 && !self.speeds;
        // without the loops' record what they do to the pattern looks like mechanics
        let driven = d.stage == Stage::Mechanics && !self.mechanics;
        // and a line in time may be one of the table or of what turns with it
        let in_time = d.parameters.iter().any(|p| matches!(p.role, ParameterRole::Located(_))) && !self.speeds;
        d.explains(&candidate.values) && !delayed && !driven && !in_time
    }
}
