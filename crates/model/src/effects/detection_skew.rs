//! A readout whose axes are not orthogonal, or that couples X into Y: y_d = y + s·x.

use super::over_temperature::Followed;
use super::{Description, Effect, Inverse, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// skewed or cross-coupled readout axes.
pub struct DetectionSkew;

impl Effect for DetectionSkew {
    const DESCRIPTION: Description = Description {
        id: "detection-skew",
        title: "skewed or cross-coupled readout axes",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("skew", "1", 2.0, 1e-3)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ½s(1+cos 2θ); amplitude ½s sin 2θ",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "shear of the readout axes",
    };

    #[inline]
    fn read<T: Real>(&[s, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::new(e.x_c, e.x_s, e.y_c + s * e.x_c, e.y_s + s * e.x_s)
    }

    #[inline]
    fn unread<T: Real>(&[s, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::new(e.x_c, e.x_s, e.y_c - s * e.x_c, e.y_s - s * e.x_s)
    }

    fn inverse<T: Real>(_: &Values<T>) -> Inverse<T> {
        Inverse::Affine
    }
}

impl Followed for DetectionSkew {
    const SLOPES: Description = Description {
        id: "skew-temperature",
        title: "detection skew that follows the temperature",
        in_sensors: false,
        parameters: &[fitted("skew_per_k", "1/K", 0.1, 1e-4)],
        signature: "angle ½s(T − T₀)(1 + cos 2θ)",
        source: "temperature coefficients of the readout electronics",
        ..Self::DESCRIPTION
    };
}
