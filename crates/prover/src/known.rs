//! What is known of signs, what is owed, and the path through comparisons.
//!
//! A division owes that its divisor is not zero, a root that what is under it is not negative. Most are paid at once, by
//! what is known when they are taken. What is not becomes a debt with a number, and every value, fact and comparison
//! carries how many of the first debts it *rests* on. A debt is paid only by what rests on earlier ones. So the first
//! debt of a path stands on nothing that was divided, the second at most on the first, and none on itself: no fact can
//! pay the division that it was derived through.

use num_rational::BigRational;
use num_traits::{Signed, Zero};

use crate::fraction::Fraction;
use crate::polynomial::{Monomial, Polynomial, Variable};
use crate::world::{Kind, Value, World};

/// A division or a root whose right to be is still to be shown.
#[derive(Clone, Debug)]
pub(crate) enum Debt {
    /// by this, which must not be zero
    Division(Polynomial),
    /// of this, which must not be negative
    Root(Polynomial),
}

/// Something above 0, or, where it is not strict, not below.
#[derive(Clone, Debug)]
pub(crate) struct Fact {
    pub(crate) value: Fraction,
    pub(crate) strict: bool,
    /// on how many of the first debts it rests
    pub(crate) rests: usize,
    /// the number of the comparison that found it
    pub(crate) choice: Option<usize>,
}

/// Which of less than, equal to and greater than 0 a value can still be, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Orders(u8);

impl Orders {
    pub(crate) const LESS: Self = Self(1);
    pub(crate) const EQUAL: Self = Self(2);
    pub(crate) const GREATER: Self = Self(4);
    pub(crate) const NOT_LESS: Self = Self(6);
    pub(crate) const NOT_GREATER: Self = Self(3);
    const ANY: Self = Self(7);
    const NONE: Self = Self(0);

    pub(crate) fn within(self, other: Self) -> bool {
        self.0 & !other.0 == 0
    }

    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// What the negative of a value can be.
    fn mirrored(self) -> Self {
        Self(self.0 & 2 | (self.0 & 1) << 2 | (self.0 & 4) >> 2)
    }

    /// Whether a value of this sign is among them.
    pub(crate) fn hold(self, value: f64) -> bool {
        const NEAR: f64 = 1e-9;
        let order = if value > NEAR {
            Self::GREATER
        } else if value < -NEAR {
            Self::LESS
        } else {
            Self::EQUAL
        };
        order.within(self)
    }

    /// As a relation to 0.
    fn sign(self) -> &'static str {
        match self {
            Self::LESS => "< 0",
            Self::EQUAL => "= 0",
            Self::GREATER => "> 0",
            Self::NOT_LESS => "≥ 0",
            Self::NOT_GREATER => "≤ 0",
            _ => "≠ 0",
        }
    }
}

/// What a comparison found on this path.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    pub(crate) difference: Fraction,
    pub(crate) orders: Orders,
    /// whether the question was answered with yes
    pub(crate) yes: bool,
    /// on how many of the first debts the comparison rests
    rests: usize,
}

/// What may be used: the facts and comparisons that rest on no more than so many debts, but for one comparison.
#[derive(Clone, Copy)]
struct Use {
    limit: usize,
    but: Option<usize>,
}

/// Everything that is known.
const ALL: Use = Use { limit: usize::MAX, but: None };

impl Use {
    fn up_to(limit: usize) -> Self {
        Self { limit, but: None }
    }
}

impl World {
    fn facts(&self, may: Use) -> impl Iterator<Item = &Fact> {
        self.facts.iter().filter(move |f| f.rests <= may.limit && (f.choice.is_none() || f.choice != may.but))
    }

    fn choices(&self, may: Use) -> impl Iterator<Item = &Choice> {
        let used = move |(n, c): &(usize, &Choice)| c.rests <= may.limit && Some(*n) != may.but;
        self.taken.iter().enumerate().filter(used).map(|(_, choice)| choice)
    }

    /// The fewest debts on which `holds` can rest, which has to hold on all of them.
    fn least(&self, holds: impl Fn(usize) -> bool) -> usize {
        (0..self.debts.len()).find(|n| holds(*n)).unwrap_or(self.debts.len())
    }

    /// Takes a division or root: how many debts rest under it, with its own where nothing known allows it.
    pub(crate) fn owe(&mut self, debt: Debt) -> usize {
        if self.is_paid(&debt, usize::MAX) {
            return self.least(|limit| self.is_paid(&debt, limit));
        }
        self.debts.push(debt);
        self.debts.len()
    }

    fn is_paid(&self, debt: &Debt, limit: usize) -> bool {
        match debt {
            Debt::Division(by) => self.is_nonzero(by, Use::up_to(limit)),
            Debt::Root(of) => self.is_not_negative(&Fraction::whole(of.clone()), Use::up_to(limit)),
        }
    }

