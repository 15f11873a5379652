//! Constant in-phase offsets of the demodulated readout, V: x_d = x + o_x, y_d = y + o_y.

use super::over_temperature::Followed;
use super::{Description, Effect, Inverse, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// offsets of the readout.
pub struct DetectionOffset;

impl Effect for DetectionOffset {
    const DESCRIPTION: Description = Description {
        id: "detection-offset",
        title: "offsets of the readout",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("offset_x", "V", 1e3, 1e-3), fitted("offset_y", "V", 1e3, 1e-3)],
        onsets: &[],
        shown: &[Shown::Plain(0), Shown::Plain(1)],
        signature: "angle (o_y cos θ − o_x sin θ)/a: harmonic 1, ∝ 1/a",
        scaling: Scaling { rate: 0, amplitude: -1, odd_in_rate: false },
        source: "feedthrough of the drive, or a sensor's bias",
    };

    #[inline]
    fn read<T: Real>(&[o_x, o_y, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::new(e.x_c + o_x, e.x_s, e.y_c + o_y, e.y_s)
    }

    #[inline]
    fn unread<T: Real>(&[o_x, o_y, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::new(e.x_c - o_x, e.x_s, e.y_c - o_y, e.y_s)
    }

    fn inverse<T: Real>(_: &Values<T>) -> Inverse<T> {
        Inverse::Affine
    }
}

impl Followed for DetectionOffset {
    const SLOPES: Description = Description {
        id: "detection-offset-temperature",
        title: "offsets of the readout that follow the temperature",
        in_sensors: false,
        parameters: &[fitted("offset_x_per_k", "V/K", 1e2, 1e-4), fitted("offset_y_per_k", "V/K", 1e2, 1e-4)],
        signature: "angle (T − T₀)(s_y cos θ − s_x sin θ)/a: harmonic 1, ∝ 1/a",
        source: "temperature coefficients of the readout electronics",
        ..Self::DESCRIPTION
    };
}
