//! The normal equations of one segment, and what belongs to the segment alone eliminated from them: its bias, and where
//! commands were not recorded a drift of its own.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::estimation::propagation::Start;

/// What belongs to a segment alone: its bias, and a drift that is believed to be small.
///
/// At a steady rate the slope of the angular gain is the time times that rate, which the drift has as well: what is left of
/// one beside the other is what is believed of the drift, 1e-13 of either and below what a difference of their sums
/// resolves. So it is taken out of the slope sample by sample, and goes with the drift in what is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Own {
    /// 1/variance of the drift before the data, s²/rad²; infinite where there is none
    drift: f64,
    /// column of the unknown whose slope goes with the time, and the part of it that does, rad/s
    along: Option<(usize, f64)>,
}

impl Own {
    /// A bias, and a drift of this standard deviation, rad/s, beside which `along` says what goes with the time.
    pub(crate) fn new(drift_deviation: f64, along: Option<(usize, f64)>) -> Self {
        Self { drift: drift_deviation.powi(-2), along: along.filter(|_| drift_deviation > 0.0) }
    }

    /// Takes out of the slopes what goes with the time.
    pub(crate) fn reduce(&self, time: f64, slopes: &mut [f64]) {
        if let Some((column, per_s)) = self.along {
            slopes[column] -= per_s * time;
        }
    }

    /// What an unknown adds to the drift, rad/s per unit of it.
    pub(crate) fn per_s(&self, unknown: usize) -> f64 {
        self.along.filter(|a| a.0 == unknown).map_or(0.0, |a| a.1)
    }

    /// Inverse of the block of bias and drift, from Σ w, Σ w t and Σ w t².
    pub(crate) fn inverse(&self, [w, wt, wtt]: [f64; 3]) -> Option<Matrix2<f64>> {
        if w <= 0.0 {
            return None;
        }
        if self.drift.is_infinite() {
            return Some(Matrix2::new(1.0 / w, 0.0, 0.0, 0.0));
        }
        Matrix2::new(w, wt, wt, wtt + self.drift).try_inverse()
    }

    /// Products of an unknown's reduced slope with the two columns, Σ w s and Σ w t s, with what is believed.
    pub(crate) fn products(&self, unknown: usize, ws: f64, wts: f64) -> Vector2<f64> {
        let believed = if self.drift.is_infinite() { 0.0 } else { self.drift * self.per_s(unknown) };
        Vector2::new(ws, wts - believed)
    }
}

/// Weighted sums of one segment: Σ w v vᵀ with v = (1, time, slopes …, residual), for angle and amplitude apart. Slopes are
/// reduced as [`Own`] says.
#[derive(Clone)]
pub(crate) struct Sums {
    n: usize,
    pub(crate) angle: Vec<f64>,
    pub(crate) amplitude: Vec<f64>,
    pub(crate) counted: [usize; 2],
    pub(crate) set_aside: usize,
    own: Own,
    start: Start,
}

/// Weighted residuals of one segment against its bias and its slope in time.
pub(crate) struct Left {
    /// Σ w (1, t)ᵀ(1, t)
    pub(crate) own: Matrix2<f64>,
    /// Σ w r (1, t)
    pub(crate) products: Vector2<f64>,
    /// Σ w r²
    pub(crate) squares: f64,
}

impl Sums {
    /// Empty sums for `n` unknowns on a segment that starts at `start`.
    pub(crate) fn new(n: usize, start: Start, own: Own) -> Self {
        let size = (n + 3) * (n + 4) / 2;
        Self { n, angle: vec![0.0; size], amplitude: vec![0.0; size], counted: [0; 2], set_aside: 0, own, start }
    }

