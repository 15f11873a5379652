//! Quotients of polynomials. The denominator is taken to be other than zero: whoever divides owes that proof.

use num_rational::BigRational;
use num_traits::{One, Zero};

use crate::polynomial::{Polynomial, Squares, Variable};

/// numerator / denominator, without a monomial in common, the denominator's leading coefficient 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fraction {
    pub(crate) numerator: Polynomial,
    pub(crate) denominator: Polynomial,
}

impl Fraction {
    pub(crate) fn new(numerator: &Polynomial, denominator: &Polynomial) -> Self {
        if numerator.is_zero() && !denominator.is_zero() {
            return Self::whole(Polynomial::default());
        }
        if let Some(factor) = numerator.multiple_of(denominator) {
            return Self { numerator: Polynomial::constant(factor), denominator: Polynomial::one() };
        }
        let (numerator, denominator) = Polynomial::without_common(numerator, denominator);
        let Some(leading) = denominator.leading() else {
            panic!("refused: a division by zero");
        };
        let factor = leading.recip();
        Self { numerator: numerator.scaled(&factor), denominator: denominator.scaled(&factor) }
    }

    pub(crate) fn whole(polynomial: Polynomial) -> Self {
        Self { numerator: polynomial, denominator: Polynomial::one() }
    }

    pub(crate) fn constant(value: BigRational) -> Self {
        Self::whole(Polynomial::constant(value))
    }

    pub(crate) fn variable(variable: Variable) -> Self {
        Self::whole(Polynomial::variable(variable))
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.numerator.is_zero()
    }

    /// The polynomial that this is, where the denominator is 1.
    pub(crate) fn as_polynomial(&self) -> Option<&Polynomial> {
        self.denominator.as_constant().is_some_and(|d| d.is_one()).then_some(&self.numerator)
    }

    /// A product of powers over another one, other than 0.
    pub(crate) fn is_monomial(&self) -> bool {
        self.numerator.as_monomial().is_some() && self.denominator.as_monomial().is_some()
    }

    pub(crate) fn as_constant(&self) -> Option<BigRational> {
        self.as_polynomial()?.as_constant()
    }

    pub(crate) fn plus(&self, other: &Self, squares: &impl Squares) -> Self {
        if self.denominator == other.denominator {
            return Self::new(&self.numerator.plus(&other.numerator), &self.denominator);
        }
        let left = self.numerator.times(&other.denominator, squares);
        let right = other.numerator.times(&self.denominator, squares);
        Self::new(&left.plus(&right), &self.denominator.times(&other.denominator, squares))
    }

    pub(crate) fn negated(&self) -> Self {
        Self { numerator: self.numerator.negated(), denominator: self.denominator.clone() }
    }

    pub(crate) fn minus(&self, other: &Self, squares: &impl Squares) -> Self {
        self.plus(&other.negated(), squares)
    }

    pub(crate) fn times(&self, other: &Self, squares: &impl Squares) -> Self {
        Self::new(
            &self.numerator.times(&other.numerator, squares),
            &self.denominator.times(&other.denominator, squares),
        )
    }

    pub(crate) fn over(&self, other: &Self, squares: &impl Squares) -> Self {
        Self::new(
            &self.numerator.times(&other.denominator, squares),
            &self.denominator.times(&other.numerator, squares),
        )
    }

    /// k with `self` = k · `other`, where there is such a rational number other than zero.
    pub(crate) fn multiple_of(&self, other: &Self) -> Option<BigRational> {
        let factor = self.numerator.multiple_of(&other.numerator)?;
        (self.denominator == other.denominator && !factor.is_zero()).then_some(factor)
    }

    pub(crate) fn evaluate(&self, at: impl Fn(Variable) -> f64 + Copy) -> f64 {
        self.numerator.evaluate(at) / self.denominator.evaluate(at)
    }
}
