//! What the indeterminates of one proof stand for, and what is known of them.
//!
//! A world belongs to the thread and to one run of one proof. It holds the values that [`crate::Exact`] points to, the
//! divisions and roots that were taken on the way (each a debt until something shows that it was allowed), the facts
//! that pay those debts, and the path through comparisons.

use std::cell::RefCell;

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use crate::fraction::Fraction;
use crate::polynomial::{Monomial, Polynomial, Squares, Variable};

/// What an indeterminate ranges over.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    /// the circle's constant
    Pi,
    /// all reals
    Real,
    /// all reals but 0
    Nonzero,
    /// all reals above 0
    Positive,
    /// all angles, or those above 0° and below 90°
    Angle {
        cos: Variable,
        sin: Variable,
        acute: bool,
    },
    /// the cosine or sine of the angle whose number is given
    Cosine(Variable),
    Sine(Variable),
    /// the root, 0 or more, of a polynomial in earlier indeterminates
    Root(Polynomial),
    /// the angle of the point (x, y)
    Arc {
        y: Fraction,
        x: Fraction,
    },
}

#[derive(Clone, Debug)]
pub(crate) struct Indeterminate {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    square: Option<Polynomial>,
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
}

/// What a comparison found on this path.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    pub(crate) difference: Fraction,
    pub(crate) orders: Orders,
    /// whether the question was answered with yes
    pub(crate) yes: bool,
}

#[derive(Default)]
pub(crate) struct World {
    pub(crate) epoch: u32,
    pub(crate) indeterminates: Vec<Indeterminate>,
    values: Vec<Fraction>,
    /// what was divided by
    pub(crate) divisors: Vec<Polynomial>,
    /// what a root was taken of
    pub(crate) radicands: Vec<Polynomial>,
    /// what is known to be above 0
    pub(crate) facts: Vec<Fraction>,
    /// preconditions: assumed to be above 0
    pub(crate) assumed: Vec<Fraction>,
    /// choices to make again, from the first comparison on
    pub(crate) script: Vec<bool>,
    pub(crate) taken: Vec<Choice>,
}

impl Squares for World {
    fn square(&self, variable: Variable) -> Option<&Polynomial> {
        self.indeterminates[variable].square.as_ref()
    }
}

thread_local! {
    static WORLD: RefCell<World> = RefCell::new(World::default());
}

/// Runs `f` on this thread's world.
pub(crate) fn with<R>(f: impl FnOnce(&mut World) -> R) -> R {
    WORLD.with(|world| f(&mut world.borrow_mut()))
}

/// Forgets everything and starts a new run along `script`.
pub(crate) fn begin(script: Vec<bool>) {
    with(|world| {
        *world = World { epoch: world.epoch + 1, script, ..World::default() };
        world.declare("π", Kind::Pi, None);
    });
}

/// π is the first indeterminate of every world.
pub(crate) const PI: Variable = 0;

impl World {
    pub(crate) fn declare(&mut self, name: &str, kind: Kind, square: Option<Polynomial>) -> Variable {
        self.indeterminates.push(Indeterminate { name: name.to_owned(), kind, square });
        self.indeterminates.len() - 1
    }

    pub(crate) fn keep(&mut self, value: Fraction) -> usize {
        self.values.push(value);
        self.values.len() - 1
    }

    pub(crate) fn value(&self, index: usize) -> &Fraction {
        &self.values[index]
    }

    /// An angle with its cosine and sine; in the first quadrant without its ends where `acute`.
    pub(crate) fn angle(&mut self, name: &str, acute: bool) -> Variable {
        let angle = self.indeterminates.len();
        let (cos, sin) = (angle + 1, angle + 2);
        self.declare(name, Kind::Angle { cos, sin, acute }, None);
        self.declare(&format!("cos {name}"), Kind::Cosine(angle), None);
        let cosine = Polynomial::variable(cos);
        let square = Polynomial::one().plus(&cosine.times(&cosine, self).negated());
        self.declare(&format!("sin {name}"), Kind::Sine(angle), Some(square));
        angle
    }

    /// The root of a polynomial, as an indeterminate whose square is known.
    pub(crate) fn root(&mut self, radicand: &Polynomial) -> Variable {
        let known = self.indeterminates.iter().position(|i| matches!(&i.kind, Kind::Root(of) if of == radicand));
        known.unwrap_or_else(|| {
            let name = format!("√{}", self.indeterminates.len());
            self.declare(&name, Kind::Root(radicand.clone()), Some(radicand.clone()))
        })
    }

    /// The point (x, y) of an arc, multiplied by a positive number that leaves no denominators.
    pub(crate) fn point(&self, arc: Variable) -> Option<(Polynomial, Polynomial)> {
        let Kind::Arc { y, x } = &self.indeterminates[arc].kind else { return None };
        if y.denominator == x.denominator {
            return Some((x.numerator.times(&x.denominator, self), y.numerator.times(&y.denominator, self)));
        }
        let both = y.denominator.times(&x.denominator, self);
        let point_x = x.numerator.times(&y.denominator, self).times(&both, self);
        let point_y = y.numerator.times(&x.denominator, self).times(&both, self);
        Some((point_x, point_y))
    }

