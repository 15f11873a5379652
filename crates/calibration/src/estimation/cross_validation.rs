//! What a fit would leave of samples that it had not seen, without fitting it again: blocked cross-validation (Stone 1974; in
//! blocks, since neighbouring samples remember each other: Burman, Chow and Nolan 1994).
//!
//! Every segment is cut into as many stretches as there are folds. Near its optimum a fit without the stretches of one fold is
//! one Gauss–Newton step away, and the normal equations of that step are those of all samples less those of the fold: one look
//! at the data tells all folds. What a stretch then leaves is a quadratic form in its own sums.

use nalgebra::{DVector, Matrix2, Vector2};
use rayon::prelude::*;

use crate::estimation::fit::{Fit, Linearised, Prepared, Prior, at_rest, collect_folds, solve, thinning};
use crate::estimation::sums::Sums;
use crate::model::unknowns::Unknowns;
use crate::recording::Role;

/// Stretches of every segment, of which each is left out in its turn: fewer leave too little to fit, more are not longer than
/// what the noise remembers (Hastie, Tibshirani and Friedman 2009, 7.10: five or ten).
const FOLDS: usize = 5;

/// Mean square of the angle that stretches leave which were not fitted, rad², about the best line of their segment; infinite
/// where nothing is left of a fit without one of them.
pub(crate) fn cross_validated(tracks: &[Prepared], fit: &Fit, priors: &[Prior], enough: usize) -> f64 {
    let sorted = Unknowns::new(&fit.hypothesis, fit.unknowns.clone());
    let sums: Vec<Vec<Vec<Sums>>> = tracks
        .par_iter()
        .zip(&fit.starts)
        .map(|(p, starts)| {
            let stride = thinning(&p.track, &fit.hypothesis, p.track.samples(Role::Fit), enough);
            collect_folds(p, starts, &fit.hypothesis, &sorted, Role::Fit, (stride, 1.0), FOLDS)
        })
        .collect();
    let here = at_rest(tracks, &fit.hypothesis, &fit.unknowns);
    let considered: Vec<Option<f64>> = fit.unknowns.iter().map(|u| Prior::considered_deviation(priors, *u)).collect();
    let steps: Option<Vec<DVector<f64>>> = (0..FOLDS)
        .map(|fold| {
            let without =
                |folds: &Vec<Sums>| Sums::total(folds.iter().enumerate().filter(|f| f.0 != fold).map(|f| f.1));
            let rest = sums.iter().map(|track| track.iter().filter_map(without).collect()).collect();
            let at = Linearised::new(&here, rest, priors, fit.unknowns.len());
            Some(solve(&at.normal, &at.right, 0.0, &considered)?.step)
        })
        .collect();
    let Some(steps) = steps else { return f64::INFINITY };
    let (mut left, mut count) = (0.0, 0.0);
    for (track, prepared) in sums.iter().zip(tracks) {
        let variance = prepared.noise.angle.powi(2);
        for folds in track {
            left += variance * about_a_line(folds, &steps);
            count += folds.iter().map(|s| s.counted[0] as f64).sum::<f64>();
        }
    }
    left / count.max(1.0)
}

/// Σ w r² of one segment about its best line, each fold after its own step.
fn about_a_line(folds: &[Sums], steps: &[DVector<f64>]) -> f64 {
    let (mut own, mut products, mut squares) = (Matrix2::zeros(), Vector2::zeros(), 0.0);
    for (sums, step) in folds.iter().zip(steps) {
        let after = sums.after(step);
        own += after.own;
        products += after.products;
        squares += after.squares;
    }
    let explained = own.try_inverse().map_or(0.0, |inverse| products.dot(&(inverse * products)));
    (squares - explained).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::fit::{Effort, Noise, fit};
    use crate::estimation::propagation::{Start, Stepping, propagate};
    use crate::estimation::subsets::tests::turning;
    use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
    use crate::numerics::statistics::line;
    use crate::recording::Instrument;
    use cvg_model::effects::EffectId;

    const ROWS: usize = 400;

    /// Runs of the same instrument, and a fit of `effects` to all of them.
    fn fitted(effects: &[EffectId], tracks: &[Prepared]) -> Fit {
        let mut hypothesis = Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        for &id in effects {
            hypothesis.admit(id, Origin::Discovered);
        }
        let unknowns: Vec<Unknown> =
            std::iter::once(Unknown::AngularGain).chain(hypothesis.effect_unknowns()).collect();
        fit(tracks, &hypothesis, &unknowns, &[], Role::Fit, Effort::FULL)
    }

    fn prepared(rows: std::ops::Range<usize>) -> Prepared {
        let noise = Noise { angle: 1e-4, amplitude: f64::INFINITY };
        let limit = Noise { angle: 1.0, amplitude: f64::INFINITY };
        let track = turning(rows);
        Prepared { track, noise, white: noise, starts: vec![Start::default()], drifts: false, limit }
    }

    #[test]
    fn a_fold_that_is_left_out_leaves_what_a_fit_without_it_leaves_there() {
        let effects = [EffectId::DetectionGainMismatch, EffectId::DetectionSkew];
        let all = [prepared(0..ROWS)];
        let found = cross_validated(&all, &fitted(&effects, &all), &[], ROWS);
        // the same, by a fit that does without each fifth in its turn; the bias of what comes after it is that of the whole
        let mut left: Vec<(f64, f64)> = Vec::new();
        for fold in 0..FOLDS {
            let [from, to] = [fold, fold + 1].map(|f| f * ROWS / FOLDS);
            let rest: Vec<Prepared> = [0..from, to..ROWS].into_iter().filter(|r| !r.is_empty()).map(prepared).collect();
            let hypothesis = fitted(&effects, &rest).hypothesis;
            let none = Unknowns::new(&hypothesis, Vec::new());
            let track = &all[0].track;
            propagate(track, &track.segments[0], &hypothesis, &none, Start::default(), Stepping::every(1), |row| {
                if (from..to).contains(&row.index) {
                    left.push((track.t_s[row.index], row.angle));
                }
            });
        }
        let (t, r): (Vec<f64>, Vec<f64>) = left.into_iter().unzip();
        let (slope, intercept) = line(&t, &r);
        let expected = t.iter().zip(&r).map(|(t, r)| (r - slope * t - intercept).powi(2)).sum::<f64>() / ROWS as f64;
        // a stretch in the middle parts the rest in two, each with a bias of its own: one unknown more in four fifths of the fits
        assert!((found - expected).abs() < 0.1 * expected, "{found:e} and not {expected:e}");
    }

    #[test]
    fn a_cause_that_is_there_is_borne_out_where_it_was_not_fitted_and_one_that_is_not_brings_nothing() {
        let tracks = [prepared(0..ROWS)];
        let left = |effects: &[EffectId]| cross_validated(&tracks, &fitted(effects, &tracks), &[], ROWS);
        let own = [EffectId::DetectionGainMismatch, EffectId::DetectionSkew, EffectId::DetectionCubic];
        let [without, with] = [left(&own[..2]), left(&own)];
        let beside = left(&[&own[..], &[EffectId::DetectionOffset]].concat());
        assert!(with < 1e-2 * without, "{with:e} of {without:e}");
        assert!(beside > 0.5 * with, "{beside:e} beside {with:e}");
    }
}
