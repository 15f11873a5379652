//! Claims on the loops and the allocation that hold bit for bit, for every input: harnesses in Kani's syntax.
//!
//! `cargo xtask prove` proves them on the compiled code, `cargo test` samples them, `cargo kani` checks them where Kani
//! is installed. Each `proof_` has a `twin_` with an error planted in the same body, which has to be refuted. An
//! assumption is either a "precondition:" of the function or a "budget:" of the solver.

pub mod allocation;
pub mod endings;
pub mod pi;
pub mod rate;
pub mod short_way;
pub mod supervisor;
#[cfg(test)]
mod tests;
pub mod way_back;
