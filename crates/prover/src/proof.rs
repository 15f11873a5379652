//! Proofs about all reals: claims on [`Exact`] values, each decided by a normal form or by a certificate.
//!
//! A claim of equality holds if the difference is the zero polynomial. A claim of sign holds if the caller's certificate
//! does: a positive multiple of the value is a sum of squares with positive weights and, where the sign is strict, of
//! something known to be positive. Every division and root on the way has to be shown to be allowed before the proof
//! counts, on every path through comparisons.
//!
//! So that no proof is about nothing, each path is also sampled: a proof needs a point at which all its assumptions
//! hold, and at each such point every claim is evaluated in floating point. A claim that fails there is refuted, which
//! is more than unproved.

use std::fmt;

use num_traits::Signed;

use crate::Exact;
use crate::fraction::Fraction;
use crate::world::{self, Orders, World};

/// Why a proof does not hold.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// false: here is a point where it fails
    Refuted {
        /// what was claimed
        claim: String,
        /// the point
        at: String,
    },
    /// not shown, and no point was found where it fails
    Unproved {
        /// what was claimed
        claim: String,
        /// what should have been zero
        left: String,
    },
    /// a division by something that was not shown to be other than zero
    Division(String),
    /// a root of something that was not shown to be positive
    Root(String),
    /// no point obeys the assumptions
    Vacuous,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refuted { claim, at } => write!(f, "\"{claim}\" is false at {at}"),
            Self::Unproved { claim, left } => write!(f, "\"{claim}\" is not shown: {left} is left"),
            Self::Division(by) => write!(f, "a division by {by}, which may be zero"),
            Self::Root(of) => write!(f, "a root of {of}, which may be negative"),
            Self::Vacuous => f.write_str("no point obeys the assumptions"),
        }
    }
}

/// What was proved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Proved {
    /// claims on all paths
    pub claims: usize,
    /// paths through comparisons
    pub paths: usize,
    /// paths on which a point was found
    pub covered: usize,
}

/// How a claim can be evaluated at a point.
enum Claim {
    Equal(Fraction, Fraction),
    Positive(Fraction),
    NotNegative(Fraction),
}

/// A weight that is known to be positive, and what it is multiplied with after squaring.
pub type Square = (Exact, Exact);

/// A proof that is being written: the claims on the path that is walked.
pub struct Proof {
    claims: Vec<(String, Claim)>,
}

/// Points that are drawn before a path counts as one on which nothing is.
pub const SAMPLES: u64 = 512;
/// How far a claim may fail in floating point at a point, relative to the sizes involved, before it is refuted.
const SLACK: f64 = 1e-6;
/// More paths than this are refused.
const MOST_PATHS: usize = 20_000;

/// Runs `argument` along every path through the comparisons that it makes.
///
/// # Errors
/// The first claim, division or root that is not shown, or that no path has a point.
pub fn prove(argument: impl Fn(&mut Proof) -> Result<(), Refusal>) -> Result<Proved, Refusal> {
    let mut scripts = vec![Vec::new()];
    let mut proved = Proved::default();
    while let Some(script) = scripts.pop() {
        let given = script.len();
        world::begin(script);
        let mut proof = Proof { claims: Vec::new() };
        argument(&mut proof)?;
        proved.claims += proof.claims.len();
        proved.paths += 1;
        assert!(proved.paths <= MOST_PATHS, "refused: more than {MOST_PATHS} paths");
        proved.covered += usize::from(proof.close()?);
        let taken: Vec<bool> = world::with(|w| w.taken.iter().map(|choice| choice.yes).collect());
        for turn in given..taken.len() {
            scripts.push(taken[..turn].iter().copied().chain([!taken[turn]]).collect());
        }
    }
    if proved.covered == 0 { Err(Refusal::Vacuous) } else { Ok(proved) }
}

/// The claim and the point that refute a proof.
///
/// # Panics
/// Where the proof holds, or fails without a point: then nothing is refuted.
#[track_caller]
pub fn refuted(result: Result<Proved, Refusal>) -> String {
    match result {
        Err(Refusal::Refuted { claim, at }) => format!("{claim} fails at {at}"),
        other => panic!("a planted error was not refuted: {other:?}"),
    }
}

