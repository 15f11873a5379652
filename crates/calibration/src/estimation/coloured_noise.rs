//! What the noise of an angle remembers, and the filter that whitens it.
//!
//! An angle random walk, a table whose rate wanders and gains that wander are states that evolve beside the bias of a
//! segment. A Kalman filter predicts each sample from those before it; what it did not foresee, over its standard
//! deviation, is white. Run over the slopes of the unknowns as well as over the residual, the filter turns generalised
//! least squares into plain least squares (Harvey 1989, section 3.4), in one pass and without a stored sample.

use nalgebra::{DMatrix, DVector};

/// Memories of the processes whose sum wanders as 1/f: of the table's rate, and of a gain, s. Equal variances at memories
/// a decade apart stay within 1 dB of 1/f between them (Keshner 1982). The shortest is what a sample can still show of
/// it, the longest of the table's that of a run; of the gains' ten times that, which is how they differ between runs.
pub(crate) const TABLE_MEMORY_S: [f64; 3] = [0.3, 3.0, 30.0];
pub(crate) const GAIN_MEMORY_S: [f64; 5] = [0.03, 0.3, 3.0, 30.0, 300.0];
/// The bias of a segment before its first sample: variance over that of the white part.
const DIFFUSE: f64 = 1e10;
/// How fast commands that were not recorded precess a pattern steadily, rad/s: tan(θ_error)/τ for a force that is wrong by
/// 10 mrad at every angle and τ = 10 s.
pub(crate) const DRIFT_RAD_S: f64 = 1e-3;
/// Share by which intervals differ that are the same but for the rounding of their times.
const SAME_INTERVAL: f64 = 1e-9;
/// Samples of a block whose whitened scores are summed before they are squared.
const BLOCK: usize = 64;

/// How strong each kind of coloured noise is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ColouredNoise {
    /// intensity of the angle random walk, rad²/s
    pub(crate) walk: f64,
    /// variance of each process of the table's relative rate
    pub(crate) table: f64,
    /// variance of each process of the ratio of the readout's gains
    pub(crate) gains: f64,
}

/// What a filter has to know of its segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surroundings {
    /// standard deviation of the white part of the angle, rad
    pub(crate) white: f64,
    /// the drift that the residuals are counted from, rad/s, where commands were not recorded
    pub(crate) drift: Option<f64>,
}

/// One sample of a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation<'a> {
    /// time since the sample before, s; what is set aside counts
    pub(crate) interval_s: f64,
    /// change of the predicted angle with the ratio of the readout's gains, rad
    pub(crate) gain_slope: f64,
    /// nominal precession rate, rad/s
    pub(crate) precession_rad_s: f64,
    /// sine and cosine of twice the pattern angle
    pub(crate) twice: [f64; 2],
    /// change of the predicted angle with each unknown, and last what is left of the angle, rad
    pub(crate) columns: &'a [f64],
}

/// What a state does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// the bias, with its random walk
    Angle,
    /// a relative deviation of the table's rate
    Table,
    /// a steady drift of the pattern
    Drift,
    /// a relative deviation of the gains' ratio
    Gain,
}

#[derive(Debug, Clone, Copy)]
struct State {
    kind: Kind,
    memory_s: f64,
    /// before the first sample and, of what forgets, ever after; over the variance of the white part
    variance: f64,
}

/// What whitened samples add up to.
#[derive(Debug, Clone)]
pub(crate) struct Whitened {
    /// Σ slopes slopesᵀ, Σ slopes residual, Σ residual², all whitened
    pub(crate) normal: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
    pub(crate) squares: f64,
    /// Σ ln of the variance of what was not foreseen, over that of the white part
    pub(crate) ln_variance: f64,
    /// samples, less the one that the bias takes
    pub(crate) count: usize,
    /// Σ over blocks of the square of their summed scores
    pub(crate) meat: DMatrix<f64>,
    pub(crate) blocks: usize,
}

impl Whitened {
    pub(crate) fn none(n: usize) -> Self {
        Self {
            normal: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            squares: 0.0,
            ln_variance: 0.0,
            count: 0,
            meat: DMatrix::zeros(n, n),
            blocks: 0,
        }
    }
}

/// The filter of one segment.
pub(crate) struct Filter {
    n: usize,
    states: Vec<State>,
    /// where the gains begin
    gains: usize,
    surroundings: Surroundings,
    walk: f64,
    /// of the states, over the variance of the white part
    covariance: Vec<f64>,
    /// of the states, for each column, over the deviation of the white part
    means: Vec<f64>,
    // between samples
    couplings: Vec<f64>,
    kept: Vec<f64>,
    /// of every pair of states
    kept_together: Vec<f64>,
    kept_for_s: f64,
    seen: Vec<f64>,
    whitened: Vec<f64>,
    score: DVector<f64>,
    started: bool,
    sums: Whitened,
}

