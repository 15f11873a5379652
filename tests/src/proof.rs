//! How proofs and their twins are run: one claim, once as it is and once with an error planted in it.

use cvg_model::Real;
use cvg_prover::{Exact, Proof, Refusal, prove, refuted};

/// A planted factor, as a quotient of integers; 1 plants nothing.
pub type Planted = (i32, i32);

/// Factors that make an equality false: 1 % too large, 1 % too small, the wrong sign.
pub const WRONG: &[Planted] = &[(101, 100), (99, 100), (-1, 1)];
/// Factors that make an upper bound too tight.
pub const TOO_TIGHT: &[Planted] = &[(99, 100), (-1, 1)];

/// The claim with nothing planted is proved, on some path that is not empty.
#[track_caller]
pub fn holds(claim: impl Fn(&mut Proof, Exact) -> Result<(), Refusal>) {
    match prove(|proof| claim(proof, Exact::one())) {
        Ok(proved) => println!("{proved:?}"),
        Err(refusal) => panic!("{refusal}"),
    }
}

/// The claim is refuted, with a point at which it fails, for each of the planted factors.
#[track_caller]
pub fn rejects(planted: &[Planted], claim: impl Fn(&mut Proof, Exact) -> Result<(), Refusal>) {
    for &(numerator, denominator) in planted {
        println!("{}", refuted(prove(|proof| claim(proof, Exact::ratio(numerator, denominator)))));
    }
}
