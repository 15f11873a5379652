//! Unequal drive gains, G_Ax/G_Ay (Equations 9 and 10), kept at a common mean: G_Ax ∝ √ratio, G_Ay ∝ 1/√ratio.

use super::over_temperature::Followed;
use super::{Belief, Description, Effect, Moment, Parameter, Role, Scaling, Shown, Stage, Values, fitted};
use crate::{AxisForces, Real};

/// unequal actuation gains.
pub struct ActuationGainMismatch;

impl Effect for ActuationGainMismatch {
    const DESCRIPTION: Description = Description {
        id: "actuation-gain-mismatch",
        title: "unequal actuation gains",
        stage: Stage::Actuation,
        declared: true,
        empirical: false,
        in_sensors: false,
        parameters: &[Parameter {
            name: "actuation_gain_ratio",
            unit: "1",
            lower: 0.2,
            upper: 5.0,
            neutral: 1.0,
            scale: 1e-2,
            role: Role::Fitted,
            belief: Belief::Within(0.15),
        }],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "v_as ∝ 1/(G_Ax cos²θ + G_Ay sin²θ); a precession ∝ 1/(τΩ)",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "the paper, Equations 9 to 11",
    };

    #[inline]
    fn actuate<T: Real>(&[ratio, ..]: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        let x = ratio.sqrt();
        let y = T::one() / x;
        AxisForces { x_c: x * f.x_c, x_s: x * f.x_s, y_c: y * f.y_c, y_s: y * f.y_s }
    }
}

impl Followed for ActuationGainMismatch {
    const SLOPES: Description = Description {
        id: "actuation-gain-temperature",
        title: "actuation gain ratio that follows the temperature",
        declared: false,
        parameters: &[fitted("actuation_gain_per_k", "1/K", 0.1, 1e-3)],
        signature: "v_as at 2θ, ∝ s(T − T₀); a precession of s(T − T₀)/(2τ) sin 2θ",
        source: "temperature coefficients of the drive electronics",
        ..Self::DESCRIPTION
    };

    const IS_RATIO: bool = true;
}
