//! The normal equations of one segment, and what belongs to the segment alone eliminated from them: its bias, and where
//! commands were not recorded a drift of its own.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::estimation::propagation::Start;

/// Weighted sums of one segment: Σ w v vᵀ with v = (1, time, slopes …, residual), for angle and amplitude apart.
pub(crate) struct Sums {
    n: usize,
    pub(crate) angle: Vec<f64>,
    pub(crate) amplitude: Vec<f64>,
    pub(crate) counted: [usize; 2],
    pub(crate) set_aside: usize,
    /// 1/variance of the drift before the data, s²/rad²; infinite where there is none
    drift: f64,
    start: Start,
}

impl Sums {
    /// Empty sums for `n` unknowns on a segment that starts at `start`.
    pub(crate) fn new(n: usize, start: Start, drift_deviation: f64) -> Self {
        let size = (n + 3) * (n + 4) / 2;
        Self {
            n,
            angle: vec![0.0; size],
            amplitude: vec![0.0; size],
            counted: [0; 2],
            set_aside: 0,
            drift: drift_deviation.powi(-2),
            start,
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

    /// Products of a row with the segment's own two columns.
    fn own(packed: &[f64], i: usize) -> Vector2<f64> {
        Vector2::new(Self::element(packed, i, 0), Self::element(packed, i, 1))
    }

    /// The inverse of the segment's own block, and the residual's products with its columns less what the prior of the
    /// drift pulls.
    fn own_block(&self, packed: &[f64]) -> Option<(Matrix2<f64>, Vector2<f64>)> {
        if packed[0] <= 0.0 {
            return None;
        }
        let mut residual = Self::own(packed, self.n + 2);
        if self.drift.is_infinite() {
            return Some((Matrix2::new(1.0 / packed[0], 0.0, 0.0, 0.0), residual));
        }
        residual[1] -= self.drift * self.start.drift;
        let block = Matrix2::new(packed[0], packed[1], packed[1], packed[2] + self.drift);
        block.try_inverse().map(|inverse| (inverse, residual))
    }

    /// Adds this segment's part to the normal matrix, the right side and Σr².
    pub(crate) fn eliminate(&self, packed: &[f64], normal: &mut DMatrix<f64>, right: &mut DVector<f64>) -> f64 {
        let n = self.n;
        let Some((inverse, residual)) = self.own_block(packed) else { return 0.0 };
        for i in 0..n {
            let own = inverse * Self::own(packed, i + 2);
            for j in 0..=i {
                let v = Self::element(packed, i + 2, j + 2) - own.dot(&Self::own(packed, j + 2));
                normal[(i, j)] += v;
                if i != j {
                    normal[(j, i)] += v;
                }
            }
            right[i] += Self::element(packed, n + 2, i + 2) - own.dot(&residual);
        }
        let believed = if self.drift.is_infinite() { 0.0 } else { self.drift * self.start.drift.powi(2) };
        Self::element(packed, n + 2, n + 2) + believed - residual.dot(&(inverse * residual))
    }

    /// By how much the segment's bias and drift move with a step of the unknowns.
    pub(crate) fn start_shift(&self, packed: &[f64], step: &DVector<f64>) -> Vector2<f64> {
        let Some((inverse, residual)) = self.own_block(packed) else { return Vector2::zeros() };
        let explained = (0..self.n).fold(Vector2::zeros(), |sum, i| sum + Self::own(packed, i + 2) * step[i]);
        inverse * (residual - explained)
    }
}
