//! The exact scalar: quotients of polynomials over the rationals, in indeterminates that stand for all reals.
//!
//! The shipping functions run on it through [`Real`]. Sines and cosines of sums of angles expand by the addition
//! theorems with c² + s² = 1; the arctangent of a point is an angle whose direction is that point; a division is taken
//! and owed. What it cannot do exactly it refuses by panicking: a sine of something that is not a sum of angles, a root
//! of a quotient, a rounding.

use std::cmp::Ordering;
use std::fmt;
use std::ops::{Add, Div, Mul, Neg, Sub};

use cvg_model::{Float, Real};
use num_rational::BigRational;
use num_traits::{One, ToPrimitive};

use crate::fraction::Fraction;
use crate::known::{Debt, Orders};
use crate::world::{self, Kind, Value, World};

/// A real number of the proof that is running on this thread.
#[derive(Clone, Copy)]
pub struct Exact {
    run: u32,
    index: usize,
}

/// π, which is the same in every run.
const ANY_RUN: u32 = u32::MAX;

impl Exact {
    pub(crate) fn keep(value: Fraction, rests: usize) -> Self {
        world::with(|w| Self { run: w.epoch, index: w.keep(value, rests) })
    }

    pub(crate) fn fraction(self) -> Fraction {
        self.value().fraction
    }

    pub(crate) fn value(self) -> Value {
        world::with(|w| self.value_in(w))
    }

    pub(crate) fn value_in(self, world: &World) -> Value {
        if self.run == ANY_RUN {
            return Value { fraction: Fraction::variable(world::PI), rests: 0 };
        }
        assert_eq!(self.run, world.epoch, "a value of another proof");
        world.value(self.index).clone()
    }

    fn declared(name: &str, kind: Kind) -> Self {
        Self::keep(Fraction::variable(world::with(|w| w.declare(name, kind, None))), 0)
    }

    /// Any real number.
    pub fn real(name: &str) -> Self {
        Self::declared(name, Kind::Real)
    }

    /// Any real number but 0.
    pub fn nonzero(name: &str) -> Self {
        Self::declared(name, Kind::Nonzero)
    }

    /// Any real number above 0.
    pub fn positive(name: &str) -> Self {
        Self::declared(name, Kind::Positive)
    }

    /// Any angle.
    pub fn angle(name: &str) -> Self {
        Self::keep(Fraction::variable(world::with(|w| w.angle(name, false))), 0)
    }

    /// Any angle above 0° and below 90°.
    pub fn acute(name: &str) -> Self {
        Self::keep(Fraction::variable(world::with(|w| w.angle(name, true))), 0)
    }

    /// 90°
    pub fn quarter_turn() -> Self {
        Self::half() * Self::PI
    }

    /// A point in the direction of this angle, (cos, sin) times a positive number: for an arctangent its own arguments.
    pub fn ray(self) -> (Self, Self) {
        let (x, y, rests) = world::with(|w| {
            let angle = self.value_in(w);
            let (x, y, rests) = w.direction(&angle.fraction, true);
            (x, y, rests.max(angle.rests))
        });
        (Self::keep(x, rests), Self::keep(y, rests))
    }

    /// The distance of the arguments of an arctangent from the origin, √(x² + y²), above 0 where the arctangent is one.
    ///
    /// # Panics
    /// Where this is not an arctangent.
    pub fn radius(self) -> Self {
        let (radius, rests) = world::with(|w| {
            let angle = self.value_in(w);
            let [(arc, 1)] = w.multiples(&angle.fraction)[..] else { panic!("refused: {self:?} is not an arctangent") };
            (w.radius(arc), angle.rests)
        });
        Self::keep(Fraction::variable(radius), rests)
    }

    /// The partial derivative by an indeterminate, through roots, sines, cosines and arctangents of it: of the value as
    /// it is on this path.
    ///
    /// # Panics
    /// Where `by` is not one real or angle that stands for itself, and where this path may have an edge or no inside: two
    /// values that were compared may be equal on it.
    #[must_use]
    pub fn derivative(self, by: Self) -> Self {
        let by_value = by.fraction();
        let variable = by_value.as_polynomial().and_then(|p| p.as_monomial()).and_then(|(monomial, coefficient)| {
            let [(variable, 1)] = monomial.powers() else { return None };
            coefficient.is_one().then_some(*variable)
        });
        let slope = world::with(|w| {
            let free = |v: &usize| {
                matches!(w.indeterminates[*v].kind, Kind::Real | Kind::Nonzero | Kind::Positive | Kind::Angle { .. })
            };
            let variable = variable.filter(free)?;
            assert!(w.is_open(), "refused: a derivative where two values may be equal that were compared");
            let value = self.value_in(w);
            let (slope, rests) = w.derivative(&value.fraction, variable);
            Some((slope, rests.max(value.rests)))
        });
        let Some((slope, rests)) = slope else { panic!("refused: a derivative by {by:?}") };
        Self::keep(slope, rests)
    }
}

