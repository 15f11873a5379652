//! A rotation that the record of the input does not hold: Ω(t) = Ω0 + Ω_o. The Earth's turn, an offset of the rate
//! sensor that was recorded, and a drift of the pattern itself look alike, so no cause is claimed.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::Real;

/// steady drift beside the recorded rotation.
pub struct RateOffset;

impl Effect for RateOffset {
    const DESCRIPTION: Description = Description {
        id: "rate-offset",
        title: "steady drift beside the recorded rotation",
        stage: Stage::Input,
        declared: false,
        empirical: true,
        in_sensors: true,
        parameters: &[fitted("rate_offset", "rad/s", 0.1, 1e-4)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle ∝ t in either direction",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "none: empirical",
    };

    #[inline]
    fn input_rate<T: Real>(&[offset, ..]: &Values<T>, rate_rad_s: T, _: &Moment<T>) -> T {
        rate_rad_s + offset
    }
}
