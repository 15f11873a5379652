//! The error of a hypothesis on data that was not fitted: angle minus the best line, with angular gain and bias
//! refitted on the same samples, after the hypothesis has removed what it knows.

use crate::estimation::bias::angle_dependent_bias;
use crate::estimation::fit::Prepared;
use crate::estimation::propagation::Start;
use crate::estimation::residuals::{Residual, Window, residuals};
use crate::facts::ErrorSize;
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{circular_mean, line, robust_deviation, white_noise};
use crate::recording::Role;

/// Residuals further out than this many robust deviations are spikes.
const SPIKE: f64 = 6.0;

/// Samples in a row that a spike may last.
const LONGEST_SPIKE: usize = 2;

/// The angle error of a hypothesis on the segments of one role.
#[derive(Debug, Clone)]
pub(crate) struct Evaluation {
    /// residuals with the best line taken out of the angle, one per segment
    pub(crate) segments: Vec<Residual>,
    /// samples that are no spikes
    pub(crate) kept: Vec<Vec<bool>>,
}

/// Evaluates `hypothesis` on the segments of `role`. Spikes are those of this evaluation, or of `like` where given.
pub(crate) fn evaluate(
    tracks: &[Prepared],
    hypothesis: &Hypothesis,
    starts: &[Vec<Start>],
    role: Role,
    window: Window,
    like: Option<&Evaluation>,
) -> Evaluation {
    let mut segments: Vec<Residual> =
        residuals(tracks, hypothesis, starts, role, window).into_iter().flatten().collect();
    for s in &mut segments {
        let middle = circular_mean(s.angle.iter().copied(), hypothesis.period_rad);
        for a in &mut s.angle {
            *a = wrapped(*a - middle, hypothesis.period_rad);
        }
    }
    let Some(like) = like else { return Evaluation::of(segments) };
    Evaluation::of_segments(segments, Some(like))
}

/// Takes the best line out of a segment, and its spikes out of the line; says what is left of it.
fn straightened(s: &mut Residual) -> Vec<bool> {
    let mut keep = vec![true; s.angle.len()];
    for _ in 0..3 {
        take_line(s, &keep);
        let limit = SPIKE * robust_deviation(s.angle.iter().copied()) + f64::MIN_POSITIVE;
        for (k, a) in keep.iter_mut().zip(&s.angle) {
            *k = a.abs() <= limit;
        }
    }
    take_line(s, &keep);
    keep
}

/// Keeps what is far off for more than two samples in a row.
fn only_short_spikes(mut kept: Vec<bool>) -> Vec<bool> {
    let mut from = 0;
    for run in kept.clone().chunk_by(|a, b| a == b) {
        if run.len() > LONGEST_SPIKE {
            kept[from..from + run.len()].fill(true);
        }
        from += run.len();
    }
    kept
}

/// Takes the best line through the kept samples out of all of them.
fn take_line(s: &mut Residual, keep: &[bool]) {
    if keep.iter().all(|k| *k) {
        s.angle = angle_dependent_bias(&s.turned, &s.angle);
        return;
    }
    let (x, y): (Vec<f64>, Vec<f64>) =
        s.turned.iter().zip(&s.angle).zip(keep).filter(|(_, k)| **k).map(|((x, y), _)| (*x, *y)).unzip();
    let (slope, intercept) = line(&x, &y);
    for (a, t) in s.angle.iter_mut().zip(&s.turned) {
        *a -= slope * t + intercept;
    }
}

/// Mean square of errors; nothing of none.
fn mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = errors.fold((0usize, 0.0), |(n, s), a| (n + 1, s + a * a));
    sum / n.max(1) as f64
}

impl Evaluation {
    /// Residuals less the best line of each segment, with the spikes of `like` where given. What lasts longer than two
    /// samples is an error and no spike.
    pub(crate) fn of_segments(mut segments: Vec<Residual>, like: Option<&Self>) -> Self {
        let Some(like) = like else {
            let kept: Vec<Vec<bool>> = segments.iter_mut().map(straightened).map(only_short_spikes).collect();
            for (s, keep) in segments.iter_mut().zip(&kept) {
                take_line(s, keep);
            }
            return Self { segments, kept };
        };
        for (s, keep) in segments.iter_mut().zip(&like.kept) {
            take_line(s, keep);
        }
        Self { segments, kept: like.kept.clone() }
    }

    /// Residuals less the best line and the spikes of each segment.
    pub(crate) fn of(mut segments: Vec<Residual>) -> Self {
        let kept = segments.iter_mut().map(straightened).collect();
        Self { segments, kept }
    }

    /// Kept angle errors, rad, all segments.
    pub(crate) fn errors(&self) -> impl Iterator<Item = f64> + '_ {
        self.segments
            .iter()
            .zip(&self.kept)
            .flat_map(|(s, k)| s.angle.iter().zip(k).filter(|(_, k)| **k).map(|(a, _)| *a))
    }

    /// Samples of a track that are set aside as spikes.
    pub(crate) fn spikes_of(&self, track: usize) -> usize {
        let of_track = self.segments.iter().zip(&self.kept).filter(|(s, _)| s.track == track);
        of_track.flat_map(|(_, kept)| kept).filter(|k| !**k).count()
    }

    /// Mean square of the kept errors, rad².
    pub(crate) fn mean_square(&self) -> f64 {
        mean_square(self.errors())
    }

    /// Mean square of the kept errors of a track, rad²; nothing where none of it is there.
    pub(crate) fn mean_square_of(&self, track: usize) -> f64 {
        let own = self.segments.iter().zip(&self.kept).filter(|(s, _)| s.track == track);
        mean_square(own.flat_map(|(s, kept)| s.angle.iter().zip(kept).filter(|(_, k)| **k).map(|(a, _)| *a)))
    }

    /// Size of the error.
    pub(crate) fn size(&self) -> ErrorSize {
        let peak = self.errors().fold(0.0f64, |m, a| m.max(a.abs()));
        let spans = self.segments.iter().zip(&self.kept).map(|(s, k)| {
            let (lo, hi) = s
                .angle
                .iter()
                .zip(k)
                .filter(|(_, k)| **k)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, _)| (l.min(*a), h.max(*a)));
            if hi > lo { hi - lo } else { 0.0 }
        });
        ErrorSize {
            rms_deg: self.mean_square().sqrt().to_degrees(),
            peak_deg: peak.to_degrees(),
            peak_to_peak_deg: spans.fold(0.0, f64::max).to_degrees(),
        }
    }

    /// The white part of the error, rms over all segments, rad: no correction that varies smoothly can go below it. Asks
    /// for an evaluation of every sample.
    pub(crate) fn noise_floor(&self) -> f64 {
        let (n, sum) = self
            .segments
            .iter()
            .fold((0usize, 0.0), |(n, sum), s| (n + s.samples, sum + s.samples as f64 * white_noise(&s.angle).powi(2)));
        (sum / n.max(1) as f64).sqrt()
    }
}
