//! The numerically controlled oscillator: cosine and sine of the reference phase, one rotation a sample.
//!
//! A rotation costs four products and needs neither a table nor a phase in an integer. Its length drifts by rounding
//! and is set right once a window ([`Oscillator::tune`]); its phase needs no exactness, because the phase-locked loop
//! closes around it. It serves both as the reference of the demodulator and as the carrier of the drives.
//!
//! It refuses to decide its frequency: it follows a correction.

use cvg_model::{Float, Real};

use crate::ConfigError;

/// The oscillator's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator<T> {
    /// cosine and sine of the nominal phase step ω₀T
    pub(crate) centre_cos: T,
    pub(crate) centre_sin: T,
    pub(crate) period_s: T,
    pub(crate) limit_rad_s: T,
}

/// The oscillator's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phasor<T> {
    /// cosine of the reference phase at this sample
    pub cos: T,
    /// sine of the reference phase at this sample
    pub sin: T,
    /// cosine of the phase step to the next sample
    pub step_cos: T,
    /// sine of the phase step to the next sample
    pub step_sin: T,
}

impl<T: Float> Phasor<T> {
    /// The phasor at the next sample.
    #[inline(always)]
    pub fn advanced(&self) -> Self {
        Self {
            cos: self.cos * self.step_cos - self.sin * self.step_sin,
            sin: self.sin * self.step_cos + self.cos * self.step_sin,
            ..*self
        }
    }

    /// Moves on to the next sample.
    #[inline(always)]
    pub fn advance(&mut self) {
        let next = self.advanced();
        (self.cos, self.sin) = (next.cos, next.sin);
    }

    /// The phasor moved ahead by the angle of (`cos`, `sin`).
    #[inline]
    pub fn turned(&self, cos: T, sin: T) -> Self {
        Self { cos: self.cos * cos - self.sin * sin, sin: self.sin * cos + self.cos * sin, ..*self }
    }
}

impl<T: Float> Oscillator<T> {
    /// An oscillator of `frequency_hz` (> 0), stepped every `period_s` (> 0), that follows corrections within
    /// ±`limit_rad_s` (> 0).
    ///
    /// # Errors
    /// A parameter outside its domain; fewer than 2.2 samples per period of the oscillation at its fastest, or more
    /// than 64 at its slowest; a correction of more than 0.2 rad per sample.
    pub fn new(frequency_hz: f64, period_s: f64, limit_rad_s: f64) -> Result<Self, ConfigError> {
        let refused = |parameter, expected| Err(ConfigError { parameter, expected });
        if !(period_s > 0.0 && period_s.is_finite()) {
            return refused("period_s", "finite and positive");
        }
        if !(limit_rad_s > 0.0 && limit_rad_s * period_s < 0.2) {
            return refused("limit_rad_s", "positive and below 0.2 rad per sample");
        }
        let step = core::f64::consts::TAU * frequency_hz * period_s;
        let reach = limit_rad_s * period_s;
        if !(step - reach > core::f64::consts::TAU / 64.0 && step + reach < core::f64::consts::TAU / 2.2) {
            return refused("frequency_hz", "between 1/64 and 1/2.2 of the sample rate, with its correction");
        }
        let (sin, cos) = Real::sin_cos(step);
        Ok(Self {
            centre_cos: T::from_f64(cos),
            centre_sin: T::from_f64(sin),
            period_s: T::from_f64(period_s),
            limit_rad_s: T::from_f64(limit_rad_s),
        })
    }

    /// The oscillator at phase 0 and its nominal frequency.
    pub fn start(&self) -> Phasor<T> {
        Phasor { cos: T::one(), sin: T::zero(), step_cos: self.centre_cos, step_sin: self.centre_sin }
    }

    /// The phasor with its length set to one, running from now on at the nominal frequency plus `correction_rad_s`.
    ///
    /// The step's angle is exact to rounding: of the series of the correction's sine and cosine, the first neglected
    /// terms are below 3e-9 and 1e-10 at the limit of 0.2 rad, and below 2e-15 at 400 Hz and 100 kHz. Total: a phasor of
    /// no sensible length starts anew.
    #[inline]
    pub fn tune(&self, phasor: &Phasor<T>, correction_rad_s: T) -> Phasor<T> {
        match self.tune_within(phasor, correction_rad_s) {
            Some(tuned) => tuned,
            None => self.tune_beyond(phasor, correction_rad_s),
        }
    }

    /// [`Oscillator::tune`] where the correction is within its limit and the phasor's length is near one. None elsewhere.
    #[inline(always)]
    pub fn tune_within(&self, phasor: &Phasor<T>, correction_rad_s: T) -> Option<Phasor<T>> {
        let length_2 = phasor.cos * phasor.cos + phasor.sin * phasor.sin;
        // false for any NaN
        if correction_rad_s.within(self.limit_rad_s) && (length_2 - T::one()).within(T::ratio(1, 4)) {
            let (step_cos, step_sin) = self.step(correction_rad_s);
            // one step of Newton's iteration towards length 1
            let scale = T::ratio(3, 2) - T::half() * length_2;
            Some(Phasor { cos: phasor.cos * scale, sin: phasor.sin * scale, step_cos, step_sin })
        } else {
            None
        }
    }

    #[cold]
    #[inline(never)]
    fn tune_beyond(&self, phasor: &Phasor<T>, correction_rad_s: T) -> Phasor<T> {
        let within = correction_rad_s.bounded(self.limit_rad_s);
        self.tune_within(phasor, within).unwrap_or_else(|| {
            let (step_cos, step_sin) = self.step(within);
            Phasor { cos: T::one(), sin: T::zero(), step_cos, step_sin }
        })
    }

    /// Cosine and sine of the phase step at a correction within the limit.
    #[inline(always)]
    fn step(&self, correction_rad_s: T) -> (T, T) {
        let u = correction_rad_s * self.period_s;
        let u2 = u * u;
        let sin = u * (T::one() - u2 * (T::ratio(1, 6) - u2 * T::ratio(1, 120)));
        let cos = T::one() - u2 * (T::half() - u2 * (T::ratio(1, 24) - u2 * T::ratio(1, 720)));
        (self.centre_cos * cos - self.centre_sin * sin, self.centre_sin * cos + self.centre_cos * sin)
    }

    /// The largest correction, rad/s.
    pub fn limit_rad_s(&self) -> T {
        self.limit_rad_s
    }
}

/// Cosine and sine of an angle of which the sine and cosine of the double, times any positive length, are given:
/// the half angle in (−90°, 90°]. Not a number where both are 0.
#[inline]
pub(crate) fn half_angle<T: Real>(cos_2: T, sin_2: T) -> (T, T) {
    let length = cos_2.norm(sin_2);
    let (cos, sin) = if cos_2 < T::zero() {
        let sin = length - cos_2;
        if sin_2 < T::zero() { (-sin_2, -sin) } else { (sin_2, sin) }
    } else {
        (length + cos_2, sin_2)
    };
    let scale = T::one() / cos.norm(sin);
    (cos * scale, sin * scale)
}
