//! Values between rows.

/// The value at time `t`, by a straight line between the rows beside it; the first or the last beyond them. `value` gives that
/// of a row. One row at least, and times that grow.
pub(crate) fn at(t_s: &[f64], t: f64, value: impl Fn(usize) -> f64) -> f64 {
    let next = t_s.partition_point(|other| *other < t).min(t_s.len() - 1);
    let Some(before) = next.checked_sub(1) else { return value(next) };
    if t >= t_s[next] {
        return value(next);
    }
    let along = (t - t_s[before]) / (t_s[next] - t_s[before]);
    value(before) * (1.0 - along) + value(next) * along
}

/// Mean rate over so long before row `i`, of an angle with these rates: between rows the cubic through both (Hermite), beyond
/// the first and the last the rate there. The rate of the row itself where the time is none.
pub(crate) fn mean_rate_before(
    t_s: &[f64],
    angle: impl Fn(usize) -> f64,
    rate: impl Fn(usize) -> f64,
    i: usize,
    since_s: f64,
) -> f64 {
    if since_s == 0.0 {
        return rate(i);
    }
    let (t, last) = (t_s[i] - since_s, t_s.len() - 1);
    let next = t_s.partition_point(|other| *other < t);
    // the angle then, from that of a row nearby, so that a small difference stays one
    let then = if next == 0 || next > last {
        let end = next.min(last);
        (angle(end) - angle(i)) + rate(end) * (t - t_s[end])
    } else {
        let (a, b) = (next - 1, next);
        let step = t_s[b] - t_s[a];
        let u = (t - t_s[a]) / step;
        let (to_a, to_b) = (angle(a) - angle(i), angle(b) - angle(i));
        to_a + (to_b - to_a) * u * u * (3.0 - 2.0 * u) + step * u * (1.0 - u) * (rate(a) * (1.0 - u) - rate(b) * u)
    };
    -then / since_s
}

/// The integral of values over time since the first row, by trapezoids; as long as the shorter of the two.
pub(crate) fn accumulated(t_s: &[f64], values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let at = |i: usize| {
        if i > 0 {
            sum += 0.5 * (values[i] + values[i - 1]) * (t_s[i] - t_s[i - 1]);
        }
        sum
    };
    (0..values.len().min(t_s.len())).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::{at, mean_rate_before};

    #[test]
    fn the_mean_rate_of_a_cubic_is_exact_within_rows_and_over_many() {
        let t_s: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i) + 0.02 * (f64::from(i)).sin()).collect();
        let of = |t: f64| 2.0 * t - 0.7 * t * t + 0.3 * t.powi(3);
        let slope = |t: f64| 2.0 - 1.4 * t + 0.9 * t * t;
        let found = |i: usize, since: f64| mean_rate_before(&t_s, |r| of(t_s[r]), |r| slope(t_s[r]), i, since);
        for since in [1e-4, 0.03, 0.1, 0.77, -0.05] {
            let mean = (of(t_s[20]) - of(t_s[20] - since)) / since;
            assert!((found(20, since) - mean).abs() < 1e-10, "{since}: {} for {mean}", found(20, since));
        }
        assert_eq!(found(7, 0.0), slope(t_s[7]));
        // before the first row it went on as there
        let before = (of(t_s[1]) - of(t_s[0]) + slope(t_s[0]) * (t_s[0] + 0.5 - t_s[1])) / 0.5;
        assert!((found(1, 0.5) - before).abs() < 1e-12);
    }

    #[test]
    fn a_line_is_met_between_uneven_rows_and_held_beyond_them() {
        let t_s = [0.0, 0.1, 0.5, 0.6];
        let of = |t: f64| at(&t_s, t, |i| 3.0 * t_s[i] - 1.0);
        for t in [0.0, 0.02, 0.1, 0.31, 0.6] {
            assert!((of(t) - (3.0 * t - 1.0)).abs() < 1e-14, "{t}: {}", of(t));
        }
        assert_eq!([of(-1.0), of(9.0)], [-1.0, 3.0 * 0.6 - 1.0]);
        assert_eq!(at(&[2.0], 5.0, |_| 7.0), 7.0);
    }
}
