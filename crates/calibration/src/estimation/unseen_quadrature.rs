//! What a quadrature that was not read may have made of the angular gain.
//!
//! A loop of the bandwidth ω_Q leaves a quadrature in step with the pattern, Q/E ≈ 2 Δω kΩ/ω_Q², where the frequencies differ by Δω,
//! and ½ Δω Q/E cos 2(θ − θ_ω) of it precesses in the mean, against kΩ: δk/k is −2 to −3 times (Δω/ω_Q)² (simulations), at every rate and in both
//! directions. Where the quadrature is read the model has it. Where it was not recorded, or stays below a step of its converter, no run
//! tells it from another angular gain. The command that holds it down tells Δω, whose half it has to undo at the most; of the bandwidth nothing
//! tells.

use cvg_model::effects::EffectId;

use crate::data::track::Track;
use crate::estimation::joint_fit::{Dataset, Fitted, fitted_tracks};
use crate::facts::Estimate;

/// δk/k of a quadrature that was not recorded, one standard deviation: as of a split of 0.1 Hz beside a loop of 5 Hz.
const UNRECORDED: f64 = 1e-3;

/// A bandwidth of the loop that holds the quadrature down, rad/s, at the lower end of what is usual: 4 Hz. Engineering choice.
const BANDWIDTH_RAD_S: f64 = 25.0;
/// δk/k is so many times (Δω/ω_Q)², and no more than the second: a loop whose bandwidth is less than six times the split does not hold the
/// quadrature down, and the angle shows that.
const SLOWED: f64 = 2.5;
const MOST_SLOWED: f64 = 0.08;

fn is_recorded(dataset: &Dataset) -> bool {
    fitted_tracks(&dataset.tracks).any(Track::has_quadrature)
}

/// Δω as the command has it that holds the quadrature down: as of a sine of which half of Δω is the peak, rad/s.
fn commanded_split(dataset: &Dataset, fitted: &Fitted) -> f64 {
    2.0 * std::f64::consts::SQRT_2 * (fitted.fit.hypothesis.force_scale * dataset.command_rms[1]).abs()
}

/// One standard deviation of δk/k.
fn share(dataset: &Dataset, fitted: &Fitted) -> f64 {
    if !is_recorded(dataset) {
        let by_the_split = SLOWED * (commanded_split(dataset, fitted) / BANDWIDTH_RAD_S).powi(2);
        return by_the_split.clamp(UNRECORDED, MOST_SLOWED);
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

/// What has to be said of a quadrature that was not recorded, or not resolved.
pub(crate) fn said_of_the_quadrature(dataset: &Dataset, fitted: &Fitted) -> Option<String> {
    let share = share(dataset, fitted);
    let percent = 100.0 * share;
    if is_recorded(dataset) {
        return (share > UNRECORDED).then(|| {
            format!(
                "the quadrature stays below a step of its converter, and the split of the frequencies may have slowed the pattern by \
                 {percent:.1} % unseen: the interval of the angular gain allows for it; finer readings of xs_v and ys_v would tell"
            )
        });
    }
    if share > UNRECORDED {
        let split_hz = commanded_split(dataset, fitted) / std::f64::consts::TAU;
        return Some(format!(
            "vqc_v shows frequencies that differ by about {split_hz:.2} Hz, and without the quadrature nothing tells how much that slowed the \
             pattern: the interval of the angular gain allows for {percent:.1} %; xs_v and ys_v would tell"
        ));
    }
    (dataset.command_rms[1] == 0.0).then(|| {
        format!(
            "neither the quadrature nor its command was recorded: the interval of the angular gain allows for frequencies that differ by 0.1 Hz \
             ({percent:.1} %), and no run tells whether they differ by more; vqc_v, or xs_v and ys_v, would tell"
        )
    })
}
