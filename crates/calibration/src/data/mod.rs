//! What a run is made ready to: angles unwrapped, commands beside them, segments between the jumps; and whether a
//! recording is what it seems: rows that were not recorded anew or were drawn between others, what is there twice,
//! references that contradict each other, samples that are too far apart, runs that do not belong together.

pub(crate) mod agreement;
pub(crate) mod channel_ranges;
pub(crate) mod clock;
pub(crate) mod copies;
pub(crate) mod held_reference;
pub(crate) mod interpolated;
pub(crate) mod leaping_rows;
pub(crate) mod plausibility;
pub(crate) mod quantised_drives;
pub(crate) mod rail;
mod rate_spikes;
pub(crate) mod references;
pub(crate) mod sampling;
pub(crate) mod slips;
pub(crate) mod table;
pub(crate) mod track;
