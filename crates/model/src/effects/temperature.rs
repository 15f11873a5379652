//! A detection gain ratio that follows the temperature: y_d = y(1 + s(T − T₀)), s relative to the ratio itself, T₀ the
//! temperature that parameters refer to.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{DetectionGains, Envelope, Real};

/// detection gain ratio that follows the temperature.
pub struct Temperature;

impl Effect for Temperature {
    const DESCRIPTION: Description = Description {
        id: "temperature",
        title: "detection gain ratio that follows the temperature",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("gain_per_k", "1/K", 0.1, 1e-4)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ½s(T − T₀) sin 2θ",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "temperature coefficients of the readout electronics",
    };

    const BY_TEMPERATURE: bool = true;

    #[inline]
    fn read<T: Real>(&[slope, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: T::one() + slope * at.warmer_k }.measure(&e)
    }

    #[inline]
    fn unread<T: Real>(&[slope, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: T::one() / (T::one() + slope * at.warmer_k) }.measure(&e)
    }
}
