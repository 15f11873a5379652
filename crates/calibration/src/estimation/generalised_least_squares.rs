//! The last step of a gyroscope's fit: residuals weighted by what their noise remembers, and a covariance that holds.
//!
//! The fit before it weighs residuals as if they were white, so that a walk of the angle outvotes the ring-downs. Here each
//! kind of coloured noise has the most likely strength ([`crate::restricted_likelihood`]), a filter along each segment
//! whitens the residuals ([`crate::coloured_noise`]), and the step is repeated, linearised anew, until it no longer
//! moves. Runs are propagated sample by sample and never stored.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::data::track::LARGEST_TURN;
use crate::estimation::coloured_noise::{ColouredNoise, Filter, Observation, Surroundings, Whitened};
use crate::estimation::fit::{Fit, Prepared, Prior, Solution};
use crate::estimation::normal::Normal;
use crate::estimation::propagation::{Row, Start, Stepping, propagate};
use crate::estimation::restricted_likelihood::{Sampled, strengths};
use crate::model::hypothesis::{Unknown, direction};
use crate::model::unknowns::Unknowns;
use crate::recording::Role;
use cvg_model::effects::EffectId;

/// Samples of a segment that tell how strong its noise is: as few as can be averaged to, and as many as are looked at.
const ENOUGH: usize = 1_000;
const MOST: usize = 2_000;
/// Segments of fewer samples say nothing of their noise.
const FEWEST: usize = 64;
/// Linearisations, and the share of a deviation by which the last one may still move an unknown.
const STEPS: usize = 5;
const CONVERGED: f64 = 0.05;
/// A run is heard against the others on what it tells at least this share of what all tell together.
const LEAST_SHARE: f64 = 0.05;
/// How far Σ of squares may lie above its expectation, in deviations, before runs are said to disagree: 1 in 100.
const DISAGREEMENT: f64 = 2.33;
/// How far runs and ring-downs may lie apart, in deviations, before either is said to be of another device: 1 in 2,000, since
/// the interval that covers both may be twenty times as wide.
const CONTRADICTION: f64 = 3.5;

/// A fit after its last step.
pub(crate) struct Refined {
    pub(crate) fit: Fit,
    /// of the unknowns
    pub(crate) covariance: DMatrix<f64>,
    /// by what factor runs disagree beyond their noise, as a variance
    pub(crate) disagreement: f64,
}

/// What one fitted segment adds up to.
struct Part {
    track: usize,
    segment: usize,
    whitened: Whitened,
    /// means of the columns, and of the time since the start
    means: Vec<f64>,
    mean_time_s: f64,
    /// the drift that each column shows, where commands were not recorded
    drift: Option<Vec<f64>>,
}

/// The fit at hand with what it takes to walk it.
struct Problem<'a> {
    tracks: &'a [Prepared],
    unknowns: Unknowns,
    /// the detection ratio's column
    ratio: Option<usize>,
    priors: &'a [Prior],
}

impl<'a> Problem<'a> {
    fn new(tracks: &'a [Prepared], fit: &Fit, priors: &'a [Prior]) -> Self {
        let ratio = |u: &Unknown| match u {
            Unknown::Effect(member, 0) => fit.hypothesis.members[*member].id == EffectId::DetectionGainMismatch,
            _ => false,
        };
        Self {
            tracks,
            unknowns: Unknowns::new(&fit.hypothesis, fit.unknowns.clone()),
            ratio: fit.unknowns.iter().position(ratio),
            priors,
        }
    }

    fn segments(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let all = self.tracks.iter().enumerate();
        all.flat_map(|(t, p)| p.track.segments.iter().enumerate().map(move |(s, segment)| (t, s, segment.role)))
            .filter(|(_, _, role)| *role == Role::Fit)
            .map(|(t, s, _)| (t, s))
    }

    fn surroundings(&self, fit: &Fit, (t, s): (usize, usize)) -> Surroundings {
        let p = &self.tracks[t];
        Surroundings { white: p.white.angle, drift: p.drifts.then_some(fit.starts[t][s].drift) }
    }

    /// Walks a segment and hands each sample that is no spike to `take`, with the time since the segment's start.
    fn propagate(&self, fit: &Fit, (t, s): (usize, usize), mut take: impl FnMut(&Observation<'_>, f64)) {
        let p = &self.tracks[t];
        let segment = &p.track.segments[s];
        let n = self.unknowns.all.len();
        let mut columns = vec![0.0; n + 1];
        let first = p.track.t_s[segment.range.start];
        let mut before = None;
        let stepping = Stepping::without(p.limit.angle);
        propagate(&p.track, segment, &fit.hypothesis, &self.unknowns, fit.starts[t][s], stepping, |row: &Row<'_>| {
            if row.angle.abs() > p.limit.angle {
                return;
            }
            columns[..n].copy_from_slice(row.angle_slopes);
            columns[n] = row.angle;
            let now = p.track.t_s[row.index];
            let (sin, cos) = (2.0 * direction(&row.vibration)).sin_cos();
            let observation = Observation {
                interval_s: before.map_or(0.0, |before| now - before),
                gain_slope: self.ratio.map_or(0.0, |column| row.angle_slopes[column]),
                precession_rad_s: row.precession,
                twice: [sin, cos],
                columns: &columns,
            };
            take(&observation, now - first);
            before = Some(now);
        });
    }

