//! The rail of a converter: the extreme value of a channel occurs far more often than the level beside it, and while it does
//! the other channel moves. A station that is read again and again, or a rest, repeats both.

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::recording::{Channel, Recording};

/// The extreme value has to occur in this share of the rows to be a rail.
const LEAST_SHARE: f64 = 0.002;
/// … and this many times as often as the next level. A sine dwells at its peak: its last two levels of equal width are
/// occupied as √2 : 2 − √2, 2.4 times at most, the first by this share of both.
const TIES_OVER_NEXT: usize = 4;
const OF_A_SINE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// … which a sine makes in fewer than one of so many channels: five rows against one are one in three.
const BY_CHANCE: f64 = 1e-3;
/// Share of its range that the other channel moves by at a rail: an engineering choice, a twentieth of a radian to both sides of the
/// peak, as where an eighth of a percent of the amplitude is cut off. Noise of a station that is read again and again is less.
const LEAST_SWEEP: f64 = 0.05;

/// The rails that a channel reaches, lower and upper, of its values and the other channel's; infinite where it reaches none.
pub(crate) fn rails(values: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    let (mut lower, mut upper) = (Levels::default(), Levels::default());
    for [value, other] in values {
        lower.add(-value, other);
        upper.add(value, other);
    }
    [
        if lower.end_at_a_rail() { -lower.outermost.value } else { f64::NEG_INFINITY },
        if upper.end_at_a_rail() { upper.outermost.value } else { f64::INFINITY },
    ]
}

/// A value, how often it occurs, and between what the other channel is then.
#[derive(Clone, Copy)]
struct Level {
    value: f64,
    count: usize,
    other: Span,
}

/// From the least to the largest of some values.
#[derive(Clone, Copy)]
struct Span {
    least: f64,
    largest: f64,
}

impl Span {
    const EMPTY: Self = Self { least: f64::INFINITY, largest: f64::NEG_INFINITY };

    #[inline]
    fn with(self, value: f64) -> Self {
        Self { least: self.least.min(value), largest: self.largest.max(value) }
    }

    fn width(self) -> f64 {
        (self.largest - self.least).max(0.0)
    }
}

/// The two largest levels of some values, how many values there are, and the range of the other channel.
struct Levels {
    outermost: Level,
    next: Level,
    count: usize,
    other: Span,
}

impl Default for Levels {
    fn default() -> Self {
        let none = Level { value: f64::NEG_INFINITY, count: 0, other: Span::EMPTY };
        Self { outermost: none, next: none, count: 0, other: Span::EMPTY }
    }
}

impl Levels {
    #[inline]
    fn add(&mut self, value: f64, other: f64) {
        self.count += 1;
        self.other = self.other.with(other);
        let first = || Level { value, count: 1, other: Span::EMPTY.with(other) };
        if value > self.outermost.value {
            self.next = std::mem::replace(&mut self.outermost, first());
        } else if value == self.outermost.value {
            self.outermost.count += 1;
            self.outermost.other = self.outermost.other.with(other);
        } else if value > self.next.value {
            self.next = first();
        } else if value == self.next.value {
            self.next.count += 1;
        }
    }

    #[allow(clippy::cast_precision_loss, reason = "a count of rows")]
    fn end_at_a_rail(&self) -> bool {
        let (ties, next) = (self.outermost.count, self.next.count);
        let by_chance = || Binomial::new(OF_A_SINE, (ties + next) as u64).map_or(1.0, |of| of.sf(ties as u64 - 1));
        let enough = ties as f64 >= LEAST_SHARE * self.count as f64 && ties > 0 && by_chance() < BY_CHANCE;
        let swept = self.outermost.other.width() > LEAST_SWEEP * self.other.width();
        // half of all rows at one value is a channel that does not move
        enough && swept && ties > TIES_OVER_NEXT * next.max(1) && 2 * ties < self.count
    }
}

