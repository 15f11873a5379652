//! A drive that couples X into Y: f_y += s_a·f_x.

use super::{Description, Effect, Scaling, Shown, Stage, Values, fitted};
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
    fn actuate<T: Real>(&[s, ..]: &Values<T>, f: AxisForces<T>) -> AxisForces<T> {
        AxisForces { y_c: f.y_c + s * f.x_c, y_s: f.y_s + s * f.x_s, ..f }
    }
}
