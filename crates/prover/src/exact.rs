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
use num_traits::ToPrimitive;

use crate::fraction::Fraction;
use crate::world::{self, Kind, Orders, World};

/// A real number of the proof that is running on this thread.
#[derive(Clone, Copy)]
pub struct Exact {
    run: u32,
    index: usize,
}

/// π, which is the same in every run.
const ANY_RUN: u32 = u32::MAX;

impl Exact {
    pub(crate) fn keep(value: Fraction) -> Self {
        world::with(|w| Self { run: w.epoch, index: w.keep(value) })
    }

    pub(crate) fn fraction(self) -> Fraction {
        world::with(|w| self.value_in(w))
    }

    pub(crate) fn value_in(self, world: &World) -> Fraction {
        if self.run == ANY_RUN {
            return Fraction::variable(world::PI);
        }
        assert_eq!(self.run, world.epoch, "a value of another proof");
        world.value(self.index).clone()
    }

    fn declared(name: &str, kind: Kind) -> Self {
        Self::keep(Fraction::variable(world::with(|w| w.declare(name, kind, None))))
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
        Self::keep(Fraction::variable(world::with(|w| w.angle(name, false))))
    }

    /// Any angle above 0° and below 90°.
    pub fn acute(name: &str) -> Self {
        Self::keep(Fraction::variable(world::with(|w| w.angle(name, true))))
    }

    /// 90°
    pub fn quarter_turn() -> Self {
        Self::half() * Self::PI
    }

    /// A point in the direction of this angle, (cos, sin) times a positive number: for an arctangent its own arguments.
    pub fn ray(self) -> (Self, Self) {
        let (x, y) = world::with(|w| {
            let angle = self.value_in(w);
            w.direction(&angle, true)
        });
        (Self::keep(x), Self::keep(y))
    }

    /// The distance of the arguments of an arctangent from the origin, √(x² + y²), above 0 where the arctangent is one.
    ///
    /// # Panics
    /// Where this is not an arctangent.
    pub fn radius(self) -> Self {
        let radius = world::with(|w| {
            let angle = self.value_in(w);
            let [(arc, 1)] = w.multiples(&angle)[..] else { panic!("refused: {self:?} is not an arctangent") };
            w.radius(arc)
        });
        Self::keep(Fraction::variable(radius))
    }

    /// The partial derivative by an indeterminate. Domain: no angle, root or arctangent of it occurs.
    pub fn derivative(self, by: Self) -> Self {
        let (value, by) = (self.fraction(), by.fraction());
        let variable = by.numerator.as_monomial().map(|(m, _)| m.powers().to_vec());
        let Some([(variable, 1)]) = variable.as_deref() else { panic!("refused: a derivative by {by:?}") };
        let (n, d) = (&value.numerator, &value.denominator);
        let slope = world::with(|w| {
            let top = n.derivative(*variable).times(d, w).plus(&n.times(&d.derivative(*variable), w).negated());
            Fraction::new(&top, &d.times(d, w))
        });
        Self::keep(slope)
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
                let value = world::with(|w| self.value_in(w).$of(&other.value_in(w), w));
                Self::keep(value)
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
        let value = world::with(|w| {
            let divisor = other.value_in(w);
            assert!(!divisor.is_zero(), "refused: a division by zero");
            w.divisors.push(divisor.numerator.clone());
            self.value_in(w).over(&divisor, w)
        });
        Self::keep(value)
    }
}

impl Neg for Exact {
    type Output = Self;
    fn neg(self) -> Self {
        Self::keep(self.fraction().negated())
    }
}

impl Exact {
    fn decide(self, other: Self, asked: Orders) -> bool {
        world::with(|w| {
            let difference = self.value_in(w).minus(&other.value_in(w), w);
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
        Self::keep(Fraction::constant(BigRational::new(numerator.into(), denominator.into())))
    }

    fn sqrt(self) -> Self {
        let value = self.fraction();
        let Some(radicand) = value.as_polynomial().cloned() else {
            panic!("refused: the root of the quotient {self:?}");
        };
        let root = world::with(|w| {
            let positive = |p| w.is_positive(&Fraction::whole(p));
            if let Some(root) = radicand.monomial_root()
                && positive(root.clone())
            {
                return Fraction::whole(root);
            }
            w.radicands.push(radicand.clone());
            Fraction::variable(w.root(&radicand))
        });
        Self::keep(root)
    }

    fn sin_cos(self) -> (Self, Self) {
        let (cos, sin) = world::with(|w| {
            let angle = self.value_in(w);
            w.direction(&angle, false)
        });
        (Self::keep(sin), Self::keep(cos))
    }

    fn atan2(self, x: Self) -> Self {
        let arc = world::with(|w| {
            let (y, x) = (self.value_in(w), x.value_in(w));
            let name = format!("arc{}", w.indeterminates.len());
            w.declare(&name, Kind::Arc { y, x }, None)
        });
        Self::keep(Fraction::variable(arc))
    }
}

impl Float for Exact {
    const PI: Self = Self { run: ANY_RUN, index: 0 };

    fn from_f64(value: f64) -> Self {
        let Some(value) = BigRational::from_float(value) else { panic!("refused: {value} is not a real number") };
        Self::keep(Fraction::constant(value))
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
