//! What a quadrature that was not read may have made of the angular gain.
//!
//! A loop of the bandwidth ω_Q leaves a quadrature in step with the pattern, Q/E ≈ 2 Δω kΩ/ω_Q², where the frequencies differ by Δω,
//! and ½ Δω Q/E cos 2(θ − θ_ω) of it precesses in the mean, against kΩ: δk/k is −2 to −3 times (Δω/ω_Q)² (simulations), at every rate and in both
//! directions. Where the quadrature is read the model has it. Where it was not recorded, or stays below a step of its converter, no run
//! tells it from another angular gain.

use cvg_model::effects::EffectId;

use crate::data::track::Track;
use crate::estimation::joint_fit::{Dataset, Fitted, fitted_tracks};
use crate::facts::Estimate;

/// δk/k of a quadrature that was not recorded, one standard deviation: as of a split of 0.1 Hz beside a loop of 5 Hz.
const UNRECORDED: f64 = 1e-3;

/// One standard deviation of δk/k.
fn share(dataset: &Dataset, fitted: &Fitted) -> f64 {
    if !fitted_tracks(&dataset.tracks).any(Track::has_quadrature) {
        return UNRECORDED;
    }
    let hypothesis = &fitted.fit.hypothesis;
    let split = hypothesis.member(EffectId::Anisoelasticity).map_or(0.0, |m| m.values[0].hypot(m.values[1]));
    // half a step of what is read is as much of Q/E twice
    let of = |t: &Track| {
        let step = t.unresolved_quadrature()?;
        Some(0.5 * split * step / t.mean_amplitude() / hypothesis.precession(t.mean_speed()).abs())
    };
    fitted_tracks(&dataset.tracks).filter_map(of).reduce(f64::min).unwrap_or(0.0)
}

/// The angular gain with an interval that also holds what a quadrature that was not read may have made of it.
pub(crate) fn with_unseen_quadrature(gain: Estimate, dataset: &Dataset, fitted: &Fitted) -> Estimate {
    let by = 1.96 * share(dataset, fitted) * gain.value.abs();
    gain.widened(gain.half_width().hypot(by) - gain.half_width())
}

/// What has to be said of a quadrature that was recorded and not resolved.
pub(crate) fn said_of_the_quadrature(dataset: &Dataset, fitted: &Fitted) -> Option<String> {
    let share = Some(share(dataset, fitted)).filter(|s| *s > UNRECORDED)?;
    Some(format!(
        "the quadrature stays below a step of its converter, and the split of the frequencies may have slowed the pattern by {:.1} % unseen: \
         the interval of the angular gain allows for it; finer readings of xs_v and ys_v would tell",
        100.0 * share
    ))
}
