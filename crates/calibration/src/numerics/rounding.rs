//! What is left of rounding to whole steps where the value moves meanwhile.

/// The mean of round(v/step)·step over a value that moves evenly from `from` to `to`.
///
/// What rounding adds, s(u) = round(u) − u of u = v/step, is a sawtooth, and −½ s² is an antiderivative of it: a parabola that repeats.
#[inline]
pub(crate) fn mean_rounded([from, to]: [f64; 2], step: f64) -> f64 {
    let [from, to] = [from / step, to / step];
    let moved = to - from;
    if moved.abs() < STILL {
        return step * (0.5 * (from + to)).round();
    }
    let sawtooth = |u: f64| u.round() - u;
    let (before, after) = (sawtooth(from), sawtooth(to));
    step * (0.5 * (from + to) + 0.5 * (before * before - after * after) / moved)
}

/// A value that moves by less than this share of a step stands still: the difference of two parabolas would be rounding alone.
const STILL: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::mean_rounded;

    #[test]
    fn the_mean_is_that_of_many_values_on_the_way() {
        let n = 200_000;
        for [from, to] in [[0.1, 0.3], [0.1, 2.7], [-3.3, 1.9], [0.49, 0.51], [4.0, -4.0], [-0.5, 0.5]] {
            let on_the_way = |i: i32| from + (to - from) * (f64::from(i) + 0.5) / f64::from(n);
            let mean = (0..n).map(|i| (on_the_way(i) / 0.4).round() * 0.4).sum::<f64>() / f64::from(n);
            assert!((mean_rounded([from, to], 0.4) - mean).abs() < 1e-5, "{from} to {to}");
        }
    }

    #[test]
    fn what_stands_still_is_rounded_and_what_crosses_whole_steps_is_not() {
        assert_eq!(mean_rounded([0.7, 0.7], 0.5), 0.5);
        assert_eq!(mean_rounded([0.8, 0.8 + 1e-9], 0.5), 1.0);
        assert!((mean_rounded([0.2, 1.7], 0.5) - 0.95).abs() < 1e-15);
    }
}
