//! How proofs and their twins are run: one claim, once as it is and once with an error planted in it.

use std::collections::BTreeSet;

use cvg_model::Real;
use cvg_prover::{Exact, Failure, Format, Formula, Interval, Proof, Refusal, bound_rounding, prove, refuted};

use crate::{Scalar, Tolerance};

/// A planted factor, as a quotient of integers; 1 plants nothing.
pub type Planted = (i32, i32);

/// Factors that make an equality false: 1 % too large, 1 % too small, the wrong sign.
pub const WRONG: &[Planted] = &[(101, 100), (99, 100), (-1, 1)];
/// Factors that make an upper bound too tight.
pub const TOO_TIGHT: &[Planted] = &[(99, 100), (-1, 1)];

/// The claim with nothing planted is proved, on every path.
#[track_caller]
pub fn holds(claim: impl Fn(&mut Proof, Exact) -> Result<(), Refusal>) {
    holds_outside(&[], claim);
}

/// The claim with nothing planted is proved on every path but those that are outside, or on which a point was looked for in
/// vain, for one of these reasons, each of which some path has.
#[track_caller]
pub fn holds_outside(reasons: &[&str], claim: impl Fn(&mut Proof, Exact) -> Result<(), Refusal>) {
    match prove(|proof| claim(proof, Exact::one())) {
        Ok(proved) => {
            println!("{proved:?}");
            let told: BTreeSet<String> = reasons.iter().map(ToString::to_string).collect();
            let left: BTreeSet<String> = proved.outside.iter().chain(proved.unvisited.keys()).cloned().collect();
            assert_eq!(left, told, "what is left out of the claim, and what it says is");
        }
        Err(refusal) => panic!("{refusal}"),
    }
}

/// The claim is refuted, with a point at which it fails, for each of the planted factors.
#[track_caller]
pub fn rejects(planted: &[Planted], claim: impl Fn(&mut Proof, Exact) -> Result<(), Refusal>) {
    assert!(planted.iter().any(|(numerator, denominator)| numerator != denominator), "nothing is planted");
    for &(numerator, denominator) in planted {
        println!("{}", refuted(prove(|proof| claim(proof, Exact::ratio(numerator, denominator)))));
    }
}

/// The larger of two numbers, as a scale of a bound.
pub fn larger<T: Real>(a: T, b: T) -> T {
    if a < b { b } else { a }
}

/// |v|, as a part of a scale of a bound.
pub fn magnitude<T: Real>(v: T) -> T {
    if v < T::zero() { -v } else { v }
}

/// A box of inputs.
pub type Inputs = Vec<Interval>;

/// For all inputs in the boxes the scalar's result is within its tolerance of the real value.
#[track_caller]
pub fn bounded<T: Scalar + Format>(formula: &impl Formula, boxes: &[Inputs], tolerance: &Tolerance) {
    match bound_rounding::<T>(formula, boxes, T::tolerance(tolerance), 1.0) {
        Ok(bounded) => println!("{}: {bounded:?}", tolerance.of),
        Err(failure) => panic!("{}: {failure}", tolerance.of),
    }
}

/// The same bound is refuted, with inputs at which the machine breaks it, where the result is 1 % off or has the wrong
/// sign, and in single precision also where the tolerance is a five-hundredth.
#[track_caller]
pub fn rejects_rounding<T: Scalar + Format>(formula: &impl Formula, boxes: &[Inputs], tolerance: &Tolerance) {
    let allowed = T::tolerance(tolerance);
    let tight = if T::UNIT > 1e-10 { Some((allowed / 500.0, 1.0)) } else { None };
    for (allowed, factor) in [(allowed, 1.01), (allowed, -1.0)].into_iter().chain(tight) {
        match bound_rounding::<T>(formula, boxes, allowed, factor) {
            Err(Failure::Refuted { at, error, .. }) => println!("{error:e} at {at:?} refutes {allowed:e}"),
            other => panic!("a planted error was not refuted: {other:?}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use cvg_prover::{Exact, Proof, Refusal};

    use super::{WRONG, rejects};

    fn a_square(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
        let x = Exact::nonzero("x");
        proof.equal("square", x * x, planted * x * x)
    }

    #[test]
    fn a_claim_with_an_error_is_rejected() {
        rejects(WRONG, a_square);
    }

    #[test]
    #[should_panic(expected = "nothing is planted")]
    fn a_twin_without_an_error_rejects_nothing() {
        rejects(&[], a_square);
    }
}
