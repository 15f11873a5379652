//! Angles that begin anew at each period.

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
    let sense = (1..angles.len()).filter(|i| !is_long(*i)).map(together).sum::<f64>().signum();
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
}
