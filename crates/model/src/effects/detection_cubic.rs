//! Cubic readout: X_d = X(1 + ¾κ_x|X|²), Y likewise. Differential parallel plates have κ = 1/gap².
//!
//! The two axes' coefficients are κ ± δκ: κ_x = κ + δκ, κ_y = κ − δκ.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted, refined};
use crate::{Envelope, Real};

/// cubic readout of parallel plates.
pub struct DetectionCubic;

impl Effect for DetectionCubic {
    const DESCRIPTION: Description = Description {
        id: "detection-cubic",
        title: "cubic readout of parallel plates",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[fitted("kappa", "1/V^2", 1e6, 1e-3), refined("kappa_difference", "1/V^2", 1e6, 1e-3)],
        onsets: &[],
        shown: &[Shown::Plain(0), Shown::Plain(1)],
        signature: "angle −(3/16)κa² sin 4θ; amplitude ¾κa²(¾+¼cos 4θ)",
        scaling: Scaling { rate: 0, amplitude: 2, odd_in_rate: false },
        source: "Hu and Gallacher 2019; envelope of x + κx³",
    };

    #[inline]
    fn read<T: Real>(&[kappa, difference, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let (x_c, x_s) = cubed(kappa + difference, e.x_c, e.x_s);
        let (y_c, y_s) = cubed(kappa - difference, e.y_c, e.y_s);
        Envelope::new(x_c, x_s, y_c, y_s)
    }

    #[inline]
    fn unread<T: Real>(&[kappa, difference, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let (x_c, x_s) = uncubed(kappa + difference, e.x_c, e.x_s);
        let (y_c, y_s) = uncubed(kappa - difference, e.y_c, e.y_s);
        Envelope::new(x_c, x_s, y_c, y_s)
    }
}

/// (c, s)·(1 + ¾κ(c² + s²)): the first harmonic of x + κx³.
#[inline]
fn cubed<T: Real>(kappa: T, c: T, s: T) -> (T, T) {
    let gain = T::one() + T::ratio(3, 4) * kappa * (c * c + s * s);
    (c * gain, s * gain)
}

/// The inverse of [`cubed`]: u = 1/gain solves ¾κm²u³ + u = 1 for the readout's size m. Newton's first step from u = 1,
/// then Halley's iteration.
///
/// The cubic is increasing for κ ≥ 0, and for κ < 0 as long as the readout is below its turning point.
#[inline]
fn uncubed<T: Real>(kappa: T, c: T, s: T) -> (T, T) {
    let k = T::ratio(3, 4) * kappa * (c * c + s * s);
    let three_k = T::ratio(3, 1) * k;
    let first = T::one() + three_k;
    let mut u = if first > T::zero() { (first - k) / first } else { T::one() };
    for _ in 0..HALLEY_STEPS {
        let slope = three_k * u * u + T::one();
        let rest = k * u * u * u + u - T::one();
        let divisor = slope * slope - three_k * u * rest;
        if slope > T::zero() && divisor > T::zero() {
            u = u - rest * slope / divisor;
        }
    }
    (c * u, s * u)
}

/// Halley steps of the inverse; from Newton's first they reach f64 rounding for |¾κm²| ≤ 0.1.
const HALLEY_STEPS: usize = 2;
