//! What is left when no physical effect explains it: θ_d += A cos(nθ + phase), resolved into (A cos phase, A sin phase).

use super::{Description, Effect, Moment, Scaling, Search, Shown, Stage, Values, fitted, searched};
use crate::{Envelope, Real};

/// a harmonic of the pattern angle without a known cause.
pub struct HarmonicN;

impl Effect for HarmonicN {
    const DESCRIPTION: Description = Description {
        id: "harmonic-n",
        title: "a harmonic of the pattern angle without a known cause",
        stage: Stage::Readout,
        declared: false,
        empirical: true,
        in_sensors: true,
        parameters: &[
            searched("n", "1", 1.0, 720.0, Search::PatternHarmonic),
            fitted("harmonic_cos", "rad", 0.5, 1e-3),
            fitted("harmonic_sin", "rad", 0.5, 1e-3),
        ],
        onsets: &[],
        shown: &[
            Shown::Plain(0),
            Shown::Polar { cos: 1, sin: 2, magnitude: "amplitude", unit: "rad", angle: "phase", division: 1.0 },
        ],
        signature: "angle at nθ",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "none: empirical",
    };

    #[inline]
    fn read<T: Real>(&[n, cos, sin, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let (sin_n, cos_n) = (n * direction(&e)).sin_cos();
        let (s, c) = (cos * cos_n - sin * sin_n).sin_cos();
        e.turned(s, c)
    }
}

/// The direction of the vibration over the full turn, rad: that of the axis which carries the in-phase part.
///
/// Odd harmonics exist only because the reference phase tells θ from θ + 180°.
#[inline]
fn direction<T: Real>(e: &Envelope<T>) -> T {
    e.y_c.atan2(e.x_c)
}
