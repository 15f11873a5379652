//! Free decays: a resonator that rings without any loop. Its envelope obeys the equation of motion alone, so that damping,
//! stiffness, their axes, precession and nonlinearity stand in (E, R, S, Q) as they go down; any turn of the pattern will do.
mod agreement;
mod effects;
mod errors;
mod fit;
mod identify;
mod model;
mod noise;
mod phase;
mod report;
mod runs;
mod selection;
mod start;
mod stokes;

pub(crate) use identify::{apart, beside, identify, serves};
