//! What is left of the angle at every stage, and the curves of it.

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::estimation::actuation::RingDown;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::residuals::Window;
use crate::identified::{BiasCurve, Figures};
use crate::model::hypothesis::Hypothesis;
use crate::recording::Role;
use crate::report::Heldout;

/// What is left of the angle, at every stage: of the held-out samples, and of the fitted ones.
pub(super) struct Errors {
    /// with nothing undone, and what that is
    pub(super) raw: Evaluation,
    pub(super) ideal: Hypothesis,
    pub(super) declared: Evaluation,
    pub(super) discovered: Evaluation,
    pub(super) declared_on_fit: Evaluation,
    pub(super) on_fit: Evaluation,
    /// of short windows, where nothing slow shows
    pub(super) dense_on_fit: Evaluation,
    pub(super) noise_floor: f64,
}

impl Errors {
    pub(super) fn of(dataset: &Dataset, declared: &Fit, found: &Fit) -> Self {
        let left = |h: &Hypothesis, fit: &Fit, role, window, like: Option<&Evaluation>| {
            evaluate(&dataset.tracks, h, &fit.starts, role, window, like)
        };
        let heldout = |h: &Hypothesis, fit: &Fit, like| left(h, fit, Role::Holdout, Window::Whole, like);
        let ideal = Hypothesis { members: Vec::new(), force_scale: 0.0, ..found.hypothesis.clone() };
        let discovered = heldout(&found.hypothesis, found, None);
        Self {
            raw: heldout(&ideal, found, Some(&discovered)),
            ideal,
            declared: heldout(&declared.hypothesis, declared, Some(&discovered)),
            declared_on_fit: left(&declared.hypothesis, declared, Role::Fit, Window::Whole, None),
            on_fit: left(&found.hypothesis, found, Role::Fit, Window::Whole, None),
            dense_on_fit: left(&found.hypothesis, found, Role::Fit, Window::Dense, None),
            noise_floor: left(&found.hypothesis, found, Role::Holdout, Window::Dense, None).noise_floor(),
            discovered,
        }
    }

    pub(super) fn heldout(&self) -> Heldout {
        Heldout {
            raw: Some(self.raw.size()),
            declared: self.declared.size(),
            discovered: self.discovered.size(),
            // the white part of what is left is none of more than that
            noise_floor_deg: self.noise_floor.to_degrees().min(self.discovered.size().rms_deg),
        }
    }
}

/// Points of one curve.
const CURVE_POINTS: usize = 2000;

/// The curves of a report.
pub(super) fn figures(
    dataset: &Dataset,
    raw: Option<&Evaluation>,
    before: &Evaluation,
    after: &Evaluation,
    ring_downs: Vec<RingDown>,
) -> Figures {
    let degrees = |e: &Evaluation, s: usize, kept: &[usize]| -> Vec<f64> {
        kept.iter().map(|&i| e.segments[s].angle[i].to_degrees()).collect()
    };
    let bias = (0..after.segments.len())
        .map(|s| {
            let segment = &after.segments[s];
            let stride = (segment.angle.len() / CURVE_POINTS).max(1);
            let kept: Vec<usize> = (0..segment.angle.len()).step_by(stride).filter(|&i| after.kept[s][i]).collect();
            let period = dataset.start.period_rad;
            BiasCurve {
                name: dataset.tracks[segment.track].track.name.clone(),
                pattern_deg: kept.iter().map(|&i| segment.direction[i].rem_euclid(period).to_degrees()).collect(),
                raw_deg: raw.map(|r| degrees(r, s, &kept)).unwrap_or_default(),
                declared_deg: degrees(before, s, &kept),
                discovered_deg: degrees(after, s, &kept),
            }
        })
        .collect();
    Figures { bias, ring_downs, channels: None }
}
