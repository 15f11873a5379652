//! What a recording tells of a gyroscope.
//!
//! One idea: **undo the electronics; what remains must obey the mechanics.** Every readout effect is a map of the
//! envelope with an inverse. Behind the right inverse, the pattern must precess as the equation of motion says, driven
//! by the input rotation and by the commands that were recorded with it. The fit looks for the instrument that leaves
//! nothing but noise.
//!
//! ```no_run
//! use cvg_calibration::{Options, identify, recording::Campaign};
//!
//! fn report(path: &std::path::Path) -> Result<(), cvg_calibration::Refusal> {
//!     let identified = identify(Campaign::open(path)?, &Options::default())?;
//!     println!("{:?}", identified.report.heldout);
//!     Ok(())
//! }
//! ```
//!
//! A recording can come from anywhere that gives bytes, with columns by any name:
//!
//! ```
//! use cvg_calibration::recording::{Naming, Recording};
//!
//! let mut naming = Naming::default();
//! naming.add("t_s=Time (ms)*0.001").expect("a channel and a column");
//! let text = "Time (ms);rate_dps;theta_deg\n0;10;0,0\n100;10;0,78\n200;10;1,56\n";
//! let recording = Recording::read_from(text.as_bytes(), &naming, "export.csv".as_ref())?;
//! assert_eq!(recording.t_s, [0.0, 0.1, 0.2]);
//! assert!(recording.require_rotation().is_ok());
//! # Ok::<(), cvg_calibration::recording::ReadError>(())
//! ```
//!
//! [`recording`] reads files, [`identify()`] answers, [`calibration`] keeps the answer, [`compensate()`] puts it to use.
//! This crate knows nothing of the simulator, and renders nothing.
#![forbid(unsafe_code)]

mod angle_sensor;
mod carrier;
mod data;
mod diagnostics;
mod error;
mod estimation;
mod facts;
mod free_decay;
mod identification;
mod identified;
mod model;
mod numerics;
mod rate_table;
pub mod report;
mod selection;
mod survey;
mod virtual_precession;

pub use angle_sensor::curve::Curve;
pub use angle_sensor::likeness::hint as looks_like;
pub use carrier::envelopes;
pub use cvg_recording as recording;
pub use diagnostics::allan;
pub use diagnostics::plots;
pub use error::{Cause, Refusal};
pub use estimation::joint_fit::belief;
pub use estimation::{actuation, bias, identifiability};
pub use facts::{ErrorSize, Follows, Harmonic};
pub use identification::{identify, identify_with_plots};
pub use identified::{BiasCurve, Figures, Identification, Options};
pub use model::angle_table::{AngleTable, Form};
pub use model::hypothesis::{ChannelClip, Hypothesis, Member, Origin, Unknown};
pub use model::written::export::export;
pub use model::written::{EffectText, Law, ParameterText};
pub use report::calibration;
pub use report::compensate::{compensate, left_out, outside};
pub use selection::step::Step;
pub use survey::{Answer, Surveyed, answer};

/// The page of the book on campaigns in memory, whose program is run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/src/in-memory.md")]
struct InMemory;
