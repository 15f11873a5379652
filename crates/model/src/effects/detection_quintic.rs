//! Quintic readout: X_d = X(1 + ⅝κ₅|X|⁴), Y likewise, the first harmonic of x + κ₅x⁵.
//!
//! At one amplitude it is a cubic readout, in the angle and in the amplitude; two amplitudes tell it from that.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// quintic readout of parallel plates.
pub struct DetectionQuintic;

impl Effect for DetectionQuintic {
    const DESCRIPTION: Description = Description {
        id: "detection-quintic",
        title: "quintic readout of parallel plates",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("kappa_5", "1/V^4", 1e6, 1e-3)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle −(5/32)κ₅a⁴ sin 4θ; amplitude ⅝κ₅a⁴(⅝+⅜cos 4θ)",
        scaling: Scaling { rate: 0, amplitude: 4, odd_in_rate: false },
        source: "next term of the cubic readout's series; envelope of x + κ₅x⁵",
    };

    #[inline]
    fn read<T: Real>(&[kappa, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let gain = |c: T, s: T| {
            let square = c * c + s * s;
            T::one() + T::ratio(5, 8) * kappa * square * square
        };
        let (x, y) = (gain(e.x_c, e.x_s), gain(e.y_c, e.y_s));
        Envelope::new(e.x_c * x, e.x_s * x, e.y_c * y, e.y_s * y)
    }

    #[inline]
    fn unread<T: Real>(&[kappa, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let share = |c: T, s: T| {
            let square = c * c + s * s;
            root(T::ratio(5, 8) * kappa * square * square)
        };
        let (x, y) = (share(e.x_c, e.x_s), share(e.y_c, e.y_s));
        Envelope::new(e.x_c * x, e.x_s * x, e.y_c * y, e.y_s * y)
    }
}

/// The root u of k u⁵ + u = 1 by Newton's iteration from u = 1: from above for k > 0, from below for k < 0, where the readout
/// is short of its turning point.
#[inline]
fn root<T: Real>(k: T) -> T {
    let mut u = T::one();
    for _ in 0..NEWTON_STEPS {
        let fourth = u * u * u * u;
        let slope = T::ratio(5, 1) * k * fourth + T::one();
        if slope > T::zero() {
            u = u - (k * fourth * u + u - T::one()) / slope;
        }
    }
    u
}

/// Steps that reach the rounding of f64 for |⅝κ₅a⁴| ≤ 0.08.
const NEWTON_STEPS: usize = 6;
