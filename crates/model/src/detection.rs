//! What unequal readout gains do to the pendulum variables and the angle (Equations 5, 6 and 7).

use crate::{Envelope, Real};

/// Displacement-to-voltage gains of the two readout channels, V per unit of displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DetectionGains<T> {
    /// G_Dx
    pub x: T,
    /// G_Dy
    pub y: T,
}

impl<T: Real> DetectionGains<T> {
    /// The readout of an envelope: (G_Dx x, G_Dy y), the definition behind Equations 5 to 7.
    #[inline]
    pub fn measure(&self, e: &Envelope<T>) -> Envelope<T> {
        Envelope::new(self.x * e.x_c, self.x * e.x_s, self.y * e.y_c, self.y * e.y_s)
    }

    /// g = G_Dy / G_Dx. Domain: G_Dx ≠ 0.
    #[inline]
    pub fn ratio(&self) -> T {
        self.y / self.x
    }

    //= specs/equation-05.md#product-of-the-gains
    //# The measured quadrature MUST be the quadrature times both detection gains.
    //= specs/equation-05.md#zero-is-kept
    //# The measured quadrature of an orbit without quadrature MUST be zero.
    //= specs/equation-05.md#sign-is-kept
    //# Detection gains of one sign MUST keep the sign of the quadrature.
    //= specs/equation-05.md#reversed-channel
    //# Reversing one channel MUST reverse the sign of the measured quadrature.
    /// **Equation 5**, the quadrature that the electronics see:
    ///
    /// $$Q_d = G_{Dx} G_{Dy} Q$$
    ///
    /// Exact for every envelope; its zero and, for gains of one sign, its sign are those of Q, so a loop that nulls
    /// Q_d nulls Q. Source: the paper, Equation 5.
    #[inline]
    pub fn measured_quadrature(&self, q: T) -> T {
        self.x * self.y * q
    }

    //= specs/equation-06.md#energy-of-the-measured-orbit
    //# The measured energy MUST be the energy of the measured envelope.
    //= specs/equation-06.md#extremes
    //# The measured energy MUST lie between the energy times the smaller and the energy times the larger squared gain.
    //= specs/equation-06.md#where-the-extremes-are
    //# The measured energy MUST be the energy times the squared gain of X at 0° and of Y at 90°.
    //= specs/equation-06.md#equal-gains
    //# Equal gains MUST make the measured energy independent of the angle.
    //= specs/equation-06.md#even-in-the-angle
    //# The measured energy MUST be the same at opposite angles.
    //= specs/equation-06.md#sign-of-a-channel
    //# Reversing one channel MUST leave the measured energy as it was.
    //= specs/equation-06.md#mean-over-a-turn
    //# The mean of the measured energy over a turn MUST be the energy times the mean of the squared gains.
    //= specs/equation-06.md#neglected-quadrature
    //# The part of the measured energy that the equation neglects MUST be of second order in the semi-minor axis.
    /// **Equation 6**, the energy that the electronics see on a line orbit (q = 0) at pattern angle `theta` (rad):
    ///
    /// $$E_d = G_{Dx}^2 E\left[1 + \frac{1-\cos 2\theta}{2}\left(\frac{G_{Dy}^2}{G_{Dx}^2}-1\right)\right]$$
    ///
    /// Between G_Dx²E (at 0°) and G_Dy²E (at 90°). Domain: G_Dx ≠ 0. Source: the paper, Equation 6.
    #[inline]
    pub fn measured_energy(&self, e: T, theta: T) -> T {
        let (_, cos_2theta) = (T::two() * theta).sin_cos();
        let g = self.ratio();
        self.x * self.x * e * (T::one() + (T::one() - cos_2theta) * T::half() * (g * g - T::one()))
    }
}

//= specs/equation-07.md#angle-of-the-measured-orbit
//# The measured angle MUST be the angle of the measured envelope up to a multiple of 180°.
//= specs/equation-07.md#group
//# Two mismatches one after the other MUST give the angle of the single mismatch with the product of their ratios.
//= specs/equation-07.md#inverse
//# The inverse ratio MUST undo the mismatch up to a multiple of 360°.
//= specs/equation-07.md#quadrant
//# The measured angle MUST lie in the quadrant of the true angle.
//= specs/equation-07.md#total
//# The measured angle, the error and the bound MUST lie within 180° of zero or be NaN.
/// **Equation 7**, the pattern angle that the electronics see, rad in (−π, π]:
///
/// $$\theta_d = \operatorname{atan2}\left(\frac{G_{Dy}}{G_{Dx}}\sin\theta,\ \cos\theta\right)$$
///
/// `g` = G_Dy/G_Dx > 0; `theta` in rad. Zero quadrature is assumed, as in the paper; with quadrature the exact form
/// is Equation 4 of the measured envelope. Source: the paper, Equation 7.
#[inline]
pub fn measured_angle<T: Real>(g: T, theta: T) -> T {
    let (sin, cos) = theta.sin_cos();
    (g * sin).atan2(cos)
}

//= specs/equation-07.md#closed-form-of-the-error
//# The error MUST be the measured angle less the true angle up to a multiple of 360°.
//= specs/equation-07.md#zeros
//# The error MUST be zero at every multiple of 90°.
//= specs/equation-07.md#no-other-zeros
//# The error MUST have the sign of g − 1 between 0° and 90° and the opposite sign between 90° and 180°.
//= specs/equation-07.md#odd
//# The error MUST change its sign with the angle.
//= specs/equation-07.md#period
//# The error MUST repeat after 180°.
//= specs/equation-07.md#exchange-of-the-axes
//# The error for the inverse ratio at 90° less the angle MUST be the error with its sign reversed.
//= specs/equation-07.md#no-mismatch
//# Equal gains MUST give an error of exactly zero.
//= specs/equation-07.md#small-mismatch
//# The error MUST be half the mismatch times the sine of twice the angle up to the square of the mismatch.
//= specs/equation-07.md#compensation
//# A ratio that a compensation leaves between one and that of the readout MUST NOT enlarge the error at any angle, and one between its inverse and itself MUST NOT enlarge the bound.
/// θ_error = θ_d − θ of Equation 7 in closed form, rad:
///
/// $$\theta_{error} = \operatorname{atan2}\left((g-1)\sin 2\theta,\ (g+1)-(g-1)\cos 2\theta\right)$$
///
/// No branch cut for g > 0: the second argument is at least 2 min(1, g). Odd in θ, period 180°, zero at multiples of
/// 90°, bounded by [`angle_error_bound`].
#[inline]
pub fn angle_error<T: Real>(g: T, theta: T) -> T {
    let (sin_2theta, cos_2theta) = (T::two() * theta).sin_cos();
    let (m, p) = (g - T::one(), g + T::one());
    (m * sin_2theta).atan2(p - m * cos_2theta)
}

//= specs/equation-07.md#bound
//# The magnitude of the error MUST NOT exceed the arcsine of |g − 1| over g + 1.
//= specs/equation-07.md#where-the-bound-is-attained
//# The magnitude of the error MUST equal its bound where the cosine of twice the angle is g − 1 over g + 1.
/// The largest |θ_error| over all θ for a ratio `g` > 0, rad: asin(|g−1|/(g+1)).
///
/// Attained where cos 2θ = (g−1)/(g+1).
#[inline]
pub fn angle_error_bound<T: Real>(g: T) -> T {
    let m = if g < T::one() { T::one() - g } else { g - T::one() };
    // asin(m / p) = atan2(m, √(p² − m²)) with p² − m² = 4g: no cancellation.
    m.atan2(T::two() * g.sqrt())
}
