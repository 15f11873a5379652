//! The joint fit of a hypothesis to all runs: Gauss–Newton on robustly weighted residuals, one bias per segment.
//!
//! Residuals are those of [`crate::estimation::propagation`]; the biases are eliminated in closed form ([`crate::estimation::sums`]), so that the system
//! to solve has only the unknowns of the instrument. Weak, stated priors keep what the data cannot tell at its neutral value; how
//! much narrower than its prior an unknown became is how much the data told of it.

use cvg_model::effects::{Role as ParameterRole, Stage};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::data::track::{LARGEST_TURN, Segment, Track};
use crate::estimation::coloured_noise::{ColouredNoise, DRIFT_RAD_S};
use crate::estimation::propagation::{Start, Stepping, propagate};
use crate::estimation::sums::{Own, Sums};
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::model::unknowns::Unknowns;
use crate::recording::Role;

/// A Gaussian belief about an unknown before the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    /// the unknown
    pub(crate) unknown: Unknown,
    /// centre
    pub(crate) mean: f64,
    /// standard deviation
    pub(crate) deviation: f64,
    /// hold the unknown where it is, and let its uncertainty show in all that depends on it (a consider parameter)
    pub(crate) considered: bool,
}

/// Standard deviations of its prior beyond which the value of a parameter is not believed: one in 16,000 by chance.
pub(crate) const BEYOND_BELIEF: f64 = 4.0;

impl Prior {
    /// Whether a fit moved a parameter of the drives further than is believed, as it does for want of an effect that is not in
    /// the model: the drives multiply all that the commands do.
    pub(crate) fn is_exceeded(&self, hypothesis: &Hypothesis) -> bool {
        let off = (hypothesis.get(self.unknown) - self.mean).abs();
        let of_the_drives = |member: usize| hypothesis.members[member].id.description().stage == Stage::Actuation;
        !self.considered
            && matches!(self.unknown, Unknown::Effect(member, _) if of_the_drives(member))
            && off > BEYOND_BELIEF * self.deviation
    }

    /// The deviation of `unknown`, if these priors hold it as a considered one.
    pub(crate) fn considered_deviation(priors: &[Self], unknown: Unknown) -> Option<f64> {
        priors.iter().find(|p| p.considered && p.unknown == unknown).map(|p| p.deviation)
    }
}

/// Standard deviations of the residuals of one track: the scale of its weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// angle, rad
    pub(crate) angle: f64,
    /// ln amplitude; infinite where the amplitude is not used
    pub(crate) amplitude: f64,
}

/// One track with what a fit needs besides: its noise and where its segments start.
#[derive(Debug)]
pub(crate) struct Prepared {
    pub(crate) track: Track,
    /// scale of the residuals, the weights of the fit
    pub(crate) noise: Noise,
    /// the part of them that is white
    pub(crate) white: Noise,
    pub(crate) starts: Vec<Start>,
    /// what precesses the pattern was not all recorded, commands and quadrature: every segment may drift
    pub(crate) drifts: bool,
    /// residuals beyond this many rad (angle) or relative (amplitude) are set aside
    pub(crate) limit: Noise,
}

/// The result of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) unknowns: Vec<Unknown>,
    /// covariance of the unknowns if the residuals are white
    pub(crate) covariance: DMatrix<f64>,
    /// the part of it that the residuals' noise makes; the rest is what considered unknowns could be
    pub(crate) by_noise: DMatrix<f64>,
    /// what its residuals remember, after the last step
    pub(crate) coloured: Option<ColouredNoise>,
    /// starts of the segments, per track
    pub(crate) starts: Vec<Vec<Start>>,
    /// Σ(r/σ)² over angle residuals, and over amplitude residuals, before the last step
    pub(crate) chi2: [f64; 2],
    /// Σ of squared distances from the priors
    pub(crate) prior_chi2: f64,
    /// what the last step takes off their sum, to first order
    pub(crate) step_gain: f64,
    /// residuals counted in each
    pub(crate) counted: [usize; 2],
    /// samples of each track that are set aside as spikes
    pub(crate) set_aside: Vec<usize>,
}