/// Whether each row of a recording has a channel of the vibration in phase at a rail, by the channel's own values.
pub(crate) fn rows_at_rails(recording: &Recording) -> Vec<bool> {
    let mut out = vec![false; recording.len()];
    let channels = [Channel::Xc, Channel::Yc].map(|c| recording.channel(c));
    let [Some(x), Some(y)] = channels else { return out };
    for (values, others) in [(x, y), (y, x)] {
        let [lower, upper] = rails(values.iter().zip(others).map(|(v, o)| [*v, *o]));
        out.iter_mut().zip(values).for_each(|(out, v)| *out |= *v <= lower || *v >= upper);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of amplitude 10 in whole steps, clipped at these levels, and its cosine.
    fn clipped(lower: f64, upper: f64) -> Vec<[f64; 2]> {
        let row = |(sin, cos): (f64, f64)| [(10.0 * sin).clamp(lower, upper).round(), (10.0 * cos).round()];
        (0..5000).map(|i| row((0.1 * f64::from(i)).sin_cos())).collect()
    }

    #[test]
    fn the_level_of_many_ties_is_a_rail_and_the_peak_of_a_sine_is_none() {
        let open = [f64::NEG_INFINITY, f64::INFINITY];
        assert_eq!(rails(clipped(-11.0, 11.0).into_iter()), open);
        assert_eq!(rails(clipped(-11.0, 6.0).into_iter()), [open[0], 6.0]);
        assert_eq!(rails(clipped(-6.0, 11.0).into_iter()), [-6.0, open[1]]);
        assert_eq!(rails(clipped(-5.0, 6.0).into_iter()), [-5.0, 6.0]);
        // a channel that hardly moves, and none
        assert_eq!(rails(clipped(-11.0, 0.0).into_iter()), open);
        assert_eq!(rails(std::iter::repeat_n([3.0, 3.0], 100)), open);
        assert_eq!(rails(std::iter::empty()), open);
    }

    /// Of whole counts with a hundred rows five may stand at the peak and one beside it.
    #[test]
    fn few_rows_of_a_sine_in_whole_counts_have_no_rail_by_chance() {
        let mut found = 0;
        for seed in 0..400 {
            let noise = crate::numerics::statistics::remembered(0.0, 100, seed);
            let row = |u: &f64| {
                let (sin, cos) = (100.0 * u).sin_cos();
                [(98.0 * cos).round(), (98.0 * sin).round()]
            };
            found += usize::from(rails(noise.iter().map(row)).iter().any(|r| r.is_finite()));
        }
        assert!(found <= 2, "{found} of 400");
    }

    #[test]
    fn stations_that_are_read_again_and_again_and_rests_are_no_rails() {
        // fifty times each, the other channel by a count more or less; the first station is at the peak of x alone
        let stations = (0..24).map(|n| (0.262 * f64::from(n)).sin_cos());
        let rows = stations.flat_map(|(sin, cos)| {
            (0..50).map(move |i| [(1000.0 * cos).round(), (1000.0 * sin).round() + f64::from(i % 3 - 1)])
        });
        let turned = rows.clone().map(|[x, y]| [y, x]);
        for rows in [rows.collect::<Vec<_>>(), turned.collect()] {
            assert_eq!(rails(rows.into_iter()), [f64::NEG_INFINITY, f64::INFINITY]);
        }
    }

    #[test]
    fn the_order_of_the_rows_and_those_without_a_value_change_nothing() {
        let mut rows = clipped(-5.0, 6.0);
        rows.reverse();
        assert_eq!(rails(rows.iter().copied()), [-5.0, 6.0]);
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(rails(rows.iter().copied()), [-5.0, 6.0]);
        rows.extend([[f64::NAN, f64::NAN]; 20]);
        rows.extend([[-f64::NAN, f64::NAN]; 20]);
        assert_eq!(rails(rows.into_iter()), [-5.0, 6.0]);
    }
}
