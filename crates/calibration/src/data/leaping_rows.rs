//! Rows whose channels leap: no vibration does for a row or two, but numbers are damaged so. The angle of such a row is off and can be
//! set aside; what a split of the frequencies makes of its quadrature and amplitude would stay in the angle to the end of the recording.
//!
//! A value is compared with the cubic through two rows before and two after it. One that leaps pulls those about it off their own
//! cubics, so that rows are looked at in clusters, and taken out one by one, the furthest first, until the rest is smooth.
//!
//! Rows in which nothing is read at all were lost on their way and filled in: they say nothing of those about them.

use std::ops::Range;

use rayon::prelude::*;

use crate::data::plausibility::{places, stretches};
use crate::numerics::statistics::median;
use crate::recording::{Channel, Recording};

/// A value leaps by this many times what is usual, which is this often what [`USUAL`] of all values are off their cubics at the most.
const LEAP: f64 = 12.0;
const USUAL: f64 = 0.5;
const TAIL: f64 = 3.7;
/// … at either end, where a cubic is gone on with, this many times as far.
const AT_AN_END: f64 = 4.0;
/// Rows before and after that say what a value should be, and how many usual intervals all of them may span.
const BESIDE: usize = 2;
const SPAN: f64 = 10.0;
/// What leads to a leap from before and from after is the same within this share of it: it is no step.
const BACK: f64 = 0.2;
/// A command that leaps in more than this share of the rows is given in pulses.
const MOST_OF_A_COMMAND: f64 = 0.03;
/// Nothing is read where the amplitude is below this share of the usual one; so many such rows in a row can be filled in.
const NOTHING: f64 = 0.1;
const LONGEST_LOST: usize = 5;
/// … beside rows in which so many times as much is.
const AGAIN: f64 = 3.0;
/// So many rows in a row leap at the most, and of a cluster this share and one.
const LONGEST: usize = 2;
const OF_A_CLUSTER: usize = 3;
/// A cluster of more rows than this is a channel that works in steps, and no few rows that leap.
const LARGEST_CLUSTER: usize = 60;
/// Rows beyond which every so many say what is usual.
const ENOUGH_ROWS: usize = 100_000;

/// Puts into rows in which a channel of the vibration, or a command, leaps, or in which nothing is read, what lies between those beside
/// them; how many they are, and what to say of them. The row stays: its rate belongs to the angle of the reference.
pub(crate) fn mend(recording: &mut Recording) -> Option<(usize, String)> {
    let times = Times::of(&recording.t_s, lost(recording));
    let channels = [Channel::Xc, Channel::Yc, Channel::Xs, Channel::Ys, Channel::Vas, Channel::Vqc];
    let found: Vec<(Channel, Vec<(usize, f64)>)> = channels
        .into_par_iter()
        .filter_map(|channel| {
            let values = recording.channel(channel)?;
            let mut leaps = Column { times: &times, values }.leaps();
            if matches!(channel, Channel::Vas | Channel::Vqc) {
                // a loop that begins to work leaps at the beginning
                leaps.retain(|(i, _)| (BESIDE..values.len() - BESIDE).contains(i));
                if leaps.len() as f64 > MOST_OF_A_COMMAND * values.len() as f64 {
                    leaps.clear();
                }
            }
            Some((channel, leaps)).filter(|(_, leaps)| !leaps.is_empty())
        })
        .collect();
    let mut leaping = vec![false; recording.len()];
    for (channel, leaps) in found {
        let Some(mut values) = recording.channel(channel).map(<[f64]>::to_vec) else { continue };
        for (i, value) in leaps {
            values[i] = value;
            leaping[i] = true;
        }
        recording.set_channel(channel, values);
    }
    let rows = stretches(leaping.len(), |i| leaping[i]);
    let count: usize = rows.iter().map(Range::len).sum();
    let said = || {
        format!(
            "{}: a channel or a command leaps for single rows, which no vibration does: {}; {count} rows are spikes, and take what lies between \
             those beside them",
            recording.source.display(),
            places(&recording.t_s, &rows)
        )
    };
    (count > 0).then(|| (count, said()))
}