impl Fit {
    /// Σ(r/σ)² after the last step, with the squared distances from the priors.
    pub(crate) fn left(&self) -> f64 {
        (self.chi2[0] + self.chi2[1] + self.prior_chi2 - self.step_gain).max(0.0)
    }
}

/// How a fit is run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// most Gauss–Newton steps
    pub(crate) steps: usize,
    /// samples to which a track is thinned while converging
    pub(crate) thinned: usize,
    /// a last step on all samples
    pub(crate) polish: bool,
}

impl Effort {
    pub(crate) const FULL: Self = Self { steps: 14, thinned: 6_000, polish: true };
    pub(crate) const ROUGH: Self = Self { polish: false, ..Self::FULL };
}

/// More than this share of the samples cannot be spikes.
const LARGEST_SET_ASIDE: f64 = 0.2;
/// Limits of spikes are not widened beyond this factor.
const WIDEST: f64 = 1e6;
/// A step is the last when after it no unknown is wrong by more than this share of its standard deviation.
const CONVERGED: f64 = 0.02;
/// A step that moves the angle by δ rad misses by less than this times δ, as a share of itself.
const BEND: f64 = 10.0;

/// Fits `hypothesis` to the segments of `role` of all tracks.
pub(crate) fn fit(
    tracks: &[Prepared],
    hypothesis: &Hypothesis,
    unknowns: &[Unknown],
    priors: &[Prior],
    role: Role,
    effort: Effort,
) -> Fit {
    let sorted = Unknowns::new(hypothesis, unknowns.to_vec());
    let n = unknowns.len();
    let mut result = at_rest(tracks, hypothesis, unknowns);
    let considered: Vec<Option<f64>> = unknowns.iter().map(|u| Prior::considered_deviation(priors, *u)).collect();
    let (mut widened, mut damping, mut polishing) = (1.0, 0.0, false);
    let mut best: Option<Linearised> = None;
    let mut step_number = 0;
    while step_number < effort.steps {
        let stride = |p: &Prepared| {
            let samples = p.track.samples(role);
            if polishing { 1 } else { thinning(&p.track, &result.hypothesis, samples, effort.thinned) }
        };
        let every_sample = tracks.iter().all(|p| stride(p) == 1);
        let sums: Vec<Vec<Sums>> = tracks
            .par_iter()
            .zip(&result.starts)
            .map(|(p, starts)| collect(p, starts, &result.hypothesis, &sorted, role, (stride(p), widened)))
            .collect();
        let here = Linearised::new(&result, sums, priors, n);
        let set_aside: usize = here.set_aside.iter().sum();
        let far_off = set_aside as f64 > LARGEST_SET_ASIDE * (set_aside + here.counted[0]) as f64;
        if far_off && best.is_none() && widened < WIDEST {
            // Not spikes but a hypothesis that does not fit yet: look at more of the data.
            widened *= 4.0;
            continue;
        }
        step_number += 1;
        // Levenberg and Marquardt: a step that made things worse is taken back and shortened.
        let worse = far_off || best.as_ref().is_some_and(|b| here.mean_square() > b.mean_square() * (1.0 + 1e-9));
        let taken_back = worse && !polishing;
        let (from, last) = match (taken_back, best.take()) {
            (true, Some(b)) => {
                damping = (damping * 10.0f64).max(1e-3);
                result.hypothesis = b.hypothesis.clone();
                result.starts.clone_from(&b.starts);
                (b, false)
            }
            _ => {
                damping = if damping > 1e-6 { 0.1 * damping } else { 0.0 };
                (here, polishing)
            }
        };
        let Some(Solution { step, by_noise, covariance }) = solve(&from.normal, &from.right, damping, &considered)
        else {
            break;
        };
        from.apply(&step, &mut result);
        if damping == 0.0 || result.covariance.iter().all(|v| *v == 0.0) {
            (result.covariance, result.by_noise) = (covariance, by_noise);
        }
        let deviation = |i: usize| result.covariance[(i, i)].max(0.0).sqrt();
        // what the step moves or, of unknowns that bend the residuals little, leaves
        let left = |i: usize| {
            let bent = if is_straight(&from.hypothesis, unknowns[i]) { BEND * from.moved(i, step[i]) } else { 1.0 };
            step[i].abs() * bent.min(1.0)
        };
        let small = (0..n).all(|i| left(i) <= CONVERGED * deviation(i) + f64::MIN_POSITIVE);
        best = Some(from);
        if last {
            break;
        }
        // what is taken back and shortened to nothing has no better value near: spikes at their limit come and go
        if (small && (damping == 0.0 || taken_back)) || step_number + 1 >= effort.steps {
            if !effort.polish || (small && every_sample) {
                break;
            }
            // the last step looks at all samples, and must not be compared with those that did not
            polishing = true;
            damping = 0.0;
            best = None;
        }
    }
    result
}

