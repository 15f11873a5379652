//! Claims on the trackers, the oscillator and the demodulator that hold bit for bit: harnesses in Kani's syntax.
//!
//! `cargo xtask prove` proves them on the compiled code, `cargo test` samples them, `cargo kani` checks them where Kani
//! is installed. Each `proof_` has a `twin_` with an error planted in the same body, which has to be refuted. An
//! assumption is either a "precondition:" of the function or a "budget:" of the solver. √, sine, cosine and arctangent
//! are `cvg_model::proofs::stand_in` to a prover.

pub mod angle;
pub mod demodulator;
pub mod direction;
pub mod oscillator;
pub mod precession;
pub mod short_way;
#[cfg(test)]
mod tests;

use cvg_model::{Envelope, Float, Pendulum};
use kani::Arbitrary;

/// The components of a direction as [`direction`] promises them and [`precession`] assumes them.
const LONGEST_DIRECTION: i32 = 3;

fn any_envelope<T: Float + Arbitrary>() -> Envelope<T> {
    Envelope::new(kani::any(), kani::any(), kani::any(), kani::any())
}

fn any_pendulum<T: Float + Arbitrary>() -> Pendulum<T> {
    Pendulum { e: kani::any(), q: kani::any(), r: kani::any(), s: kani::any(), l: kani::any() }
}
