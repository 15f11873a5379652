//! What the indeterminates of one proof stand for, and what is known of them.
//!
//! A world belongs to the thread and to one run of one proof. It holds the values that [`crate::Exact`] points to. What
//! it owes, knows and has compared is in [`crate::known`], the points at which it is tried in [`crate::points`].

use std::cell::RefCell;

use num_rational::BigRational;
use num_traits::{One, Zero};

use crate::fraction::Fraction;
use crate::known::{Choice, Debt, Fact};
use crate::polynomial::{Polynomial, Squares, Variable};

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

/// A value, and how many of the first debts it rests on: it is one where those are paid.
#[derive(Clone, Debug)]
pub(crate) struct Value {
    pub(crate) fraction: Fraction,
    pub(crate) rests: usize,
}

#[derive(Default)]
pub(crate) struct World {
    pub(crate) epoch: u32,
    pub(crate) indeterminates: Vec<Indeterminate>,
    values: Vec<Value>,
    /// divisions and roots that were not allowed by anything known when they were taken
    pub(crate) debts: Vec<Debt>,
    /// what is known of signs
    pub(crate) facts: Vec<Fact>,
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

    pub(crate) fn keep(&mut self, fraction: Fraction, rests: usize) -> usize {
        self.values.push(Value { fraction, rests });
        self.values.len() - 1
    }

    pub(crate) fn value(&self, index: usize) -> &Value {
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

    /// (cos, sin) of an arc: x/ρ and y/ρ. And what the division by ρ rests on.
    fn arc_direction(&mut self, arc: Variable) -> (Fraction, Fraction, usize) {
        let (x, y) = self.point(arc).expect("an arc");
        let rho = Polynomial::variable(self.radius(arc));
        let rests = self.owe(Debt::Division(rho.clone()));
        (Fraction::new(&x, &rho), Fraction::new(&y, &rho), rests)
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
    /// the result is the direction times a positive number. And what the divisions on the way rest on.
    pub(crate) fn direction(&mut self, angle: &Fraction, as_ray: bool) -> (Fraction, Fraction, usize) {
        let mut rests = 0;
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
                _ => {
                    let (cos, sin, of_arc) = self.arc_direction(variable);
                    rests = rests.max(of_arc);
                    (cos, sin)
                }
            };
            let s = if count < 0 { s.negated() } else { s };
            for _ in 0..count.unsigned_abs() {
                let turned_cos = cos.times(&c, self).minus(&sin.times(&s, self), self);
                sin = sin.times(&c, self).plus(&cos.times(&s, self), self);
                cos = turned_cos;
            }
        }
        (cos, sin, rests)
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