/// A fit before its first step.
pub(crate) fn at_rest(tracks: &[Prepared], hypothesis: &Hypothesis, unknowns: &[Unknown]) -> Fit {
    let n = unknowns.len();
    Fit {
        hypothesis: hypothesis.clone(),
        unknowns: unknowns.to_vec(),
        covariance: DMatrix::zeros(n, n),
        by_noise: DMatrix::zeros(n, n),
        coloured: None,
        starts: tracks.iter().map(|t| t.starts.clone()).collect(),
        chi2: [0.0; 2],
        prior_chi2: 0.0,
        step_gain: 0.0,
        counted: [0; 2],
        set_aside: vec![0; tracks.len()],
    }
}

/// A change of this unknown bends the residuals as little as the angle that it moves: with it by δ rad, by some δ².
fn is_straight(hypothesis: &Hypothesis, unknown: Unknown) -> bool {
    match unknown {
        Unknown::AngularGain | Unknown::Damping => true,
        // the drive's unknowns multiply one another
        Unknown::ForceScale | Unknown::ControlLatency => false,
        Unknown::Effect(i, _) => {
            let d = hypothesis.members[i].id.description();
            // and so do a frequency and its line; an onset has a corner
            let located = d.parameters.iter().any(|p| matches!(p.role, ParameterRole::Located(_)));
            d.stage != Stage::Actuation && d.onsets.is_empty() && !located
        }
    }
}

/// The least-squares problem around one hypothesis.
pub(super) struct Linearised {
    hypothesis: Hypothesis,
    starts: Vec<Vec<Start>>,
    sums: Vec<Vec<Sums>>,
    pub(super) normal: DMatrix<f64>,
    pub(super) right: DVector<f64>,
    chi2: [f64; 2],
    prior_chi2: f64,
    counted: [usize; 2],
    set_aside: Vec<usize>,
}

impl Linearised {
    pub(super) fn new(at: &Fit, sums: Vec<Vec<Sums>>, priors: &[Prior], n: usize) -> Self {
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut chi2, mut prior_chi2, mut counted) = ([0.0; 2], 0.0, [0; 2]);
        let set_aside = sums.iter().map(|track| track.iter().map(|s| s.set_aside).sum()).collect();
        for s in sums.iter().flatten() {
            chi2[0] += s.eliminate(&s.angle, &mut normal, &mut right);
            chi2[1] += s.eliminate(&s.amplitude, &mut normal, &mut right);
            counted[0] += s.counted[0];
            counted[1] += s.counted[1];
        }
        for p in priors {
            if let Some(i) = at.unknowns.iter().position(|u| *u == p.unknown) {
                let w = 1.0 / (p.deviation * p.deviation);
                let off = p.mean - at.hypothesis.get(p.unknown);
                normal[(i, i)] += w;
                right[i] += w * off;
                prior_chi2 += w * off * off;
            }
        }
        let (hypothesis, starts) = (at.hypothesis.clone(), at.starts.clone());
        Self { hypothesis, starts, sums, normal, right, chi2, prior_chi2, counted, set_aside }
    }

    /// rms of the angle (and of ln a, where that is fitted) that a step of one unknown moves, rad.
    fn moved(&self, unknown: usize, step: f64) -> f64 {
        let weight: f64 = self.sums.iter().flatten().map(|s| s.angle[0] + s.amplitude[0]).sum();
        step.abs() * (self.normal[(unknown, unknown)] / weight.max(f64::MIN_POSITIVE)).sqrt()
    }

    pub(super) fn mean_square(&self) -> f64 {
        (self.chi2[0] + self.chi2[1] + self.prior_chi2) / self.samples().max(1.0)
    }

    /// Residuals that are counted.
    pub(super) fn samples(&self) -> f64 {
        (self.counted[0] + self.counted[1]) as f64
    }

    /// Moves `result` from here by `step`, biases and all.
    fn apply(&self, step: &DVector<f64>, result: &mut Fit) {
        (result.chi2, result.prior_chi2) = (self.chi2, self.prior_chi2);
        (result.counted, result.set_aside) = (self.counted, self.set_aside.clone());
        result.step_gain = self.right.dot(step);
        for (i, u) in result.unknowns.iter().enumerate() {
            let value = self.hypothesis.get(*u) + step[i];
            result.hypothesis.set(*u, value);
        }
        for ((sums, from), to) in self.sums.iter().zip(&self.starts).zip(&mut result.starts) {
            for ((s, from), to) in sums.iter().zip(from).zip(to) {
                let shift = s.start_shift(&s.angle, step);
                to.angle = from.angle + shift[0];
                to.drift = from.drift + shift[1];
                to.amplitude = from.amplitude + s.start_shift(&s.amplitude, step)[0];
            }
        }
    }
}

