//! Linear least squares for a few dozen unknowns: normal equations of scaled columns, with the directions that the data
//! does not determine set to nothing, as the solution of least norm has them.

use nalgebra::{DMatrix, DVector};

/// Eigenvalues of the scaled normal matrix below this share of the largest count as none: rounding of what was squared.
const RANK: f64 = 1e-11;

/// Normal equations under construction.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl NormalEquations {
    /// For this many unknowns.
    pub(crate) fn new(unknowns: usize) -> Self {
        Self { matrix: DMatrix::zeros(unknowns, unknowns), right: DVector::zeros(unknowns) }
    }

    /// Of sums that were made elsewhere.
    pub(crate) fn of(matrix: DMatrix<f64>, right: DVector<f64>) -> Self {
        Self { matrix, right }
    }

    /// Adds an equation `row · x = value`.
    pub(crate) fn add(&mut self, row: &[f64], value: f64) {
        for (j, b) in row.iter().enumerate().filter(|(_, b)| **b != 0.0) {
            let column = &mut self.matrix.column_mut(j);
            for (entry, a) in column.iter_mut().zip(row).take(j + 1) {
                *entry += a * b;
            }
            self.right[j] += b * value;
        }
    }

    /// Marquardt's: every diagonal entry larger by this share of itself.
    pub(crate) fn damped(mut self, share: f64) -> Self {
        for i in 0..self.right.len() {
            self.matrix[(i, i)] *= 1.0 + share;
        }
        self
    }

    /// The solution.
    pub(crate) fn solve(&self) -> Vec<f64> {
        let n = self.right.len();
        let scale: Vec<f64> =
            (0..n).map(|i| self.matrix[(i, i)].sqrt()).map(|d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| self.matrix[(i.min(j), i.max(j))] * scale[i] * scale[j]);
        let right = DVector::from_fn(n, |i, _| self.right[i] * scale[i]);
        let solved = well_conditioned(&scaled).map_or_else(|| least_norm(scaled, &right), |c| c.solve(&right));
        solved.iter().zip(&scale).map(|(x, s)| x * s).collect()
    }
}

/// Cholesky's factors where every pivot is well above rounding.
fn well_conditioned(scaled: &DMatrix<f64>) -> Option<nalgebra::Cholesky<f64, nalgebra::Dyn>> {
    let factors = scaled.clone().cholesky()?;
    let sound = factors.l_dirty().diagonal().iter().all(|d| d * d > 1e3 * RANK);
    sound.then_some(factors)
}

fn least_norm(scaled: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    let eigen = scaled.symmetric_eigen();
    let least = RANK * eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let mut seen = eigen.eigenvectors.tr_mul(right);
    for (s, value) in seen.iter_mut().zip(&eigen.eigenvalues) {
        *s = if *value > least { *s / value } else { 0.0 };
    }
    eigen.eigenvectors * seen
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn normal_equations_agree_with_dense_least_squares() {
        let rows: Vec<[f64; 3]> = (0..40)
            .map(|i| {
                let x = f64::from(i) * 0.1;
                [1.0, x.sin(), (2.3 * x).cos()]
            })
            .collect();
        let values: Vec<f64> = (0..40).map(|i| (f64::from(i) * 1.7).sin()).collect();
        let mut equations = NormalEquations::new(3);
        for (row, value) in rows.iter().zip(&values) {
            equations.add(row, *value);
        }
        let dense = DMatrix::from_fn(40, 3, |i, j| rows[i][j])
            .svd(true, true)
            .solve(&DVector::from_vec(values), 1e-12)
            .unwrap();
        for (ours, theirs) in equations.solve().iter().zip(dense.iter()) {
            assert!((ours - theirs).abs() < 1e-10, "{ours} {theirs}");
        }
    }

    #[test]
    fn what_the_data_does_not_determine_stays_at_nothing() {
        let mut equations = NormalEquations::new(3);
        for i in 0..10 {
            let x = f64::from(i);
            equations.add(&[x, x, 0.0], 4.0 * x);
        }
        let solved = equations.solve();
        assert!((solved[0] - 2.0).abs() < 1e-6 && (solved[1] - 2.0).abs() < 1e-6 && solved[2] == 0.0, "{solved:?}");
    }
}