    /// The sums of several stretches of a segment; none of no stretch.
    pub(crate) fn total<'a>(parts: impl Iterator<Item = &'a Self>) -> Option<Self> {
        parts.fold(None, |total: Option<Self>, part| {
            let Some(mut total) = total else { return Some(part.clone()) };
            let both = |into: &mut [f64], from: &[f64]| into.iter_mut().zip(from).for_each(|(a, b)| *a += b);
            both(&mut total.angle, &part.angle);
            both(&mut total.amplitude, &part.amplitude);
            total.counted = std::array::from_fn(|i| total.counted[i] + part.counted[i]);
            total.set_aside += part.set_aside;
            Some(total)
        })
    }

    /// What a step of the unknowns would leave of the angle, to first order, before its bias and its slope are taken out.
    pub(crate) fn after(&self, step: &DVector<f64>) -> Left {
        let n = self.n;
        // the slope that was reduced goes with the time
        let timed = -(0..n).map(|i| self.own.per_s(i) * step[i]).sum::<f64>();
        let shares = |i: usize| match i {
            0 => 0.0,
            1 => timed,
            i if i < n + 2 => -step[i - 2],
            _ => 1.0,
        };
        let row = |i: usize| (0..n + 3).map(|j| Self::element(&self.angle, i, j) * shares(j)).sum::<f64>();
        let [w, wt, wtt] = [self.angle[0], self.angle[1], self.angle[2]];
        Left {
            own: Matrix2::new(w, wt, wt, wtt),
            products: Vector2::new(row(0), row(1)),
            squares: (0..n + 3).map(|i| shares(i) * row(i)).sum(),
        }
    }

    pub(crate) fn add(packed: &mut [f64], weight: f64, time: f64, slopes: &[f64], residual: f64) {
        // rows of the lower triangle: 1; time; slopes; residual
        packed[0] += weight;
        packed[1] += weight * time;
        packed[2] += weight * time * time;
        let mut at = 3;
        let mut row = |packed: &mut [f64], value: f64, columns: &[f64]| {
            let w = weight * value;
            packed[at] += w;
            packed[at + 1] += w * time;
            for (p, q) in packed[at + 2..].iter_mut().zip(columns) {
                *p += w * q;
            }
            at += columns.len() + 2;
        };
        for (i, s) in slopes.iter().enumerate() {
            row(packed, *s, &slopes[..=i]);
        }
        row(packed, residual, slopes);
        packed[at] += weight * residual * residual;
    }

    /// Element (i, j) of the packed lower triangle.
    fn element(packed: &[f64], i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        packed[i * (i + 1) / 2 + j]
    }

    /// Products of an unknown's slope with the segment's own two columns.
    fn own(&self, packed: &[f64], unknown: usize) -> Vector2<f64> {
        self.own.products(unknown, Self::element(packed, unknown + 2, 0), Self::element(packed, unknown + 2, 1))
    }

    /// The inverse of the segment's own block, and the residual's products with its columns less what the prior of the
    /// drift pulls.
    fn own_block(&self, packed: &[f64]) -> Option<(Matrix2<f64>, Vector2<f64>)> {
        let inverse = self.own.inverse([packed[0], packed[1], packed[2]])?;
        let row = self.n + 2;
        Some((inverse, Vector2::new(Self::element(packed, row, 0), Self::element(packed, row, 1) - self.pull())))
    }

    /// What is believed of the drift pulls it back by this.
    fn pull(&self) -> f64 {
        if self.own.drift.is_infinite() { 0.0 } else { self.own.drift * self.start.drift }
    }

    /// Adds this segment's part to the normal matrix, the right side and Σr².
    pub(crate) fn eliminate(&self, packed: &[f64], normal: &mut DMatrix<f64>, right: &mut DVector<f64>) -> f64 {
        let n = self.n;
        let Some((inverse, residual)) = self.own_block(packed) else { return 0.0 };
        for i in 0..n {
            let own = inverse * self.own(packed, i);
            for j in 0..=i {
                let products = self.own.products(j, 0.0, 0.0)[1] * self.own.per_s(i);
                let v = Self::element(packed, i + 2, j + 2) - products - own.dot(&self.own(packed, j));
                normal[(i, j)] += v;
                if i != j {
                    normal[(j, i)] += v;
                }
            }
            right[i] += Self::element(packed, n + 2, i + 2) + self.own.per_s(i) * self.pull() - own.dot(&residual);
        }
        let believed = self.pull() * self.start.drift;
        Self::element(packed, n + 2, n + 2) + believed - residual.dot(&(inverse * residual))
    }

    /// By how much the segment's bias and drift move with a step of the unknowns.
    pub(crate) fn start_shift(&self, packed: &[f64], step: &DVector<f64>) -> Vector2<f64> {
        let Some((inverse, residual)) = self.own_block(packed) else { return Vector2::zeros() };
        let explained = (0..self.n).fold(Vector2::zeros(), |sum, i| sum + self.own(packed, i) * step[i]);
        let mut shift = inverse * (residual - explained);
        // the unknown whose slope was reduced takes its part of the drift with it
        shift[1] -= (0..self.n).map(|i| self.own.per_s(i) * step[i]).sum::<f64>();
        shift
    }
}