/// By how much a track is thinned where `enough` of `samples` will do, as far as the pattern turns little between them.
pub(crate) fn thinning(track: &Track, hypothesis: &Hypothesis, samples: usize, enough: usize) -> usize {
    (samples / enough).min(track.resolved(LARGEST_TURN, hypothesis.precession(track.mean_speed()))).max(1)
}

/// Sums of all segments of a track; those of another role stay empty, so that the order of segments is kept.
pub(super) fn collect(
    prepared: &Prepared,
    starts: &[Start],
    hypothesis: &Hypothesis,
    unknowns: &Unknowns,
    role: Role,
    thinned: (usize, f64),
) -> Vec<Sums> {
    collect_folds(prepared, starts, hypothesis, unknowns, role, thinned, 1).into_iter().flatten().collect()
}

/// [`collect`], with every segment cut into `folds` stretches of equally many samples.
pub(super) fn collect_folds(
    prepared: &Prepared,
    starts: &[Start],
    hypothesis: &Hypothesis,
    unknowns: &Unknowns,
    role: Role,
    (stride, widened): (usize, f64),
    folds: usize,
) -> Vec<Vec<Sums>> {
    let Prepared { track, noise, .. } = prepared;
    let limit = Noise { angle: widened * prepared.limit.angle, amplitude: widened * prepared.limit.amplitude };
    let weights = [noise.angle.powi(-2), noise.amplitude.powi(-2)].map(|w| w * stride as f64);
    track
        .segments
        .iter()
        .zip(starts)
        .map(|(segment, start)| {
            let own = own(prepared, segment, hypothesis, unknowns);
            let mut sums: Vec<Sums> = (0..folds).map(|_| Sums::new(unknowns.all.len(), *start, own)).collect();
            let mut slopes = vec![0.0; unknowns.all.len()];
            let first = track.t_s[segment.range.start];
            if segment.role == role {
                let stepping = Stepping { stride, spike: limit.angle };
                propagate(track, segment, hypothesis, unknowns, *start, stepping, |row| {
                    let sums = &mut sums[(row.index - segment.range.start) * folds / segment.range.len()];
                    if row.angle.abs() <= limit.angle && (weights[1] == 0.0 || row.amplitude.abs() <= limit.amplitude) {
                        let time = track.t_s[row.index] - first;
                        slopes.copy_from_slice(row.angle_slopes);
                        own.reduce(time, &mut slopes);
                        Sums::add(&mut sums.angle, weights[0], time, &slopes, row.angle);
                        sums.counted[0] += stride;
                        if weights[1] > 0.0 {
                            Sums::add(&mut sums.amplitude, weights[1], time, row.amplitude_slopes, row.amplitude);
                            sums.counted[1] += stride;
                        }
                    } else {
                        sums.set_aside += stride;
                    }
                });
            }
            sums
        })
        .collect()
}

