//! Claims on the calibrator that hold bit for bit: harnesses in Kani's syntax.
//!
//! `cargo xtask prove` proves them on the compiled code, `cargo test` samples them, `cargo kani` checks them where Kani
//! is installed. Each `proof_` has a `twin_` with an error planted in the same body, which has to be refuted. An
//! assumption is either a "precondition:" of the function or a "budget:" of the solver.

pub mod correction;
pub mod held;
pub mod ud;
