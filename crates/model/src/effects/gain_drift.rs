//! A detection gain ratio that drifts in time: y_d = y(1 + ġt), ġ relative to the ratio itself, t from the start of the
//! recording's clock.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{DetectionGains, Envelope, Real};

/// drift of the detection gain ratio.
pub struct GainDrift;

impl Effect for GainDrift {
    const DESCRIPTION: Description = Description {
        id: "gain-drift",
        title: "drift of the detection gain ratio",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("gain_drift", "1/s", 1.0, 1e-4)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "2θ growing in time",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "temperature of the readout electronics",
    };

    const IN_TIME: bool = true;

    #[inline]
    fn read<T: Real>(&[drift, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: T::one() + drift * at.t_s }.measure(&e)
    }

    #[inline]
    fn unread<T: Real>(&[drift, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        DetectionGains { x: T::one(), y: T::one() / (T::one() + drift * at.t_s) }.measure(&e)
    }
}
