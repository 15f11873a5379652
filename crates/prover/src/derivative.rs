//! Derivatives by the chain rule, through sines, cosines, roots and arctangents.

use num_rational::BigRational;
use num_traits::{One, Zero};

use crate::fraction::Fraction;
use crate::known::Debt;
use crate::polynomial::{Polynomial, Variable};
use crate::world::{Kind, World};

impl World {
    /// The derivative of `value` by the indeterminate `by`, which stands for itself, and what its divisions rest on.
    pub(crate) fn derivative(&mut self, value: &Fraction, by: Variable) -> (Fraction, usize) {
        let (above, rests_above) = self.slope_of(&value.numerator, by);
        let (below, rests_below) = self.slope_of(&value.denominator, by);
        let whole = |p: &Polynomial| Fraction::whole(p.clone());
        // (n/d)' = (n' − (n/d) d')/d
        let rest = above.minus(&value.times(&below, self), self);
        (rest.over(&whole(&value.denominator), self), rests_above.max(rests_below))
    }

    fn slope_of(&mut self, polynomial: &Polynomial, by: Variable) -> (Fraction, usize) {
        let mut slope = Fraction::constant(BigRational::zero());
        let mut rests = 0;
        for v in 0..self.indeterminates.len() {
            let partial = polynomial.derivative(v);
            if partial.is_zero() {
                continue;
            }
            let (inner, of_inner) = self.slope_of_indeterminate(v, by);
            slope = slope.plus(&Fraction::whole(partial).times(&inner, self), self);
            rests = rests.max(of_inner);
        }
        (slope, rests)
    }

    fn slope_of_indeterminate(&mut self, v: Variable, by: Variable) -> (Fraction, usize) {
        let none = Fraction::constant(BigRational::zero());
        if v == by {
            return (Fraction::constant(BigRational::one()), 0);
        }
        match self.indeterminates[v].kind.clone() {
            // an angle is followed by its cosine and its sine
            Kind::Cosine(angle) if angle == by => (Fraction::variable(angle + 2).negated(), 0),
            Kind::Sine(angle) if angle == by => (Fraction::variable(angle + 1), 0),
            Kind::Root(radicand) => {
                let (inner, rests) = self.slope_of(&radicand, by);
                if inner.is_zero() {
                    return (none, 0);
                }
                let twice = Polynomial::variable(v).scaled(&BigRational::from_integer(2.into()));
                let owed = self.owe(Debt::Division(twice.clone()));
                (inner.over(&Fraction::whole(twice), self), rests.max(owed))
            }
            Kind::Arc { y, x } => {
                let ((of_y, rests_y), (of_x, rests_x)) = (self.derivative(&y, by), self.derivative(&x, by));
                if of_y.is_zero() && of_x.is_zero() {
                    return (none, 0);
                }
                let turned = x.times(&of_y, self).minus(&y.times(&of_x, self), self);
                let distance = x.times(&x, self).plus(&y.times(&y, self), self);
                let owed = self.owe(Debt::Division(distance.numerator.clone()));
                (turned.over(&distance, self), owed.max(rests_y).max(rests_x))
            }
            _ => (none, 0),
        }
    }
}
