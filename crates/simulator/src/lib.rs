//! The loop closed: model, estimator and controller make recordings.
//!
//! A [`Scenario`] says what a device is, what is wrong with it and which runs are recorded; [`Scenario::simulate`]
//! makes the recordings in memory, [`Simulated::write`] puts them into a folder as a campaign with its truth beside
//! it. Below that lie the resonator's envelope, propagated exactly between control samples ([`plant`]), the control
//! loop around it ([`closed_loop`]), and a two-channel angle sensor without any loop ([`sensor`]).
//!
//! Effects come from the library in `cvg_model::effects` and act in the stage where they say they do: nothing here
//! names one.
//!
//! The same loop at the carrier, with plates, converters and the production electronics, is in [`carrier`].
//!
//! The crate refuses to identify anything: what it writes is for others to find out.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod carrier;
pub mod closed_loop;
pub mod noise;
pub mod plant;
pub mod scenario;
pub mod sensor;
pub mod stages;

pub use campaign::{Column, Simulated, SimulatedRun, WriteError};
pub use closed_loop::{ClosedLoop, Seen};
pub use scenario::{Scenario, ScenarioError, Settings};