    /// The first debt that nothing pays which rests on earlier ones alone.
    pub(crate) fn unpaid(&self) -> Option<&Debt> {
        self.debts.iter().enumerate().find(|(number, debt)| !self.is_paid(debt, *number)).map(|(_, debt)| debt)
    }

    /// From here on `value` is known to be above 0, or not below where that is not `strict`.
    pub(crate) fn learn(&mut self, value: Value, strict: bool) {
        self.facts.push(Fact { value: value.fraction, strict, rests: value.rests, choice: None });
    }

    /// On how many debts it rests that `value` is above 0, where that is known.
    pub(crate) fn positive(&self, value: &Fraction) -> Option<usize> {
        self.is_positive(value, ALL).then(|| self.least(|limit| self.is_positive(value, Use::up_to(limit))))
    }

    /// On how many debts it rests that `value` is not below 0, where that is known.
    pub(crate) fn not_negative(&self, value: &Fraction) -> Option<usize> {
        self.is_not_negative(value, ALL).then(|| self.least(|limit| self.is_not_negative(value, Use::up_to(limit))))
    }

    /// Whether `value` cannot be below 0, by everything that is known.
    pub(crate) fn never_below(&self, value: &Fraction) -> bool {
        self.orders(value, ALL).within(Orders::NOT_LESS)
    }

    /// A positive multiple of a fact, or a sum of nothing but positive factors and squares.
    fn is_positive(&self, value: &Fraction, may: Use) -> bool {
        let mut strict = self.facts(may).filter(|fact| fact.strict);
        let by_fact = strict.any(|fact| value.multiple_of(&fact.value).is_some_and(|k| k.is_positive()));
        let positive = |v: Variable| match &self.indeterminates[v].kind {
            Kind::Positive | Kind::Pi => true,
            Kind::Cosine(angle) | Kind::Sine(angle) => {
                matches!(self.indeterminates[*angle].kind, Kind::Angle { acute: true, .. })
            }
            Kind::Root(radicand) => self.is_positive(&Fraction::whole(radicand.clone()), may),
            _ => false,
        };
        let even =
            |v: Variable, power: u32| power.is_multiple_of(2) && matches!(self.indeterminates[v].kind, Kind::Nonzero);
        let strictly = |m: &Monomial| m.powers().iter().all(|(v, power)| even(*v, *power) || positive(*v));
        let weakly = |m: &Monomial| m.powers().iter().all(|(v, power)| power.is_multiple_of(2) || positive(*v));
        // no term below 0, and one above
        let only_positive = |p: &Polynomial| {
            p.terms().all(|(m, c)| c.is_positive() && weakly(m)) && p.terms().any(|(m, _)| strictly(m))
        };
        by_fact || (only_positive(&value.numerator) && only_positive(&value.denominator))
    }

    /// 0, a sum of squares and of what is not negative, or what a comparison found not to be.
    fn is_not_negative(&self, value: &Fraction, may: Use) -> bool {
        if value.is_zero() || self.is_positive(value, may) {
            return true;
        }
        let multiple = |of: &Fraction| value.multiple_of(of);
        let by_fact = self.facts(may).any(|fact| multiple(&fact.value).is_some_and(|k| k.is_positive()));
        let by_path = self.choices(may).any(|choice| {
            let orders = |k: BigRational| {
                if k.is_positive() { choice.orders } else { choice.orders.mirrored() }
            };
            multiple(&choice.difference).is_some_and(|k| orders(k).within(Orders::NOT_LESS))
        });
        // term by term: a square, or what is known times something positive
        let known = |v: Variable| self.is_positive(&Fraction::variable(v), may);
        let squares = |m: &Monomial| m.powers().iter().all(|(v, power)| power.is_multiple_of(2) || known(*v));
        let product = |term: Fraction| {
            let mut monomials = self.facts(may).filter(|fact| fact.value.is_monomial());
            monomials.any(|fact| self.is_positive(&term.over(&fact.value, self), may))
        };
        let by_terms = || {
            let term = |m: &Monomial, c: &BigRational| Fraction::whole(Polynomial::term(m.clone(), c.clone()));
            self.is_positive(&Fraction::whole(value.denominator.clone()), may)
                && value.numerator.terms().all(|(m, c)| (c.is_positive() && squares(m)) || product(term(m, c)))
        };
        by_fact || by_path || by_terms()
    }

    fn is_nonzero(&self, value: &Polynomial, may: Use) -> bool {
        let factor = |v: Variable| match &self.indeterminates[v].kind {
            Kind::Nonzero => true,
            _ => self.is_positive(&Fraction::variable(v), may),
        };
        let by_factors = value.as_monomial().is_some_and(|(m, _)| m.powers().iter().all(|(v, _)| factor(*v)));
        let multiple = |of: &Polynomial| value.multiple_of(of).is_some_and(|k| !k.is_zero());
        let by_fact = self.facts(may).any(|fact| fact.strict && multiple(&fact.value.numerator));
        let by_path = self
            .choices(may)
            .any(|choice| choice.orders.and(Orders::EQUAL) == Orders::NONE && multiple(&choice.difference.numerator));
        by_factors || by_fact || by_path || self.is_positive(&Fraction::whole(value.clone()), may)
    }

