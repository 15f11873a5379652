//! Instruments whose loops are closed, on a rate table: from the recordings to the report.

mod errors;
mod explained;
mod foreign;
mod identify;
mod report;

pub(crate) use identify::identify;
