//! Clocks that begin far from zero, as one that counts seconds since 1970.

use crate::recording::{Campaign, RunKind};

/// Counts the times of a campaign from its first row where they begin further from zero than they last: what drifts is counted
/// from there, and a zero that nobody recorded would make a drift which is too small to be seen as large as anything.
pub(crate) fn from_the_first_row(campaign: &mut Campaign) {
    let times =
        |pick: fn(&[f64]) -> Option<&f64>| campaign.runs.iter().filter_map(move |r| pick(&r.recording.t_s).copied());
    let first = times(<[f64]>::first).fold(f64::INFINITY, f64::min);
    let last = times(<[f64]>::last).fold(f64::NEG_INFINITY, f64::max);
    if !first.is_finite() || first.abs() <= last - first {
        return;
    }
    for run in &mut campaign.runs {
        run.recording.t_s.iter_mut().for_each(|t| *t -= first);
        if let RunKind::Ringdown { energy_off_s, .. } = &mut run.kind {
            *energy_off_s -= first;
        }
    }
}
