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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

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
