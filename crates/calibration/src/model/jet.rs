//! First-order forward differentiation: a value and its slopes against a few unknowns.
//!
//! The library's effects are generic over [`Real`], so their exact derivatives come from running them on this scalar.
//! The orphan rule keeps a third-party dual number from being a [`Real`]; a wrapper would be as long as this file.

use core::ops::{Add, Div, Mul, Neg, Sub};
use std::cmp::Ordering;

use cvg_model::Real;

/// How many unknowns one evaluation differentiates against.
pub(crate) const LANES: usize = 4;

/// A value with its slopes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet<const N: usize = LANES> {
    pub(crate) value: f64,
    pub(crate) slope: [f64; N],
}

impl<const N: usize> Jet<N> {
    /// A value that does not depend on the unknowns.
    pub(crate) fn constant(value: f64) -> Self {
        Self { value, slope: [0.0; N] }
    }

    /// The unknown of `lane` itself.
    pub(crate) fn unknown(value: f64, lane: usize) -> Self {
        let mut jet = Self::constant(value);
        jet.slope[lane] = 1.0;
        jet
    }

    /// f(self) given f and f′ at the value.
    #[inline]
    fn chain(self, value: f64, derivative: f64) -> Self {
        let mut slope = self.slope;
        for s in &mut slope {
            *s *= derivative;
        }
        Self { value, slope }
    }

    /// u·self + v·other in the slopes.
    #[inline]
    fn combine(self, other: Self, value: f64, u: f64, v: f64) -> Self {
        let mut slope = self.slope;
        for (s, o) in slope.iter_mut().zip(&other.slope) {
            *s = u * *s + v * o;
        }
        Self { value, slope }
    }
}

impl<const N: usize> PartialEq for Jet<N> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize> PartialOrd for Jet<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.combine(o, self.value + o.value, 1.0, 1.0)
    }
}

impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.combine(o, self.value - o.value, 1.0, -1.0)
    }
}

impl<const N: usize> Mul for Jet<N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        self.combine(o, self.value * o.value, o.value, self.value)
    }
}

impl<const N: usize> Div for Jet<N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let q = self.value / o.value;
        self.combine(o, q, 1.0 / o.value, -q / o.value)
    }
}

impl<const N: usize> Neg for Jet<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Real for Jet<N> {
    #[inline]
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::constant(f64::ratio(numerator, denominator))
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        // At 0 the slope is infinite; the magnitudes that are rooted here enter multiplied by themselves.
        self.chain(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        let norm2 = self.value * self.value + x.value * x.value;
        let k = if norm2 > 0.0 { 1.0 / norm2 } else { 0.0 };
        self.combine(x, self.value.atan2(x.value), x.value * k, -self.value * k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cvg_model::effects::{EffectId, Moment, Stage, Values};
    use cvg_model::{AxisForces, Envelope};

    #[test]
    fn slopes_of_every_readout_effect_are_those_of_finite_differences() {
        let drive = AxisForces { x_c: 0.2, x_s: 0.1, y_c: -0.3, y_s: 0.05 };
        let at = Moment { t_s: 3.0, table_rad: 1.2, precession_rad_s: -6.8, warmer_k: 4.0, drive };
        let z = Envelope::new(0.7, 0.01, -0.6, -0.02);
        for &id in EffectId::ALL.iter().filter(|e| e.description().stage == Stage::Readout) {
            let parameters = id.description().parameters;
            let mut values: Values<f64> = id.neutral();
            for (v, p) in values.iter_mut().zip(parameters) {
                *v += 3.0 * p.scale;
            }
            let jets: Values<Jet> = core::array::from_fn(|i| Jet::unknown(values[i], i));
            let lift = |e: Envelope<f64>| {
                Envelope::new(Jet::constant(e.x_c), Jet::constant(e.x_s), Jet::constant(e.y_c), Jet::constant(e.y_s))
            };
            let at_jet = at.map(Jet::constant);
            let exact = id.unread(&jets, lift(z), &at_jet).y_c;
            for (i, p) in parameters.iter().enumerate() {
                let h = 1e-4 * p.scale;
                let (mut up, mut down) = (values, values);
                up[i] += h;
                down[i] -= h;
                let numeric = (id.unread(&up, z, &at).y_c - id.unread(&down, z, &at).y_c) / (2.0 * h);
                assert!(
                    (exact.slope[i] - numeric).abs() < 1e-4 * (1.0 + numeric.abs()),
                    "{id} {}: {} against {numeric}",
                    p.name,
                    exact.slope[i]
                );
            }
        }
    }
}
