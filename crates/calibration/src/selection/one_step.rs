//! What one linear step promises of every candidate, from one look at the data: Rao's score test. All candidates that change
//! nothing at their initial values stand in one linearisation, and the model of each is some rows and columns of it.

use rayon::prelude::*;

use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::subsets::Superset;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::selection::candidates::Candidate;
use crate::selection::trial::{QUICK, extend, mean_square, price, refit};

/// A candidate after one step.
#[derive(Debug, Clone)]
pub(super) struct Promise {
    pub(super) candidate: Candidate,
    /// the fitted hypothesis with it, after the step
    pub(super) hypothesis: Hypothesis,
    /// gain in 2 ln likelihood to first order, price paid, with residuals taken for white
    pub(super) gain: f64,
}

/// A fitted hypothesis with candidates that change nothing yet, linearised once for all of them.
pub(super) struct OneStep {
    all: Hypothesis,
    unknowns: Vec<Unknown>,
    superset: Superset,
    /// the member that each candidate became
    members: Vec<usize>,
}

impl OneStep {
    /// Of `candidates` that [`begins_at_nothing`] only.
    pub(super) fn new(dataset: &Dataset, fitted: &Fitted, candidates: &[&Candidate]) -> Self {
        let mut all = fitted.fit.hypothesis.clone();
        for candidate in candidates {
            all = extend(&all, candidate, Origin::Discovered);
        }
        let member = |c: &&Candidate| all.members.iter().rposition(|m| m.id == c.id && m.values == c.values);
        let members = candidates.iter().filter_map(member).collect();
        let unknowns = dataset.unknowns(&all);
        let priors = dataset.priors(&all, fitted.drive.as_ref());
        let superset = Superset::new(&dataset.tracks, &all, &unknowns, &priors, QUICK.thinned);
        Self { all, unknowns, superset, members }
    }

    /// Columns of the fitted hypothesis and of some candidates.
    fn columns(&self, taken: &[usize]) -> Vec<usize> {
        let own = |u: &Unknown| match u {
            Unknown::Effect(m, _) => !self.members.contains(m) || taken.iter().any(|&c| self.members[c] == *m),
            _ => true,
        };
        (0..self.unknowns.len()).filter(|&i| own(&self.unknowns[i])).collect()
    }

    /// What a step with these candidates leaves; none where it has no solution.
    pub(super) fn mean_square(&self, taken: &[usize]) -> Option<f64> {
        Some(self.superset.step(&self.columns(taken))?.1)
    }

    /// The fitted hypothesis with one candidate after the step, and what that leaves.
    fn with(&self, candidate: usize) -> Option<(Hypothesis, f64)> {
        let columns = self.columns(&[candidate]);
        let (step, mean_square) = self.superset.step(&columns)?;
        let mut hypothesis = self.all.clone();
        for (&column, step) in columns.iter().zip(&step) {
            let unknown = self.unknowns[column];
            hypothesis.set(unknown, hypothesis.get(unknown) + step);
        }
        let mut at = 0..;
        let is_another = |m: usize| m != self.members[candidate] && self.members.contains(&m);
        hypothesis.members.retain(|_| !at.next().is_some_and(is_another));
        Some((hypothesis, mean_square))
    }
}

/// Whether a candidate changes nothing before its first step, so that it shares the linearisation of the fitted hypothesis.
fn begins_at_nothing(candidate: &Candidate) -> bool {
    candidate.refine.is_none() && candidate.id.description().onsets.is_empty()
}

/// What one step promises of each candidate, the most promising first.
pub(super) fn promises(dataset: &Dataset, fitted: &Fitted, candidates: &[Candidate]) -> Vec<Promise> {
    let (shared, alone): (Vec<&Candidate>, Vec<&Candidate>) = candidates.iter().partition(|c| begins_at_nothing(c));
    let one_step = OneStep::new(dataset, fitted, &shared);
    let (Some(before), n) = (one_step.mean_square(&[]), one_step.superset.samples()) else { return Vec::new() };
    let of_shared = shared.par_iter().enumerate().filter_map(|(at, c)| Some((*c, one_step.with(at)?)));
    let of_alone = alone.par_iter().map(|c| {
        let fit = refit(dataset, fitted, &extend(&fitted.fit.hypothesis, c, Origin::Discovered), QUICK);
        let left = mean_square(&fit);
        (*c, (fit.hypothesis, left))
    });
    let mut ranked: Vec<Promise> = of_shared
        .chain(of_alone)
        .map(|(candidate, (hypothesis, left))| {
            let gain = n * (before / left).ln() - price(candidate, n);
            Promise { candidate: candidate.clone(), hypothesis, gain }
        })
        .filter(|promise| promise.gain.is_finite())
        .collect();
    ranked.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    ranked
}
