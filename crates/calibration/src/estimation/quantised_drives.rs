//! What drives with coarse steps leave open: of a force that its loop holds at the edge of a step nothing tells what was put out.
//!
//! A push across the pattern that goes with its angle turns it as an anisodamping does, and as drives that are unequal or askew.
//! A ring-down is held by such a force in one direction: its decay is told, and what it takes to replace that hardly.

use cvg_model::effects::EffectId;
use nalgebra::DMatrix;

use crate::data::quantised_drives::Quantisation;
use crate::estimation::actuation::RingDown;
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::model::hypothesis::Unknown;

impl Dataset {
    /// What drives with coarse steps leave open of what a ring-down takes.
    pub(super) fn with_unknown_force(&self, ring_down: RingDown) -> RingDown {
        let Some(force) = self.unknown_force() else { return ring_down };
        let amplitude = ring_down.decay.first().map_or(f64::INFINITY, |(_, amplitude)| *amplitude);
        RingDown { drive_error: ring_down.drive_error.hypot(force / amplitude), ..ring_down }
    }

    /// The force scale of drives with coarse steps and its uncertainty, as the quadrature balance tells it beside the step.
    pub(super) fn told_with_the_step(&self) -> Option<(f64, f64)> {
        let gain = self.quantisation.as_ref().and_then(|q| q.force_gain);
        gain.map(|gain| (gain.value, gain.half_width() / 1.96))
    }

    /// How far a force may be from the one that is taken for it, as a standard deviation, V.
    pub(crate) fn unknown_force(&self) -> Option<f64> {
        self.quantisation.as_ref().map(Quantisation::unknown_force)
    }
}

/// The covariance of a fit with what drives with coarse steps may have moved.
pub(crate) fn with_quantised_drives(dataset: &Dataset, fitted: &Fitted, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    let Some(force) = dataset.unknown_force() else { return covariance };
    let hypothesis = &fitted.fit.hypothesis;
    let per_amplitude = force / dataset.usual_amplitude();
    let mut widen = |id: EffectId, p: usize, by: f64| {
        let unknown = hypothesis.position(id).map(|member| Unknown::Effect(member, p));
        if let Some(i) = fitted.fit.unknowns.iter().position(|u| Some(*u) == unknown) {
            covariance[(i, i)] += by * by;
        }
    };
    let damping = hypothesis.force_scale * per_amplitude;
    (0..2).for_each(|p| widen(EffectId::Anisodamping, p, damping));
    let share = per_amplitude / dataset.command_rms[0].max(f64::MIN_POSITIVE);
    widen(EffectId::ActuationGainMismatch, 0, share);
    covariance
}
