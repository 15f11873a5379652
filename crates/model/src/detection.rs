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

/// The largest |θ_error| over all θ for a ratio `g` > 0, rad: asin(|g−1|/(g+1)).
///
/// Attained where cos 2θ = (g−1)/(g+1).
#[inline]
pub fn angle_error_bound<T: Real>(g: T) -> T {
    let m = if g < T::one() { T::one() - g } else { g - T::one() };
    // asin(m / p) = atan2(m, √(p² − m²)) with p² − m² = 4g: no cancellation.
    m.atan2(T::two() * g.sqrt())
}
