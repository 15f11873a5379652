//! What the electronics of a whole-angle Coriolis vibratory gyroscope command.
//!
//! The energy and the quadrature loop ([`pi`], Equation 3 of the paper), the loop that holds the pattern at an angle
//! ([`rate`], for ring-downs and force to rebalance), and the projection of their commands on the electrodes with the
//! actuation compensated ([`allocation`], Equation 9 and its inverse).
//!
//! Every running part is an immutable configuration, checked when built, and a plain state; one call of `step` joins
//! them. A step is total: any bit pattern in, a finite and bounded command and a status out. No allocation, no panic.
//!
//! ```
//! use cvg_controller::Pi;
//!
//! // the energy loop: gain, integration time, sample period, limit
//! let energy = Pi::<f32>::new(1.0, 0.2, 5e-4, 10.0)?;
//! let mut state = energy.primed(0.0);
//! // more energy than set: a positive output takes it out
//! assert!(energy.energy(&mut state, 1.1, 1.0).volts > 0.0);
//! // whatever comes in, what goes out is finite and within the limit
//! assert!(energy.energy(&mut state, f32::NAN, 1.0).volts.abs() <= 10.0);
//! # Ok::<(), cvg_controller::ConfigError>(())
//! ```
//!
//! The crate refuses to measure: it takes pendulum variables and a direction as numbers, whoever found them.
#![no_std]
#![forbid(unsafe_code)]

pub mod allocation;
pub mod pi;
#[cfg(any(kani, test, cvg_prove))]
pub mod proofs;
pub mod rate;
pub mod supervisor;

pub use allocation::{ActuationCompensation, Allocation, OrbitCommands};
pub use pi::{Pi, PiState};
pub use rate::{Heading, RateLoop};
pub use supervisor::{Fault, LoopCommand, Mode, RequestedMode, Supervisor, SupervisorSettings, SupervisorState};

use cvg_model::Float;

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

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Status {
    /// as the law asks
    #[default]
    Within,
    /// the law asked for more than the limit
    Limited,
    /// the input was not a number; the integral part alone is commanded
    Invalid,
}

/// A command in volts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T> {
    /// V; finite and within the limit, always
    pub volts: T,
    /// what became of it
    pub status: Status,
}

fn positive<T: Float>(value: T, parameter: &'static str) -> Result<T, ConfigError> {
    if value > T::zero() && value.is_finite() {
        Ok(value)
    } else {
        Err(ConfigError { parameter, expected: "finite and positive" })
    }
}
