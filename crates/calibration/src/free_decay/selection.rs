//! Which terms the decays ask for: the paper's, as far as the pattern's angles tell them apart, and beyond them what the
//! likelihood pays for.

use super::fit::{Data, Fit, approach, fit};
use super::model::{Model, Term};
use super::runs::DecayRun;
use super::start::{begun, energy};

/// 1 − |mean e^{2iθ}|², from which on the two components of an anisotropy are told apart, and from what does not depend
/// on direction: a pattern that is seen over some ±8°.
const SPREAD: f64 = 0.02;
/// Gain in 2 ln likelihood, after the price of the unknowns, that a term is believed for.
pub(crate) const BELIEVED: f64 = 10.0;
/// A rival that gains as much less than this is not ruled out.
const RULED_OUT: f64 = 10.0;

/// A term that was added, with what speaks for it.
#[derive(Debug, Clone)]
pub(crate) struct Added {
    pub(crate) term: Term,
    /// gain in 2 ln likelihood after its price
    pub(crate) gain: f64,
    /// the other terms that were tried, with theirs
    pub(crate) rivals: Vec<(Term, f64)>,
}

impl Added {
    /// Rivals that explain the decays nearly as well.
    pub(crate) fn not_ruled_out(&self) -> impl Iterator<Item = Term> + '_ {
        self.rivals.iter().filter(|(_, gain)| *gain > BELIEVED && self.gain - gain < RULED_OUT).map(|(t, _)| *t)
    }
}

/// What was chosen.
#[derive(Debug, Clone)]
pub(crate) struct Chosen {
    /// the paper's terms only
    pub(crate) declared: Fit,
    /// all that is believed
    pub(crate) discovered: Fit,
    pub(crate) added: Vec<Added>,
    /// the pattern was seen at angles that tell anisotropies apart
    pub(crate) many_angles: bool,
}

/// A term of the paper's model.
pub(crate) fn is_declared(term: Term) -> bool {
    !matches!(term, Term::Spring | Term::DampingGrowth | Term::Skew)
}

/// How far the pattern is spread, 1 − |mean e^{2iθ}|², and its mean angle, rad.
fn spread(data: Data<'_>) -> (f64, f64) {
    let (mut weight, mut r, mut s) = (0.0, 0.0, 0.0);
    for u in data.runs.iter().zip(data.counts).flat_map(|(run, n)| &run.seen[..*n]) {
        let line = u[1].hypot(u[2]).max(f64::MIN_POSITIVE);
        // a circle lies nowhere
        let w = line.powi(2) / energy(u).max(f64::MIN_POSITIVE);
        (weight, r, s) = (weight + w, r + w * u[1] / line, s + w * u[2] / line);
    }
    let (r, s) = (r / weight, s / weight);
    (1.0 - (r * r + s * s), 0.5 * s.atan2(r))
}

/// The declared terms that these decays tell.
fn declared_terms(runs: &[DecayRun], many_angles: bool) -> Vec<Term> {
    let rotated = runs.iter().any(|r| r.rate_is_known && r.mean_rate() != 0.0);
    let turning = if rotated { Term::AngularGain } else { Term::Precession };
    let mut terms = vec![Term::Damping, turning, Term::SplitAcross];
    if many_angles {
        terms.extend([Term::SplitAlong, Term::DampingAlong, Term::DampingAcross]);
    }
    terms
}

/// Chooses and fits.
pub(crate) fn choose(data: Data<'_>, discover: bool, progress: &dyn Fn(&str)) -> Chosen {
    let (spread, mean_angle) = spread(data);
    let many_angles = spread >= SPREAD;
    let base = Model::new(declared_terms(data.runs, many_angles), if many_angles { 0.0 } else { mean_angle });
    let at = |model: &Model| {
        let counts = data.counts;
        let of = |run: &DecayRun| data.runs.iter().position(|r| r.number == run.number).map_or(0, |i| counts[i]);
        begun(model, data.runs, of)
    };
    let (model, starts) = approach(&at(&base), data);
    let mut best = fit(&model, &starts, data);
    let mut added: Vec<Added> = Vec::new();
    loop {
        let open: Vec<Term> = candidates(many_angles, discover).into_iter().filter(|t| !best.model.has(*t)).collect();
        let price = (best.values as f64).ln();
        let mut tried: Vec<(Fit, Term, f64)> = open
            .into_iter()
            .map(|term| {
                let more = fit(&best.model.with(term), &best.starts, data);
                let gain = best.minus_two_log - more.minus_two_log - price;
                (more, term, gain)
            })
            .filter(|(more, ..)| is_sound(more))
            .collect();
        tried.sort_by(|a, b| b.2.total_cmp(&a.2));
        let Some((more, term, gain)) = tried.first().cloned().filter(|t| t.2 > BELIEVED) else { break };
        progress(&format!("{term:?}: gain {gain:.0} in 2 ln likelihood"));
        added.push(Added { term, gain, rivals: tried.iter().skip(1).map(|t| (t.1, t.2)).collect() });
        best = more;
    }
    let declared = if added.iter().all(|a| is_declared(a.term)) {
        best.clone()
    } else {
        let terms = best.model.terms.iter().copied().filter(|t| is_declared(*t)).collect();
        let mut model = Model::new(terms, best.model.axis_rad);
        model.values = model.terms.iter().map(|t| best.model.value(*t)).collect();
        fit(&model, &best.starts, data)
    };
    Chosen { declared, discovered: best, added, many_angles }
}

/// What may be there beside the terms that always are.
fn candidates(many_angles: bool, discover: bool) -> Vec<Term> {
    let mut out = if many_angles { vec![Term::GainRatio] } else { vec![Term::SplitAlong] };
    if discover {
        out.extend([Term::Spring, Term::DampingGrowth]);
        if many_angles {
            out.push(Term::Skew);
        }
    }
    out
}

/// A fit whose numbers are numbers.
pub(crate) fn is_sound(fit: &Fit) -> bool {
    let numbers = fit.model.values.iter().chain(fit.starts.iter().flatten());
    numbers.chain(fit.covariance.iter()).all(|v| v.is_finite()) && fit.minus_two_log.is_finite()
}
