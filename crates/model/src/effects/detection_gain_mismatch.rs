//! Unequal readout gains: y_d = g·y with g = G_Dy/G_Dx (Equations 5 to 7).

use super::over_temperature::Followed;
use super::{Belief, Description, Effect, Inverse, Moment, Parameter, Role, Scaling, Shown, Stage, Values, fitted};
use crate::{DetectionGains, Envelope, Real};

/// unequal detection gains.
pub struct DetectionGainMismatch;

impl Effect for DetectionGainMismatch {
    const DESCRIPTION: Description = Description {
        id: "detection-gain-mismatch",
        title: "unequal detection gains",
        stage: Stage::Readout,
        declared: true,
        empirical: false,
        in_sensors: true,
        parameters: &[Parameter {
            name: "detection_gain_ratio",
            unit: "1",
            lower: 0.2,
            upper: 5.0,
            neutral: 1.0,
            scale: 1e-3,
            role: Role::Fitted,
            belief: Belief::Vague,
        }],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ½(g−1) sin 2θ; amplitude ½(g−1)(1−cos 2θ)",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "the paper, Equations 5 to 7",
    };

    #[inline]
    fn read<T: Real>(&[g, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: g }.measure(&e)
    }

    #[inline]
    fn unread<T: Real>(&[g, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: T::one() / g }.measure(&e)
    }

    fn inverse<T: Real>(_: &Values<T>) -> Inverse<T> {
        Inverse::Affine
    }
}

impl Followed for DetectionGainMismatch {
    const SLOPES: Description = Description {
        id: "temperature",
        title: "detection gain ratio that follows the temperature",
        declared: false,
        in_sensors: false,
        parameters: &[fitted("gain_per_k", "1/K", 0.1, 1e-4)],
        signature: "angle ½s(T − T₀) sin 2θ",
        source: "temperature coefficients of the readout electronics",
        ..Self::DESCRIPTION
    };

    const IS_RATIO: bool = true;
}