impl Filter {
    /// The filter of a segment for `n` unknowns.
    pub(crate) fn new(n: usize, noise: &ColouredNoise, surroundings: Surroundings) -> Self {
        let w2 = surroundings.white * surroundings.white;
        let lasting = |kind, deviation: f64| State { kind, memory_s: f64::INFINITY, variance: deviation.powi(2) / w2 };
        let mut states = vec![State { kind: Kind::Angle, memory_s: f64::INFINITY, variance: DIFFUSE }];
        if noise.table > 0.0 {
            let of = |memory_s| State { kind: Kind::Table, memory_s, variance: noise.table / w2 };
            states.extend(TABLE_MEMORY_S.map(of));
        }
        let drift = states.len();
        if surroundings.drift.is_some() {
            states.extend([lasting(Kind::Drift, DRIFT_RAD_S)]);
        }
        let gains = states.len();
        if noise.gains > 0.0 {
            let of = |memory_s| State { kind: Kind::Gain, memory_s, variance: noise.gains / w2 };
            states.extend(GAIN_MEMORY_S.map(of));
        }
        let (s, columns) = (states.len(), n + 1);
        let mut covariance = vec![0.0; s * s];
        for (i, state) in states.iter().enumerate() {
            covariance[i * s + i] = state.variance;
        }
        let mut means = vec![0.0; s * columns];
        if let Some(known) = surroundings.drift {
            // the belief is about the whole drift; the residuals are counted from what is known of it
            means[drift * columns + n] = -known / surroundings.white;
        }
        Self {
            n,
            gains,
            surroundings,
            walk: noise.walk / w2,
            covariance,
            means,
            couplings: vec![0.0; s],
            kept: vec![1.0; s],
            kept_together: vec![1.0; s * s],
            kept_for_s: 0.0,
            seen: vec![0.0; s],
            whitened: vec![0.0; columns],
            score: DVector::zeros(n),
            started: false,
            sums: Whitened::none(n),
            states,
        }
    }

    /// Takes the next sample in.
    pub(crate) fn take(&mut self, o: &Observation<'_>) {
        if self.started {
            self.propagate(o);
        }
        let variance = self.update(o);
        // the first sample is what the bias is counted from
        if self.started {
            self.count(variance);
        }
        self.started = true;
    }

    /// The states to the next sample.
    fn propagate(&mut self, o: &Observation<'_>) {
        let (s, columns) = (self.states.len(), self.n + 1);
        if (o.interval_s - self.kept_for_s).abs() > SAME_INTERVAL * o.interval_s {
            for (kept, state) in self.kept.iter_mut().zip(&self.states) {
                *kept = (-o.interval_s / state.memory_s).exp();
            }
            for (row, own) in self.kept_together.chunks_exact_mut(s).zip(&self.kept) {
                row.iter_mut().zip(&self.kept).for_each(|(together, other)| *together = own * other);
            }
            self.kept_for_s = o.interval_s;
        }
        for (coupling, state) in self.couplings.iter_mut().zip(&self.states) {
            *coupling = o.interval_s
                * match state.kind {
                    Kind::Table => o.precession_rad_s,
                    Kind::Drift => 1.0,
                    Kind::Angle | Kind::Gain => 0.0,
                };
        }
        // the rates turn the angle …
        for j in 1..self.gains {
            let (g, (angle, rates)) = (self.couplings[j], self.means.split_at_mut(columns));
            for (a, r) in angle.iter_mut().zip(&rates[(j - 1) * columns..]) {
                *a += g * r;
            }
            let (angle, rates) = self.covariance.split_at_mut(s);
            for (a, r) in angle.iter_mut().zip(&rates[(j - 1) * s..]) {
                *a += g * r;
            }
        }
        if self.gains > 1 {
            for row in self.covariance.chunks_exact_mut(s) {
                row[0] += row.iter().zip(&self.couplings).skip(1).map(|(p, g)| p * g).sum::<f64>();
            }
        }
        // … and forget
        for ((mean, keep), state) in self.means.chunks_exact_mut(columns).zip(&self.kept).zip(&self.states) {
            if state.memory_s.is_finite() {
                mean.iter_mut().for_each(|m| *m *= keep);
            }
        }
        for (p, kept) in self.covariance.iter_mut().zip(&self.kept_together) {
            *p *= kept;
        }
        for (i, (state, keep)) in self.states.iter().zip(&self.kept).enumerate() {
            self.covariance[i * s + i] += state.variance * (1.0 - keep * keep);
        }
        self.covariance[0] += self.walk * o.interval_s;
    }

