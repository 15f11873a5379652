//! Proofs about all reals: claims on [`Exact`] values, each decided by a normal form or by a certificate.
//!
//! A claim of equality holds if the difference is the zero polynomial. A claim of sign holds if the caller's certificate
//! does: a positive multiple of the value is a sum of squares with positive weights and, where the sign is strict, of
//! something known to be positive. Every division and root on the way has to be shown to be allowed before the proof
//! counts, on every path through comparisons, by what does not rest on it.
//!
//! So that no proof is about nothing, each path is also tried at points: a path needs a point at which all assumptions
//! hold, unless it is shown that none lies on it; and it needs a claim after its last comparison, unless the argument
//! says, by [`Proof::outside`], why it claims nothing there. At each point every claim is evaluated in floating point. A
//! claim that fails there is refuted, which is more than unproved.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use crate::Exact;
use crate::fraction::Fraction;
use crate::known::Debt;
use crate::world::{self, Value};

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
    /// no point was found on this path that obeys the assumptions, and it was not shown that none lies there
    Vacuous(String),
    /// nothing is claimed on this path, or nothing after its last comparison
    Silent(String),
    /// assumed after a comparison, so that it would narrow this path alone
    Late(String),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refuted { claim, at } => write!(f, "\"{claim}\" is false at {at}"),
            Self::Unproved { claim, left } => write!(f, "\"{claim}\" is not shown: {left} is left"),
            Self::Division(by) => write!(f, "a division by {by}, which may be zero"),
            Self::Root(of) => write!(f, "a root of {of}, which may be negative"),
            Self::Vacuous(path) => write!(f, "no point was found on {path}"),
            Self::Silent(path) => write!(f, "nothing is claimed at the end of {path}"),
            Self::Late(assumption) => write!(f, "{assumption} > 0 is assumed after a comparison"),
        }
    }
}

/// What was proved.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Proved {
    /// claims on all paths
    pub claims: usize,
    /// paths through comparisons
    pub paths: usize,
    /// paths on which a point was found; on the others none lies, or they are outside or unvisited
    pub covered: usize,
    /// why nothing is claimed on some paths
    pub outside: BTreeSet<String>,
    /// paths on which no point was found, although everything that is claimed was shown there, and why that may be
    pub unvisited: BTreeMap<String, usize>,
    /// each claim with the number of paths on which it is made
    pub by_claim: BTreeMap<String, usize>,
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
    /// comparisons that had been made when the last claim was
    compared: usize,
    outside: Option<String>,
    may_be_empty: Option<String>,
}

/// Points that are drawn on each path.
pub const SAMPLES: u64 = 512;
/// Points that are drawn before a path counts as one on which nothing is.
const PATIENCE: u64 = 8 * SAMPLES;
/// How far a claim may fail in floating point at a point, relative to the sizes involved, before it is refuted.
const SLACK: f64 = 1e-6;
/// More paths than this are refused.
const MOST_PATHS: usize = 20_000;

