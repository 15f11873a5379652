//! Angles that begin anew at each period.

use super::statistics::median;

/// The representative of `angle` in [−period/2, period/2].
#[inline]
pub(crate) fn wrapped(angle: f64, period: f64) -> f64 {
    angle - period * (angle / period).round()
}

/// An angle of any wrapping as a continuous one: each step is the shortest of the period.
pub(crate) fn unwrapped(angles: impl Iterator<Item = f64>, period: f64) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(angles.size_hint().0);
    for raw in angles {
        let last = out.last().copied().unwrap_or(raw);
        out.push(last + wrapped(raw - last, period));
    }
    out
}

/// The same beside another angle that goes as far: where that takes a step of more than a quarter of the period, as in a gap, each step is the
/// nearest to its own.
pub(crate) fn unwrapped_beside(angles: &[f64], other: &[f64], period: f64) -> Vec<f64> {
    let step = |v: &[f64], i: usize| v[i] - v[i - 1];
    let is_long = |i: usize| step(other, i).abs() > 0.25 * period;
    let together = |i: usize| wrapped(step(angles, i), period) * step(other, i);
    // where every step is long nothing tells, and a sum of nothing is −0
    let sense = if (1..angles.len()).filter(|i| !is_long(*i)).map(together).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let mut out: Vec<f64> = Vec::with_capacity(angles.len());
    for (i, raw) in angles.iter().enumerate() {
        let expected = match out.last() {
            Some(last) if is_long(i) => last + sense * step(other, i),
            Some(last) => *last,
            None => *raw,
        };
        out.push(expected + wrapped(raw - expected, period));
    }
    out
}

/// Steps of a reference below this share of their mean do not tell how far an angle turns with it: engineering choice.
const TELLS: f64 = 0.1;

/// The same beside a reference that it turns any number of times as far as: as often as it does from row to row, in the median.
pub(crate) fn followed(angles: &[f64], reference: &[f64], period: f64) -> Vec<f64> {
    let steps: Vec<(f64, f64)> =
        reference.windows(2).zip(angles.windows(2)).map(|(a, t)| (a[1] - a[0], wrapped(t[1] - t[0], period))).collect();
    let least = TELLS * steps.iter().map(|(by, _)| by.abs()).sum::<f64>() / steps.len().max(1) as f64;
    let told = steps.iter().filter(|(by, _)| by.abs() > least);
    let usual = median(&mut told.map(|(by, turned)| turned / by).collect::<Vec<_>>());
    unwrapped_beside(angles, &reference.iter().map(|a| usual * a).collect::<Vec<_>>(), period)
}

/// A phase off nothing, or off half a turn, by no more than rounding is that.
const ROUNDING: f64 = 1e-12;

/// The angle of (cos, sin), in (−π, π].
pub(crate) fn phase(cos: f64, sin: f64) -> f64 {
    let angle = sin.atan2(cos);
    match () {
        () if angle.abs() < ROUNDING => 0.0,
        () if angle.abs() > std::f64::consts::PI - ROUNDING => std::f64::consts::PI,
        () => angle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    #[test]
    fn half_a_turn_is_not_less_than_nothing_and_rounding_is_no_phase() {
        let of = [(-1.0, -0.0), (-1.0, 0.0), (-1.0, -1e-15), (1.0, -1e-15), (1.0, -0.0), (0.0, -1.0)];
        let phases = of.map(|(cos, sin)| phase(cos, sin));
        assert_eq!(phases, [PI, PI, PI, 0.0, 0.0, -FRAC_PI_2]);
        assert!(phases[4].is_sign_positive());
    }

    #[test]
    fn an_angle_of_any_wrapping_is_continuous() {
        let wrapped = (0..100).map(|i| (f64::from(i) * 0.7).rem_euclid(TAU));
        for (i, a) in unwrapped(wrapped, TAU).iter().enumerate() {
            #[allow(clippy::cast_precision_loss, reason = "a hundred")]
            let expected = i as f64 * 0.7;
            assert!((a - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn beside_another_angle_a_long_step_is_the_nearest_to_its_own() {
        let other = [0.0, 0.3, 0.6, 5.5, 5.8, -7.0];
        for sense in [1.0, -1.0] {
            let turned: Vec<f64> = other.iter().map(|a| sense * 1.01 * a).collect();
            let read: Vec<f64> = turned.iter().map(|a| a.rem_euclid(TAU)).collect();
            let followed = unwrapped_beside(&read, &other, TAU);
            let off = followed.iter().zip(&turned).map(|(is, was)| is - was - (followed[0] - turned[0]));
            assert!(off.into_iter().all(|off| off.abs() < 1e-12), "{followed:?}");
        }
    }

    #[test]
    fn an_angle_that_turns_by_nearly_half_a_period_a_row_is_followed_the_way_that_is_nearer() {
        let reference: Vec<f64> = (0..100).map(|i| 0.03 * f64::from(i)).collect();
        for gain in [90.0, -90.0] {
            let read: Vec<f64> = reference.iter().map(|a| (gain * a).rem_euclid(TAU)).collect();
            let off = followed(&read, &reference, TAU).into_iter().zip(&reference).map(|(is, a)| (is - gain * a).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{gain}");
        }
    }

    #[test]
    fn an_angle_is_followed_through_gaps_of_more_than_half_a_period_at_any_gain() {
        // 40 stations of every 80 are missing, and each is read three times
        for gain in [1.0, -1.0, 4.0] {
            let row = |i: i32| 0.15 * f64::from(i / 3) / gain + 1e-6 * f64::from(i % 3);
            let reference: Vec<f64> = (0..900).filter(|i| i % 240 < 120).map(row).collect();
            let turned: Vec<f64> = reference.iter().map(|a| gain * a + 0.1 * a.sin()).collect();
            let read: Vec<f64> = turned.iter().map(|a| a.rem_euclid(TAU)).collect();
            let off = followed(&read, &reference, TAU).into_iter().zip(&turned).map(|(is, was)| (is - was).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{gain}");
        }
    }
}
