//! The values of what is believed: a hypothesis propagated along the runs, and the fit that leaves the least.

pub mod actuation;
pub(crate) mod amplitude_equation;
pub mod bias;
pub(crate) mod coloured_noise;
pub(crate) mod contrasts;
pub(crate) mod cross_validation;
mod damping_balance;
pub(crate) mod divided;
pub(crate) mod fit;
pub(crate) mod generalised_least_squares;
pub mod identifiability;
pub(crate) mod initial_guess;
pub(crate) mod joint_fit;
pub(crate) mod normal;
pub(crate) mod propagation;
mod quadrature_balance;
pub(crate) mod quantised_drives;
pub(crate) mod residuals;
pub(crate) mod restricted_likelihood;
pub(crate) mod ring_down_agreement;
pub(crate) mod screening;
pub(crate) mod subsets;
pub(crate) mod sums;
pub(crate) mod swing;
pub(crate) mod unknown_drives;
pub(crate) mod unseen_quadrature;
