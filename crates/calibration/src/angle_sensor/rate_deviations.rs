//! How far what was fitted to a rate gyroscope may be off, by the larger of two answers.
//!
//! The jackknife over parts of the runs counts whatever makes one part differ from another, and of a handful of parts it is now
//! and then far too small by chance. What is integrated walks: a step u of the walk moves all rows behind it, and with them
//! what is fitted by R(u), the least-squares answer to a step there. Of steps over blocks with variance σ² that is
//! $$\operatorname{var} = σ^2 \sum_b R_b^2$$
//! with σ² from what the fit leaves.

use nalgebra::{DMatrix, DVector};

use super::rate_regression::{Stretch, Term, rows};
use crate::numerics::linear::NormalEquations;

/// Student's 97.5 % point for one fewer than five parts, and for as many blocks as one run has.
pub(super) const T_PARTS: f64 = 2.776;
const T_BLOCKS: f64 = 2.02;
/// Blocks of one run.
const BLOCKS: usize = 40;

/// Deviations of `values` of `terms`, estimated from `stretches`; `fits` are the same without one part after the other. Half
/// widths of 95 % intervals are [`T_PARTS`] of them.
pub(super) fn deviations(stretches: &[Stretch], terms: &[Term], values: &[f64], fits: &[Vec<f64>]) -> Vec<f64> {
    let walked = of_a_walk(stretches, terms, values).into_iter().map(|d| T_BLOCKS / T_PARTS * d);
    jackknife(fits, terms.len()).into_iter().zip(walked).map(|(a, b)| a.max(b)).collect()
}

/// Standard deviations of estimates each made without one part (Künsch 1989).
pub(super) fn jackknife(fits: &[Vec<f64>], unknowns: usize) -> Vec<f64> {
    let n = fits.len() as f64;
    (0..unknowns)
        .map(|i| {
            let mean = fits.iter().map(|f| f[i]).sum::<f64>() / n;
            ((n - 1.0) / n * fits.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>()).sqrt()
        })
        .collect()
}

/// Standard deviations where what is left is a random walk.
pub(super) fn of_a_walk(stretches: &[Stretch], terms: &[Term], values: &[f64]) -> Vec<f64> {
    let n = terms.len();
    let mut matrix = DMatrix::zeros(n, n);
    let mut steps: Vec<DVector<f64>> = Vec::new();
    let mut squares = 0.0;
    for stretch in stretches {
        let rows = rows(std::slice::from_ref(stretch), terms);
        let left = stretch.left(terms, values);
        let (last, blocks) = (rows.len() - 1, BLOCKS.min(rows.len() - 1));
        let edges: Vec<usize> = (0..=blocks).map(|b| b * last / blocks.max(1)).collect();
        // sums of the regressors from each row on: what a step there adds to the right-hand side
        let mut behind = DVector::zeros(n);
        let mut next = blocks;
        for (at, (row, _)) in rows.iter().enumerate().rev() {
            let row = DVector::from_column_slice(row);
            matrix += &row * row.transpose();
            behind += row;
            if next > 0 && at == (edges[next - 1] + edges[next]).div_ceil(2) {
                steps.push(behind.clone());
                squares += (left[edges[next]] - left[edges[next - 1]]).powi(2);
                next -= 1;
            }
        }
    }
    let variance = squares / steps.len().saturating_sub(n).max(1) as f64;
    let answers = steps.into_iter().map(|right| NormalEquations::of(matrix.clone(), right).solve());
    let sums = answers.fold(vec![0.0; n], |sums: Vec<f64>, r| sums.iter().zip(r).map(|(s, r)| s + r * r).collect());
    sums.into_iter().map(|s| (variance * s).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle_sensor::rate_regression::{ErrorLaw, estimate};
    use crate::numerics::statistics::remembered;

    /// Of many walks the deviation is what the estimates scatter by.
    #[test]
    fn a_walk_scatters_by_the_deviation_that_is_stated() {
        let rows = 4000_usize;
        let t: Vec<f64> = (0..rows).map(|i| 0.01 * i as f64).collect();
        let reference: Vec<f64> = t.iter().map(|t| (0.6 * t).sin() + 0.2 * (2.3 * t).cos()).collect();
        let terms = [Term::Bias, Term::Scale];
        let trials = 60_u64;
        let (mut found, mut stated) = (Vec::new(), [0.0; 2]);
        for seed in 0..trials {
            let walk = remembered(0.0, rows, (seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15)).into_iter().scan(
                0.0,
                |sum, u| {
                    *sum += 1e-4 * u;
                    Some(*sum)
                },
            );
            let stretch = [Stretch::of(t.clone(), reference.clone(), walk.collect())];
            let values = estimate(&stretch, &terms, ErrorLaw::Normal);
            let walked = of_a_walk(&stretch, &terms, &values);
            (0..2).for_each(|i| stated[i] += walked[i] / trials as f64);
            found.push(values);
        }
        for i in 0..2 {
            let rms = (found.iter().map(|v| v[i] * v[i]).sum::<f64>() / trials as f64).sqrt();
            assert!((stated[i] / rms - 1.0).abs() < 0.25, "{:?}: stated {}, scatters by {rms}", terms[i], stated[i]);
        }
    }
}
