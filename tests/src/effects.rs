//! What tests of effects begin with.

use cvg_model::Envelope;
use cvg_model::effects::{MAX_PARAMETERS, Values};

/// A line orbit of amplitude `a` at `theta`, rad.
pub fn line(a: f64, theta: f64) -> Envelope<f64> {
    Envelope::new(a * theta.cos(), 0.0, a * theta.sin(), 0.0)
}

/// Parameter values from the first few; the rest are unused.
///
/// # Panics
/// Where there are more than an effect has.
pub fn values(first: &[f64]) -> Values<f64> {
    let mut v = [0.0; MAX_PARAMETERS];
    v[..first.len()].copy_from_slice(first);
    v
}