    /// What the sample says that was not foreseen, over its deviation, into `whitened`; the states learn from it.
    fn update(&mut self, o: &Observation<'_>) -> f64 {
        let (s, columns) = (self.states.len(), self.n + 1);
        let slope = o.gain_slope;
        let mut variance = 1.0;
        for i in 0..s {
            let row = &self.covariance[i * s..(i + 1) * s];
            self.seen[i] = row[0] + slope * row[self.gains..].iter().sum::<f64>();
        }
        variance += self.seen[0] + slope * self.seen[self.gains..].iter().sum::<f64>();
        let per_white = self.surroundings.white.recip();
        for (e, v) in self.whitened.iter_mut().zip(o.columns) {
            *e = v * per_white;
        }
        for (i, m) in self.means.chunks_exact(columns).enumerate() {
            if i == 0 || i >= self.gains {
                let h = if i == 0 { 1.0 } else { slope };
                for (e, m) in self.whitened.iter_mut().zip(m) {
                    *e -= h * m;
                }
            }
        }
        for (i, m) in self.means.chunks_exact_mut(columns).enumerate() {
            let gain = self.seen[i] / variance;
            for (m, e) in m.iter_mut().zip(&self.whitened) {
                *m += gain * e;
            }
        }
        for (i, row) in self.covariance.chunks_exact_mut(s).enumerate() {
            let gain = self.seen[i] / variance;
            for (p, seen) in row.iter_mut().zip(&self.seen) {
                *p -= gain * seen;
            }
        }
        let per_deviation = variance.sqrt().recip();
        for e in &mut self.whitened {
            *e *= per_deviation;
        }
        variance
    }

