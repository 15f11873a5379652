//! Faults of upkeep, as another hand makes them in code that it did not write: what is left over from the window before, an edge,
//! a field that is dropped on the way through a restore or through C, the order of two updates, one precision only. One file a
//! crate, and two for the calibrator.

use super::{Fault, fault};

mod calibrator_commits;
mod calibrator_learning;
mod capi;
mod controller;
mod estimator;
mod instrument;
mod model;

pub(super) fn faults() -> Vec<Fault> {
    [
        calibrator_commits::FAULTS,
        calibrator_learning::FAULTS,
        capi::FAULTS,
        controller::FAULTS,
        estimator::FAULTS,
        instrument::FAULTS,
        model::FAULTS,
    ]
    .concat()
}