/// Rows in which nothing is read, few enough in a row.
fn lost(recording: &Recording) -> Vec<bool> {
    let rows = recording.len();
    let Some((x, y)) = recording.xc_v.as_ref().zip(recording.yc_v.as_ref()) else { return vec![false; rows] };
    let of = |v: &Option<Vec<f64>>, i: usize| v.as_ref().map_or(0.0, |v| v[i]);
    let size = |i: usize| x[i].hypot(y[i]).hypot(of(&recording.xs_v, i).hypot(of(&recording.ys_v, i)));
    let sizes: Vec<f64> = (0..rows).map(size).collect();
    let usual = median(&mut sizes.clone());
    let mut lost = vec![false; rows];
    let all = stretches(rows, |i| sizes[i] < NOTHING * usual);
    // an amplitude that decays goes there by degrees
    let is_read = |i: usize| i >= rows || sizes[i] > AGAIN * NOTHING * usual;
    let is_a_gap =
        |r: &Range<usize>| r.len() <= LONGEST_LOST && is_read(r.end) && (r.start == 0 || is_read(r.start - 1));
    all.into_iter().filter(is_a_gap).for_each(|r| lost[r].fill(true));
    lost
}

/// When the rows were recorded, and which of them say nothing.
struct Times<'a> {
    t_s: &'a [f64],
    lost: Vec<bool>,
    any_is_lost: bool,
    /// a usual interval, s
    usual_s: f64,
}

impl<'a> Times<'a> {
    fn of(t_s: &'a [f64], lost: Vec<bool>) -> Self {
        let mut intervals: Vec<f64> = t_s.windows(2).step_by(stride(t_s.len())).map(|t| t[1] - t[0]).collect();
        Self { t_s, any_is_lost: lost.contains(&true), lost, usual_s: median(&mut intervals) }
    }
}

/// Of so many rows, every how many say what is usual.
fn stride(rows: usize) -> usize {
    (rows / ENOUGH_ROWS).max(1)
}

/// A channel over time.
struct Column<'a> {
    times: &'a Times<'a>,
    values: &'a [f64],
}