/// What belongs to a segment alone.
fn own(prepared: &Prepared, segment: &Segment, hypothesis: &Hypothesis, unknowns: &Unknowns) -> Own {
    let (track, last) = (&prepared.track, segment.range.end - 1);
    let turned = track.input_rad[last] - track.input_rad[segment.range.start];
    let lasted = (track.t_s[last] - track.t_s[segment.range.start]).max(f64::MIN_POSITIVE);
    let along = unknowns.angular_gain.map(|k| (k, hypothesis.sense() * turned / lasted));
    Own::new(if prepared.drifts { DRIFT_RAD_S } else { 0.0 }, along)
}

/// A step of the unknowns and its covariance: all of it, and the part that the residuals' noise makes.
pub(crate) struct Solution {
    pub(crate) step: DVector<f64>,
    pub(crate) by_noise: DMatrix<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

/// Solves a fit's normal equations after scaling them to a unit diagonal and adding `damping` to that. Considered
/// unknowns, those with a deviation, do not move; what they could be shows in the covariance.
pub(crate) fn solve(
    normal: &DMatrix<f64>,
    right: &DVector<f64>,
    damping: f64,
    considered: &[Option<f64>],
) -> Option<Solution> {
    let n = right.len();
    let free: Vec<usize> = (0..n).filter(|&i| considered[i].is_none()).collect();
    let held: Vec<(usize, f64)> = (0..n).filter_map(|i| considered[i].map(|d| (i, d))).collect();
    let inverse = scaled_inverse(&normal.select_rows(&free).select_columns(&free), damping)?;
    let (mut step, mut by_noise) = (DVector::zeros(n), DMatrix::zeros(n, n));
    let moved = &inverse * right.select_rows(&free);
    for (a, &i) in free.iter().enumerate() {
        step[i] = moved[a];
        for (b, &j) in free.iter().enumerate() {
            by_noise[(i, j)] = inverse[(a, b)];
        }
    }
    let mut covariance = by_noise.clone();
    for &(c, deviation) in &held {
        // a unit of the held unknown moves the free ones by −N⁻¹ n_c
        let mut sensitivity = DVector::zeros(n);
        let moved = -(&inverse * normal.column(c).select_rows(&free));
        for (a, &i) in free.iter().enumerate() {
            sensitivity[i] = moved[a];
        }
        sensitivity[c] = 1.0;
        covariance.ger(deviation * deviation, &sensitivity, &sensitivity, 1.0);
    }
    step.iter().all(|s| s.is_finite()).then_some(Solution { step, by_noise, covariance })
}

/// The inverse of a symmetric positive semidefinite matrix; directions without information carry a large variance
/// instead of an infinite one.
pub(crate) fn scaled_inverse(normal: &DMatrix<f64>, damping: f64) -> Option<DMatrix<f64>> {
    let n = normal.nrows();
    if n == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    let scale = DVector::from_iterator(
        n,
        (0..n).map(|i| if normal[(i, i)] > 0.0 { normal[(i, i)].sqrt().recip() } else { 1.0 }),
    );
    let eigen = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]).symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let floor = largest * 1e-13;
    let weights = eigen.eigenvalues.map(|l| 1.0 / (l.max(floor) + damping));
    let inverse = &eigen.eigenvectors * DMatrix::from_diagonal(&weights) * eigen.eigenvectors.transpose();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Length of a block of the block covariance in samples: longer than what the noise remembers.
const BLOCK: usize = 64;

