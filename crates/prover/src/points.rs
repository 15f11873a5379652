//! Points at which a path is tried: a value for each indeterminate, drawn over its domain.

use crate::fraction::Fraction;
use crate::known::Orders;
use crate::polynomial::Variable;
use crate::world::{Kind, World};

use crate::known::Debt;

/// Steps of Newton's method towards the points where two values are equal.
const STEPS: usize = 12;

impl World {
    /// The `n`th of many points; where a comparison on this path found two values equal, one at which they are, if
    /// Newton's method finds it.
    pub(crate) fn sample(&self, n: u64) -> Vec<f64> {
        let mut at = self.completed(&self.drawn(n));
        let equal = || self.taken.iter().filter(|choice| choice.orders == Orders::EQUAL);
        if equal().next().is_some() {
            for _ in 0..STEPS {
                for choice in equal() {
                    at = self.towards_zero(at, &choice.difference);
                }
            }
        }
        at
    }

    /// All assumptions hold at this point, it lies on this path, and nothing is divided by zero.
    pub(crate) fn is_on_path(&self, at: &[f64]) -> bool {
        let value = |f: &Fraction| f.evaluate(|v| at[v]);
        let owed = |debt: &Debt| match debt {
            Debt::Division(by) => by.evaluate(|v| at[v]).abs() > 1e-6,
            Debt::Root(_) => true,
        };
        let domain = |(v, i): (usize, &crate::world::Indeterminate)| match i.kind {
            Kind::Positive => at[v] > 0.0,
            Kind::Nonzero => at[v] != 0.0,
            Kind::Angle { acute: true, .. } => at[v] > 0.0 && at[v] < std::f64::consts::FRAC_PI_2,
            _ => at[v].is_finite(),
        };
        self.indeterminates.iter().enumerate().all(domain)
            && self.taken.iter().all(|choice| choice.orders.hold(value(&choice.difference)))
            && self.assumed.iter().all(|f| value(f) > 1e-6)
            && self.debts.iter().all(owed)
    }

    /// Numbers over the domains of what stands for itself; what depends on others is still open.
    fn drawn(&self, n: u64) -> Vec<f64> {
        let mut state = n.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03;
        let mut draw = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let value = |kind: &Kind| match kind {
            Kind::Real => 4.0 * draw() - 2.0,
            Kind::Nonzero => {
                let size = 0.2 + 2.0 * draw();
                if draw() < 0.5 { -size } else { size }
            }
            Kind::Positive => 0.05 * 60_f64.powf(draw()),
            Kind::Angle { acute: true, .. } => (0.02 + 0.96 * draw()) * std::f64::consts::FRAC_PI_2,
            Kind::Angle { acute: false, .. } => (2.0 * draw() - 1.0) * std::f64::consts::PI,
            _ => f64::NAN,
        };
        self.indeterminates.iter().map(|i| &i.kind).map(value).collect()
    }

    /// The point with what follows from the values of `free`.
    fn completed(&self, free: &[f64]) -> Vec<f64> {
        let mut at: Vec<f64> = Vec::with_capacity(free.len());
        for (indeterminate, free) in self.indeterminates.iter().zip(free) {
            let value = match &indeterminate.kind {
                Kind::Pi => std::f64::consts::PI,
                Kind::Cosine(angle) => at[*angle].cos(),
                Kind::Sine(angle) => at[*angle].sin(),
                Kind::Root(radicand) => radicand.evaluate(|v| at[v]).sqrt(),
                Kind::Arc { y, x } => y.evaluate(|v| at[v]).atan2(x.evaluate(|v| at[v])),
                _ => *free,
            };
            at.push(value);
        }
        at
    }

    fn is_free(&self, v: Variable) -> bool {
        matches!(self.indeterminates[v].kind, Kind::Real | Kind::Nonzero | Kind::Positive | Kind::Angle { .. })
    }

    /// A point nearer to where `difference` is zero, along its steepest slope.
    fn towards_zero(&self, at: Vec<f64>, difference: &Fraction) -> Vec<f64> {
        const NUDGE: f64 = 1e-6;
        let value = |at: &[f64]| difference.evaluate(|v| at[v]);
        let here = value(&at);
        let slope = |v: Variable| {
            let moved = |by: f64| {
                let mut free = at.clone();
                free[v] += by;
                value(&self.completed(&free))
            };
            if self.is_free(v) { (moved(NUDGE) - moved(-NUDGE)) / (2.0 * NUDGE) } else { 0.0 }
        };
        let slopes: Vec<f64> = (0..at.len()).map(slope).collect();
        let steepness: f64 = slopes.iter().map(|s| s * s).sum();
        if !(steepness > 0.0 && here.is_finite()) {
            return at;
        }
        let free: Vec<f64> = at.iter().zip(&slopes).map(|(v, s)| v - here * s / steepness).collect();
        self.completed(&free)
    }
}