impl Column<'_> {
    /// The rows that leap, and what lies between those beside them.
    fn leaps(&self) -> Vec<(usize, f64)> {
        let (n, lost) = (self.values.len(), &self.times.lost);
        // a digit more or less is no leap
        let steps = self.values.windows(2).map(|v| (v[1] - v[0]).abs());
        let digit = steps.filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        if n <= 4 * BESIDE || digit.is_infinite() {
            return Vec::new();
        }
        let off = |i: usize, out: &[usize]| self.off(i, out, SPAN * self.times.usual_s);
        let own = |i: usize| if lost[i] { 0.0 } else { off(i, &[]) };
        let mut some: Vec<f64> = (0..n).step_by(stride(n)).map(own).collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the rows")]
        let at = (USUAL * (some.len() - 1) as f64) as usize;
        let limit = LEAP * (TAIL * *some.select_nth_unstable_by(at, f64::total_cmp).1).max(digit);
        let is_lost = (0..n).filter(|i| lost[*i]);
        let mut found: Vec<(usize, f64)> = is_lost.map(|i| (i, self.between(i, &[]))).collect();
        for cluster in clusters((0..n).filter(|i| own(*i) > limit), n) {
            let Some(leaping) = leaping(&cluster.filter(|i| !lost[*i]).collect::<Vec<_>>(), limit, off) else {
                continue;
            };
            let goes_back = |i: &usize| self.goes_back(*i, &leaping);
            if leaping.iter().all(goes_back) {
                found.extend(leaping.iter().map(|i| (*i, self.between(*i, &leaping))));
            }
        }
        found
    }

    /// By how much a value is off what those beside it say without rows that are `out`; nothing where they are far apart.
    fn off(&self, i: usize, out: &[usize], widest_s: f64) -> f64 {
        let beside = self.beside(i, out);
        let (first, last) = (beside[0].min(i), beside[2 * BESIDE - 1].max(i));
        if self.times.t_s[last] - self.times.t_s[first] > widest_s {
            return 0.0;
        }
        let is_an_end = i < BESIDE || i + BESIDE >= self.values.len();
        let factor = if is_an_end { AT_AN_END } else { 1.0 };
        (self.values[i] - self.through(&beside, self.times.t_s[i])).abs() / factor
    }

    /// The nearest rows before and after one that are not `out`, in their order; at an end more of the other side.
    fn beside(&self, i: usize, out: &[usize]) -> [usize; 2 * BESIDE] {
        let n = self.values.len();
        // most rows, and the least work
        let lost = &self.times.lost;
        let all_are_sound = |lost: &[bool]| out.is_empty() && (!self.times.any_is_lost || !lost.contains(&true));
        if i >= BESIDE && lost.get(i - BESIDE..=i + BESIDE).is_some_and(all_are_sound) {
            return std::array::from_fn(|k| if k < BESIDE { i + k - BESIDE } else { i + 1 + k - BESIDE });
        }
        let is_sound = |j: &usize| !lost[*j] && !out.contains(j);
        let mut before = (0..i).rev().filter(is_sound);
        let mut after = (i + 1..n).filter(is_sound);
        let mut beside = [i; 2 * BESIDE];
        for pair in beside.chunks_exact_mut(2) {
            let (left, right) = (before.next(), after.next());
            pair[0] = left.or_else(|| after.nth(0)).unwrap_or(i);
            pair[1] = right.or_else(|| before.nth(0)).unwrap_or(i);
        }
        beside.sort_unstable();
        beside
    }

    /// The polynomial through some rows, at a time (Lagrange).
    fn through(&self, rows: &[usize], t: f64) -> f64 {
        let from = |j: usize| self.times.t_s[j] - t;
        let weight = |j: usize| {
            let others = rows.iter().filter(|k| **k != j);
            let (above, below) =
                others.fold((1.0, 1.0), |(above, below), &k| (above * from(k), below * (from(k) - from(j))));
            above / below
        };
        rows.iter().map(|&j| weight(j) * self.values[j]).sum()
    }

    fn between(&self, i: usize, out: &[usize]) -> f64 {
        self.through(&self.beside(i, out), self.times.t_s[i])
    }

    /// Whether the rows before and those after one lead to the same, beside which it leaps.
    fn goes_back(&self, i: usize, out: &[usize]) -> bool {
        let (before, after): (Vec<usize>, Vec<usize>) = self.beside(i, out).iter().partition(|j| **j < i);
        if before.len() != after.len() {
            return true;
        }
        let [from, to] = [before, after].map(|rows| self.through(&rows, self.times.t_s[i]));
        (to - from).abs() < BACK * (self.values[i] - 0.5 * (from + to)).abs()
    }
}

/// Rows that are off, in their order, with those of `all` that could have pulled them.
fn clusters(off: impl Iterator<Item = usize>, all: usize) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for i in off {
        let (start, end) = (i.saturating_sub(BESIDE), (i + BESIDE + 1).min(all));
        match out.last_mut() {
            Some(last) if last.end >= start => last.end = end,
            _ => out.push(start..end),
        }
    }
    out
}

