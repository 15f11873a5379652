//! A rotation that is of another device than the rest, or in which something acted that acts in none of them.
//!
//! Its angular gain may be that of the others, and a common fit then spreads what it says over all: more is left of every run, and effects
//! that are in the others are lost. Left out, the others are explained, and what explains them leaves far more of it than of any of them.

use crate::data::track::Track;
use crate::diagnostics::evaluate::evaluate;
use crate::error::Refusal;
use crate::estimation::fit::{Fit, Prepared};
use crate::estimation::joint_fit::{Dataset, fitted_tracks};
use crate::estimation::residuals::Window;
use crate::identified::Options;
use crate::model::hypothesis::Hypothesis;
use crate::rate_table::explained::Explained;
use crate::recording::Role;

/// Rotations to fit, of which one may be left out so.
const FEWEST_RUNS: usize = 4;
/// What is left of a run, rms, over its white noise from which on something is wrong.
const WRONG: f64 = 10.0;
/// Runs that are tried, of recordings with so many rows in all, and of longer ones.
const TRIED: usize = 4;
const MANY_ROWS: usize = 400_000;
const TRIED_OF_MANY: usize = 1;
/// Speeds and amplitudes within this share are alike.
const ALIKE: f64 = 0.05;
/// Left out, the others leave this share of their mean square at most, and it leaves this many times theirs: a fourth and five times of
/// the rms. Engineering choices.
const EXPLAINED: f64 = 1.0 / 16.0;
const FOREIGN: f64 = 25.0;

impl Explained {
    /// Begun anew without the rotation that keeps the others from being explained; this, where there is none. With every rotation, all that they
    /// ask for left `before` of each, whatever of it was taken back.
    pub(super) fn without_a_foreign_rotation(
        self,
        before: &[Option<f64>],
        dataset: &mut Dataset,
        paper: &Hypothesis,
        options: &Options<'_>,
    ) -> Result<Self, Refusal> {
        if !options.discover {
            return Ok(self);
        }
        let suspects = suspects(dataset, &left_of_each(dataset, &self.fitted.fit));
        for at in &suspects {
            (options.progress)("beginning anew without a rotation that does not agree");
            let before = before.iter().enumerate().filter(|(other, _)| other != at).filter_map(|(_, left)| *left);
            let before = mean(before);
            let (foreign, said) = (dataset.tracks.remove(*at), dataset.warnings.len());
            let Ok(anew) = Self::from(dataset, paper, options) else {
                dataset.tracks.insert(*at, foreign);
                dataset.warnings.truncate(said);
                continue;
            };
            let after = mean(left_of_each(dataset, &anew.fitted.fit).into_iter().flatten());
            let starts = std::slice::from_ref(&foreign.starts);
            let hypothesis = &anew.fitted.fit.hypothesis;
            let own = evaluate(std::slice::from_ref(&foreign), hypothesis, starts, Role::Fit, Window::Whole, None);
            let own = own.mean_square();
            // one that is alone at its amplitude may show what no other does
            let is_among = |of| is_among(&foreign.track, &dataset.tracks, of);
            let stands_apart = after < EXPLAINED * before || is_among(Track::mean_speed);
            if is_among(Track::mean_amplitude) && stands_apart && own > FOREIGN * after {
                let degrees = |mean_square: f64| mean_square.sqrt().to_degrees();
                let why = format!(
                    "what explains the other rotations to {:.4}° leaves {:.4}° of it: of another device, or something acted in it alone",
                    degrees(after),
                    degrees(own)
                );
                let number = dataset.screen.kept[*at];
                dataset.screen.leave_out(number, &foreign.track.name, &why, &mut dataset.warnings);
                return Ok(anew);
            }
            dataset.tracks.insert(*at, foreign);
            dataset.warnings.truncate(said);
        }
        dataset.restore(&self.fitted);
        Ok(self)
    }
}

/// A rotation at a speed, or an amplitude, that other fitted ones have, or have on either side.
fn is_among(track: &Track, others: &[Prepared], of: fn(&Track) -> f64) -> bool {
    let ends = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
    let (low, high) = fitted_tracks(others).map(of).fold((f64::INFINITY, 0.0), ends);
    (low / (1.0 + ALIKE)..=high * (1.0 + ALIKE)).contains(&of(track))
}

/// The rotations of which most is left, where that is far beyond their noise.
fn suspects(dataset: &Dataset, left: &[Option<f64>]) -> Vec<usize> {
    if left.iter().flatten().count() < FEWEST_RUNS {
        return Vec::new();
    }
    let is_suspect = |(at, left): (usize, &Option<f64>)| {
        let white = dataset.tracks[at].white.angle.powi(2);
        left.filter(|left| *left > WRONG * WRONG * white).map(|left| (at, left))
    };
    let mut suspects: Vec<(usize, f64)> = left.iter().enumerate().filter_map(is_suspect).collect();
    suspects.sort_by(|a, b| b.1.total_cmp(&a.1));
    let rows: usize = dataset.tracks.iter().map(|p| p.track.t_s.len()).sum();
    let tried = if rows > MANY_ROWS { TRIED_OF_MANY } else { TRIED };
    suspects.into_iter().take(tried).map(|(at, _)| at).collect()
}

/// Mean square of what is left of each rotation that is fitted, rad².
pub(super) fn left_of_each(dataset: &Dataset, fit: &Fit) -> Vec<Option<f64>> {
    let all = evaluate(&dataset.tracks, &fit.hypothesis, &fit.starts, Role::Fit, Window::Whole, None);
    let of = |track: usize| {
        let segments = all.segments.iter().zip(&all.kept).filter(|(s, _)| s.track == track);
        let kept = segments.flat_map(|(s, kept)| s.angle.iter().zip(kept).filter(|(_, kept)| **kept));
        let (sum, rows) = kept.fold((0.0, 0usize), |(sum, rows), (angle, _)| (sum + angle * angle, rows + 1));
        (rows > 0).then(|| sum / rows as f64)
    };
    (0..dataset.tracks.len()).map(of).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), v| (sum + v, count + 1));
    sum / count.max(1) as f64
}
