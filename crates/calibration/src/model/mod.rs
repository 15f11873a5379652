//! An instrument as believed, and what it says of one sample, with slopes against what is fitted.

pub(crate) mod angle_table;
pub(crate) mod hypothesis;
pub(crate) mod jet;
pub(crate) mod prediction;
pub(crate) mod unknowns;
pub(crate) mod written;
