//! The machine numbers that every equation is tested in.

use cvg_model::{Envelope, Float};

use crate::Tolerance;

/// A machine number that tests can draw, convert and hold to a tolerance.
pub trait Scalar: Float + 'static {
    /// This scalar's column of the table of tolerances.
    fn tolerance(of: &Tolerance) -> f64;

    /// The number with these bits; the upper half is unused where the scalar is narrower.
    fn from_pattern(bits: u64) -> Self;

    /// The bits, with every NaN made one.
    fn pattern(self) -> u64;

    /// Not a number.
    fn is_nan(self) -> bool;
}

impl Scalar for f64 {
    fn tolerance(of: &Tolerance) -> f64 {
        of.f64
    }
    fn from_pattern(bits: u64) -> Self {
        f64::from_bits(bits)
    }
    fn pattern(self) -> u64 {
        if self.is_nan() { f64::NAN.to_bits() } else { self.to_bits() }
    }
    fn is_nan(self) -> bool {
        f64::is_nan(self)
    }
}

impl Scalar for f32 {
    fn tolerance(of: &Tolerance) -> f64 {
        of.f32
    }
    #[allow(clippy::cast_possible_truncation, reason = "the lower half is the pattern")]
    fn from_pattern(bits: u64) -> Self {
        f32::from_bits(bits as u32)
    }
    fn pattern(self) -> u64 {
        u64::from(if self.is_nan() { f32::NAN.to_bits() } else { self.to_bits() })
    }
    fn is_nan(self) -> bool {
        f32::is_nan(self)
    }
}

/// `value` rounded to the scalar, and what it then is as `f64`: reference values start from the second.
pub fn rounded<T: Scalar>(value: f64) -> (T, f64) {
    let t = T::from_f64(value);
    (t, t.to_f64())
}

/// The envelope rounded to the scalar, and what it then is as `f64`.
pub fn rounded_envelope<T: Scalar>(e: &Envelope<f64>) -> (Envelope<T>, Envelope<f64>) {
    let t = Envelope::new(T::from_f64(e.x_c), T::from_f64(e.x_s), T::from_f64(e.y_c), T::from_f64(e.y_s));
    (t, widened(&t))
}

/// The envelope as `f64`, exactly.
pub fn widened<T: Scalar>(e: &Envelope<T>) -> Envelope<f64> {
    Envelope::new(e.x_c.to_f64(), e.x_s.to_f64(), e.y_c.to_f64(), e.y_s.to_f64())
}
