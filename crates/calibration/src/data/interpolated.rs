//! Rows that were not recorded but drawn: X and Y on the straight line between their neighbours, as where a file was resampled.
//!
//! A vibration whose angle turns by 2φ from one neighbour to the other bends away from their chord $c$ by the sagitta
//! $s = c^2/8a$, with the amplitude $a$; of channels with unequal gains, that of the circle that they draw with equal ones. Neither noise nor the shape of the readout takes that to nothing in row after row;
//! linear interpolation does. Between the rows that were recorded the angle may have turned any number of times.

use crate::data::plausibility::{Findings, leave_out as leave_out_rows, places, stretches};
use crate::numerics::statistics::inner_range;
use crate::recording::Recording;

/// A row is on the chord where it is off by less than this share of the sagitta, and by no more than rounding: channels that saturate run
/// straighter than a circle, and not that straight.
const ON_THE_CHORD: f64 = 0.1;
/// A sagitta tells where it is this many times the resolution of a channel: below, a coarse converter draws chords as well.
const RESOLVED: f64 = 4.0;
/// A row stands between its neighbours in time by this share of their distance; beside a gap it does not.
const EVEN: std::ops::RangeInclusive<f64> = 0.2..=0.8;
/// More rows than this share lie on no chord by chance: white noise as large as the sagitta puts one in 300 there.
const BY_CHANCE: f64 = 0.05;
/// … and in a short recording more than so many.
const FEWEST: usize = 8;
/// Rows that tell a channel's resolution.
const ENOUGH: usize = 2000;
/// Channels go round where each quarter about their middle has this share of the rows.
const A_QUARTER: f64 = 0.05;

/// Leaves out rows that lie on the straight line between their neighbours, and says so.
pub(super) fn leave_out(recording: &mut Recording, name: &str, findings: &mut Findings) {
    let (Some(x), Some(y)) = (recording.xc_v.as_deref(), recording.yc_v.as_deref()) else { return };
    let drawn = interpolated_rows(&recording.t_s, x, y);
    if let Some(what) = said(&drawn, &recording.t_s) {
        findings.warnings.push(format!("{name}: {what}"));
        leave_out_rows(recording, &drawn);
    }
}

/// What is wrong with a recording of which these rows were drawn, if any were.
pub(crate) fn said(drawn: &[bool], t_s: &[f64]) -> Option<String> {
    let lost = drawn.iter().filter(|on| **on).count();
    (lost > 0).then(|| {
        format!(
            "X and Y of {lost} of {} rows lie on straight lines between their neighbours, which a turning angle does not: \
             {}; these rows were interpolated and are left out",
            drawn.len(),
            places(t_s, &stretches(drawn.len(), |i| drawn[i]))
        )
    })
}

/// Which rows lie on the chord of their neighbours; none unless more do than by chance.
#[allow(clippy::float_cmp, reason = "a value that stands still is the same to the last bit")]
pub(crate) fn interpolated_rows(t: &[f64], x: &[f64], y: &[f64]) -> Vec<bool> {
    let rows = t.len();
    let mut drawn = vec![false; rows];
    let circle = as_a_circle(x, y);
    let (x, y) = circle.as_ref().map_or((x, y), |[x, y]| (x.as_slice(), y.as_slice()));
    let rounding = RESOLVED * f64::max(resolution(x), resolution(y));
    let mut judged = 0;
    for i in 1..rows.saturating_sub(1) {
        let share = (t[i] - t[i - 1]) / (t[i + 1] - t[i - 1]);
        let off = |v: &[f64]| v[i] - v[i - 1] - share * (v[i + 1] - v[i - 1]);
        // squares: a root for every row is most of the time
        let square = |x: f64, y: f64| x * x + y * y;
        let chord_square = square(x[i + 1] - x[i - 1], y[i + 1] - y[i - 1]);
        let amplitude = f64::max(square(x[i - 1], y[i - 1]), square(x[i + 1], y[i + 1])).sqrt();
        // what was drawn stands evenly; across a gap nothing was
        let is_even = EVEN.contains(&share);
        // a channel that stands still is another fault
        let both_move = x[i] != x[i - 1] && y[i] != y[i - 1];
        let sagitta = chord_square / (8.0 * amplitude);
        if is_even && both_move && sagitta > rounding {
            judged += 1;
            drawn[i] = square(off(x), off(y)) < rounding.min(ON_THE_CHORD * sagitta).powi(2);
        }
    }
    let found = drawn.iter().filter(|on| **on).count();
    if found < FEWEST || found as f64 <= BY_CHANCE * f64::from(judged) {
        drawn.fill(false);
    }
    drawn
}