impl Proof {
    /// `a` = `b` for all reals.
    ///
    /// # Errors
    /// Where the difference is not the zero polynomial.
    pub fn equal(&mut self, claim: &str, a: Exact, b: Exact) -> Result<(), Refusal> {
        let (a, b) = (a.fraction(), b.fraction());
        let left = world::with(|w| {
            let (left, right) = (a.numerator.times(&b.denominator, w), b.numerator.times(&a.denominator, w));
            left.plus(&right.negated())
        });
        let holds = left.is_zero();
        self.settle(claim, Claim::Equal(a, b), holds, &Fraction::whole(left))
    }

    /// `value` > 0, assumed: a precondition of what is proved.
    pub fn assume_positive(&mut self, value: Exact) {
        let value = value.fraction();
        world::with(|w| {
            w.facts.push(value.clone());
            w.assumed.push(value);
        });
    }

    /// `value` > 0: `multiplier` · `value` = `strict` + Σ weight · square², with `multiplier`, `strict` and the
    /// weights known to be positive. From here on `value` is known to be positive.
    ///
    /// # Errors
    /// Where the certificate does not hold.
    pub fn positive(
        &mut self,
        claim: &str,
        value: Exact,
        multiplier: Exact,
        strict: Exact,
        squares: &[Square],
    ) -> Result<(), Refusal> {
        self.certified(claim, value, multiplier, Some(strict), squares)
    }

    /// `value` > 0 by its factors: nothing but positive indeterminates, or what was shown before.
    ///
    /// # Errors
    /// Where a factor may be zero or negative.
    pub fn positive_by_factors(&mut self, claim: &str, value: Exact) -> Result<(), Refusal> {
        let value = value.fraction();
        let holds = world::with(|w| w.is_positive(&value));
        let left = value.clone();
        self.settle(claim, Claim::Positive(value), holds, &left)
    }

    /// `value` ≥ 0 by what a comparison on this path found, or by its factors.
    ///
    /// # Errors
    /// Where no comparison says so.
    pub fn not_negative_by_path(&mut self, claim: &str, value: Exact) -> Result<(), Refusal> {
        let value = value.fraction();
        let holds = world::with(|w| w.orders(&value).within(Orders::NOT_LESS));
        let left = value.clone();
        self.settle(claim, Claim::NotNegative(value), holds, &left)
    }

    /// The product of two values that are known to be positive, which then is known to be positive.
    ///
    /// # Panics
    /// Where a factor is not known to be positive.
    pub fn product(&mut self, a: Exact, b: Exact) -> Exact {
        let product = a * b;
        for factor in [a, b] {
            let known = world::with(|w| w.is_positive(&factor.value_in(w)));
            assert!(known, "refused: {factor:?} is not known to be positive");
        }
        let value = product.fraction();
        world::with(|w| w.facts.push(value));
        product
    }

    /// `value` ≥ 0: `multiplier` · `value` = Σ weight · square².
    ///
    /// # Errors
    /// Where the certificate does not hold.
    pub fn not_negative(
        &mut self,
        claim: &str,
        value: Exact,
        multiplier: Exact,
        squares: &[Square],
    ) -> Result<(), Refusal> {
        self.certified(claim, value, multiplier, None, squares)
    }

    /// `a` and `b` are one angle up to whole turns: their directions have no cross product, and a dot product above 0,
    /// which `multiplier`, `strict` and `squares` certify as in [`Proof::positive`].
    ///
    /// # Errors
    /// Where either is not shown.
    pub fn same_angle(
        &mut self,
        claim: &str,
        a: Exact,
        b: Exact,
        multiplier: Exact,
        strict: Exact,
        squares: &[Square],
    ) -> Result<(), Refusal> {
        let ((ax, ay), (bx, by)) = (a.ray(), b.ray());
        self.equal(claim, ax * by, ay * bx)?;
        self.positive(claim, ax * bx + ay * by, multiplier, strict, squares)
    }

