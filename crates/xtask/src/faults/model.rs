//! Faults of the equations, the pendulum variables, the effects and their inverses.

use super::Fault;

pub(super) const FAULTS: &[Fault] = &[];
