//! Cubic readout: X_d = X(1 + ¾κ_x|X|²), Y likewise. Differential parallel plates have κ = 1/gap².
//!
//! The two axes' coefficients are κ ± δκ: κ_x = κ + δκ, κ_y = κ − δκ.

use super::over_temperature::Followed;
use super::{Description, Effect, Inverse, Moment, Scaling, Shown, Stage, Values, fitted, refined};
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
    fn unread<T: Real>(p: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Cubic::new(p).undo(e)
    }

    fn inverse<T: Real>(p: &Values<T>) -> Inverse<T> {
        Inverse::Cubic(Cubic::new(p))
    }
}

impl Followed for DetectionCubic {
    const SLOPES: Description = Description {
        id: "cubic-temperature",
        title: "cubic readout that follows the temperature",
        in_sensors: false,
        parameters: &[fitted("kappa_per_k", "1/V^2/K", 1e5, 1e-4)],
        shown: &[Shown::Plain(0)],
        signature: "angle −(3/16)s(T − T₀)a² sin 4θ",
        source: "thermal expansion of the gap of the plates",
        ..Self::DESCRIPTION
    };
}

/// (c, s)·(1 + ¾κ(c² + s²)): the first harmonic of x + κx³.
#[inline]
fn cubed<T: Real>(kappa: T, c: T, s: T) -> (T, T) {
    let gain = T::one() + T::ratio(3, 4) * kappa * (c * c + s * s);
    (c * gain, s * gain)
}

/// The inverse of both channels' cubic: u = 1/gain is the root of k u³ + u = 1 with k = ¾κm² for the readout's size m.
///
/// The cubic is increasing for κ ≥ 0, and for κ < 0 as long as the readout is below its turning point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cubic<T> {
    /// ¾κ_x
    x: T,
    /// ¾κ_y
    y: T,
}

impl<T: Real> Cubic<T> {
    fn new(&[kappa, difference, ..]: &Values<T>) -> Self {
        let three_quarters = T::ratio(3, 4);
        Self { x: three_quarters * (kappa + difference), y: three_quarters * (kappa - difference) }
    }

    /// ¾κ of X and of Y.
    pub fn coefficients(&self) -> [T; 2] {
        [self.x, self.y]
    }

    /// The vibration behind the readout `e`.
    #[inline(always)]
    pub fn undo(&self, e: Envelope<T>) -> Envelope<T> {
        let k_x = self.x * (e.x_c * e.x_c + e.x_s * e.x_s);
        let k_y = self.y * (e.y_c * e.y_c + e.y_s * e.y_s);
        let k_2 = k_x * k_x + k_y * k_y;
        // false for NaN
        if k_2 * k_2 <= T::epsilon() {
            let (x, y) = (small_root(k_x), small_root(k_y));
            Envelope::new(e.x_c - e.x_c * x, e.x_s - e.x_s * x, e.y_c - e.y_c * y, e.y_s - e.y_s * y)
        } else {
            let (x, y) = (root(k_x), root(k_y));
            Envelope::new(e.x_c * x, e.x_s * x, e.y_c * y, e.y_s * y)
        }
    }
}

/// 1 − u for the root u of k u³ + u = 1 with a small k: the quotient of quadratics that agrees with
/// u = 1 − k + 3k² − 12k³ + 55k⁴ − … up to k⁴. It is off by 9|k|⁵: below ε/6 where k⁴ ≤ ε, for every ε of a machine.
#[inline(always)]
fn small_root<T: Real>(k: T) -> T {
    let (three, ten) = (T::ratio(3, 1), T::ratio(10, 1));
    k * (three + ten * k) / (three + k * (T::ratio(19, 1) + T::ratio(21, 1) * k))
}

/// The root u of k u³ + u = 1. Newton's first step from u = 1, then Halley's iteration.
#[inline(never)]
fn root<T: Real>(k: T) -> T {
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
    u
}

/// Halley steps of the inverse; from Newton's first they reach f64 rounding for |¾κm²| ≤ 0.1.
const HALLEY_STEPS: usize = 2;
