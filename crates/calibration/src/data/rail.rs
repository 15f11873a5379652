//! The rail of a converter: the extreme value occurs far more often than the level beside it.

use crate::recording::{Channel, Recording};

/// The extreme value has to occur this often, and in this share of the rows, to be a rail.
const FEWEST_TIES: usize = 4;
const LEAST_SHARE: f64 = 0.002;
/// … and this many times as often as the next level. A sine dwells at its peak: its last two levels of equal width are
/// occupied as √2 : 2 − √2, 2.4 times at most.
const TIES_OVER_NEXT: usize = 4;

/// The rails that a channel reaches, lower and upper; infinite where it reaches none.
pub(crate) fn rails(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut lower, mut upper) = (Levels::default(), Levels::default());
    for value in values {
        lower.add(-value);
        upper.add(value);
    }
    [
        if lower.end_at_a_rail() { -lower.outermost.value } else { f64::NEG_INFINITY },
        if upper.end_at_a_rail() { upper.outermost.value } else { f64::INFINITY },
    ]
}

/// A value, and how often it occurs.
#[derive(Clone, Copy)]
struct Level {
    value: f64,
    count: usize,
}

/// The two largest levels of some values, and how many values there are.
struct Levels {
    outermost: Level,
    next: Level,
    count: usize,
}

impl Default for Levels {
    fn default() -> Self {
        let none = Level { value: f64::NEG_INFINITY, count: 0 };
        Self { outermost: none, next: none, count: 0 }
    }
}

impl Levels {
    #[inline]
    fn add(&mut self, value: f64) {
        self.count += 1;
        if value > self.outermost.value {
            self.next = std::mem::replace(&mut self.outermost, Level { value, count: 1 });
        } else if value == self.outermost.value {
            self.outermost.count += 1;
        } else if value > self.next.value {
            self.next = Level { value, count: 1 };
        } else if value == self.next.value {
            self.next.count += 1;
        }
    }

    #[allow(clippy::cast_precision_loss, reason = "a count of rows")]
    fn end_at_a_rail(&self) -> bool {
        let ties = self.outermost.count;
        let enough = ties >= FEWEST_TIES && ties as f64 >= LEAST_SHARE * self.count as f64;
        // half of all rows at one value is a channel that does not move
        enough && ties > TIES_OVER_NEXT * self.next.count.max(1) && 2 * ties < self.count
    }
}

/// Whether each row of a recording has a channel of the vibration in phase at a rail, by the channel's own values.
pub(crate) fn rows_at_rails(recording: &Recording) -> Vec<bool> {
    let mut out = vec![false; recording.len()];
    for values in [Channel::Xc, Channel::Yc].into_iter().filter_map(|c| recording.channel(c)) {
        let [lower, upper] = rails(values.iter().copied());
        out.iter_mut().zip(values).for_each(|(out, v)| *out |= *v <= lower || *v >= upper);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of amplitude 10 in whole steps, clipped at these levels.
    fn clipped(lower: f64, upper: f64) -> Vec<f64> {
        (0..5000).map(|i| (10.0 * (0.1 * f64::from(i)).sin()).clamp(lower, upper).round()).collect()
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
        assert_eq!(rails(std::iter::repeat_n(3.0, 100)), open);
        assert_eq!(rails(std::iter::empty()), open);
    }

    #[test]
    fn the_order_of_the_rows_and_those_without_a_value_change_nothing() {
        let mut rows = clipped(-5.0, 6.0);
        rows.reverse();
        assert_eq!(rails(rows.iter().copied()), [-5.0, 6.0]);
        rows.sort_by(f64::total_cmp);
        assert_eq!(rails(rows.iter().copied()), [-5.0, 6.0]);
        rows.extend([f64::NAN; 20]);
        rows.extend([-f64::NAN; 20]);
        assert_eq!(rails(rows.into_iter()), [-5.0, 6.0]);
    }
}
