//! Faults of what learns in operation: windows, regressors, covariance, commits, records.

use super::Fault;

pub(super) const FAULTS: &[Fault] = &[];
