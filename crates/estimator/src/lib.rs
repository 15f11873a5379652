//! What the electronics of a whole-angle Coriolis vibratory gyroscope measure.
//!
//! The oscillator that makes the reference ([`nco`]) and the demodulator that finds the envelope in carrier samples
//! ([`demodulator`]), how far the reference is off when nothing is locked yet ([`beat`]), and how the pattern moves from
//! window to window ([`precession`]). The direction of the vibration's major axis ([`direction`]), the pattern angle, unwrapped ([`angle`], Equation 4
//! of the paper), the phase-locked loop that keeps the reference on the vibration's phase ([`oscillator`]), and the
//! inverse of the readout effects that an identification found ([`compensation`]).
//!
//! Every running part is an immutable configuration, checked when built, and a plain state; one call of `step` joins
//! them. A step is total: any bit pattern in, a finite answer and a status out. No allocation, no panic.
//!
//! ```
//! use cvg_estimator::Compensation;
//! use cvg_model::effects::{EffectId, Moment};
//! use cvg_model::Envelope;
//!
//! // what an identification found, in the order of the parameters in calibration.toml
//! let readout = Compensation::<f32, 4>::new(&[(EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0])])?;
//! // every control sample
//! let vibration = readout.apply(Envelope::new(0.6, 0.0, 0.81056, 0.0), &Moment::default());
//! assert!((vibration.y_c - 0.8).abs() < 1e-6);
//! # Ok::<(), cvg_estimator::ConfigError>(())
//! ```
//!
//! The crate refuses to command anything: what is done with a measurement is the controller's business, and the two
//! do not know each other.
#![no_std]
#![forbid(unsafe_code)]

pub mod angle;
pub mod beat;
pub mod compensation;
pub mod demodulator;
pub mod direction;
pub mod nco;
pub mod oscillator;
pub mod precession;
#[cfg(any(kani, test, cvg_prove))]
pub mod proofs;

pub use angle::{AngleState, PatternAngle, Period, Reading};
pub use beat::Beat;
pub use compensation::Compensation;
pub use demodulator::{Demodulator, Measurement, Window};
pub use direction::Direction;
pub use nco::{Oscillator, Phasor};
pub use oscillator::{LockState, PhaseLock};
pub use precession::{Movement, Precession, PrecessionState};

/// Why a configuration was refused when it was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConfigError {
    /// which parameter
    pub parameter: &'static str,
    /// what it has to be
    pub expected: &'static str,
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.parameter)?;
        f.write_str(" has to be ")?;
        f.write_str(self.expected)
    }
}

impl core::error::Error for ConfigError {}

/// How far a measurement can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Status {
    /// measured
    Valid,
    /// the input was finite but does not determine the quantity (at rest, or a circular orbit); the last value holds
    #[default]
    Undetermined,
    /// the input was not a number; the last value holds
    Invalid,
}