/// Covariance of a fit's unknowns that allows for autocorrelated residuals: scores summed over blocks of neighbouring
/// samples (a cluster-robust sandwich). What considered unknowns could be is added as it is: no residual speaks of them.
pub(crate) fn block_covariance(tracks: &[Prepared], fit: &Fit, role: Role) -> DMatrix<f64> {
    let n = fit.unknowns.len();
    let sorted = Unknowns::new(&fit.hypothesis, fit.unknowns.clone());
    let meats: Vec<(DMatrix<f64>, usize)> = tracks
        .par_iter()
        .zip(&fit.starts)
        .map(|(prepared, starts)| {
            let mut meat = DMatrix::zeros(n, n);
            let mut blocks = 0;
            for (segment, start) in prepared.track.segments.iter().zip(starts).filter(|(s, _)| s.role == role) {
                let own = own(prepared, segment, &fit.hypothesis, &sorted);
                let mut angle = Scores::new(n, own);
                let mut amplitude = Scores::new(n, Own::new(0.0, None));
                let first = prepared.track.t_s[segment.range.start];
                let stepping = Stepping::without(prepared.limit.angle);
                propagate(&prepared.track, segment, &fit.hypothesis, &sorted, *start, stepping, |row| {
                    if row.angle.abs() <= prepared.limit.angle {
                        let time = prepared.track.t_s[row.index] - first;
                        angle.add(prepared.noise.angle.powi(-2), time, row.angle, row.angle_slopes);
                        amplitude.add(prepared.noise.amplitude.powi(-2), time, row.amplitude, row.amplitude_slopes);
                    }
                });
                blocks += angle.blocks.len();
                for (a, b) in angle.centred().iter().zip(&amplitude.centred()) {
                    let score = a + b;
                    meat.ger(1.0, &score, &score, 1.0);
                }
            }
            (meat, blocks)
        })
        .collect();
    let blocks: usize = meats.iter().map(|m| m.1).sum();
    let meat = meats.into_iter().fold(DMatrix::zeros(n, n), |sum, m| sum + m.0);
    let finite = blocks as f64 / (blocks.saturating_sub(n)).max(1) as f64;
    &fit.by_noise * meat * &fit.by_noise * finite + &fit.covariance - &fit.by_noise
}

/// Scores w·r·slopes of one segment, block by block.
struct Scores {
    own: Own,
    /// Σ w r, Σ w t r, and Σ w r s per unknown
    blocks: Vec<([f64; 2], DVector<f64>)>,
    in_block: usize,
    /// Σ w, Σ w t, Σ w t²
    weight: [f64; 3],
    /// Σ w s and Σ w t s per unknown
    slopes: [DVector<f64>; 2],
    reduced: Vec<f64>,
}

impl Scores {
    fn new(n: usize, own: Own) -> Self {
        let slopes = [DVector::zeros(n), DVector::zeros(n)];
        Self { own, blocks: Vec::new(), in_block: BLOCK, weight: [0.0; 3], slopes, reduced: vec![0.0; n] }
    }

    fn add(&mut self, weight: f64, time: f64, residual: f64, slopes: &[f64]) {
        if self.in_block == BLOCK {
            self.blocks.push(([0.0; 2], DVector::zeros(slopes.len())));
            self.in_block = 0;
        }
        self.in_block += 1;
        self.reduced.copy_from_slice(slopes);
        self.own.reduce(time, &mut self.reduced);
        if let Some((rest, score)) = self.blocks.last_mut() {
            rest[0] += weight * residual;
            rest[1] += weight * time * residual;
            for (i, s) in self.reduced.iter().enumerate() {
                score[i] += weight * residual * s;
                self.slopes[0][i] += weight * s;
                self.slopes[1][i] += weight * time * s;
            }
        }
        for (sum, power) in self.weight.iter_mut().zip([1.0, time, time * time]) {
            *sum += weight * power;
        }
    }

    /// The scores with the segment's bias and drift eliminated, as the fit eliminates them.
    fn centred(&self) -> Vec<DVector<f64>> {
        let Some(inverse) = self.own.inverse(self.weight) else {
            return self.blocks.iter().map(|(_, score)| score.clone()).collect();
        };
        let n = self.reduced.len();
        let of = |i: usize| inverse * self.own.products(i, self.slopes[0][i], self.slopes[1][i]);
        let own: Vec<_> = (0..n).map(of).collect();
        let centre = |([rest, timed], score): &([f64; 2], DVector<f64>)| {
            DVector::from_fn(n, |i, _| score[i] - own[i][0] * rest - own[i][1] * timed)
        };
        self.blocks.iter().map(centre).collect()
    }
}