    fn certified(
        &mut self,
        claim: &str,
        value: Exact,
        multiplier: Exact,
        strict: Option<Exact>,
        squares: &[Square],
    ) -> Result<(), Refusal> {
        let weighted = squares.iter().map(|(weight, root)| *weight * *root * *root);
        let sum = strict.into_iter().chain(weighted).reduce(|a, b| a + b).map(Exact::fraction);
        let (left, known) = world::with(|w| {
            let product = multiplier_times(multiplier, value, w);
            let left = sum.map_or(product.clone(), |sum| product.minus(&sum, w));
            let mut weights = squares.iter().map(|(weight, _)| *weight).chain([multiplier]).chain(strict);
            (left, weights.all(|weight| w.is_positive(&weight.value_in(w))))
        });
        let value = value.fraction();
        let holds = known && left.is_zero();
        let evaluated =
            if strict.is_some() { Claim::Positive(value.clone()) } else { Claim::NotNegative(value.clone()) };
        self.settle(claim, evaluated, holds, &left)?;
        if strict.is_some() {
            world::with(|w| w.facts.push(value));
        }
        Ok(())
    }

    fn settle(&mut self, claim: &str, evaluated: Claim, holds: bool, left: &Fraction) -> Result<(), Refusal> {
        self.claims.push((claim.to_owned(), evaluated));
        if holds {
            return Ok(());
        }
        self.sampled()?;
        Err(Refusal::Unproved { claim: claim.to_owned(), left: world::with(|w| w.text(left)) })
    }

    /// Pays the debts of this path; whether a point of it was found.
    fn close(&self) -> Result<bool, Refusal> {
        world::with(|w| {
            if let Some(divisor) = w.divisors.iter().find(|d| d.as_constant().is_none() && !w.is_nonzero(d)) {
                return Err(Refusal::Division(w.text(&Fraction::whole(divisor.clone()))));
            }
            let allowed = |p: &&crate::polynomial::Polynomial| match p.as_constant() {
                Some(value) => value.is_negative(),
                None => !w.is_positive(&Fraction::whole((*p).clone())),
            };
            match w.radicands.iter().find(allowed) {
                Some(radicand) => Err(Refusal::Root(w.text(&Fraction::whole(radicand.clone())))),
                None => Ok(()),
            }
        })?;
        Ok(self.sampled()? > 0)
    }

    /// Evaluates every claim at points that obey the assumptions and lie on this path; how many there were.
    fn sampled(&self) -> Result<usize, Refusal> {
        world::with(|w| {
            let mut points = 0;
            for n in 0..SAMPLES {
                let at = w.sample(n);
                if !admissible(w, &at) {
                    continue;
                }
                points += 1;
                if let Some((claim, _)) = self.claims.iter().find(|(_, claim)| !claim.holds(&at)) {
                    let named = w.indeterminates.iter().zip(&at).skip(1);
                    let at: Vec<_> = named.map(|(i, value)| format!("{} = {value:.6}", i.name)).collect();
                    return Err(Refusal::Refuted { claim: claim.clone(), at: at.join(", ") });
                }
            }
            Ok(points)
        })
    }
}

fn multiplier_times(multiplier: Exact, value: Exact, w: &World) -> Fraction {
    multiplier.value_in(w).times(&value.value_in(w), w)
}

/// All assumptions hold at this point, it lies on this path, and nothing is divided by zero.
fn admissible(w: &World, at: &[f64]) -> bool {
    let value = |f: &Fraction| f.evaluate(|v| at[v]);
    let on_path = w.taken.iter().all(|choice| choice.orders.hold(value(&choice.difference)));
    on_path
        && w.assumed.iter().all(|f| value(f) > 1e-6)
        && w.divisors.iter().all(|d| d.evaluate(|v| at[v]).abs() > 1e-6)
        && at.iter().all(|v| v.is_finite())
}

impl Claim {
    fn holds(&self, at: &[f64]) -> bool {
        let value = |f: &Fraction| f.evaluate(|v| at[v]);
        match self {
            Self::Equal(a, b) => {
                let (a, b) = (value(a), value(b));
                (a - b).abs() <= SLACK * (1.0 + a.abs() + b.abs())
            }
            Self::Positive(f) => value(f) > -SLACK,
            Self::NotNegative(f) => value(f) >= -SLACK,
        }
    }
}