    /// What the residuals remember.
    fn noise(&self, fit: &Fit) -> ColouredNoise {
        let n = self.unknowns.all.len();
        let segments: Vec<(usize, usize)> = self.segments().collect();
        let sampled: Vec<Sampled> = segments
            .into_par_iter()
            .map(|at| {
                let track = &self.tracks[at.0].track;
                let count = track.segments[at.1].range.len();
                let range = &track.segments[at.1].range;
                let span = track.t_s[range.end - 1] - track.t_s[range.start];
                let turn = (fit.hypothesis.precession(track.mean_speed()) * span / count.max(1) as f64).abs();
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive count")]
                let resolved = (LARGEST_TURN / turn.max(1e-12)) as usize;
                let averaged = resolved.min(count / ENOUGH).max(1);
                let thinned = (count / averaged).div_ceil(MOST).max(1);
                let mut sampled = Sampled::new(n, self.surroundings(fit, at), averaged, thinned);
                self.propagate(fit, at, |o, _| sampled.take(o));
                sampled
            })
            .filter(|s| s.len() > FEWEST)
            .collect();
        strengths(&sampled, &self.beliefs(fit))
    }

    fn beliefs(&self, fit: &Fit) -> Normal {
        Normal::of_beliefs(&fit.unknowns, &fit.hypothesis, self.priors)
    }

    /// All fitted segments, whitened.
    fn parts(&self, fit: &Fit, noise: &ColouredNoise) -> Vec<Part> {
        let n = self.unknowns.all.len();
        let segments: Vec<(usize, usize)> = self.segments().collect();
        segments
            .into_par_iter()
            .map(|at| {
                let mut filter = Filter::new(n, noise, self.surroundings(fit, at));
                let (mut means, mut mean_time_s, mut count) = (vec![0.0; n + 1], 0.0, 0.0);
                self.propagate(fit, at, |o, time_s| {
                    filter.take(o);
                    count += 1.0;
                    for (m, v) in means.iter_mut().zip(o.columns) {
                        *m += (v - *m) / count;
                    }
                    mean_time_s += (time_s - mean_time_s) / count;
                });
                let (whitened, drift) = filter.finish();
                Part { track: at.0, segment: at.1, whitened, means, mean_time_s, drift }
            })
            .collect()
    }
}

impl Part {
    /// By how much the start of its segment moves with a step of the unknowns.
    fn moved(&self, start: &Start, step: &DVector<f64>) -> Start {
        let after = |columns: &[f64]| -> f64 {
            columns[step.len()] - columns.iter().zip(step.iter()).map(|(c, s)| c * s).sum::<f64>()
        };
        let drift = self.drift.as_ref().map_or(0.0, |d| after(d));
        Start {
            angle: start.angle + after(&self.means) - drift * self.mean_time_s,
            drift: start.drift + drift,
            ..*start
        }
    }
}

/// Moves `fit` by its last steps and says the covariance of its unknowns; `None` where nothing was fitted.
pub(crate) fn refine(tracks: &[Prepared], fit: &Fit, priors: &[Prior]) -> Option<Refined> {
    let problem = Problem::new(tracks, fit, priors);
    let noise = problem.noise(fit);
    let mut fit = fit.clone();
    let mut best: Option<(Fit, Vec<Part>, Normal)> = None;
    for _ in 0..STEPS {
        let parts = problem.parts(&fit, &noise);
        let mut normal = problem.beliefs(&fit);
        parts.iter().for_each(|p| normal.add(&p.whitened, 1.0));
        if best.as_ref().is_some_and(|(_, _, before)| normal.squares > before.squares) {
            break;
        }
        let solution = normal.solution()?;
        let small = (0..fit.unknowns.len())
            .all(|i| solution.step[i].abs() <= CONVERGED * solution.covariance[(i, i)].max(0.0).sqrt());
        let mut next = fit.clone();
        for (i, u) in fit.unknowns.iter().enumerate() {
            next.hypothesis.set(*u, fit.hypothesis.get(*u) + solution.step[i]);
        }
        for p in &parts {
            let start = &fit.starts[p.track][p.segment];
            next.starts[p.track][p.segment] = p.moved(start, &solution.step);
        }
        if small {
            best = Some((next, parts, normal));
            break;
        }
        best = Some((fit, parts, normal));
        fit = next;
    }
    let (mut fit, parts, normal) = best?;
    let (covariance, disagreement) = covariance(&parts, &normal)?;
    let solution = normal.solution()?;
    (fit.covariance, fit.by_noise, fit.coloured) = (solution.covariance, solution.by_noise, Some(noise));
    Some(Refined { fit, covariance, disagreement })
}

