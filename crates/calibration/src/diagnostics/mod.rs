//! What a fit leaves: its size on held-out data, its harmonics and lines, and the figures that show it.

pub mod allan;
pub(crate) mod angle_random_walk;
pub(crate) mod at_rest;
pub(crate) mod covariance;
pub(crate) mod decomposition;
pub(crate) mod drives;
pub(crate) mod evaluate;
pub(crate) mod gain_over_rate;
pub(crate) mod influences;
pub mod plots;
pub(crate) mod residual;
pub(crate) mod scale_factor;
pub(crate) mod temperature;
