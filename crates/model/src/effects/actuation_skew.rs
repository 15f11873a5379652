//! A drive that couples X into Y: f_y += s_a·f_x.

use super::over_temperature::Followed;
use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{AxisForces, Real};

/// skewed or cross-coupled drive axes.
pub struct ActuationSkew;

impl Effect for ActuationSkew {
    const DESCRIPTION: Description = Description {
        id: "actuation-skew",
        title: "skewed or cross-coupled drive axes",
        stage: Stage::Actuation,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("actuation_skew", "1", 1.0, 1e-2)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "v_as at 2θ (sine); a precession ∝ 1/(τΩ)",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "shear of the drive axes",
    };

    #[inline]
    fn actuate<T: Real>(&[s, ..]: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        AxisForces { y_c: f.y_c + s * f.x_c, y_s: f.y_s + s * f.x_s, ..f }
    }
}

impl Followed for ActuationSkew {
    const SLOPES: Description = Description {
        id: "actuation-skew-temperature",
        title: "actuation skew that follows the temperature",
        parameters: &[fitted("actuation_skew_per_k", "1/K", 0.1, 1e-3)],
        signature: "v_as at 2θ (sine), ∝ s(T − T₀); a precession ∝ 1/(τΩ)",
        source: "temperature coefficients of the drive electronics",
        ..Self::DESCRIPTION
    };
}
