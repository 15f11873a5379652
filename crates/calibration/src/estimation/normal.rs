//! Normal equations of whitened residuals with what is believed of the unknowns, and what they say.

use nalgebra::{DMatrix, DVector};

use crate::estimation::coloured_noise::Whitened;
use crate::estimation::fit::{Prior, Solution, solve};
use crate::model::hypothesis::{Hypothesis, Unknown};

/// Least squares around one hypothesis.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
    pub(crate) squares: f64,
    /// 1/variance of what was believed of each unknown
    pub(crate) believed: DVector<f64>,
    /// what was believed less what is there
    off: DVector<f64>,
    /// deviations of the unknowns that are held
    considered: Vec<Option<f64>>,
}

impl Normal {
    /// What is believed before any residual.
    pub(crate) fn of_beliefs(unknowns: &[Unknown], hypothesis: &Hypothesis, priors: &[Prior]) -> Self {
        let n = unknowns.len();
        let mut own = Self {
            matrix: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            squares: 0.0,
            believed: DVector::zeros(n),
            off: DVector::zeros(n),
            considered: vec![None; n],
        };
        for (i, unknown) in unknowns.iter().enumerate() {
            for p in priors.iter().filter(|p| p.unknown == *unknown) {
                let weight = p.deviation.powi(-2);
                let off = p.mean - hypothesis.get(*unknown);
                own.matrix[(i, i)] += weight;
                own.right[i] += weight * off;
                own.squares += weight * off * off;
                own.believed[i] += weight;
                own.off[i] = off;
                if p.considered {
                    own.considered[i] = Some(p.deviation);
                }
            }
        }
        own
    }

    /// Adds what residuals say, as far as they are worth it.
    pub(crate) fn add(&mut self, w: &Whitened, worth: f64) {
        self.matrix += &w.normal * worth;
        self.right += &w.right * worth;
        self.squares += w.squares * worth;
    }

    /// The step to the least sum of squares, and its covariance.
    pub(crate) fn solution(&self) -> Option<Solution> {
        solve(&self.matrix, &self.right, 0.0, &self.considered)
    }

    /// By how much a step leaves an unknown off what was believed of it.
    pub(crate) fn off_belief(&self, unknown: usize, step: &DVector<f64>) -> f64 {
        self.off[unknown] - step[unknown]
    }

    /// Unknowns that are not held.
    pub(crate) fn free(&self) -> Vec<usize> {
        (0..self.considered.len()).filter(|&i| self.considered[i].is_none()).collect()
    }

    /// ln |N| of the free unknowns and the squares that their best values leave.
    pub(crate) fn restricted_misfit(&self) -> Option<f64> {
        /// Directions of less information than this share of the largest tell nothing, whatever the noise.
        const SILENT: f64 = 1e-13;
        let step = self.solution()?.step;
        let free = self.free();
        if free.is_empty() {
            return Some(self.squares);
        }
        let chosen = self.matrix.select_rows(&free).select_columns(&free);
        let scale = chosen.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt());
        let unit = DMatrix::from_fn(free.len(), free.len(), |i, j| chosen[(i, j)] / (scale[i] * scale[j]));
        let ln_determinant: f64 = unit.symmetric_eigenvalues().iter().map(|l| l.max(SILENT).ln()).sum::<f64>()
            + 2.0 * scale.iter().map(|s| s.ln()).sum::<f64>();
        Some(ln_determinant + self.squares - self.right.dot(&step))
    }
}
