//! What a whole-angle Coriolis vibratory gyroscope is.
//!
//! The pendulum variables that describe its orbit ([`pendulum`]), what unequal readout gains make of them
//! ([`detection`], Equations 5 to 7 of the paper), what unequal forces do ([`actuation`], Equations 8 to 10), the
//! mechanics at three levels of detail ([`resonator`]), and every effect a recording can hold ([`effects`]).
//!
//! Each equation is one function, generic over [`Real`]: the same source runs on `f32` in firmware, on `f64` in the
//! simulator and the identification, and on dual numbers for derivatives.
//!
//! ```
//! use cvg_model::Orbit;
//! use cvg_model::detection::{angle_error, angle_error_bound};
//! use cvg_model::effects::{EffectId, Moment};
//!
//! // Equation 7: what unequal readout gains do to the pattern angle, and how much at most
//! let (g, theta) = (1.0132_f64, 0.5);
//! assert!(angle_error(g, theta).abs() <= angle_error_bound(g));
//!
//! // the same from the library: a vibration, what the readout makes of it, and back
//! let vibration = Orbit { a: 1.0, q: 0.0, theta, delta: 0.0 }.envelope();
//! let (gains, now) = ([g, 0.0, 0.0, 0.0], Moment::default());
//! let readout = EffectId::DetectionGainMismatch.read(&gains, vibration, &now);
//! assert!((readout.pendulum().angle() - theta - angle_error(g, theta)).abs() < 1e-12);
//! let undone = EffectId::DetectionGainMismatch.unread(&gains, readout, &now);
//! assert!((undone.pendulum().angle() - theta).abs() < 1e-12);
//! ```
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
