//! A nonlinear spring, electrostatic or mechanical, that precesses the pattern: θ̇ += p sin(4θ + phase), resolved into
//! (p cos phase, p sin phase).

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real, resonator::envelope::precession};

/// nonlinear spring that precesses the pattern.
pub struct SpringCubic;

impl Effect for SpringCubic {
    const DESCRIPTION: Description = Description {
        id: "spring-cubic",
        title: "nonlinear spring that precesses the pattern",
        stage: Stage::Mechanics,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("spring_cos", "rad/s", 10.0, 1e-2), fitted("spring_sin", "rad/s", 10.0, 1e-2)],
        onsets: &[],
        shown: &[Shown::Polar { cos: 0, sin: 1, magnitude: "p", unit: "rad/s", angle: "phase", division: 1.0 }],
        signature: "angle at 4θ, p/(4kΩ): dynamic, unlike the cubic readout",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "Hu and Gallacher 2019",
    };

    #[inline]
    fn mechanics<T: Real>(&[cos, sin, ..]: &Values<T>, e: &Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let p = e.pendulum();
        let (r2, s2) = (p.r * p.r, p.s * p.s);
        let size = r2 + s2;
        if size > T::zero() {
            // sin 4θ = 2RS/(R²+S²), cos 4θ = (R²−S²)/(R²+S²)
            let turned = (cos * T::two() * p.r * p.s + sin * (r2 - s2)) / size;
            precession(turned, e)
        } else {
            // A circular orbit, or none at all, has no orientation that could be turned.
            Envelope::zero()
        }
    }
}
