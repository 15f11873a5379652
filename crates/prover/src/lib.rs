//! Scalars that prove: the shipping functions run on them, so that what is proved is what runs.
//!
//! [`Exact`] holds quotients of polynomials over the rationals. On it [`prove`] decides identities for all reals, and
//! inequalities by certificates: sums of squares that add up. It speaks of real numbers and knows no rounding.
//!
//! [`Rounded`] holds what a real value and the rounding error of its floating evaluation can be at most, over a box of
//! inputs. On it [`bound_rounding`] shows, by splitting the box, that the machine's result stays within a tolerance of
//! the real one for all inputs of the box.
//!
//! Nothing that ships depends on this crate. It refuses what it cannot do: by an error where a claim does not hold, by
//! a panic where it was asked for arithmetic that it does not have. It never answers approximately.
#![forbid(unsafe_code)]

mod derivative;
mod exact;
mod fraction;
mod interval;
mod known;
mod points;
mod polynomial;
mod proof;
mod rounded;
mod search;
mod world;

pub use exact::Exact;
pub use interval::Interval;
pub use proof::{Proof, Proved, Refusal, SAMPLES, Square, prove, refuted};
pub use rounded::{Format, Rounded};
pub use search::{Bounded, Failure, Formula, MOST_POINTS, bound_rounding};
