//! The energy and the quadrature balance between two neighbouring samples, and what goes without saying in them.

use cvg_estimator::direction::major_axis;
use nalgebra::{DMatrix, DVector};

use crate::data::track::Track;
use crate::numerics::rounding::mean_rounded;
use crate::recording::Role;

/// The pattern turns by less than this between neighbours, rad: the command of an axis moves evenly between them.
const LARGEST_TURN_RAD: f64 = 0.15;
/// Neighbours are no further apart than so many usual intervals.
const LONGEST_INTERVAL: f64 = 3.0;

/// Two neighbouring samples: of the energy (0) and of the quadrature balance (1) the chords of both axes' commands, V, what a unit of each
/// does, 1/V, and what happened, 1/s.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub(super) chords: [[[f64; 2]; 2]; 2],
    pub(super) pulls: [[f64; 2]; 2],
    pub(super) rates: [f64; 2],
    /// direction of the pattern, rad, how fast it turns, rad/s, and the ellipticity
    pub(super) theta: f64,
    pub(super) turn_rad_s: f64,
    pub(super) ellipticity: f64,
}

impl Pair {
    /// Of sample `i` and the next, where the commands move evenly between them.
    pub(super) fn new(track: &Track, i: usize, longest_s: f64) -> Option<Self> {
        let at = |i: usize| {
            let seen = track.envelope(i);
            let p = seen.pendulum();
            (track.moment(i, 0.0).drive, major_axis(&seen, &p), p)
        };
        let ((f, before, p), (g, after, r)) = (at(i), at(i + 1));
        let interval_s = track.t_s[i + 1] - track.t_s[i];
        let (sin, cos) = (before.sin + after.sin, before.cos + after.cos);
        let turned = before.cos * after.sin - before.sin * after.cos;
        let (length, a) = (sin.hypot(cos), (0.5 * (p.e + r.e)).sqrt());
        let rates = [0.5 * (r.e / p.e).ln(), 0.5 * (r.q / r.e - p.q / p.e)].map(|change| change / interval_s);
        // of two directions that are almost one the sum is almost two
        let is_even = length > 1.0 && turned.abs() < LARGEST_TURN_RAD && interval_s < longest_s;
        let (sin, cos) = (sin / length, cos / length);
        (is_even && rates.iter().all(|rate| rate.is_finite())).then(|| Self {
            chords: [[[f.x_s, g.x_s], [f.y_s, g.y_s]], [[f.x_c, g.x_c], [f.y_c, g.y_c]]],
            pulls: [[-cos / a, -sin / a], [-sin / a, cos / a]],
            rates,
            theta: sin.atan2(cos),
            turn_rad_s: turned / interval_s,
            ellipticity: 0.5 * (p.q / p.e + r.q / r.e),
        })
    }

    /// Every `stride`th of the samples of a track that are fitted.
    pub(super) fn fitted(track: &Track, stride: usize) -> Vec<Self> {
        let longest_s = longest_interval_s(track);
        let fitted = track.segments.iter().filter(|s| s.role == Role::Fit);
        let rows = fitted.flat_map(|s| (s.range.start..s.range.end.saturating_sub(1)).step_by(stride));
        rows.filter_map(|i| Self::new(track, i, longest_s)).collect()
    }

    /// The larger command of an axis, V.
    pub(super) fn largest(&self) -> f64 {
        let [[xs, ys], [xc, yc]] = self.chords.map(|axes| axes.map(|chord| chord[0]));
        xs.hypot(xc).max(ys.hypot(yc))
    }

    /// What the forces of a balance, X and Y, do to it, 1/s per unit of gain.
    pub(super) fn pushed(&self, witness: usize, force: impl Fn([f64; 2]) -> f64) -> f64 {
        let ([x, y], [by_x, by_y]) = (self.chords[witness], self.pulls[witness]);
        by_x * force(x) + by_y * force(y)
    }
}

/// The longest interval between samples of a track that are neighbours, s.
pub(super) fn longest_interval_s(track: &Track) -> f64 {
    let last = track.t_s.len().saturating_sub(1);
    LONGEST_INTERVAL * (track.t_s[last] - track.t_s[0]) / last.max(1) as f64
}

/// The mean of a command that moves evenly.
pub(super) fn commanded([from, to]: [f64; 2]) -> f64 {
    0.5 * (from + to)
}

/// One balance of one run.
pub(super) struct Balance<'a> {
    run: &'a [Pair],
    witness: usize,
    /// what goes without saying, orthonormal
    taken_out: DMatrix<f64>,
    /// what happened, without it
    pub(super) change: DVector<f64>,
}

impl<'a> Balance<'a> {
    /// Of the energy (0) or of the quadrature (1), beside `harmonics` of the pattern.
    pub(super) fn new(run: &'a [Pair], witness: usize, harmonics: &[f64]) -> Self {
        let goes_without_saying = |p: &Pair| {
            let turning = harmonics.iter().flat_map(|n| <[f64; 2]>::from((n * p.theta).sin_cos()));
            // the ellipse that is left decays
            let own = [p.ellipticity, 1.0].into_iter().skip(1 - witness);
            own.chain(turning).collect::<Vec<_>>()
        };
        let rows: Vec<f64> = run.iter().flat_map(goes_without_saying).collect();
        let taken_out = DMatrix::from_row_slice(run.len(), rows.len() / run.len(), &rows).qr().q();
        let mut balance = Self { run, witness, taken_out, change: DVector::zeros(0) };
        balance.change = balance.beside(run.iter().map(|p| p.rates[witness]));
        balance
    }

    /// A column without what goes without saying.
    pub(super) fn beside(&self, column: impl Iterator<Item = f64>) -> DVector<f64> {
        let mut column = DVector::from_iterator(self.run.len(), column);
        let share = self.taken_out.tr_mul(&column);
        column.gemv(-1.0, &self.taken_out, &share, 1.0);
        column
    }

    /// What the forces do where drives have steps of so many V; as they are commanded where of none.
    pub(super) fn pushed(&self, step: Option<f64>) -> DVector<f64> {
        let force = |chord: [f64; 2]| step.map_or_else(|| commanded(chord), |step| mean_rounded(chord, step));
        self.beside(self.run.iter().map(|p| p.pushed(self.witness, force)))
    }
}
