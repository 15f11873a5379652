//! Claims on what joins the parts that hold bit for bit, for every input: harnesses in Kani's syntax.
//!
//! `cargo xtask prove` proves them on the compiled code, `cargo test` samples them, `cargo kani` checks them where Kani
//! is installed. Each `proof_` has a `twin_` with an error planted in the same body, which has to be refuted. An
//! assumption is either a "precondition:" of the function or a "budget:" of the solver.

pub mod continuity;
pub mod correction;
pub mod drives;
pub mod short_way;