impl fmt::Debug for Exact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.fraction();
        f.write_str(&world::with(|w| w.text(&value)))
    }
}

macro_rules! operation {
    ($trait:ident, $method:ident, $of:ident) => {
        impl $trait for Exact {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let (value, rests) = world::with(|w| {
                    let (a, b) = (self.value_in(w), other.value_in(w));
                    (a.fraction.$of(&b.fraction, w), a.rests.max(b.rests))
                });
                Self::keep(value, rests)
            }
        }
    };
}

operation!(Add, add, plus);
operation!(Sub, sub, minus);
operation!(Mul, mul, times);

impl Div for Exact {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let (value, rests) = world::with(|w| {
            let (value, divisor) = (self.value_in(w), other.value_in(w));
            assert!(!divisor.fraction.is_zero(), "refused: a division by zero");
            let owed = w.owe(Debt::Division(divisor.fraction.numerator.clone()));
            (value.fraction.over(&divisor.fraction, w), owed.max(value.rests).max(divisor.rests))
        });
        Self::keep(value, rests)
    }
}

impl Neg for Exact {
    type Output = Self;
    fn neg(self) -> Self {
        let value = self.value();
        Self::keep(value.fraction.negated(), value.rests)
    }
}

impl Exact {
    fn decide(self, other: Self, asked: Orders) -> bool {
        world::with(|w| {
            let (a, b) = (self.value_in(w), other.value_in(w));
            let difference = Value { fraction: a.fraction.minus(&b.fraction, w), rests: a.rests.max(b.rests) };
            w.decide(&difference, asked)
        })
    }
}

impl PartialEq for Exact {
    fn eq(&self, other: &Self) -> bool {
        self.decide(*other, Orders::EQUAL)
    }
}

/// Comparisons fork: each answer that is not excluded is a path of its own.
impl PartialOrd for Exact {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(if self.decide(*other, Orders::LESS) {
            Ordering::Less
        } else if self.decide(*other, Orders::EQUAL) {
            Ordering::Equal
        } else {
            Ordering::Greater
        })
    }

    fn lt(&self, other: &Self) -> bool {
        self.decide(*other, Orders::LESS)
    }

    fn le(&self, other: &Self) -> bool {
        self.decide(*other, Orders::NOT_GREATER)
    }

    fn gt(&self, other: &Self) -> bool {
        self.decide(*other, Orders::GREATER)
    }

    fn ge(&self, other: &Self) -> bool {
        self.decide(*other, Orders::NOT_LESS)
    }
}

impl Real for Exact {
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self::keep(Fraction::constant(BigRational::new(numerator.into(), denominator.into())), 0)
    }

    fn sqrt(self) -> Self {
        let value = self.value();
        let Some(radicand) = value.fraction.as_polynomial().cloned() else {
            panic!("refused: the root of the quotient {self:?}");
        };
        let (root, rests) = world::with(|w| {
            if let Some(root) = radicand.monomial_root().map(Fraction::whole)
                && let Some(rests) = w.positive(&root)
            {
                return (root, rests);
            }
            let owed = w.owe(Debt::Root(radicand.clone()));
            (Fraction::variable(w.root(&radicand)), owed)
        });
        Self::keep(root, rests.max(value.rests))
    }

    fn sin_cos(self) -> (Self, Self) {
        let (cos, sin, rests) = world::with(|w| {
            let angle = self.value_in(w);
            let (cos, sin, rests) = w.direction(&angle.fraction, false);
            (cos, sin, rests.max(angle.rests))
        });
        (Self::keep(sin, rests), Self::keep(cos, rests))
    }

    fn atan2(self, x: Self) -> Self {
        let (arc, rests) = world::with(|w| {
            let (y, x) = (self.value_in(w), x.value_in(w));
            let name = format!("arc{}", w.indeterminates.len());
            let rests = y.rests.max(x.rests);
            (w.declare(&name, Kind::Arc { y: y.fraction, x: x.fraction }, None), rests)
        });
        Self::keep(Fraction::variable(arc), rests)
    }
}

impl Float for Exact {
    const PI: Self = Self { run: ANY_RUN, index: 0 };

    fn from_f64(value: f64) -> Self {
        let Some(value) = BigRational::from_float(value) else { panic!("refused: {value} is not a real number") };
        Self::keep(Fraction::constant(value), 0)
    }

    fn to_f64(self) -> f64 {
        let value = self.fraction().as_constant().and_then(|v| v.to_f64());
        let Some(value) = value else { panic!("refused: {self:?} has no one value") };
        value
    }

    /// Every real number is.
    fn is_finite(self) -> bool {
        true
    }

    fn floor(self) -> Self {
        panic!("refused: the whole part of {self:?}")
    }
}
