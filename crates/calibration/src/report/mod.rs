//! What was found, as facts that can be written: the report, the calibration, and recordings with the errors taken out.

pub(crate) mod belonging;
pub(crate) mod benefit;
pub mod calibration;
pub(crate) mod channels;
pub(crate) mod compensate;
pub(crate) mod gate;
pub(crate) mod inference;
pub(crate) mod laws;
pub mod named;
pub(crate) mod polar;
pub(crate) mod proposals;
pub(crate) mod provenance;
pub(crate) mod recorded;
pub mod refused;
pub mod repeatability;
pub(crate) mod runs;
pub(crate) mod stages;
pub mod survey;
pub(crate) mod unexplained;
pub(crate) mod way;
pub(crate) mod worded;

pub use crate::facts::*;

/// The files of a campaign with their checksums, as a report of it names them.
pub fn inputs(campaign: &crate::recording::Campaign) -> Vec<Input> {
    provenance::sums(&provenance::files(campaign))
}
