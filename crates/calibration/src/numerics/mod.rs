//! Numerical methods that know nothing of instruments.

pub(crate) mod angles;
pub(crate) mod interpolation;
pub(crate) mod linear;
pub(crate) mod rounding;
pub(crate) mod simplex;
pub(crate) mod statistics;
