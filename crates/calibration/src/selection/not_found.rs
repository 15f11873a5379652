//! What effects that were not found may hide. An effect below what discovery asks for moves what it is confounded with all the same, by
//! many deviations where the campaign hardly tells it apart: every interval has to hold that as far as the effect is likely to be there
//! (Bayesian model averaging, Hoeting, Madigan, Raftery and Volinsky 1999, over the model at hand and each that has one effect more).

use cvg_model::effects::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::data::track::Track;
use crate::estimation::fit::{Fit, Prior, scaled_inverse};
use crate::estimation::generalised_least_squares::linearised;
use crate::estimation::joint_fit::{Dataset, Fitted, fitted_tracks};
use crate::estimation::normal::Normal;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::recording::Instrument;
use crate::selection::candidates::{Candidate, alike_at_one_amplitude};
use crate::selection::together::causes;
use crate::selection::trial::extend;

/// The axes of the readout are at right angles within this, rad, before the data, and those of the drives, of which nothing tells how much
/// they put out either: engineering choices.
const READOUT_ASKEW: f64 = 0.02;
const DRIVES_ASKEW: f64 = 0.05;

/// Runs that differ by more than this in speed tell the mechanics from the drives without the second order of the readout: engineering choice.
const OTHER_SPEED: f64 = 2.0;

/// Adds to the covariance of a fit's unknowns what the causes that the campaign could name, and did not, may have moved them by. Where all
/// runs are at one rate, in one sense, no cause can be named: then it is what the drives, or the readout that points them, may turn the
/// pattern by, which a single rate takes for angular gain. What else such runs do not tell apart is said of the effects that are declared.
pub(crate) fn with_what_was_not_found(
    dataset: &mut Dataset,
    fitted: &Fitted,
    covariance: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut missing = match dataset.instrument {
        Instrument::Sensor => return covariance.clone(),
        _ if dataset.tracks_differ() => {
            let mut all = causes(dataset, &fitted.fit.hypothesis, fitted);
            all.extend(rivals_at_one_amplitude(dataset, &fitted.fit.hypothesis));
            all
        }
        _ => askew(&fitted.fit.hypothesis),
    };
    // without an effect that a user wrote down the answer is the one that it is without the text
    missing.retain(|candidate| !dataset.written.contains(&candidate.id));
    dataset.balance_damping(&fitted.fit.hypothesis);
    let Some(models) = Models::around(dataset, fitted, &missing) else { return covariance.clone() };
    models.others.iter().filter_map(|other| models.moved_by(other)).fold(covariance.clone(), |all, by| all + by)
}

/// The skews that a hypothesis lacks.
fn askew(hypothesis: &Hypothesis) -> Vec<Candidate> {
    lacking(hypothesis, [EffectId::DetectionSkew, EffectId::ActuationSkew])
}

/// What may stand in the place of an effect that was found where all runs are at one amplitude and about one speed: the same to first order,
/// and not to second, by which such runs tell the anisodamping from the drives.
fn rivals_at_one_amplitude(dataset: &Dataset, hypothesis: &Hypothesis) -> Vec<Candidate> {
    let speeds = || fitted_tracks(&dataset.tracks).map(Track::mean_speed);
    let (slowest, fastest) = speeds().fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
    if !dataset.alike().amplitude || fastest > OTHER_SPEED * slowest {
        return Vec::new();
    }
    let found = hypothesis.members.iter().filter(|m| m.origin == Origin::Discovered);
    let mut rivals: Vec<EffectId> = found.flat_map(|m| alike_at_one_amplitude(m.id)).collect();
    rivals.sort_unstable();
    rivals.dedup();
    lacking(hypothesis, rivals)
}

/// The size, at this amplitude, of what was found and is this effect as well where all runs are at one amplitude.
fn found_as(hypothesis: &Hypothesis, id: EffectId, amplitude: f64) -> Option<f64> {
    let found = hypothesis.members.iter().find(|m| alike_at_one_amplitude(m.id).any(|rival| rival == id))?;
    let power = i32::from(found.id.description().scaling.amplitude);
    Some(found.values.first()?.abs() * amplitude.powi(power))
}

/// Those of these effects that a hypothesis lacks.
fn lacking(hypothesis: &Hypothesis, of: impl IntoIterator<Item = EffectId>) -> Vec<Candidate> {
    let lacking = of.into_iter().filter(|id| hypothesis.member(*id).is_none());
    lacking.map(|id| Candidate { id, values: id.neutral(), refine: None, tried: 1.0 }).collect()
}

/// One linearisation for the fitted model and for each that has one effect more.
struct Models {
    equations: Normal,
    hypothesis: Hypothesis,
    unknowns: Vec<Unknown>,
    /// those of the fitted model
    own: Vec<usize>,
    /// those of them that are held
    held: Vec<bool>,
    /// unknowns of each effect that was not found
    others: Vec<Vec<usize>>,
}

