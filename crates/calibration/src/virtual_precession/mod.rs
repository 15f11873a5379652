//! Instruments without a table: virtual precession at rest, and rotation that nobody recorded. The same walk with rooms of
//! its own, through the filter that flies (`cvg-calibrator`), so that a bench and an instrument in operation tell the same.

mod identify;
mod lost_rows;
mod passes;
mod report;
mod runs;

pub(crate) use identify::{identify, serves};