/// Channels that go round, each from its middle and over its own range; none where they do not, of which nothing tells a range.
fn as_a_circle(x: &[f64], y: &[f64]) -> Option<[Vec<f64>; 2]> {
    let scaled = |v: &[f64]| -> Option<Vec<f64>> {
        let [low, high] = inner_range(v)?;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        (half > 0.0).then(|| v.iter().map(|v| (v - middle) / half).collect())
    };
    let [x, y] = [scaled(x)?, scaled(y)?];
    let mut quarters = [0_usize; 4];
    for (x, y) in x.iter().zip(&y) {
        quarters[usize::from(*x > 0.0) + 2 * usize::from(*y > 0.0)] += 1;
    }
    quarters.iter().all(|n| *n as f64 > A_QUARTER * x.len() as f64).then_some([x, y])
}

/// The smallest distance between different values of a channel, of some of its rows: of a converter, its resolution.
pub(crate) fn resolution(v: &[f64]) -> f64 {
    let mut some: Vec<f64> = v.iter().copied().step_by((v.len() / ENOUGH).max(1)).collect();
    some.sort_by(f64::total_cmp);
    some.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::plausibility::mend;
    use crate::data::plausibility::tests::recorded;

    /// Of every `step` rows the first as it was, the others on the line to the next.
    fn resampled(step: usize) -> Recording {
        let mut recording = recorded();
        for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
            for i in 0..v.len() - step {
                let from = i - i % step;
                v[i] = v[from] + (v[from + step] - v[from]) * (i - from) as f64 / step as f64;
            }
        }
        recording
    }

    #[test]
    fn rows_between_which_a_file_was_resampled_are_left() {
        for step in [2, 3, 7] {
            let mut recording = resampled(step);
            let (all, times) = (recording.len(), recording.t_s.clone());
            let findings = mend(&mut recording);
            assert!(findings.broken.is_none() && findings.warnings[0].contains("were interpolated"), "{findings:?}");
            assert!(recording.len().abs_diff(all / step) <= 2 * step, "{} of {all}", recording.len());
            assert!(recording.t_s.iter().take(50).eq(times.iter().step_by(step).take(50)));
        }
    }

    #[test]
    fn a_turning_vibration_draws_no_chords() {
        let sound = recorded();
        let drawn = |x: &[f64], y: &[f64]| interpolated_rows(&sound.t_s, x, y).contains(&true);
        let (Some(x), Some(y)) = (&sound.xc_v, &sound.yc_v) else { panic!() };
        assert!(!drawn(x, y));
        // of unequal gains and about another origin
        let eight_times: Vec<f64> = x.iter().map(|x| 8.0 * x - 3.0).collect();
        assert!(!drawn(&eight_times, y) && !drawn(y, &eight_times));
        // twelve bits, and steps of less than one of theirs
        for rate_dps in [500.0, 20.0, 2.0] {
            let theta = |i: usize| 0.3 - 0.78 * (rate_dps * 0.01 * i as f64).to_radians();
            let counted = |v: f64| (v * 2048.0).round();
            let x: Vec<f64> = (0..2000).map(|i| counted(theta(i).cos())).collect();
            let y: Vec<f64> = (0..2000).map(|i| counted(theta(i).sin())).collect();
            assert!(!drawn(&x, &y), "{rate_dps}");
        }
    }

    /// Blocks of a recording that are held out leave gaps, beside which the rounding of a converter draws what it likes.
    #[test]
    fn nothing_is_drawn_across_a_gap() {
        let (mut t, mut angle) = (vec![0.0], vec![0.0f64]);
        for i in 1..600 {
            // every second interval is twenty times as long, and the pattern stands in it
            let (passed, turned) = if i % 2 == 0 { (0.2, 0.0) } else { (0.01, 0.02) };
            t.push(t[i - 1] + passed);
            angle.push(angle[i - 1] + turned);
        }
        let on_chords = |v: Vec<f64>| -> Vec<f64> {
            (0..v.len())
                .map(|i| match i % 2 {
                    1 if i + 1 < v.len() => {
                        v[i - 1] + (v[i + 1] - v[i - 1]) * (t[i] - t[i - 1]) / (t[i + 1] - t[i - 1])
                    }
                    _ => v[i],
                })
                .collect()
        };
        let wide = |f: fn(f64) -> f64| on_chords(angle.iter().map(|a| f(8.0 * a)).collect());
        assert!(!interpolated_rows(&t, &wide(f64::cos), &wide(f64::sin)).contains(&true));
    }
}
