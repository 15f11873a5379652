//! The orbit's own equations: energy, quadrature and pattern angle of the free resonator (Lynch's averaged form).

use super::Resonator;
use crate::Real;

/// Energy, quadrature and pattern angle.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Averages<T> {
    /// E = a² + q²
    pub e: T,
    /// Q = 2aq
    pub q: T,
    /// θ, rad
    pub theta: T,
}

impl<T: Real> Resonator<T> {
    /// d/dt of (E, Q, θ) without forces:
    ///
    /// $$\dot E = -\tfrac2\tau E - \Delta(\tfrac1\tau)\sqrt{E^2-Q^2}\cos2(\theta-\theta_\tau)$$
    /// $$\dot Q = -\tfrac2\tau Q - \Delta\omega\sqrt{E^2-Q^2}\sin2(\theta-\theta_\omega)$$
    /// $$\dot\theta = -k\Omega + \tfrac12\Delta(\tfrac1\tau)\frac{E}{\sqrt{E^2-Q^2}}\sin2(\theta-\theta_\tau)
    ///   + \tfrac12\Delta\omega\frac{Q}{\sqrt{E^2-Q^2}}\cos2(\theta-\theta_\omega)$$
    ///
    /// Domain: |Q| < E. Source: Lynch 1995.
    pub fn averaged_rate(&self, s: &Averages<T>, rate_rad_s: T) -> Averages<T> {
        let line = (s.e * s.e - s.q * s.q).sqrt();
        let (sin, cos) = (T::two() * s.theta).sin_cos();
        let (d, w) = (&self.anisodamping, &self.anisoelasticity);
        // Δ cos 2(θ − θ_Δ) and Δ sin 2(θ − θ_Δ), from the resolved differences
        let along = |c: T, s: T| c * cos + s * sin;
        let across = |c: T, s: T| c * sin - s * cos;
        let damped = -(T::two() * self.damping_per_s);
        Averages {
            e: damped * s.e - along(d.cos2, d.sin2) * line,
            q: damped * s.q - across(w.cos2, w.sin2) * line,
            theta: -(self.angular_gain * rate_rad_s)
                + T::half() * across(d.cos2, d.sin2) * s.e / line
                + T::half() * along(w.cos2, w.sin2) * s.q / line,
        }
    }
}
