//! Which effects are there: what a residual proposes, what is adopted of it, and whether every run shows it.

pub(crate) mod candidates;
pub(crate) mod consistency;
pub(crate) mod discovery;
pub(crate) mod last_step;
pub(crate) mod not_found;
pub(crate) mod one_law;
mod one_step;
mod pairs;
mod powers;
pub(crate) mod refuted;
pub(crate) mod step;
mod together;
mod trial;