    fn count(&mut self, variance: f64) {
        let n = self.n;
        let sums = &mut self.sums;
        sums.ln_variance += variance.ln();
        sums.count += 1;
        let (slopes, left) = (&self.whitened[..n], self.whitened[n]);
        for (j, column) in sums.normal.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
            for (sum, slope) in column[j..].iter_mut().zip(&slopes[j..]) {
                *sum += slopes[j] * slope;
            }
            sums.right[j] += slopes[j] * left;
            self.score[j] += slopes[j] * left;
        }
        sums.squares += left * left;
        if sums.count.is_multiple_of(BLOCK) {
            sums.meat.ger(1.0, &self.score, &self.score, 1.0);
            sums.blocks += 1;
            self.score.fill(0.0);
        }
    }

    /// What the samples add up to, and the drift that they show per column, rad/s, where there is one.
    pub(crate) fn finish(mut self) -> (Whitened, Option<Vec<f64>>) {
        self.sums.normal.fill_upper_triangle_with_lower_triangle();
        let columns = self.n + 1;
        let drift = self.states.iter().position(|s| s.kind == Kind::Drift).map(|i| {
            let white = self.surroundings.white;
            self.means[i * columns..(i + 1) * columns].iter().map(|m| m * white).collect()
        });
        (self.sums, drift)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::{ColouredNoise, DRIFT_RAD_S, Filter, GAIN_MEMORY_S, Observation, Surroundings, TABLE_MEMORY_S};
    use nalgebra::{DMatrix, DVector};

    /// A segment of uneven samples: times, slopes of the gains, rates, and two unknowns' slopes with a residual.
    struct Segment {
        t_s: Vec<f64>,
        gain: Vec<f64>,
        rate: Vec<f64>,
        columns: Vec<[f64; 3]>,
    }

    fn segment() -> Segment {
        let mut t_s = Vec::new();
        let mut t = 0.0;
        for i in 0..80 {
            t += if i % 7 == 3 { 0.05 } else { 0.02 };
            t_s.push(t);
        }
        let of = |f: &dyn Fn(f64) -> f64| t_s.iter().map(|t| f(*t)).collect::<Vec<_>>();
        let columns = t_s.iter().map(|t| [2.0 * t, (5.0 * t).sin(), 1e-4 * (37.0 * t * t).sin()]).collect();
        Segment { gain: of(&|t| 0.5 * (4.0 * t).sin()), rate: of(&|t| 3.0 + t), columns, t_s }
    }

    /// Covariance of a segment's noise, sample by sample, as the sum of what each process does.
    fn dense(s: &Segment, noise: &ColouredNoise, at: Surroundings) -> DMatrix<f64> {
        let n = s.t_s.len();
        let correlation = |i: usize, j: usize, memory: f64| (-(s.t_s[i] - s.t_s[j]).abs() / memory).exp();
        let mut v = DMatrix::from_fn(n, n, |i, j| {
            let white = if i == j { at.white * at.white } else { 0.0 };
            let gains: f64 = GAIN_MEMORY_S.iter().map(|m| correlation(i, j, *m)).sum();
            let walk = noise.walk * (s.t_s[i.min(j)] - s.t_s[0]);
            white + walk + noise.gains * gains * s.gain[i] * s.gain[j]
        });
        // the angle takes rate · interval of what each process of the table was a sample before
        let turned =
            DMatrix::from_fn(n, n - 1, |i, l| if l < i { (s.t_s[l + 1] - s.t_s[l]) * s.rate[l + 1] } else { 0.0 });
        for memory in TABLE_MEMORY_S {
            let process = DMatrix::from_fn(n - 1, n - 1, |i, j| noise.table * correlation(i, j, memory));
            v += &turned * process * turned.transpose();
        }
        if at.drift.is_some() {
            v += DMatrix::from_fn(n, n, |i, j| DRIFT_RAD_S.powi(2) * (s.t_s[i] - s.t_s[0]) * (s.t_s[j] - s.t_s[0]));
        }
        v
    }

    fn filtered(s: &Segment, noise: &ColouredNoise, at: Surroundings) -> Filter {
        let mut filter = Filter::new(2, noise, at);
        for i in 0..s.t_s.len() {
            filter.take(&Observation {
                interval_s: if i == 0 { 0.0 } else { s.t_s[i] - s.t_s[i - 1] },
                gain_slope: s.gain[i],
                precession_rad_s: s.rate[i],
                twice: [0.0, 0.0],
                columns: &s.columns[i],
            });
        }
        filter
    }

    /// Generalised least squares with the whole covariance matrix, the bias as one more unknown.
    fn compare(noise: &ColouredNoise, at: Surroundings) {
        let s = segment();
        let n = s.t_s.len();
        let weight = dense(&s, noise, at).try_inverse().unwrap();
        let x = DMatrix::from_fn(n, 3, |i, j| if j == 0 { 1.0 } else { s.columns[i][j - 1] });
        let y = DVector::from_fn(n, |i, _| s.columns[i][2] + at.drift.unwrap_or(0.0) * (s.t_s[i] - s.t_s[0]));
        let covariance = (x.transpose() * &weight * &x).try_inverse().unwrap();
        let expected = &covariance * x.transpose() * weight * y;
        let (whitened, _) = filtered(&s, noise, at).finish();
        let own = whitened.normal.clone().try_inverse().unwrap();
        let estimate = &own * &whitened.right;
        for i in 0..2 {
            let deviation = covariance[(i + 1, i + 1)].sqrt();
            assert!((estimate[i] - expected[i + 1]).abs() < 1e-4 * deviation, "{noise:?}: {estimate} {expected}");
            for j in 0..2 {
                let off = own[(i, j)] - covariance[(i + 1, j + 1)];
                assert!(off.abs() < 1e-4 * deviation * covariance[(j + 1, j + 1)].sqrt(), "{noise:?}: {own}");
            }
        }
    }

    const STILL: Surroundings = Surroundings { white: 1e-5, drift: None };

    #[test]
    fn whitened_samples_say_what_the_whole_covariance_matrix_says() {
        let none = ColouredNoise::default();
        compare(&none, STILL);
        compare(&ColouredNoise { walk: 1e-9, ..none }, STILL);
        compare(&ColouredNoise { table: 1e-8, ..none }, STILL);
        compare(&ColouredNoise { gains: 1e-8, ..none }, STILL);
        compare(&ColouredNoise { walk: 3e-10, table: 1e-9, gains: 1e-8 }, STILL);
    }

    #[test]
    fn a_drift_is_believed_to_be_small_as_a_whole_and_not_from_where_it_is_known() {
        // the residuals are counted from half the drift's deviation; to the unknowns it must not matter
        let s = segment();
        let noise = ColouredNoise { walk: 1e-10, ..ColouredNoise::default() };
        let from = |known: f64| {
            let mut moved = segment();
            for (c, t) in moved.columns.iter_mut().zip(&s.t_s) {
                c[2] -= known * (t - s.t_s[0]);
            }
            filtered(&moved, &noise, Surroundings { drift: Some(known), ..STILL }).finish()
        };
        let [(zero, drift), (half, rest)] = [0.0, 0.5 * DRIFT_RAD_S].map(from);
        let estimate = |w: &super::Whitened| w.normal.clone().try_inverse().unwrap() * &w.right;
        assert!((estimate(&zero) - estimate(&half)).norm() < 1e-6 * estimate(&zero).norm());
        let (drift, rest) = (drift.unwrap(), rest.unwrap());
        assert!((drift[2] - rest[2] - 0.5 * DRIFT_RAD_S).abs() < 1e-6 * DRIFT_RAD_S);
    }
}
