//! Faults of a reading of every file, line by line, of what no other fault here touches: where no engineer who plants has looked,
//! one in eight was seen by nothing. One file a crate.

use super::{Fault, fault};

mod calibrator;
mod capi;
mod controller;
mod estimator;
mod instrument;
mod model;

pub(super) fn faults() -> Vec<Fault> {
    [calibrator::FAULTS, capi::FAULTS, controller::FAULTS, estimator::FAULTS, instrument::FAULTS, model::FAULTS]
        .concat()
}
