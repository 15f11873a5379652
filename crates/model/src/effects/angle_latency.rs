//! An output that is stamped late by t_d: θ_d(t) = θ(t − t_d), which is θ + kΩt_d at rate Ω.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// output stamped late.
pub struct AngleLatency;

impl Effect for AngleLatency {
    const DESCRIPTION: Description = Description {
        id: "angle-latency",
        title: "output stamped late",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("latency", "s", 1.0, 1e-4)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle +kΩt_d: a constant per rate, seen between +Ω and −Ω",
        scaling: Scaling { rate: 1, amplitude: 0, odd_in_rate: true },
        source: "transport delay of the electronics",
    };

    #[inline]
    fn read<T: Real>(&[latency, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = (latency * at.precession_rad_s).sin_cos();
        e.turned(-sin, cos)
    }

    #[inline]
    fn unread<T: Real>(&[latency, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = (latency * at.precession_rad_s).sin_cos();
        e.turned(sin, cos)
    }
}