    /// ρ of an arc: ρ² = x² + y².
    pub(crate) fn radius(&mut self, arc: Variable) -> Variable {
        let (x, y) = self.point(arc).expect("an arc");
        let radicand = x.times(&x, self).plus(&y.times(&y, self));
        self.root(&radicand)
    }

    /// (cos, sin) of an arc: x/ρ and y/ρ.
    fn arc_direction(&mut self, arc: Variable) -> (Fraction, Fraction) {
        let (x, y) = self.point(arc).expect("an arc");
        let rho = Polynomial::variable(self.radius(arc));
        self.divisors.push(rho.clone());
        (Fraction::new(&x, &rho), Fraction::new(&y, &rho))
    }

    /// The multiples of indeterminates whose sum an angle is: integers of angles and arcs, halves of π.
    pub(crate) fn multiples(&self, angle: &Fraction) -> Vec<(Variable, i64)> {
        let refuse = |why: &str| -> ! { panic!("refused: the sine and cosine of {}: {why}", self.text(angle)) };
        let Some(sum) = angle.as_polynomial() else { refuse("a quotient") };
        let mut found = Vec::new();
        for (monomial, coefficient) in sum.terms() {
            let [(variable, 1)] = monomial.powers() else { refuse("not a sum of angles") };
            let whole = match self.indeterminates[*variable].kind {
                Kind::Pi => coefficient * BigRational::from_integer(2.into()),
                Kind::Angle { .. } | Kind::Arc { .. } => coefficient.clone(),
                _ => refuse("not an angle"),
            };
            if !whole.is_integer() {
                refuse("not a whole multiple");
            }
            found.push((*variable, i64::try_from(whole.numer()).unwrap_or_else(|_| refuse("too large a multiple"))));
        }
        found
    }

    /// (cos, sin) of an angle by the addition theorems. With `as_ray` the point of an arc stands for its direction, and
    /// the result is the direction times a positive number.
    pub(crate) fn direction(&mut self, angle: &Fraction, as_ray: bool) -> (Fraction, Fraction) {
        let mut cos = Fraction::constant(BigRational::one());
        let mut sin = Fraction::constant(BigRational::zero());
        for (variable, count) in self.multiples(angle) {
            let (c, s) = match self.indeterminates[variable].kind.clone() {
                Kind::Pi => (Fraction::constant(BigRational::zero()), Fraction::constant(BigRational::one())),
                Kind::Angle { cos, sin, .. } => (Fraction::variable(cos), Fraction::variable(sin)),
                Kind::Arc { .. } if as_ray => {
                    let (x, y) = self.point(variable).expect("an arc");
                    (Fraction::whole(x), Fraction::whole(y))
                }
                _ => self.arc_direction(variable),
            };
            let s = if count < 0 { s.negated() } else { s };
            for _ in 0..count.unsigned_abs() {
                let turned_cos = cos.times(&c, self).minus(&sin.times(&s, self), self);
                sin = sin.times(&c, self).plus(&cos.times(&s, self), self);
                cos = turned_cos;
            }
        }
        (cos, sin)
    }

    /// Whether `value` is known to be above 0: a positive multiple of a fact, or nothing but positive factors.
    pub(crate) fn is_positive(&self, value: &Fraction) -> bool {
        let by_fact = self.facts.iter().any(|fact| value.multiple_of(fact).is_some_and(|k| k.is_positive()));
        let positive = |v: Variable| match &self.indeterminates[v].kind {
            Kind::Positive | Kind::Pi => true,
            Kind::Cosine(angle) | Kind::Sine(angle) => {
                matches!(self.indeterminates[*angle].kind, Kind::Angle { acute: true, .. })
            }
            Kind::Root(radicand) => self.is_positive(&Fraction::whole(radicand.clone())),
            _ => false,
        };
        let even =
            |v: Variable, power: u32| power.is_multiple_of(2) && matches!(self.indeterminates[v].kind, Kind::Nonzero);
        let factors = |m: &Monomial| m.powers().iter().all(|(v, power)| even(*v, *power) || positive(*v));
        let only_positive = |p: &Polynomial| !p.is_zero() && p.terms().all(|(m, c)| c.is_positive() && factors(m));
        by_fact || (only_positive(&value.numerator) && only_positive(&value.denominator))
    }