    /// How `difference` can compare with 0, by what is known and by the comparisons on this path.
    fn orders(&self, difference: &Fraction, may: Use) -> Orders {
        if let Some(value) = difference.as_constant() {
            return if value.is_positive() {
                Orders::GREATER
            } else if value.is_negative() {
                Orders::LESS
            } else {
                Orders::EQUAL
            };
        }
        let negative = difference.negated();
        let known = [
            (Orders::GREATER, self.is_positive(difference, may)),
            (Orders::LESS, self.is_positive(&negative, may)),
            (Orders::NOT_LESS, self.is_not_negative(difference, may)),
            (Orders::NOT_GREATER, self.is_not_negative(&negative, may)),
        ];
        let known = known.into_iter().fold(Orders::ANY, |all, (orders, so)| if so { all.and(orders) } else { all });
        let by_path = self.choices(may).fold(known, |orders, choice| {
            let factor = difference.multiple_of(&choice.difference);
            factor.map_or(orders, |factor| {
                orders.and(if factor.is_positive() { choice.orders } else { choice.orders.mirrored() })
            })
        });
        let both_ways = [
            (Orders::GREATER, self.is_absurd(difference, true, may)),
            (Orders::LESS, self.is_absurd(&negative, true, may)),
            (Orders::EQUAL, self.is_absurd(difference, false, may) || self.is_absurd(&negative, false, may)),
        ];
        both_ways
            .into_iter()
            .fold(by_path, |orders, (order, absurd)| if absurd { orders.without(order) } else { orders })
    }

    /// Whether `value` above 0 (or, if not `strict`, not below 0) contradicts something on this path: their sum is below 0,
    /// or not above it although it should be.
    fn is_absurd(&self, value: &Fraction, strict: bool, may: Use) -> bool {
        let against = |known: &Fraction, known_strict: bool| {
            let left = value.plus(known, self).negated();
            self.is_positive(&left, may) || ((strict || known_strict) && self.is_not_negative(&left, may))
        };
        self.choices(may).any(|choice| {
            let d = &choice.difference;
            let above = choice.orders.within(Orders::NOT_LESS) && against(d, choice.orders == Orders::GREATER);
            let below =
                choice.orders.within(Orders::NOT_GREATER) && against(&d.negated(), choice.orders == Orders::LESS);
            above || below
        })
    }

    /// Whether `difference` is one of `asked` in comparison with 0: as is known, as the script says, or as a new choice
    /// whose alternative is to be walked later.
    pub(crate) fn decide(&mut self, difference: &Value, asked: Orders) -> bool {
        let fraction = &difference.fraction;
        let possible = self.orders(fraction, ALL);
        if possible.within(asked) {
            return true;
        }
        if possible.and(asked) == Orders::NONE {
            return false;
        }
        let yes = self.script.get(self.taken.len()).copied().unwrap_or(true);
        let orders = if yes { possible.and(asked) } else { possible.without(asked) };
        let narrowed = self.least(|limit| self.orders(fraction, Use::up_to(limit)) == possible);
        let (rests, choice) = (narrowed.max(difference.rests), Some(self.taken.len()));
        for (strict, kept, value) in [
            (orders == Orders::GREATER, orders.within(Orders::NOT_LESS), fraction.clone()),
            (orders == Orders::LESS, orders.within(Orders::NOT_GREATER), fraction.negated()),
        ] {
            if kept {
                self.facts.push(Fact { value, strict, rests, choice });
            }
        }
        self.taken.push(Choice { difference: fraction.clone(), orders, yes, rests });
        yes
    }

    /// Whether some comparison of this path came out as it cannot, by what else is known: no point lies on the path.
    pub(crate) fn is_impossible(&self) -> bool {
        self.taken.iter().enumerate().any(|(number, choice)| {
            let but = Use { limit: usize::MAX, but: Some(number) };
            self.orders(&choice.difference, but).and(choice.orders) == Orders::NONE
        })
    }

    /// Whether every point of this path has others of it all around: its comparisons found strict inequalities alone.
    pub(crate) fn is_open(&self) -> bool {
        self.taken.iter().all(|choice| choice.orders.and(Orders::EQUAL) == Orders::NONE)
    }

    /// The comparisons of this path, as text.
    pub(crate) fn path(&self) -> String {
        let found = |c: &Choice| format!("{} {}", self.text(&c.difference), c.orders.sign());
        let all: Vec<_> = self.taken.iter().map(found).collect();
        if all.is_empty() { "the only path".to_owned() } else { format!("the path {}", all.join(", ")) }
    }
}
