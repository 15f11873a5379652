//! Readout axes whose skew follows the temperature: y_d = y + s(T − T₀)·x, T₀ the temperature that parameters refer to.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// detection skew that follows the temperature.
pub struct SkewTemperature;

impl Effect for SkewTemperature {
    const DESCRIPTION: Description = Description {
        id: "skew-temperature",
        title: "detection skew that follows the temperature",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("skew_per_k", "1/K", 0.1, 1e-4)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ½s(T − T₀)(1 + cos 2θ)",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "temperature coefficients of the readout electronics",
    };

    const BY_TEMPERATURE: bool = true;

    #[inline]
    fn read<T: Real>(&[slope, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let s = slope * at.warmer_k;
        Envelope::new(e.x_c, e.x_s, e.y_c + s * e.x_c, e.y_s + s * e.x_s)
    }

    #[inline]
    fn unread<T: Real>(&[slope, ..]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let s = slope * at.warmer_k;
        Envelope::new(e.x_c, e.x_s, e.y_c - s * e.x_c, e.y_s - s * e.x_s)
    }
}