impl Models {
    fn around(dataset: &Dataset, fitted: &Fitted, missing: &[Candidate]) -> Option<Self> {
        let all = missing.iter().fold(fitted.fit.hypothesis.clone(), |h, c| extend(&h, c, Origin::Discovered));
        let mut unknowns = dataset.unknowns(&all);
        let ratio = all.position(EffectId::ActuationGainMismatch).map(|member| Unknown::Effect(member, 0));
        // held while the drives are, and as wrong as it may be
        let held_ratio = ratio.filter(|ratio| !dataset.tracks_differ() && !unknowns.contains(ratio));
        unknowns.extend(held_ratio);
        let is_of = |c: &Candidate, u: &Unknown| matches!(u, Unknown::Effect(m, _) if all.members[*m].id == c.id);
        let mut others: Vec<Vec<usize>> =
            missing.iter().map(|c| (0..unknowns.len()).filter(|&i| is_of(c, &unknowns[i])).collect()).collect();
        others.extend(held_ratio.map(|_| vec![unknowns.len() - 1]));
        let own: Vec<usize> = (0..unknowns.len()).filter(|i| !others.iter().any(|o| o.contains(i))).collect();
        if own.len() != fitted.fit.unknowns.len() {
            return None;
        }
        let mut priors = dataset.priors(&all, fitted.drive.as_ref());
        priors.extend(dataset.by_the_energy_loop(&all));
        let amplitude = dataset.usual_amplitude();
        for unknown in others.iter().flatten().map(|&i| unknowns[i]) {
            let Unknown::Effect(member, p) = unknown else { continue };
            if priors.iter().any(|prior| prior.unknown == unknown) {
                continue;
            }
            let d = all.members[member].id.description();
            let size = match all.members[member].id {
                EffectId::DetectionSkew if !dataset.tracks_differ() => READOUT_ASKEW,
                EffectId::ActuationSkew if !dataset.tracks_differ() => DRIVES_ASKEW,
                // in the place of what was found, it is as large
                id => found_as(&fitted.fit.hypothesis, id, amplitude)
                    .map_or(d.parameters[p].scale, |found| found.max(d.parameters[p].scale)),
            };
            let deviation = size * amplitude.powi(-i32::from(d.scaling.amplitude));
            priors.push(Prior { unknown, mean: d.parameters[p].neutral, deviation, considered: false });
        }
        let held = own.iter().map(|&i| Prior::considered_deviation(&priors, unknowns[i]).is_some()).collect();
        let fit = Fit { hypothesis: all, unknowns, ..fitted.fit.clone() };
        let equations = linearised(&dataset.tracks, &fit, &priors)?;
        Some(Self { equations, hypothesis: fit.hypothesis, unknowns: fit.unknowns, own, held, others })
    }

    /// Unknowns of what was found in the place of these: its size is what it is if it is there, and that it may be the other is said.
    fn found_in_their_place(&self, other: &[usize]) -> Vec<usize> {
        let members = &self.hypothesis.members;
        let member = |i: usize| match self.unknowns[i] {
            Unknown::Effect(member, _) => Some(members[member].id),
            _ => None,
        };
        let is_found_as = |found: EffectId| {
            other.iter().filter_map(|&i| member(i)).any(|rival| alike_at_one_amplitude(found).any(|id| id == rival))
        };
        self.own.iter().copied().filter(|&i| member(i).is_some_and(is_found_as)).collect()
    }

    /// The step of some unknowns and its covariance.
    fn step(&self, of: &[usize]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let inverse = scaled_inverse(&self.equations.matrix.select_rows(of).select_columns(of), 0.0)?;
        Some((&inverse * self.equations.right.select_rows(of), inverse))
    }

    /// The mean square of what an effect that was not found moves the fitted unknowns by, times the probability that it is there: as
    /// likely as not before the data, and within what is believed of its size.
    fn moved_by(&self, other: &[usize]) -> Option<DMatrix<f64>> {
        let free: Vec<usize> = self.own.iter().zip(&self.held).filter(|(_, held)| !**held).map(|(i, _)| *i).collect();
        let both: Vec<usize> = free.iter().chain(other).copied().collect();
        let ((alone, _), (step, covariance)) = (self.step(&free)?, self.step(&both)?);
        let gain = |of: &[usize], step: &DVector<f64>| self.equations.right.select_rows(of).dot(step);
        let at = free.len();
        let value = step.rows(at, other.len());
        let own = covariance.view((at, at), (other.len(), other.len())).into_owned();
        let believed: f64 = other.iter().map(|&i| self.equations.believed[i]).product();
        let ln_odds = 0.5 * (gain(&both, &step) - gain(&free, &alone)) + 0.5 * (own.determinant() * believed).ln();
        let probability = (1.0 + (-ln_odds).exp()).recip();
        // by how much the fitted unknowns follow a unit of the effect
        let follow = covariance.view((0, at), (at, other.len())) * scaled_inverse(&own, 0.0)?;
        let mean_square = (own + value * value.transpose()) * probability;
        let moved = &follow * mean_square * follow.transpose();
        let mut out = DMatrix::zeros(self.own.len(), self.own.len());
        let place: Vec<usize> = (0..self.own.len()).filter(|&i| !self.held[i]).collect();
        let found = self.found_in_their_place(other);
        let moves = |i: usize| !found.contains(&self.own[i]);
        for (a, &i) in place.iter().enumerate().filter(|(_, i)| moves(**i)) {
            for (b, &j) in place.iter().enumerate().filter(|(_, j)| moves(**j)) {
                out[(i, j)] = moved[(a, b)];
            }
        }
        out.iter().all(|v| v.is_finite()).then_some(out)
    }
}
