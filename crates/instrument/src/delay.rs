//! The delay of the whole loop, from what is read to the middle of the output's hold.

use cvg_model::{AxisForces, Float, Real};

use crate::ConfigError;

/// A delay in which the carrier turns by a known phase, and by a little more where its frequency is corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Delay<T> {
    /// cosine and sine of ω₀ times the delay
    pub(crate) cos: T,
    pub(crate) sin: T,
    pub(crate) s: T,
}

impl<T: Float> Delay<T> {
    /// A delay of `delay_s` of a carrier of `omega_rad_s`, which is corrected by up to `limit_rad_s`.
    ///
    /// # Errors
    /// A correction that turns a radian in the delay.
    pub(crate) fn new(delay_s: f64, omega_rad_s: f64, limit_rad_s: f64) -> Result<Self, ConfigError> {
        // the drives follow a correction to first order: up to here within 0.22 rad, and 1.42 times as large
        if limit_rad_s * delay_s >= 1.0 {
            return Err(ConfigError {
                parameter: "drive_delay_s",
                expected: "so short that the band turns less than a radian in the loop's delay",
            });
        }
        let (sin, cos) = Real::sin_cos(omega_rad_s * delay_s);
        Ok(Self { cos: T::from_f64(cos), sin: T::from_f64(sin), s: T::from_f64(delay_s) })
    }

    /// The commands with the delay undone: f(t) is to have the phase of the vibration at the middle of the output's hold, which is
    /// ahead of the oscillator's phase at the sample by ω times the delay.
    #[inline(always)]
    pub(crate) fn undone(&self, f: &AxisForces<T>, correction_rad_s: T) -> AxisForces<T> {
        let (cos, sin) = self.phase(correction_rad_s);
        f.ahead(cos, sin)
    }

    /// The commands of a drive that [`Delay::undone`] gave.
    pub(crate) fn done(&self, drive: &AxisForces<T>, correction_rad_s: T) -> AxisForces<T> {
        let (cos, sin) = self.phase(correction_rad_s);
        drive.behind(cos, sin)
    }

    /// Cosine and sine of the carrier's phase in the delay, both √(1 + (correction · delay)²) times as large.
    #[inline(always)]
    fn phase(&self, correction_rad_s: T) -> (T, T) {
        // the correction's own share is small: first order
        let more = correction_rad_s * self.s;
        (self.cos - self.sin * more, self.sin + self.cos * more)
    }
}

#[cfg(test)]
mod tests {
    use cvg_model::AxisForces;

    use super::Delay;

    #[test]
    fn a_correction_turns_less_than_a_radian_in_the_delay() {
        for (limit_rad_s, accepted) in [(1.0, true), (1.999, true), (2.0, false), (2.1, false)] {
            assert_eq!(Delay::<f32>::new(0.5, 1e5, limit_rad_s).is_ok(), accepted, "{limit_rad_s}");
        }
    }

    #[test]
    fn the_commands_of_a_drive_are_those_that_it_was_made_of() {
        let f = AxisForces { x_c: 0.3, x_s: -0.2, y_c: 0.1, y_s: 0.4 };
        let delay = Delay::<f64>::new(1e-4, 1e5, 9e3).expect("less than a radian");
        for correction_rad_s in [0.0, 400.0, -400.0, 9e3, -9e3] {
            let g = delay.done(&delay.undone(&f, correction_rad_s), correction_rad_s);
            for (got, made_of) in [(g.x_c, f.x_c), (g.x_s, f.x_s), (g.y_c, f.y_c), (g.y_s, f.y_s)] {
                assert!((got - made_of).abs() < 1e-15, "{correction_rad_s}: {g:?}");
            }
        }
    }
}
