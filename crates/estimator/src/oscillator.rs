//! The phase-locked loop: holds the reference phase on the vibration's by nulling Lynch's fifth variable L.
//!
//! It puts out a frequency correction; the oscillator that follows it belongs to whoever makes the carrier. It refuses
//! to know the carrier's frequency: a correction is all an envelope can tell.

use cvg_model::{Float, Pendulum};

use crate::{ConfigError, Status};

/// The loop's configuration: a PI on the measured phase error.
///
/// With δ the vibration's phase ahead of the reference, L = −(E² − Q²)^½ sin 2δ, so −L/(2E) ≈ δ for a thin orbit. A
/// correction u of the reference frequency makes δ̇ = (detuning) − u, and u = K(δ + (1/2τ)∫δ dt) closes
///
/// $$s^2 + K s + \frac{K}{2\tau} = 0,\qquad K = 2\zeta\omega_n,\quad \tau = \zeta/\omega_n.$$
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLock<T> {
    pub(crate) gain_per_s: T,
    /// K·T/(2τ), 1/s: what one sample of error adds to the integral part
    pub(crate) integral_gain_per_s: T,
    pub(crate) limit_rad_s: T,
}

/// The loop's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockState<T> {
    /// the integral part of the correction, rad/s: in lock, the detuning
    pub detuning_rad_s: T,
}

impl<T: Float> Default for LockState<T> {
    fn default() -> Self {
        Self { detuning_rad_s: T::zero() }
    }
}

/// A frequency correction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction<T> {
    /// to add to the reference frequency, rad/s; within the limit, always
    pub rad_s: T,
    /// whether the phase error was measured
    pub status: Status,
}

impl<T: Float> PhaseLock<T> {
    /// A loop of natural frequency `bandwidth_rad_s` (> 0) and damping ratio `damping` (> 0), stepped every `period_s`
    /// (> 0), whose correction stays within ±`limit_rad_s` (> 0).
    ///
    /// # Errors
    /// A parameter outside its domain, or a bandwidth that the period cannot realise (2ζω_n T ≥ 1).
    ///
    /// ```
    /// use cvg_estimator::{LockState, PhaseLock};
    /// use cvg_model::Orbit;
    ///
    /// let lock = PhaseLock::<f64>::new(30.0, 1.0, 5e-4, 1e3)?;
    /// let (mut state, mut phase) = (LockState::default(), 0.3);
    /// // a vibration 5 rad/s beside the reference: the phase is nulled, the detuning found
    /// for _ in 0..4000 {
    ///     let vibration = Orbit { a: 1.0, q: 0.0, theta: 0.4, delta: phase }.envelope();
    ///     let correction = lock.step(&mut state, &vibration.pendulum());
    ///     phase += (5.0 - correction.rad_s) * 5e-4;
    /// }
    /// assert!(phase.abs() < 1e-6 && (state.detuning_rad_s - 5.0).abs() < 1e-4);
    /// # Ok::<(), cvg_estimator::ConfigError>(())
    /// ```
    pub fn new(bandwidth_rad_s: T, damping: T, period_s: T, limit_rad_s: T) -> Result<Self, ConfigError> {
        let positive = |v: T, parameter| {
            if v > T::zero() && v.is_finite() {
                Ok(v)
            } else {
                Err(ConfigError { parameter, expected: "finite and positive" })
            }
        };
        let bandwidth = positive(bandwidth_rad_s, "bandwidth_rad_s")?;
        let damping = positive(damping, "damping")?;
        let period = positive(period_s, "period_s")?;
        let limit = positive(limit_rad_s, "limit_rad_s")?;
        let gain = positive(T::two() * damping * bandwidth, "bandwidth_rad_s times damping")?;
        if gain * period >= T::one() {
            return Err(ConfigError { parameter: "bandwidth_rad_s", expected: "below 1/(2 damping period_s)" });
        }
        Ok(Self { gain_per_s: gain, integral_gain_per_s: bandwidth * bandwidth * period, limit_rad_s: limit })
    }

    //= specs/electronics.md#correction-within-its-limit
    //# The frequency correction MUST be finite and within its limit for every input and every state.
    //= specs/electronics.md#correction-is-held
    //# Pendulum variables that hold no phase MUST leave the integral part of the correction as it was.
    /// The correction for the pendulum variables `p`. Total; holds the integral where there is no phase to measure.
    #[inline]
    pub fn step(&self, state: &mut LockState<T>, p: &Pendulum<T>) -> Correction<T> {
        match self.step_within(state, p) {
            Some(rad_s) => Correction { rad_s, status: Status::Valid },
            None => self.beyond(state, p),
        }
    }

    /// [`PhaseLock::step`] where nothing is at a limit: the correction, rad/s. None, and nothing changed, elsewhere.
    #[inline(always)]
    pub fn step_within(&self, state: &mut LockState<T>, p: &Pendulum<T>) -> Option<T> {
        let error = phase_error(p);
        let detuning = state.detuning_rad_s + self.integral_gain_per_s * error;
        let rad_s = self.gain_per_s * error + detuning;
        // |L| ≤ E, so an error beyond ½ (with room for rounding) is no measurement; false for any NaN
        if error.within(T::one()) && detuning.within(self.limit_rad_s) && rad_s.within(self.limit_rad_s) {
            state.detuning_rad_s = detuning;
            return Some(rad_s);
        }
        None
    }

    /// The step where a limit is met, or there is no phase to measure.
    #[cold]
    #[inline(never)]
    fn beyond(&self, state: &mut LockState<T>, p: &Pendulum<T>) -> Correction<T> {
        let error = phase_error(p);
        let held = state.detuning_rad_s.bounded(self.limit_rad_s);
        if error.within(T::one()) {
            state.detuning_rad_s = (held + self.integral_gain_per_s * error).bounded(self.limit_rad_s);
            let rad_s = (self.gain_per_s * error + state.detuning_rad_s).bounded(self.limit_rad_s);
            Correction { rad_s, status: Status::Valid }
        } else {
            state.detuning_rad_s = held;
            let status = if p.e.is_finite() && p.l.is_finite() { Status::Undetermined } else { Status::Invalid };
            Correction { rad_s: held, status }
        }
    }
}

/// −L/(2E), which is δ for a thin orbit.
#[inline(always)]
fn phase_error<T: Float>(p: &Pendulum<T>) -> T {
    -(T::half() * p.l / p.e)
}
