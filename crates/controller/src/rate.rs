//! The rate loop: holds the pattern at a target angle by a force along the minor axis, in quadrature phase.
//!
//! Ring-downs at a held angle (Equation 11) need it, and force to rebalance is nothing else. Tuning rule: the force
//! moves the pattern at θ̇ = −(b/a) v_qs with b = G_A/2ω, and the law v_qs = a K[ε + (1/2τ)∫ε dt] on the angle error
//! ε (rad), scaled by the measured amplitude a, closes
//!
//! $$s^2 + bK\,s + \frac{bK}{2\tau} = 0 \quad\Rightarrow\quad K = \frac{2\zeta\omega_n}{b},\qquad \tau = \frac{\zeta}{\omega_n},$$
//!
//! whatever the amplitude: the loop stays the same while a ring-down decays.
//!
//! It refuses to measure a rate. What the table does is in its output, and in a ring-down the table stands still.

use cvg_model::{Float, Pendulum};

use crate::pi::{Pi, PiState, realisable};
use crate::{Command, ConfigError, Status, positive};

/// A target angle as cosine and sine of twice itself: all that a pattern of period 180° knows of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading<T> {
    pub(crate) cos_2: T,
    pub(crate) sin_2: T,
}

impl<T: Float> Heading<T> {
    /// The heading at `theta_rad`.
    ///
    /// # Errors
    /// An angle that is not finite.
    pub fn new(theta_rad: T) -> Result<Self, ConfigError> {
        if theta_rad.is_finite() {
            let (sin_2, cos_2) = (T::two() * theta_rad).sin_cos();
            Ok(Self { cos_2, sin_2 })
        } else {
            Err(ConfigError { parameter: "theta_rad", expected: "finite" })
        }
    }

    /// ½ sin 2(θ_d − θ_target) from the pendulum variables: the angle error ε, for small errors in rad.
    ///
    /// Its only other zero, 90° away, repels. Not a number where the orbit has no direction.
    #[inline]
    fn error(&self, p: &Pendulum<T>) -> T {
        T::half() * (p.s * self.cos_2 - p.r * self.sin_2) / p.r.norm(p.s)
    }
}

/// The rate loop's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateLoop<T> {
    pub(crate) pi: Pi<T>,
    pub(crate) limit_v: T,
}

impl<T: Float> RateLoop<T> {
    /// A loop of natural frequency `bandwidth_rad_s` and damping ratio `damping` under drive gain `drive_per_s_v` = b
    /// (1/s per V), stepped every `period_s`, whose command stays within ±`limit_v`. All > 0.
    ///
    /// `largest_rate_rad_s` is the fastest precession that the integral part may be asked to hold still.
    ///
    /// # Errors
    /// A parameter outside its domain, or 2ζω_n T ≥ 1: a loop the period cannot realise.
    pub fn tuned(
        bandwidth_rad_s: T,
        damping: T,
        drive_per_s_v: T,
        largest_rate_rad_s: T,
        period_s: T,
        limit_v: T,
    ) -> Result<Self, ConfigError> {
        let bandwidth = positive(bandwidth_rad_s, "bandwidth_rad_s")?;
        let damping = positive(damping, "damping")?;
        let drive = positive(drive_per_s_v, "drive_per_s_v")?;
        let largest = positive(largest_rate_rad_s, "largest_rate_rad_s")?;
        realisable(bandwidth, damping, period_s)?;
        let pi = Pi::new(T::two() * damping * bandwidth / drive, damping / bandwidth, period_s, largest / drive)?;
        Ok(Self { pi, limit_v: positive(limit_v, "limit_v")? })
    }

    //= specs/electronics.md#heading-within-its-limit
    //# The output that holds the pattern MUST be finite and within its limit for every input and every state.
    /// v_qs for the pendulum variables `p`. Total.
    #[inline]
    pub fn step(&self, state: &mut PiState<T>, p: &Pendulum<T>, target: &Heading<T>) -> Command<T> {
        let per_amplitude = self.pi.control(state, target.error(p));
        let asked = p.e.sqrt() * per_amplitude.volts;
        let volts = asked.bounded(self.limit_v);
        let status = if !asked.is_finite() {
            Status::Invalid
        } else if volts == asked {
            per_amplitude.status
        } else {
            Status::Limited
        };
        Command { volts, status }
    }
}
