//! What a hypothesis leaves of the recorded angle and amplitude, segment by segment, as columns.

use rayon::prelude::*;

use crate::data::track::{DENSE_SAMPLES, Segment, Track};
use crate::estimation::fit::{Prepared, thinning};
use crate::estimation::propagation::{Start, Stepping, propagate};
use crate::model::hypothesis::{Hypothesis, direction};
use crate::model::unknowns::Unknowns;
use crate::numerics::statistics::circular_mean;
use crate::recording::Role;

/// What part of a segment is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Window {
    /// all of it, thinned where it is long
    Whole,
    /// its beginning, every sample
    Dense,
}

impl Window {
    /// The samples of segment `number` of a track that are looked at.
    fn of(self, track: &Track, number: usize) -> (&Track, Segment) {
        let track = if self == Self::Dense { track.dense() } else { track };
        let Segment { range, role } = track.segments[number].clone();
        let end = if self == Self::Dense { range.end.min(range.start + DENSE_SAMPLES) } else { range.end };
        (track, Segment { range: range.start..end, role })
    }
}

/// Samples that tell where a segment starts.
const START_SAMPLES: usize = 500;

/// The residuals of a hypothesis on the segments of `role`, per track.
pub(crate) fn residuals(
    tracks: &[Prepared],
    hypothesis: &Hypothesis,
    starts: &[Vec<Start>],
    role: Role,
    window: Window,
) -> Vec<Vec<Residual>> {
    let none = Unknowns::new(hypothesis, Vec::new());
    tracks
        .par_iter()
        .zip(starts)
        .enumerate()
        .map(|(number, (prepared, starts))| {
            let mut out = Vec::new();
            for (at, start) in starts.iter().enumerate() {
                let (track, segment) = window.of(&prepared.track, at);
                if segment.role == role {
                    let mut r = Residual::new(number, &segment);
                    let mut start = *start;
                    if role == Role::Holdout {
                        // nothing was fitted here: where the segment starts is found first
                        let mut angles = Vec::new();
                        let coarse = Stepping::every(thinning(track, hypothesis, segment.range.len(), START_SAMPLES));
                        propagate(track, &segment, hypothesis, &none, start, coarse, |row| angles.push(row.angle));
                        start.angle += circular_mean(angles.into_iter(), hypothesis.period_rad);
                    }
                    let stepping = Stepping::without(prepared.limit.angle);
                    propagate(track, &segment, hypothesis, &none, start, stepping, |row| r.push(track, row));
                    out.push(r);
                }
            }
            out
        })
        .collect()
}

/// Residuals of one segment, as columns.
#[derive(Debug, Clone, Default)]
pub(crate) struct Residual {
    pub(crate) track: usize,
    pub(crate) samples: usize,
    pub(crate) t_s: Vec<f64>,
    /// input angle since the segment's start, and the table's, rad
    pub(crate) turned: Vec<f64>,
    pub(crate) table: Vec<f64>,
    /// direction of the vibration over the full turn, rad
    pub(crate) direction: Vec<f64>,
    /// nominal precession rate, rad/s
    pub(crate) precession: Vec<f64>,
    /// rad
    pub(crate) angle: Vec<f64>,
    pub(crate) amplitude: Vec<f64>,
}

impl Residual {
    pub(crate) fn new(track: usize, segment: &Segment) -> Self {
        Self { track, samples: segment.range.len(), ..Self::default() }
    }

    pub(crate) fn push(&mut self, track: &Track, row: &crate::estimation::propagation::Row<'_>) {
        self.t_s.push(track.t_s[row.index]);
        self.turned.push(row.turned);
        self.table.push(track.input_rad[row.index]);
        self.direction.push(direction(&row.vibration));
        self.precession.push(row.precession);
        self.angle.push(row.angle);
        self.amplitude.push(row.amplitude);
    }
}
