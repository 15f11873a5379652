//! An angular gain that drifts in time: k(t) = k(1 + k̇t), t from the start of the recording's clock.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::Real;

/// drift of the angular gain.
pub struct ScaleDrift;

impl Effect for ScaleDrift {
    const DESCRIPTION: Description = Description {
        id: "scale-drift",
        title: "drift of the angular gain",
        stage: Stage::Input,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("scale_drift", "1/s", 1.0, 1e-6)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ∝ t²",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: true },
        source: "temperature of the resonator",
    };

    const IN_TIME: bool = true;

    #[inline]
    fn input_rate<T: Real>(&[drift, ..]: &Values<T>, rate_rad_s: T, at: &Moment<T>) -> T {
        rate_rad_s * (T::one() + drift * at.t_s)
    }
}
