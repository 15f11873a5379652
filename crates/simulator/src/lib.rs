//! The loop closed: model, estimator and controller make recordings.
//!
//! A [`Scenario`] says what a device is, what is wrong with it and which runs are recorded; [`Scenario::simulate`]
//! makes the recordings in memory, [`Simulated::write`] puts them into a folder as a campaign with its truth beside
//! it. Below that lie the resonator's envelope, propagated exactly between control samples ([`plant`]), the control
//! loop around it ([`closed_loop`], with a calibrator in it where one is [joined](learning)), and a two-channel angle sensor without any loop ([`sensor`]).
//!
//! Effects come from the library in `cvg_model::effects` and act in the stage where they say they do: nothing here
//! names one.
//!
//! The same loop at the carrier, with plates, converters and the production electronics, is in [`carrier`].
//!
//! ```
//! use cvg_simulator::Scenario;
//!
//! let scenario = Scenario::parse(r#"
//!     device = "example"
//!     angular_gain = 0.78
//!     effects = [{ id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 }]
//!     [[run]]
//!     kind = "rotation"
//!     file = "rot+500.csv"
//!     rate_dps = 500.0
//!     duration_s = 1.0
//! "#)?;
//! let simulated = scenario.simulate();
//! assert_eq!(simulated.runs.len(), 1);
//! # Ok::<(), cvg_simulator::ScenarioError>(())
//! ```
//!
//! The crate refuses to identify anything: what it writes is for others to find out.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod carrier;
pub mod closed_loop;
pub mod flicker;
pub mod learning;
pub mod noise;
pub mod plant;
pub mod scenario;
pub mod sensor;
pub mod stages;

pub use campaign::{Column, Simulated, SimulatedRun, WriteError};
pub use closed_loop::{ClosedLoop, Seen};
pub use learning::Learner;
pub use scenario::{Scenario, ScenarioError, Settings};
