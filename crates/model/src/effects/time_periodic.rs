//! A disturbance of the angle at a fixed frequency in time: θ_d += A cos(2πft + phase), resolved into (A cos phase,
//! A sin phase).

use super::{Description, Effect, Moment, Scaling, Search, Shown, Stage, Values, fitted, located};
use crate::{Envelope, Real};

/// disturbance at a fixed frequency.
pub struct TimePeriodic;

impl Effect for TimePeriodic {
    const DESCRIPTION: Description = Description {
        id: "time-periodic",
        title: "disturbance at a fixed frequency",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[
            located("frequency", "Hz", 1e-3, 1e6, Search::Frequency),
            fitted("periodic_cos", "rad", 0.5, 1e-3),
            fitted("periodic_sin", "rad", 0.5, 1e-3),
        ],
        onsets: &[],
        shown: &[
            Shown::Plain(0),
            Shown::Polar { cos: 1, sin: 2, magnitude: "amplitude", unit: "rad", angle: "phase", division: 1.0 },
        ],
        signature: "a line in time, neither pattern- nor table-synchronous",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "mains, a fan, another resonance",
    };

    const IN_TIME: bool = true;

    #[inline]
    fn read<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = disturbance(p, at).sin_cos();
        e.turned(sin, cos)
    }

    #[inline]
    fn unread<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = disturbance(p, at).sin_cos();
        e.turned(-sin, cos)
    }
}

/// A cos(2πft + phase), rad.
#[inline]
fn disturbance<T: Real>(&[frequency, cos, sin, ..]: &Values<T>, at: &Moment<T>) -> T {
    let pi = T::zero().atan2(-T::one());
    let (s, c) = (T::two() * pi * frequency * at.t_s).sin_cos();
    cos * c - sin * s
}
