//! What a run is made ready to: angles unwrapped, commands beside them, segments between the jumps.

pub(crate) mod track;