/// The rows of a cluster without which the rest is smooth; none where that takes too many.
fn leaping(cluster: &[usize], limit: f64, off: impl Fn(usize, &[usize]) -> f64) -> Option<Vec<usize>> {
    if cluster.len() > LARGEST_CLUSTER {
        return None;
    }
    let most = 1 + cluster.len() / OF_A_CLUSTER;
    let mut out: Vec<usize> = Vec::new();
    loop {
        let left = cluster.iter().filter(|i| !out.contains(i)).map(|i| (off(*i, &out), *i));
        match left.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((worst, _)) if worst > limit && out.len() == most => return None,
            Some((worst, i)) if worst > limit => out.push(i),
            _ => break,
        }
    }
    // between two that leap stands the one that is off the most
    for i in out.clone() {
        let others: Vec<usize> = out.iter().copied().filter(|j| *j != i).collect();
        if off(i, &others) <= limit {
            out = others;
        }
    }
    let (first, last) = (*cluster.first()?, *cluster.last()?);
    let longest = stretches(last + 1 - first, |i| out.contains(&(first + i))).iter().map(Range::len).max();
    (longest <= Some(LONGEST)).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A channel of a pattern that turns, with noise, in whole digits.
    fn channel(turn: f64, noise: f64, digit: f64) -> Vec<f64> {
        let of = |i: f64| (turn * i).sin() + noise * (i * i).sin();
        (0..3000).map(|i| (of(f64::from(i)) / digit).round() * digit).collect()
    }

    fn leaps(values: &[f64]) -> Vec<usize> {
        let t_s: Vec<f64> = (0..values.len()).map(|i| i as f64).collect();
        let times = Times::of(&t_s, vec![false; values.len()]);
        Column { times: &times, values }.leaps().into_iter().map(|(i, _)| i).collect()
    }

    #[test]
    fn a_leap_is_found_in_noise_and_in_digits_and_a_step_is_none() {
        for (turn, noise, digit) in [(0.13, 2e-5, 1e-9), (0.13, 2e-5, 1e-3), (0.01, 1e-3, 5e-2), (0.3, 1e-5, 1e-9)] {
            let mut values = channel(turn, noise, digit);
            assert_eq!(leaps(&values), [], "{turn} {digit}");
            // far apart, side by side, with one between, with three
            let damaged = [300, 700, 701, 1200, 1202, 1500, 1504];
            damaged.iter().for_each(|at| values[*at] += if at % 5 == 0 { 1.7 } else { -1.1 });
            assert_eq!(leaps(&values), damaged, "{turn} {digit}");
        }
        let step = |i: i32| if i < 1000 { 0.1 } else { -0.1 } + 1e-6 * f64::from(i % 7);
        assert_eq!(leaps(&(0..3000).map(step).collect::<Vec<_>>()), []);
        assert_eq!(leaps(&[0.0; 100]), []);
        let from_station_to_station = |i: i32| f64::from(i / 40) * 0.3 + 1e-5 * f64::from(i % 7);
        assert_eq!(leaps(&(0..3000).map(from_station_to_station).collect::<Vec<_>>()), []);
    }

    /// A command that stands still for most of the time, and works for tens of thousands of rows: each of them was weighed against all
    /// others, and a campaign of 300,000 rows took a minute of the processor.
    #[test]
    fn what_is_looked_at_grows_with_the_rows_and_not_with_their_square() {
        let looked_at = std::cell::Cell::new(0);
        for rows in [10, LARGEST_CLUSTER, 40_000] {
            let cluster: Vec<usize> = (0..rows).collect();
            let off = |_, _: &[usize]| {
                looked_at.set(looked_at.get() + 1);
                1.0
            };
            assert_eq!(super::leaping(&cluster, 0.5, off), None, "{rows}");
            assert!(looked_at.replace(0) <= LARGEST_CLUSTER * rows, "{rows}");
        }
    }

    #[test]
    fn either_end_leaps_as_well() {
        let mut values = channel(0.13, 2e-5, 1e-9);
        values[0] = 5.0;
        values[2999] = -5.0;
        assert_eq!(leaps(&values), [0, 2999]);
    }

    #[test]
    fn a_row_that_leaps_takes_what_lies_between_those_beside_it() {
        let mut recording = Recording {
            t_s: (0..3000).map(f64::from).collect(),
            xc_v: Some(channel(0.13, 2e-5, 1e-9)),
            yc_v: Some((0..3000).map(|i| (0.13 * f64::from(i)).cos()).collect()),
            ys_v: Some(channel(0.13, 2e-5, 1e-9)),
            ..Recording::default()
        };
        let sound = recording.clone();
        assert_eq!(mend(&mut recording), None);
        recording.xc_v.as_mut().into_iter().for_each(|xc| xc[900] = 0.5);
        recording.ys_v.as_mut().into_iter().for_each(|ys| ys[1700] = -4.5);
        assert!(mend(&mut recording).is_some_and(|(rows, said)| rows == 2 && said.contains("2 rows are spikes")));
        // and rows that were lost
        let channels = [&mut recording.xc_v, &mut recording.yc_v, &mut recording.ys_v];
        channels.into_iter().flatten().for_each(|values| values[2100..2103].fill(0.0));
        assert_eq!(mend(&mut recording).map(|(rows, _)| rows), Some(3));
        for channel in [Channel::Xc, Channel::Ys] {
            let (is, was) =
                (recording.channel(channel).unwrap_or_default(), sound.channel(channel).unwrap_or_default());
            assert!(is.iter().zip(was).all(|(is, was)| (is - was).abs() < 3e-4), "{channel:?}");
        }
    }
}
