//! The envelope: the equation of motion averaged over the carrier to first order. Linear in (X, Y).
//!
//! Each term is a function of its own because the identification needs them one by one: what a unit of each does to
//! the orbit is a regressor of the recording.

use super::{Anisotropy, Resonator};
use crate::effects::{anisodamping, anisoelasticity};
use crate::{Envelope, Real};

/// Coriolis coupling: Ẋ ∋ kΩY, Ẏ ∋ −kΩX; precession at θ̇ = −kΩ.
#[inline]
pub fn coriolis<T: Real>(k_omega: T, e: &Envelope<T>) -> Envelope<T> {
    Envelope::new(k_omega * e.y_c, k_omega * e.y_s, -k_omega * e.x_c, -k_omega * e.x_s)
}

/// The same precession from the rate θ̇ itself, rad/s: Ẋ ∋ −θ̇Y, Ẏ ∋ θ̇X.
#[inline]
pub fn precession<T: Real>(theta_dot: T, e: &Envelope<T>) -> Envelope<T> {
    coriolis(-theta_dot, e)
}

/// Mean damping: Ẋ ∋ −X/τ.
#[inline]
pub fn damping<T: Real>(per_s: T, e: &Envelope<T>) -> Envelope<T> {
    *e * (-per_s)
}

/// The mode running ahead of the reference by `omega − omega_r` (rad/s): Ẋ ∋ i(ω − ω_r)X.
#[inline]
pub fn detuning<T: Real>(ahead_rad_s: T, e: &Envelope<T>) -> Envelope<T> {
    e.quarter_ahead() * ahead_rad_s
}

impl<T: Real> Resonator<T> {
    /// The free envelope's rate of change per second at input rate `rate_rad_s` and reference frequency ω_r =
    /// ω − `ahead_rad_s`:
    ///
    /// $$\dot X = k\Omega Y - \tfrac{X}{\tau} - \tfrac12\Delta(\tfrac1\tau)(X\cos2\theta_\tau + Y\sin2\theta_\tau)
    ///   - \tfrac i2\Delta\omega(X\cos2\theta_\omega + Y\sin2\theta_\omega) + i(\omega-\omega_r)X$$
    ///
    /// and Ẏ likewise. Forces add [`crate::AxisForces::envelope_rate`]. Source: Lynch 1995, first-order averaging.
    pub fn envelope_rate(&self, e: &Envelope<T>, rate_rad_s: T, ahead_rad_s: T) -> Envelope<T> {
        let Anisotropy { cos2: dc, sin2: ds } = self.anisodamping;
        let Anisotropy { cos2: wc, sin2: ws } = self.anisoelasticity;
        coriolis(self.angular_gain * rate_rad_s, e)
            + damping(self.damping_per_s, e)
            + anisodamping::envelope_rate(dc, ds, e)
            + anisoelasticity::envelope_rate(wc, ws, e)
            + detuning(ahead_rad_s, e)
    }
}