    /// Whether `value` is known to be other than 0.
    pub(crate) fn is_nonzero(&self, value: &Polynomial) -> bool {
        let factor = |v: Variable| match &self.indeterminates[v].kind {
            Kind::Nonzero => true,
            _ => self.is_positive(&Fraction::variable(v)),
        };
        let by_factors = value.as_monomial().is_some_and(|(m, _)| m.powers().iter().all(|(v, _)| factor(*v)));
        let by_fact = self.facts.iter().any(|fact| value.multiple_of(&fact.numerator).is_some());
        let by_path = self.taken.iter().any(|choice| {
            choice.orders.and(Orders::EQUAL) == Orders::NONE
                && value.multiple_of(&choice.difference.numerator).is_some()
        });
        by_factors || by_fact || by_path || self.is_positive(&Fraction::whole(value.clone()))
    }

    /// How `difference` can compare with 0, by what is known and by the comparisons on this path.
    pub(crate) fn orders(&self, difference: &Fraction) -> Orders {
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
        if self.is_positive(difference) {
            return Orders::GREATER;
        }
        if self.is_positive(&negative) {
            return Orders::LESS;
        }
        let by_path = self.taken.iter().fold(Orders::ANY, |orders, choice| {
            let factor = difference.multiple_of(&choice.difference);
            factor.map_or(orders, |factor| {
                orders.and(if factor.is_positive() { choice.orders } else { choice.orders.mirrored() })
            })
        });
        let both_ways = [
            (Orders::GREATER, self.is_absurd(difference, true)),
            (Orders::LESS, self.is_absurd(&negative, true)),
            (Orders::EQUAL, self.is_absurd(difference, false) || self.is_absurd(&negative, false)),
        ];
        both_ways
            .into_iter()
            .fold(by_path, |orders, (order, absurd)| if absurd { orders.without(order) } else { orders })
    }

    /// Whether `value` above 0 (or, if not `strict`, not below 0) contradicts something on this path: their sum is below 0.
    fn is_absurd(&self, value: &Fraction, strict: bool) -> bool {
        let against = |known: &Fraction, known_strict: bool| {
            let left = value.plus(known, self).negated();
            self.is_positive(&left) || (left.is_zero() && (strict || known_strict))
        };
        self.taken.iter().any(|choice| {
            let d = &choice.difference;
            let above = choice.orders.within(Orders::NOT_LESS) && against(d, choice.orders == Orders::GREATER);
            let below =
                choice.orders.within(Orders::NOT_GREATER) && against(&d.negated(), choice.orders == Orders::LESS);
            above || below
        })
    }

    /// Whether `difference` is one of `asked` in comparison with 0: as is known, as the script says, or as a new choice
    /// whose alternative is to be walked later.
    pub(crate) fn decide(&mut self, difference: &Fraction, asked: Orders) -> bool {
        let possible = self.orders(difference);
        if possible.within(asked) {
            return true;
        }
        if possible.and(asked) == Orders::NONE {
            return false;
        }
        let yes = self.script.get(self.taken.len()).copied().unwrap_or(true);
        let orders = if yes { possible.and(asked) } else { possible.without(asked) };
        self.taken.push(Choice { difference: difference.clone(), orders, yes });
        if orders == Orders::GREATER {
            self.facts.push(difference.clone());
        } else if orders == Orders::LESS {
            self.facts.push(difference.negated());
        }
        yes
    }

    /// A value for each indeterminate, the `n`th of many, drawn over its domain.
    pub(crate) fn sample(&self, n: u64) -> Vec<f64> {
        let mut state = n.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03;
        let mut draw = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut at: Vec<f64> = Vec::with_capacity(self.indeterminates.len());
        for indeterminate in &self.indeterminates {
            let value = match &indeterminate.kind {
                Kind::Pi => std::f64::consts::PI,
                Kind::Real => 4.0 * draw() - 2.0,
                Kind::Nonzero => {
                    let size = 0.2 + 2.0 * draw();
                    if draw() < 0.5 { -size } else { size }
                }
                Kind::Positive => 0.05 * 60_f64.powf(draw()),
                Kind::Angle { acute: true, .. } => (0.02 + 0.96 * draw()) * std::f64::consts::FRAC_PI_2,
                Kind::Angle { acute: false, .. } => (2.0 * draw() - 1.0) * std::f64::consts::PI,
                Kind::Cosine(angle) => at[*angle].cos(),
                Kind::Sine(angle) => at[*angle].sin(),
                Kind::Root(radicand) => radicand.evaluate(|v| at[v]).sqrt(),
                Kind::Arc { y, x } => y.evaluate(|v| at[v]).atan2(x.evaluate(|v| at[v])),
            };
            at.push(value);
        }
        at
    }

    /// The quotient as text.
    pub(crate) fn text(&self, value: &Fraction) -> String {
        let name = |v: Variable| self.indeterminates[v].name.clone();
        let mut text = String::new();
        let written = value.numerator.write(&mut text, name);
        debug_assert!(written.is_ok(), "a String takes any text");
        if value.as_polynomial().is_none() {
            let mut below = String::new();
            let written = value.denominator.write(&mut below, name);
            debug_assert!(written.is_ok(), "a String takes any text");
            text = format!("({text})/({below})");
        }
        text
    }
}
