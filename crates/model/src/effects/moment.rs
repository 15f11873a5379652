//! When an effect acts: time, temperature, and what the instrument does then.

use crate::{AxisForces, Real};

/// The instant at which an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Moment<T> {
    /// time of the recording, s
    pub t_s: T,
    /// angle of the table, rad
    pub table_rad: T,
    /// nominal precession rate −kΩ, rad/s
    pub precession_rad_s: T,
    /// temperature over the one that parameters refer to, K
    pub warmer_k: T,
    /// what the electronics command the drives of X and Y to, V: what acts while the readout is taken
    pub drive: AxisForces<T>,
}

impl<T: Real> Moment<T> {
    /// Where a recording starts, at the temperature that parameters refer to, with silent drives.
    pub fn origin() -> Self {
        let zero = T::zero();
        let drive = AxisForces { x_c: zero, x_s: zero, y_c: zero, y_s: zero };
        Self { t_s: zero, table_rad: zero, precession_rad_s: zero, warmer_k: zero, drive }
    }
}

impl<T: Copy> Moment<T> {
    /// The same instant in another scalar.
    #[inline]
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> Moment<U> {
        let d = &self.drive;
        Moment {
            t_s: f(self.t_s),
            table_rad: f(self.table_rad),
            precession_rad_s: f(self.precession_rad_s),
            warmer_k: f(self.warmer_k),
            drive: AxisForces { x_c: f(d.x_c), x_s: f(d.x_s), y_c: f(d.y_c), y_s: f(d.y_s) },
        }
    }
}