/// Runs `argument` along every path through the comparisons that it makes.
///
/// # Errors
/// The first claim, division or root that is not shown, or a path that has no point or claims nothing.
pub fn prove(argument: impl Fn(&mut Proof) -> Result<(), Refusal>) -> Result<Proved, Refusal> {
    let mut scripts = vec![Vec::new()];
    let mut proved = Proved::default();
    while let Some(script) = scripts.pop() {
        let given = script.len();
        world::begin(script);
        let mut proof = Proof { claims: Vec::new(), compared: 0, outside: None, may_be_empty: None };
        argument(&mut proof)?;
        proved.claims += proof.claims.len();
        proved.paths += 1;
        assert!(proved.paths <= MOST_PATHS, "refused: more than {MOST_PATHS} paths");
        let found = proof.close()?;
        proved.covered += usize::from(found);
        if let Some(reason) = proof.may_be_empty.filter(|_| !found && !world::with(|w| w.is_impossible())) {
            *proved.unvisited.entry(reason).or_default() += 1;
        }
        let names: BTreeSet<&String> = proof.claims.iter().map(|(name, _)| name).collect();
        for name in names {
            *proved.by_claim.entry(name.clone()).or_default() += 1;
        }
        proved.outside.extend(proof.outside);
        let taken: Vec<bool> = world::with(|w| w.taken.iter().map(|choice| choice.yes).collect());
        for turn in given..taken.len() {
            scripts.push(taken[..turn].iter().copied().chain([!taken[turn]]).collect());
        }
    }
    if proved.covered == 0 { Err(Refusal::Vacuous("any path".to_owned())) } else { Ok(proved) }
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

    /// `value` > 0, assumed: a precondition of what is proved, on every path.
    ///
    /// # Errors
    /// Where a comparison was made before: the assumption would hold on one path only.
    pub fn assume_positive(&mut self, value: Exact) -> Result<(), Refusal> {
        let value = value.value();
        world::with(|w| {
            if !w.taken.is_empty() {
                return Err(Refusal::Late(w.text(&value.fraction)));
            }
            w.assumed.push(value.fraction.clone());
            w.learn(value, true);
            Ok(())
        })
    }

    /// Nothing more is claimed on this path, and this is why. It stands in [`Proved::outside`] for all to see.
    pub fn outside(&mut self, reason: &str) {
        self.outside = Some(reason.to_owned());
    }

    /// No point may lie on this path, and this is why that need not be shown. All claims are still to be shown there.
    pub fn may_be_empty(&mut self, reason: &str) {
        self.may_be_empty = Some(reason.to_owned());
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
        let holds = world::with(|w| w.positive(&value).is_some());
        let left = value.clone();
        self.settle(claim, Claim::Positive(value), holds, &left)
    }

    /// `value` ≥ 0 by what a comparison on this path found, or by its factors.
    ///
    /// # Errors
    /// Where no comparison says so.
    pub fn not_negative_by_path(&mut self, claim: &str, value: Exact) -> Result<(), Refusal> {
        let value = value.fraction();
        let holds = world::with(|w| w.never_below(&value));
        let left = value.clone();
        self.settle(claim, Claim::NotNegative(value), holds, &left)
    }

    /// The product of two values that are known to be positive, or not to be negative, which then is known to be.
    ///
    /// # Panics
    /// Where a factor is not known to be either.
    pub fn product(&mut self, a: Exact, b: Exact) -> Exact {
        let product = a * b;
        let mut value = product.value();
        let strict = [a, b].map(|factor| {
            let of = factor.fraction();
            let (strictly, weakly) = world::with(|w| (w.positive(&of), w.not_negative(&of)));
            let Some(rests) = strictly.or(weakly) else { panic!("refused: {factor:?} is not known to be positive") };
            value.rests = value.rests.max(rests);
            strictly.is_some()
        });
        world::with(|w| w.learn(value, strict == [true, true]));
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
        let sum = strict.into_iter().chain(weighted).reduce(|a, b| a + b).map(Exact::value);
        let (value, multiplier) = (value.value(), multiplier.value());
        let (left, known, rests) = world::with(|w| {
            let product = multiplier.fraction.times(&value.fraction, w);
            let left = sum.as_ref().map_or(product.clone(), |sum| product.minus(&sum.fraction, w));
            let strictly = strict.map(|s| s.value_in(w).fraction).into_iter().chain([multiplier.fraction.clone()]);
            let signs = strictly.map(|v| w.positive(&v));
            let weights = squares.iter().map(|(weight, _)| weight.value_in(w).fraction);
            let signs: Vec<_> = signs.chain(weights.map(|weight| w.not_negative(&weight))).collect();
            let of_values = [&value, &multiplier].into_iter().chain(&sum).map(|v| v.rests);
            let rests = of_values.chain(signs.iter().flatten().copied()).max().unwrap_or(0);
            (left, signs.iter().all(Option::is_some), rests)
        });
        let holds = known && left.is_zero();
        let fraction = value.fraction;
        let evaluated = if strict.is_some() { Claim::Positive } else { Claim::NotNegative };
        self.settle(claim, evaluated(fraction.clone()), holds, &left)?;
        world::with(|w| w.learn(Value { fraction, rests }, strict.is_some()));
        Ok(())
    }

    fn settle(&mut self, claim: &str, evaluated: Claim, holds: bool, left: &Fraction) -> Result<(), Refusal> {
        self.claims.push((claim.to_owned(), evaluated));
        self.compared = world::with(|w| w.taken.len());
        // of no point anything may be said
        if holds || (self.sampled()? == 0 && world::with(|w| w.is_impossible())) {
            return Ok(());
        }
        Err(Refusal::Unproved { claim: claim.to_owned(), left: world::with(|w| w.text(left)) })
    }

    /// Pays the debts of this path, and looks whether it is about something; whether a point of it was found.
    fn close(&self) -> Result<bool, Refusal> {
        // a claim that is false is told before one that rests on nothing
        let points = self.sampled()?;
        world::with(|w| {
            let text = |p: &crate::polynomial::Polynomial| w.text(&Fraction::whole(p.clone()));
            match w.unpaid() {
                Some(Debt::Division(by)) => return Err(Refusal::Division(text(by))),
                Some(Debt::Root(of)) => return Err(Refusal::Root(text(of))),
                None => {}
            }
            if self.outside.is_some() || (points == 0 && w.is_impossible()) {
                return Ok(points > 0);
            }
            let silent = self.claims.is_empty() || self.compared < w.taken.len();
            match (points, silent) {
                (_, true) => Err(Refusal::Silent(w.path())),
                (0, _) if self.may_be_empty.is_none() => Err(Refusal::Vacuous(w.path())),
                (points, _) => Ok(points > 0),
            }
        })
    }

    /// Evaluates every claim at points that obey the assumptions and lie on this path; how many there were.
    fn sampled(&self) -> Result<usize, Refusal> {
        world::with(|w| {
            let mut points = 0;
            for n in 0..PATIENCE {
                if n >= SAMPLES && points > 0 {
                    break;
                }
                let at = w.sample(n);
                if !w.is_on_path(&at) {
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
