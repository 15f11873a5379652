//! The direction of the orbit's major axis as a cosine and a sine, without the angle: what the projection of forces
//! (Equation 9) and of measurements needs of Equation 4, for two square roots and one division.
//!
//! It refuses to unwrap: it is a direction of the instant, told from its opposite by the in-phase vibration.

use cvg_model::{Envelope, Float, Pendulum, Real};

use crate::Status;

/// Cosine and sine of θ_d over the full turn: of the two directions of the major axis, the one along which the
/// in-phase vibration is positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<T> {
    /// cos θ_d
    pub cos: T,
    /// sin θ_d
    pub sin: T,
    /// whether the envelope determined it
    pub status: Status,
}

//= specs/electronics.md#direction-is-bounded
//# The components of the direction of the major axis MUST be finite and below two in magnitude for every input.
//= specs/electronics.md#direction-is-a-unit-vector
//# The direction of the major axis MUST have the length one up to rounding.
//= specs/electronics.md#direction-of-equation-4
//# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
/// The direction of **Equation 4** by half-angle algebra instead of ½ atan2(S, R).
///
/// With ρ = √(R² + S²), 2ρ cos²θ = ρ + R, 2ρ sin²θ = ρ − R and 2ρ sin θ cos θ = S. So the direction is
///
/// $$(\cos\theta, \sin\theta) = \pm\frac{(\rho+R,\ S)}{\sqrt{2\rho(\rho+R)}}\quad (R\ge0),\qquad
///   \pm\frac{(S,\ \rho-R)}{\sqrt{2\rho(\rho-R)}}\quad (R<0),$$
///
/// each where it does not cancel, with the sign that makes the in-phase vibration along it positive. It equals
/// Equation 4 up to that sign, and follows the pattern through 90° without a jump, which the principal value of
/// Equation 4 does not: forces projected on it keep their sense.
///
/// `p` are the pendulum variables of `e`. Domain: R² + S² > 0 and an in-phase vibration along the major axis;
/// elsewhere the direction (1, 0) and [`Status::Undetermined`] (for finite input) or [`Status::Invalid`].
#[inline]
pub fn major_axis<T: Float>(e: &Envelope<T>, p: &Pendulum<T>) -> Direction<T> {
    let line = p.r.norm(p.s);
    let (cos, sin) = if p.r < T::zero() { (p.s, line - p.r) } else { (line + p.r, p.s) };
    let in_phase = cos * e.x_c + sin * e.y_c;
    // the length of (cos, sin), squared
    let length_2 = T::two() * line * (line + p.r.magnitude());
    // so small that squares are rounded by more than their share; never where nothing is rounded
    let lost = T::epsilon() > T::zero() && length_2 * T::epsilon() <= T::zero();
    // false for NaN and for an overflow
    if length_2 > T::zero() && !lost && length_2.is_finite() && in_phase != T::zero() {
        let scale = T::one() / length_2.sqrt();
        let scale = if in_phase < T::zero() { -scale } else { scale };
        Direction { cos: cos * scale, sin: sin * scale, status: Status::Valid }
    } else {
        let status = if length_2.is_finite() { Status::Undetermined } else { Status::Invalid };
        Direction { cos: T::one(), sin: T::zero(), status }
    }
}

//= specs/electronics.md#direction-is-bounded
//# The components of the direction of the major axis MUST be finite and below two in magnitude for every input.
//= specs/electronics.md#direction-is-a-unit-vector
//# The direction of the major axis MUST have the length one up to rounding.
//= specs/electronics.md#direction-of-equation-4
//# The direction of the major axis MUST be the angle of Equation 4 up to half a turn.
/// [`major_axis`] from cos 2θ and sin 2θ, which a tracker of the pattern has already, for one square root:
///
/// $$(\cos\theta, \sin\theta) = \pm\frac{(1+\cos 2\theta,\ \sin 2\theta)}{\sqrt{2(1+\cos 2\theta)}}\quad (\cos 2\theta\ge0),\qquad
///   \pm\frac{(\sin 2\theta,\ 1-\cos 2\theta)}{\sqrt{2(1-\cos 2\theta)}}\quad (\cos 2\theta<0).$$
///
/// Domain: a unit vector (`cos_2`, `sin_2`) and an in-phase vibration along the major axis; elsewhere as [`major_axis`],
/// also for the origin.
#[inline(always)]
pub fn major_axis_of<T: Float>(e: &Envelope<T>, cos_2: T, sin_2: T) -> Direction<T> {
    let wide = T::one() + cos_2.magnitude();
    let (cos, sin) = if cos_2 < T::zero() { (sin_2, wide) } else { (wide, sin_2) };
    let in_phase = cos * e.x_c + sin * e.y_c;
    let length_2 = wide * wide + sin_2 * sin_2;
    // at least 1; false for NaN
    if length_2 <= T::ratio(8, 1) && in_phase * in_phase > T::zero() {
        let scale = if in_phase < T::zero() { -T::one() } else { T::one() } / length_2.sqrt();
        Direction { cos: cos * scale, sin: sin * scale, status: Status::Valid }
    } else {
        let status = if length_2.is_finite() { Status::Undetermined } else { Status::Invalid };
        Direction { cos: T::one(), sin: T::zero(), status }
    }
}

impl<T: Real> Direction<T> {
    /// θ_d over the full turn, in (−π, π], rad.
    #[inline]
    pub fn angle(&self) -> T {
        self.sin.atan2(self.cos)
    }
}
