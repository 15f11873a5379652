//! What is left when no physical effect explains it: θ_d += A f(Ω) cos(nθ + phase), resolved into (A cos phase,
//! A sin phase).
//!
//! How it scales with the precession rate Ω_p is one of four: f = 1, its sign, Ω_p itself, or 1/Ω_p (Ω_p in rad/s). With
//! n = 0 and the sign it is a step between the directions, as backlash makes.

use super::{
    Belief, Description, Effect, Moment, Parameter, Role, Scaling, Search, Shown, Stage, Values, fitted, searched,
};
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
            searched("n", "1", 0.0, 720.0, Search::PatternHarmonic),
            fitted("harmonic_cos", "rad", 0.5, 1e-3),
            fitted("harmonic_sin", "rad", 0.5, 1e-3),
            Parameter {
                name: "scaling",
                unit: "1",
                lower: 0.0,
                upper: 3.0,
                neutral: scaling::CONSTANT,
                scale: 1.0,
                role: Role::Chosen(&[scaling::CONSTANT, scaling::DIRECTION, scaling::RATE, scaling::INVERSE_RATE]),
                belief: Belief::Vague,
            },
        ],
        onsets: &[],
        shown: &[
            Shown::Plain(0),
            Shown::Polar { cos: 1, sin: 2, magnitude: "amplitude", unit: "rad", angle: "phase", division: 1.0 },
            Shown::Plain(3),
        ],
        signature: "angle at nθ",
        scaling: Scaling { rate: 0, amplitude: 0, odd_in_rate: false },
        source: "none: empirical",
    };

    #[inline]
    fn read<T: Real>(&[n, cos, sin, scaling]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let (sin_n, cos_n) = (n * direction(&e)).sin_cos();
        let size = factor(scaling, at.precession_rad_s);
        let (s, c) = (size * (cos * cos_n - sin * sin_n)).sin_cos();
        e.turned(s, c)
    }

    /// The vibration lies at θ with θ + A f cos(nθ + phase) = θ_d: Newton's iteration from θ_d.
    #[inline]
    fn unread<T: Real>(&[n, cos, sin, scaling]: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let seen = direction(&e);
        let size = factor(scaling, at.precession_rad_s);
        let mut back = T::zero();
        for _ in 0..NEWTON_STEPS {
            let (sin_n, cos_n) = (n * (seen + back)).sin_cos();
            let slope = T::one() - n * size * (cos * sin_n + sin * cos_n);
            if slope > T::zero() {
                back = back - (back + size * (cos * cos_n - sin * sin_n)) / slope;
            }
        }
        let (s, c) = back.sin_cos();
        e.turned(s, c)
    }
}

/// Newton steps of the inverse; from θ_d they reach f64 rounding for n A f ≤ 0.3.
const NEWTON_STEPS: usize = 4;

/// Values of the parameter `scaling`.
pub mod scaling {
    /// the same at every rate
    pub const CONSTANT: f64 = 0.0;
    /// changes sign with the direction
    pub const DIRECTION: f64 = 1.0;
    /// proportional to the precession rate
    pub const RATE: f64 = 2.0;
    /// inversely proportional to it
    pub const INVERSE_RATE: f64 = 3.0;
}

/// f(Ω_p); 0 at rest where it follows the direction or the inverse of the rate.
#[inline]
pub fn factor<T: Real>(scaling: T, precession_rad_s: T) -> T {
    let one = T::one();
    let up_to = |steps: i32| scaling < T::ratio(2 * steps + 1, 2);
    let direction = if precession_rad_s > T::zero() {
        one
    } else if precession_rad_s < T::zero() {
        -one
    } else {
        T::zero()
    };
    if up_to(0) {
        one
    } else if up_to(1) {
        direction
    } else if up_to(2) {
        precession_rad_s
    } else if direction == T::zero() {
        direction
    } else {
        one / precession_rad_s
    }
}

/// The direction of the vibration over the full turn, rad: that of the axis which carries the in-phase part.
///
/// Odd harmonics exist only because the reference phase tells θ from θ + 180°.
#[inline]
fn direction<T: Real>(e: &Envelope<T>) -> T {
    e.y_c.atan2(e.x_c)
}
