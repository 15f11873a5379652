//! Polynomials over the rationals, exactly: sums of monomials in indeterminates that are numbered.
//!
//! It refuses to know what an indeterminate stands for. A caller that knows the square of one (s² = 1 − c², ρ² = …)
//! says so in [`Squares`], and products are then brought to the form in which that indeterminate occurs at most once
//! per monomial. Two polynomials that are equal in this form are equal for all reals that obey the squares.

use std::collections::BTreeMap;
use std::fmt;

use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

/// The number of an indeterminate.
pub(crate) type Variable = usize;

/// What the square of an indeterminate is, where that is known.
pub(crate) trait Squares {
    fn square(&self, variable: Variable) -> Option<&Polynomial>;
}

/// A product of powers, sorted by indeterminate, exponents above 0.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Monomial(Vec<(Variable, u32)>);

impl Monomial {
    pub(crate) fn powers(&self) -> &[(Variable, u32)] {
        &self.0
    }

    fn product(&self, other: &Self) -> Self {
        let mut powers: BTreeMap<Variable, u32> = self.0.iter().copied().collect();
        for (variable, power) in &other.0 {
            *powers.entry(*variable).or_default() += power;
        }
        Self(powers.into_iter().collect())
    }

    /// The greatest monomial that divides both.
    fn common(&self, other: &Self) -> Self {
        let of_other: BTreeMap<Variable, u32> = other.0.iter().copied().collect();
        let shared = self.0.iter().filter_map(|(v, power)| Some((*v, *power.min(of_other.get(v)?))));
        Self(shared.collect())
    }

    /// This monomial without `divisor`, which has to divide it.
    fn without(&self, divisor: &Self) -> Self {
        let taken: BTreeMap<Variable, u32> = divisor.0.iter().copied().collect();
        let left = self.0.iter().map(|(v, power)| (*v, power - taken.get(v).unwrap_or(&0)));
        Self(left.filter(|(_, power)| *power > 0).collect())
    }
}

/// A polynomial with rational coefficients, none of them zero.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Polynomial(BTreeMap<Monomial, BigRational>);

impl Polynomial {
    pub(crate) fn constant(value: BigRational) -> Self {
        let mut zero = Self::default();
        zero.add_term(Monomial::default(), value);
        zero
    }

    pub(crate) fn term(monomial: Monomial, coefficient: BigRational) -> Self {
        let mut term = Self::default();
        term.add_term(monomial, coefficient);
        term
    }

    pub(crate) fn one() -> Self {
        Self::constant(BigRational::one())
    }

    pub(crate) fn variable(variable: Variable) -> Self {
        Self(BTreeMap::from([(Monomial(vec![(variable, 1)]), BigRational::one())]))
    }

    pub(crate) fn terms(&self) -> impl Iterator<Item = (&Monomial, &BigRational)> {
        self.0.iter()
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.0.is_empty()
    }

    /// The value where no indeterminate occurs.
    pub(crate) fn as_constant(&self) -> Option<BigRational> {
        match self.0.len() {
            0 => Some(BigRational::zero()),
            1 => self.0.get(&Monomial::default()).cloned(),
            _ => None,
        }
    }

    /// The only term, where there is one.
    pub(crate) fn as_monomial(&self) -> Option<(&Monomial, &BigRational)> {
        if self.0.len() == 1 { self.0.iter().next() } else { None }
    }

    fn add_term(&mut self, monomial: Monomial, coefficient: BigRational) {
        if coefficient.is_zero() {
            return;
        }
        let entry = self.0.entry(monomial);
        if let std::collections::btree_map::Entry::Occupied(mut held) = entry {
            *held.get_mut() += coefficient;
            if held.get().is_zero() {
                held.remove();
            }
        } else {
            entry.or_insert(coefficient);
        }
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        for (monomial, coefficient) in &other.0 {
            sum.add_term(monomial.clone(), coefficient.clone());
        }
        sum
    }

    pub(crate) fn scaled(&self, factor: &BigRational) -> Self {
        if factor.is_zero() {
            return Self::default();
        }
        Self(self.0.iter().map(|(m, c)| (m.clone(), c * factor)).collect())
    }

    pub(crate) fn negated(&self) -> Self {
        self.scaled(&-BigRational::one())
    }

