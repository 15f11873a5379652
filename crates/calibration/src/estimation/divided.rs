//! Runs whose channels were divided by their own amplitude, so that it is constant as recorded. Unequal gains, an oblique axis
//! and cubics show in the angle and in the amplitude as read; from an angle alone with a constant beside it, a fit makes parts
//! that cancel. A loop that holds the amplitude as read does so as well, but not more closely than its noise.

use cvg_model::effects::Stage;

use crate::data::track::Track;
use crate::error::Refusal;
use crate::estimation::fit::Prepared;
use crate::estimation::joint_fit::Dataset;
use crate::model::hypothesis::{Hypothesis, Member};
use crate::numerics::statistics::root_mean_square;
use crate::recording::Role;

/// A readout effect shows where the amplitude as read varies by this share at least of what the effect by itself does to it:
/// engineering choice, a loop that holds the amplitude leaves less.
const SHOWN: f64 = 0.1;
/// Noise of the two channels is as large across the pattern, in its angle, as along it; below this share of it no amplitude was
/// measured: engineering choice, a loop that follows noise takes out some of it.
const MEASURED: f64 = 0.02;
/// What an effect does to ln amplitude below this is nothing that matters.
const LEAST: f64 = 1e-7;
/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// Samples of a run that are looked at.
const LOOKED_AT: usize = 2000;

impl Dataset {
    /// Leaves out runs whose amplitude was divided out, by name; whether there were any. `hypothesis` is what the campaign was
    /// found to be.
    ///
    /// # Errors
    /// Where they are more than a third of all.
    pub(crate) fn without_divided_runs(&mut self, hypothesis: &Hypothesis) -> Result<bool, Refusal> {
        let found: Vec<(usize, f64)> =
            self.tracks.iter().enumerate().filter_map(|(at, p)| Some((at, divided(p, hypothesis)?))).collect();
        let why = |(at, varies): &(usize, f64)| {
            let what = format!(
                "its amplitude as read varies by {varies:.1e}, where the readout that its angle asks for would make it vary by \
                 more and its noise alone does: the channels were divided by their own amplitude"
            );
            (self.tracks[*at].track.name.clone(), what)
        };
        let said: Vec<(String, String)> = found.iter().map(why).collect();
        let fitted = self.tracks.iter().filter(|p| p.track.samples(Role::Fit) > 0).count();
        if let Some((name, what)) = said.first().filter(|_| said.len() as f64 > MOST_LEFT_OUT * fitted as f64) {
            return Err(Refusal::no_answer(name, what.clone(), "the channels as they were demodulated"));
        }
        for ((at, _), (name, what)) in found.iter().zip(said).rev() {
            self.tracks.remove(*at);
            self.screen.leave_out(self.screen.kept[*at], &name, &what, &mut self.warnings);
        }
        Ok(!found.is_empty())
    }
}

/// By how much ln amplitude varies as read, rms, where that contradicts an effect of the readout.
fn divided(prepared: &Prepared, hypothesis: &Hypothesis) -> Option<f64> {
    let track = &prepared.track;
    if !track.has_amplitude() || track.samples(Role::Fit) == 0 {
        return None;
    }
    let recorded = ln_amplitude(track, None);
    let varies = root_mean_square(&recorded);
    let is_hidden = |member: &Member| {
        let with_it = ln_amplitude(track, Some(member));
        let does: Vec<f64> = with_it.iter().zip(&recorded).map(|(a, b)| a - b).collect();
        let does = root_mean_square(&does);
        does > LEAST && varies < SHOWN * does
    };
    let is_constant = varies < MEASURED * prepared.white.angle;
    (is_constant && hypothesis.acting(Stage::Readout).any(|(_, member)| is_hidden(member))).then_some(varies)
}

/// ln amplitude of the samples to fit about its mean, as read or with one effect undone.
fn ln_amplitude(track: &Track, without: Option<&Member>) -> Vec<f64> {
    let fitted = track.segments.iter().filter(|s| s.role == Role::Fit).flat_map(|s| s.range.clone());
    let stride = (track.samples(Role::Fit) / LOOKED_AT).max(1);
    let of_sample = |i: usize| {
        let read = track.envelope(i);
        let z = without.map_or(read, |m| m.id.unread(&m.values, read, &track.moment(i, 0.0)));
        0.5 * (z.pendulum().e + f64::MIN_POSITIVE).ln()
    };
    let mut out: Vec<f64> = fitted.step_by(stride).map(of_sample).collect();
    let mean = out.iter().sum::<f64>() / out.len().max(1) as f64;
    out.iter_mut().for_each(|v| *v -= mean);
    out
}
