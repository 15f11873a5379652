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
}