    /// The product, with every known square replaced.
    pub(crate) fn times(&self, other: &Self, squares: &impl Squares) -> Self {
        let mut product = Self::default();
        let mut open: Vec<(Monomial, BigRational)> = Vec::new();
        for (a, ca) in &self.0 {
            for (b, cb) in &other.0 {
                open.push((a.product(b), ca * cb));
            }
        }
        while let Some((monomial, coefficient)) = open.pop() {
            let known =
                monomial.0.iter().filter(|(_, power)| *power >= 2).find_map(|(v, _)| Some((*v, squares.square(*v)?)));
            let Some((variable, square)) = known else {
                product.add_term(monomial, coefficient);
                continue;
            };
            let rest = monomial.without(&Monomial(vec![(variable, 2)]));
            open.extend(square.0.iter().map(|(m, c)| (rest.product(m), c * &coefficient)));
        }
        product
    }

    /// The greatest monomial that divides every term; none for 0.
    fn content(&self) -> Option<Monomial> {
        let mut terms = self.0.keys();
        let first = terms.next()?.clone();
        Some(terms.fold(first, |common, m| common.common(m)))
    }

    /// Both polynomials without the monomial that divides both.
    pub(crate) fn without_common(numerator: &Self, denominator: &Self) -> (Self, Self) {
        let (Some(a), Some(b)) = (numerator.content(), denominator.content()) else {
            return (numerator.clone(), denominator.clone());
        };
        let common = a.common(&b);
        let cleared = |p: &Self| Self(p.0.iter().map(|(m, c)| (m.without(&common), c.clone())).collect());
        (cleared(numerator), cleared(denominator))
    }

    /// k with `self` = k · `other`, where there is such a rational number.
    pub(crate) fn multiple_of(&self, other: &Self) -> Option<BigRational> {
        if self.0.len() != other.0.len() {
            return None;
        }
        let (_, a) = self.0.iter().next()?;
        let (_, b) = other.0.iter().next()?;
        let factor = a / b;
        (*self == other.scaled(&factor)).then_some(factor)
    }

    /// The coefficient of the greatest monomial.
    pub(crate) fn leading(&self) -> Option<&BigRational> {
        self.0.values().next_back()
    }

    /// The square root, where this is one term with even powers and a positive coefficient that is a perfect square.
    pub(crate) fn monomial_root(&self) -> Option<Self> {
        let (monomial, coefficient) = self.as_monomial()?;
        if !coefficient.is_positive() || monomial.0.iter().any(|(_, power)| !power.is_multiple_of(2)) {
            return None;
        }
        let (n, d) = (coefficient.numer().sqrt(), coefficient.denom().sqrt());
        let root = BigRational::new(n, d);
        if &root * &root != *coefficient {
            return None;
        }
        let half = Monomial(monomial.0.iter().map(|(v, power)| (*v, power / 2)).collect());
        Some(Self(BTreeMap::from([(half, root)])))
    }

    /// The partial derivative by an indeterminate on which no other one depends.
    pub(crate) fn derivative(&self, variable: Variable) -> Self {
        let mut derivative = Self::default();
        for (monomial, coefficient) in &self.0 {
            if let Some((_, power)) = monomial.0.iter().find(|(v, _)| *v == variable) {
                let lower = monomial.without(&Monomial(vec![(variable, 1)]));
                derivative.add_term(lower, coefficient * BigRational::from_integer((*power).into()));
            }
        }
        derivative
    }

    /// The value where each indeterminate is `at` its number.
    pub(crate) fn evaluate(&self, at: impl Fn(Variable) -> f64) -> f64 {
        let power = |v: Variable, n: u32| (0..n).map(|_| at(v)).product::<f64>();
        let term = |m: &Monomial| m.0.iter().map(|(v, n)| power(*v, *n)).product::<f64>();
        self.0.iter().map(|(m, c)| c.to_f64().unwrap_or(f64::NAN) * term(m)).sum()
    }

    /// The polynomial as text.
    pub(crate) fn write(&self, f: &mut impl fmt::Write, name: impl Fn(Variable) -> String) -> fmt::Result {
        if self.is_zero() {
            return f.write_str("0");
        }
        for (n, (monomial, coefficient)) in self.0.iter().enumerate() {
            let sign = if coefficient.is_negative() { "-" } else { "+" };
            if n > 0 || sign == "-" {
                write!(f, "{}{sign} ", if n > 0 { " " } else { "" })?;
            }
            let size = coefficient.abs();
            if !size.is_one() || monomial.0.is_empty() {
                write!(f, "{size}{}", if monomial.0.is_empty() { "" } else { "·" })?;
            }
            let powers: Vec<_> = monomial
                .0
                .iter()
                .map(|(v, power)| if *power == 1 { name(*v) } else { format!("{}^{power}", name(*v)) })
                .collect();
            f.write_str(&powers.join("·"))?;
        }
        Ok(())
    }
}
