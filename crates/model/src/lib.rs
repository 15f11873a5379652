//! What a whole-angle Coriolis vibratory gyroscope is.
//!
//! The pendulum variables that describe its orbit ([`pendulum`]), what unequal readout gains make of them
//! ([`detection`], Equations 5 to 7 of the paper), what unequal forces do ([`actuation`], Equations 8 to 10), the
//! mechanics at three levels of detail ([`resonator`]), and every effect a recording can hold ([`effects`]).
//!
//! Each equation is one function, generic over [`Real`]: the same source runs on `f32` in firmware, on `f64` in the
//! simulator and the identification, and on dual numbers for derivatives.
//!
//! The crate refuses to know about time steps, filters, loops, files or noise: those live in the crates that depend
//! on it.
//!
//! "The paper" is D. Vatanparvar and A. M. Shkel, *Identification of Gain Mismatches in Control Electronics of Rate
//! Integrating CVGs*.
#![no_std]
#![forbid(unsafe_code)]

pub mod actuation;
pub mod detection;
pub mod effects;
pub mod pendulum;
#[cfg(any(kani, test, cvg_prove))]
pub mod proofs;
pub mod resonator;
pub mod scalar;

pub use actuation::{ActuationGains, AxisForces, ControlOutputs, OrbitForces};
pub use detection::DetectionGains;
pub use pendulum::{Envelope, Orbit, Pendulum};
pub use scalar::{Float, Real};
