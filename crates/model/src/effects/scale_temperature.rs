//! An angular gain that follows the temperature: k(T) = k(1 + s(T − T₀)), T₀ the temperature that parameters refer to.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::Real;

/// angular gain that follows the temperature.
pub struct ScaleTemperature;

impl Effect for ScaleTemperature {
    const DESCRIPTION: Description = Description {
        id: "scale-temperature",
        title: "angular gain that follows the temperature",
        stage: Stage::Input,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("scale_per_k", "1/K", 0.01, 1e-6)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ∝ (T − T₀) times the turned angle",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: true },
        source: "thermal expansion of the resonator and its mode shape",
    };

    const BY_TEMPERATURE: bool = true;

    #[inline]
    fn input_rate<T: Real>(&[slope, ..]: &Values<T>, rate_rad_s: T, at: &Moment<T>) -> T {
        rate_rad_s * (T::one() + slope * at.warmer_k)
    }
}
