//! The equation of motion, carrier and all: Lynch's generic Coriolis vibratory gyroscope.

use super::Resonator;
use crate::Real;

/// Displacements and velocities of the two modes.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Motion<T> {
    /// x
    pub x: T,
    /// y
    pub y: T,
    /// ẋ, per second
    pub x_dot: T,
    /// ẏ, per second
    pub y_dot: T,
}

/// The input rotation at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Rotation<T> {
    /// Ω, rad/s
    pub rate_rad_s: T,
    /// Ω̇, rad/s²
    pub acceleration_rad_s2: T,
}

impl<T: Real> Resonator<T> {
    /// d/dt of the motion under forces (per unit mass) `f_x`, `f_y`:
    ///
    /// $$\ddot x - 2k\Omega\dot y - k\dot\Omega y + \tfrac2\tau\dot x
    ///   + \Delta(\tfrac1\tau)(\dot x\cos2\theta_\tau + \dot y\sin2\theta_\tau) + (\omega^2-k'\Omega^2)x
    ///   - \omega\Delta\omega(x\cos2\theta_\omega + y\sin2\theta_\omega) = f_x$$
    ///
    /// $$\ddot y + 2k\Omega\dot x + k\dot\Omega x + \tfrac2\tau\dot y
    ///   + \Delta(\tfrac1\tau)(\dot x\sin2\theta_\tau - \dot y\cos2\theta_\tau) + (\omega^2-k'\Omega^2)y
    ///   - \omega\Delta\omega(x\sin2\theta_\omega - y\cos2\theta_\omega) = f_y$$
    ///
    /// Source: Lynch 1995. Domain: all reals.
    pub fn acceleration(&self, m: &Motion<T>, input: &Rotation<T>, f_x: T, f_y: T) -> Motion<T> {
        let (k, rate) = (self.angular_gain, input.rate_rad_s);
        let coriolis = T::two() * k * rate;
        let euler = k * input.acceleration_rad_s2;
        let damping = T::two() * self.damping_per_s;
        let (dc, ds) = (self.anisodamping.cos2, self.anisodamping.sin2);
        let spring = self.omega_rad_s * self.omega_rad_s - self.centrifugal_gain * rate * rate;
        let (wc, ws) = (self.omega_rad_s * self.anisoelasticity.cos2, self.omega_rad_s * self.anisoelasticity.sin2);
        Motion {
            x: m.x_dot,
            y: m.y_dot,
            x_dot: f_x + coriolis * m.y_dot + euler * m.y
                - damping * m.x_dot
                - (dc * m.x_dot + ds * m.y_dot)
                - spring * m.x
                + (wc * m.x + ws * m.y),
            y_dot: f_y
                - coriolis * m.x_dot
                - euler * m.x
                - damping * m.y_dot
                - (ds * m.x_dot - dc * m.y_dot)
                - spring * m.y
                + (ws * m.x - wc * m.y),
        }
    }
}
