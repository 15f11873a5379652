//! Covariance of the unknowns of a fit from what it leaves, block by block.

use nalgebra::DMatrix;

use crate::diagnostics::evaluate::evaluate;
use crate::estimation::fit::{Fit, block_covariance};
use crate::estimation::joint_fit::Dataset;
use crate::estimation::residuals::Window;
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::recording::Role;

/// Covariance without a last step: the larger of that of white residuals and of the block covariance, which allows for
/// their memory. Where the loops' commands were not recorded, what is described and not explained counts as error.
pub(crate) fn of_blocks(dataset: &Dataset, fit: &Fit) -> DMatrix<f64> {
    let dof = (fit.counted[0] + fit.counted[1]).saturating_sub(fit.unknowns.len()).max(1) as f64;
    let scale = (fit.left() / dof).max(f64::MIN_POSITIVE);
    // what considered unknowns could be does not depend on what is left
    let plain = &fit.by_noise * (scale * undescribed(dataset, fit) - 1.0) + &fit.covariance;
    let blocks = block_covariance(&dataset.tracks, fit, Role::Fit);
    let n = fit.unknowns.len();
    // raise each deviation to the larger of the two and keep the correlations
    let raise: Vec<f64> =
        (0..n).map(|i| (blocks[(i, i)] / plain[(i, i)].max(f64::MIN_POSITIVE)).max(1.0).sqrt()).collect();
    DMatrix::from_fn(n, n, |i, j| plain[(i, j)] * raise[i] * raise[j])
}

/// By what factor the mean square would be larger without empirical corrections, where the model is known to lack what
/// the loops do; 1 elsewhere.
fn undescribed(dataset: &Dataset, fit: &Fit) -> f64 {
    let mut explained: Hypothesis = fit.hypothesis.clone();
    explained.members.retain(|m| m.origin != Origin::Empirical);
    if explained == fit.hypothesis || !dataset.tracks.iter().any(|t| t.drifts) {
        return 1.0;
    }
    let mean_square = |hypothesis: &Hypothesis| {
        evaluate(&dataset.tracks, hypothesis, &fit.starts, Role::Fit, Window::Whole, None).mean_square()
    };
    (mean_square(&explained) / mean_square(&fit.hypothesis)).max(1.0)
}
