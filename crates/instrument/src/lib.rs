//! The electronics of a whole-angle gyroscope as one call per sample: two converter values in, two out.
//!
//! [`Instrument`] joins the estimator and the controller, which do not know each other: oscillator, demodulator,
//! phase-locked loop, pendulum variables and direction; energy, quadrature and rate loop; supervisor and allocation.
//! The same code runs in the simulator and in firmware, in `f32` and in `f64`.
//!
//! ```
//! use cvg_instrument::{Instrument, Settings};
//!
//! let instrument = Instrument::<f32>::new(&Settings::default())?;
//! let mut state = instrument.start();
//! // once a sample, with what the converters read, in volts
//! let (adc_x, adc_y) = (0.0, 0.0);
//! let (dac_x, dac_y, status) = instrument.step(&mut state, adc_x, adc_y);
//! assert!(dac_x.abs() <= 10.0 && dac_y.abs() <= 10.0 && status.fault.is_none());
//! # Ok::<(), cvg_instrument::ConfigError>(())
//! ```
//!
//! Every N samples, a window, the control step runs; in between a sample is a rotation of the oscillator, the mixers
//! and the carrier of the drives. A step is total: any bit pattern in, finite and bounded values and a status out. No
//! allocation, no panic.
//!
//! The crate refuses to know a converter, a timer or a clock: volts come in and go out, a sample period apart.
#![no_std]
#![forbid(unsafe_code)]

pub mod continuity;
mod correction;
mod delay;
mod drives;
#[cfg(test)]
#[path = "margins/tests.rs"]
mod margins;
#[cfg(any(kani, test, cvg_prove))]
pub mod proofs;
pub mod settings;
pub mod state;
mod step;

pub use continuity::Continuity;
pub use cvg_controller::{Fault, Heading, Mode, RequestedMode};
pub use settings::{ConfigError, Settings, Tuning};
pub use state::{Seen, State, Status};

use cvg_controller::{Allocation, Pi, RateLoop, Supervisor};
use cvg_estimator::{Compensation, Demodulator, Oscillator, PhaseLock, Precession};

/// The most readout effects that are compensated.
pub const MOST_COMPENSATED: usize = 4;

/// The instrument's configuration: immutable, checked when built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instrument<T> {
    oscillator: Oscillator<T>,
    demodulator: Demodulator<T>,
    phase: PhaseLock<T>,
    precession: Precession<T>,
    readout: Option<Compensation<T, MOST_COMPENSATED>>,
    energy: Pi<T>,
    quadrature: Pi<T>,
    rate: RateLoop<T>,
    allocation: Allocation<T>,
    supervisor: Supervisor<T>,
    /// windows unseen in which a pattern at its fastest turns by 45 degrees
    most_unseen: u32,
    energy_set_v2: T,
    /// volts on each channel in a sweep
    sweep_v: T,
    dac_limit_v: T,
    /// of the whole loop
    delay: delay::Delay<T>,
    per_window_s: T,
    hold: Heading<T>,
    /// the mode in which nearly every window takes the shortest way: where drives have a phase none does, as none goes on in a fault
    shortest: Mode,
}
