//! One linearisation for many models: the normal equations with every unknown that any of them has. Those of each model are
//! rows and columns of it, so that what a model would leave costs no look at the data (Furnival and Wilson 1974).

use nalgebra::DVector;
use rayon::prelude::*;

use crate::estimation::fit::{Linearised, Prepared, Prior, at_rest, collect, solve, thinning};
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::model::unknowns::Unknowns;
use crate::recording::Role;

/// The normal equations around one hypothesis.
pub(crate) struct Superset {
    at: Linearised,
    considered: Vec<Option<f64>>,
}

impl Superset {
    /// Linearises around `hypothesis`, on tracks thinned to some `enough` samples.
    pub(crate) fn new(
        tracks: &[Prepared],
        hypothesis: &Hypothesis,
        unknowns: &[Unknown],
        priors: &[Prior],
        enough: usize,
    ) -> Self {
        let sorted = Unknowns::new(hypothesis, unknowns.to_vec());
        let sums = tracks
            .par_iter()
            .map(|p| {
                let stride = thinning(&p.track, hypothesis, p.track.samples(Role::Fit), enough);
                collect(p, &p.starts, hypothesis, &sorted, Role::Fit, (stride, 1.0))
            })
            .collect();
        let here = at_rest(tracks, hypothesis, unknowns);
        let considered = unknowns.iter().map(|u| Prior::considered_deviation(priors, *u)).collect();
        Self { at: Linearised::new(&here, sums, priors, unknowns.len()), considered }
    }

    /// The step of the unknowns `own`, and the mean square that it would leave, to first order; none where they do not solve.
    pub(crate) fn step(&self, own: &[usize]) -> Option<(DVector<f64>, f64)> {
        let normal = self.at.normal.select_rows(own).select_columns(own);
        let right = self.at.right.select_rows(own);
        let considered: Vec<Option<f64>> = own.iter().map(|&i| self.considered[i]).collect();
        let step = solve(&normal, &right, 0.0, &considered)?.step;
        let count = self.samples();
        let left = (self.at.mean_square() - right.dot(&step) / count).max(0.0);
        (count > 0.0).then_some((step, left))
    }

    /// Residuals that are counted.
    pub(crate) fn samples(&self) -> f64 {
        self.at.samples()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::data::track::Track;
    use crate::estimation::fit::{Effort, Noise, fit};
    use crate::estimation::propagation::Start;
    use crate::model::hypothesis::Origin;
    use crate::recording::{Instrument, Recording, Run, RunKind};
    use cvg_model::effects::EffectId;

    /// Samples of a pattern that turns at 5 rad/s, read with a gain of Y, a skew and a cubic.
    pub(in crate::estimation) fn turning(samples: std::ops::Range<usize>) -> Track {
        let t_s: Vec<f64> = samples.map(|i| 0.01 * i as f64).collect();
        let read = |f: fn(f64) -> f64| Some(t_s.iter().map(|t| f(-5.0 * t)).collect::<Vec<f64>>());
        let recording = Recording {
            xc_v: read(|theta| theta.cos() + 2e-3 * theta.cos().powi(3)),
            xs_v: read(|_| 0.0),
            yc_v: read(|theta| 1.01 * (theta + 4e-3).sin()),
            ys_v: read(|_| 0.0),
            rate_dps: Some(vec![(5.0_f64 / 0.8).to_degrees(); t_s.len()]),
            t_s,
            ..Recording::default()
        };
        let (file, amplitude) = ("spin.csv".into(), None);
        let run = Run { kind: RunKind::Rotation, file, settle_s: 0.0, role: Role::Fit, amplitude, recording };
        Track::whole(run, std::f64::consts::PI).expect("a track")
    }

    #[test]
    fn what_a_model_would_leave_is_what_one_step_of_its_own_fit_leaves() {
        let noise = Noise { angle: 1e-4, amplitude: f64::INFINITY };
        let limit = Noise { angle: 1.0, amplitude: f64::INFINITY };
        let (track, starts) = (turning(0..400), vec![Start::default()]);
        let tracks = [Prepared { track, noise, white: noise, starts, drifts: false, limit }];
        let mut all = Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        let effects = [EffectId::DetectionGainMismatch, EffectId::DetectionSkew, EffectId::DetectionCubic];
        for id in effects {
            all.admit(id, Origin::Discovered);
        }
        let unknowns_of = |h: &Hypothesis| -> Vec<Unknown> {
            std::iter::once(Unknown::AngularGain).chain(h.effect_unknowns()).collect()
        };
        let unknowns = unknowns_of(&all);
        let superset = Superset::new(&tracks, &all, &unknowns, &[], 400);
        let mut least = f64::INFINITY;
        for left_out in (0..8_usize).map(|bits| (0..3).map(|i| bits >> i & 1 == 1).collect::<Vec<bool>>()) {
            let without = |id: EffectId| effects.iter().zip(&left_out).any(|(e, out)| *e == id && *out);
            let own: Vec<usize> = (0..unknowns.len())
                .filter(|&i| !matches!(unknowns[i], Unknown::Effect(m, _) if without(all.members[m].id)))
                .collect();
            let mut alone = all.clone();
            alone.members.retain(|m| !without(m.id));
            let step = Effort { steps: 1, thinned: 400, polish: false };
            let fitted = fit(&tracks, &alone, &unknowns_of(&alone), &[], Role::Fit, step);
            let expected = fitted.left() / (fitted.counted[0] + fitted.counted[1]) as f64;
            let found = superset.step(&own).expect("a step").1;
            assert!((found - expected).abs() < 1e-9 * expected, "{left_out:?}: {found} and not {expected}");
            least = least.min(found);
        }
        assert!(least < 1e-2 * superset.step(&[0]).expect("a step").1, "no effect took anything off");
    }
}
