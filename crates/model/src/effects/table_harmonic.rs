//! A table whose rate follows its own angle: Ω(t) = Ω0(1 + w cos(nα + phase)), resolved into (w cos phase, w sin phase).
//!
//! Unbalance, eccentricity and a tilted axis make the low whole orders. Higher ones (poles, teeth, lines of a scale) and
//! orders that are not whole (bearings) are described by the same formula, but their cause is not known from it.

use super::{Description, Effect, Moment, Scaling, Search, Shown, Stage, Values, fitted, searched};
use crate::Real;

/// rate ripple of the table.
pub struct TableHarmonic;

impl Effect for TableHarmonic {
    const DESCRIPTION: Description = Description {
        id: "table-harmonic",
        title: "rate ripple of the table",
        stage: Stage::Input,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[
            searched("n", "1", 0.1, 720.0, Search::TableOrder { explained_to: 8 }),
            fitted("ripple_cos", "1", 0.5, 1e-3),
            fitted("ripple_sin", "1", 0.5, 1e-3),
        ],
        onsets: &[],
        shown: &[
            Shown::Plain(0),
            Shown::Polar { cos: 1, sin: 2, magnitude: "w", unit: "1", angle: "phase", division: 1.0 },
        ],
        signature: "angle −(kw/n) sin(nα+phase): follows the table, not the pattern",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: true },
        source: "the test bench, not the gyroscope",
    };

    #[inline]
    fn input_rate<T: Real>(&[n, cos, sin, ..]: &Values<T>, rate_rad_s: T, at: &Moment<T>) -> T {
        let (sin_na, cos_na) = (n * at.table_rad).sin_cos();
        rate_rad_s * (T::one() + cos * cos_na - sin * sin_na)
    }
}