/// The normal equations around `fit`, as far as what whitened samples leave, and what the runs disagree by, allow; `None` where nothing
/// was fitted.
pub(crate) fn linearised(tracks: &[Prepared], fit: &Fit, priors: &[Prior]) -> Option<Normal> {
    let problem = Problem::new(tracks, fit, priors);
    let parts = problem.parts(fit, &fit.coloured.unwrap_or_else(|| problem.noise(fit)));
    let mut normal = problem.beliefs(fit);
    parts.iter().for_each(|p| normal.add(&p.whitened, 1.0));
    let worth = left(&parts, &normal, &normal.solution()?).max(disagreement(&parts, &normal)?).max(1.0).recip();
    let mut scaled = problem.beliefs(fit);
    parts.iter().for_each(|p| scaled.add(&p.whitened, worth));
    Some(scaled)
}

/// What whitened samples are left, as a variance.
fn left(parts: &[Part], normal: &Normal, solution: &Solution) -> f64 {
    let count: usize = parts.iter().map(|p| p.whitened.count).sum();
    (normal.squares - normal.right.dot(&solution.step)) / count.max(1) as f64
}

/// Covariance of the unknowns, and by what factor the runs' variances have to be larger for the runs to agree.
///
/// The noise's part is multiplied by what whitened samples are left, and by the disagreement of the runs, where these are
/// more than 1; and each deviation is raised to what scores summed over blocks say, where that is more.
fn covariance(parts: &[Part], normal: &Normal) -> Option<(DMatrix<f64>, f64)> {
    let solution = normal.solution()?;
    let n = solution.step.len();
    let disagreement = disagreement(parts, normal)?;
    let plain =
        &solution.by_noise * (left(parts, normal, &solution).max(disagreement).max(1.0) - 1.0) + &solution.covariance;
    let mut meat = DMatrix::from_diagonal(&normal.believed);
    let blocks: usize = parts.iter().map(|p| p.whitened.blocks).sum();
    let finite = blocks as f64 / blocks.saturating_sub(n).max(1) as f64;
    for p in parts {
        meat += &p.whitened.meat * finite;
    }
    let sandwich = &solution.by_noise * meat * &solution.by_noise + &solution.covariance - &solution.by_noise;
    let raise = DVector::from_fn(n, |i, _| (sandwich[(i, i)] / plain[(i, i)].max(f64::MIN_POSITIVE)).max(1.0).sqrt());
    let mut covariance = DMatrix::from_fn(n, n, |i, j| plain[(i, j)] * raise[i] * raise[j]);
    contradicted_beliefs(&mut covariance, normal, &solution);
    Some((covariance, disagreement))
}

/// Where the runs and the ring-downs say different things of an unknown, and both have a share in its value, either may be
/// wrong: by as much as it is off the farther of the two it counts as uncertain, with all that moves along.
fn contradicted_beliefs(covariance: &mut DMatrix<f64>, normal: &Normal, solution: &Solution) {
    for i in normal.free() {
        let (variance, by_noise) = (covariance[(i, i)], solution.by_noise[(i, i)]);
        let off = normal.off_belief(i, &solution.step);
        let share = normal.believed[i] * by_noise;
        // runs that hardly have a say need more to contradict
        let rest = (1.0 - share).max(LEAST_SHARE);
        // (1 − share) of what a belief and runs, whose noise may be larger than it looks, differ by
        let expected = (rest * (rest + share * variance / by_noise) / normal.believed[i]).sqrt();
        if off.abs() > CONTRADICTION * expected && share > LEAST_SHARE {
            let farther = off * (share / rest).max(1.0);
            let along = covariance.column(i) * (farther / variance);
            covariance.ger(1.0, &along, &along, 1.0);
        }
    }
}

/// The ratio of Birge (1932): Σ over runs of what is left of their own scores, over its degrees of freedom; 1 where noise
/// alone could make it as large.
fn disagreement(parts: &[Part], normal: &Normal) -> Option<f64> {
    let solution = normal.solution()?;
    let free = normal.free();
    let scale: Vec<f64> = free.iter().map(|&i| solution.by_noise[(i, i)].max(0.0).sqrt()).collect();
    let (mut squares, mut directions) = (0.0, 0usize);
    for p in parts {
        let score = &p.whitened.right - &p.whitened.normal * &solution.step;
        let score = DVector::from_fn(free.len(), |i, _| score[free[i]] * scale[i]);
        let own = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            p.whitened.normal[(free[i], free[j])] * scale[i] * scale[j]
        });
        let eigen = own.symmetric_eigen();
        let along = eigen.eigenvectors.transpose() * score;
        for (told, score) in eigen.eigenvalues.iter().zip(along.iter()).filter(|(told, _)| **told > LEAST_SHARE) {
            squares += score * score / told;
            directions += 1;
        }
    }
    let freedom = directions.saturating_sub(free.len()).max(1) as f64;
    let agreed = squares <= freedom + DISAGREEMENT * (2.0 * freedom).sqrt();
    Some(if agreed { 1.0 } else { squares / freedom })
}
