//! What a unit of each parameter does to amplitude, angle and ellipticity: the equation of motion, differentiated.
//!
//! With A the share of an error of the readout along the pattern and T that across it (over the amplitude),
//!
//! $$\frac{d}{dt}\ln a = f_u + r g_n - \tfrac1\tau - d_c c_2 - d_s s_2,\quad
//!   \dot\theta = f_n + d_c s_2 - d_s c_2 + (k_c c_2 + k_s s_2) r + b,\quad
//!   \dot\varepsilon = g_n - \tfrac12(k_c s_2 - k_s c_2) + q_0 - r f_u$$
//!
//! Ratio and skew of the detection, and its phase, have no part here: at rest they can't be told from the drives. What
//! excites them is the turn that no force explains ([`turned`]).

use cvg_model::{Float, Pendulum};

use crate::parameters::{OTHERS, Parameter, Vector, get};
use crate::window::{Push, Sample};

/// Amplitude, angle, ellipticity.
pub(crate) const CHANNELS: usize = 3;

/// A channel's row is made in this many parts: the readout; two of the drives; two of the mechanics.
pub(crate) const PARTS: usize = 5;
/// The first parameter of each, and the first after them. Detection has no part: what excites it is [`turned`].
const FIRST: [usize; PARTS + 1] = [
    0,
    Parameter::ForceScale as usize,
    Parameter::ForceRotation as usize,
    Parameter::Damping as usize,
    Parameter::SplitCos as usize,
    OTHERS,
];
const LARGEST: usize = 4;

/// A part of a channel's row: what each of some parameters does, in its own unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part<T> {
    pub(crate) first: usize,
    pub(crate) end: usize,
    /// rates
    pub(crate) rate: [T; LARGEST],
    /// what shows at once
    pub(crate) direct: [T; LARGEST],
}

/// Part `n` of channel `c`'s row.
///
/// Without a precession that is known, force scale, damping and split are one thing: then, without `scaled_forces`, the
/// scale is not excited, and the others are what they are in units of the force.
#[inline(always)]
pub(crate) fn part<T: Float>(s: &Sample<T>, known: &Vector<T>, c: usize, scaled_forces: bool, n: usize) -> Part<T> {
    let at = |k: usize| FIRST.get(k).copied().unwrap_or(OTHERS);
    let mut direct = [T::zero(); LARGEST];
    let rate = match n {
        0 => of_the_readout(s, known, c, &mut direct),
        1 => of_the_drives(s, c, scaled_forces),
        2 => of_their_phases(s, c),
        3 => of_the_damping(s, c),
        _ => of_the_split(s, c),
    };
    Part { first: at(n), end: at(n + 1), rate, direct }
}

/// Offsets and cubic, with what shows of them at once.
fn of_the_readout<T: Float>(s: &Sample<T>, known: &Vector<T>, c: usize, direct: &mut [T; LARGEST]) -> [T; LARGEST] {
    let (zero, quarter) = (T::zero(), T::ratio(1, 4));
    let (c1, s1, c2, s2) = (s.cos, s.sin, s.cos_2, s.sin_2);
    let (c4, s4) = (c2 * c2 - s2 * s2, T::two() * c2 * s2);
    let p = &s.push;
    let along = [c1 * s.per_amplitude, s1 * s.per_amplitude, quarter * c4, zero];
    let across = [-s1 * s.per_amplitude, c1 * s.per_amplitude, -quarter * s4, zero];
    // of the share along the pattern, and of that across it
    let (of_along, of_across) = match c {
        0 => {
            *direct = along;
            (p.along, -p.aside)
        }
        1 => {
            *direct = across;
            (p.aside, p.along)
        }
        _ => (p.quadrature, get(known, Parameter::SplitCos) * c2 + get(known, Parameter::SplitSin) * s2),
    };
    let mut rate = [zero; LARGEST];
    for ((rate, a), t) in rate.iter_mut().zip(along).zip(across) {
        *rate = a * of_along + t * of_across;
    }
    rate
}

/// Scale, ratio and skew.
fn of_the_drives<T: Float>(s: &Sample<T>, c: usize, scaled_forces: bool) -> [T; LARGEST] {
    let (c1, s1, p, zero) = (s.cos, s.sin, &s.push, T::zero());
    let fx = p.along * c1 - p.aside * s1;
    let fy = p.along * s1 + p.aside * c1;
    let [scale, ratio, skew] = match c {
        0 => [p.along, fy * s1, fx * s1],
        1 => [p.aside, fy * c1, fx * c1],
        _ => {
            let gx = p.across * c1 - p.quadrature * s1;
            let gy = p.across * s1 + p.quadrature * c1;
            [p.quadrature, gy * c1, gx * c1]
        }
    };
    [if scaled_forces { scale } else { zero }, ratio, skew, zero]
}

/// Rotation of the forces' frame, phase and phase difference.
fn of_their_phases<T: Float>(s: &Sample<T>, c: usize) -> [T; LARGEST] {
    let (c1, s1, p, zero) = (s.cos, s.sin, &s.push, T::zero());
    let gy = p.across * s1 + p.quadrature * c1;
    match c {
        0 => [-p.aside, p.across, gy * s1, zero],
        1 => [p.along, p.quadrature, gy * c1, zero],
        _ => [p.across, -p.aside, -((p.along * s1 + p.aside * c1) * c1), zero],
    }
}

/// Damping and anisodamping.
fn of_the_damping<T: Float>(s: &Sample<T>, c: usize) -> [T; LARGEST] {
    let zero = T::zero();
    match c {
        0 => [-T::one(), -s.cos_2, -s.sin_2, zero],
        1 => [zero, s.sin_2, -s.cos_2, zero],
        _ => [zero; LARGEST],
    }
}

/// Split, constant rates of quadrature and of the pattern.
fn of_the_split<T: Float>(s: &Sample<T>, c: usize) -> [T; LARGEST] {
    let (zero, half, one) = (T::zero(), T::half(), T::one());
    match c {
        0 => [zero; LARGEST],
        1 => [s.cos_2 * s.r, s.sin_2 * s.r, zero, one],
        _ => [-(half * s.sin_2), half * s.cos_2, one, zero],
    }
}

/// What a turn of `turn` rad that no force explains shows of the detection in channel `c`: half of it at this cycle's
/// angle.
pub(crate) fn turned<T: Float>(c: usize, cos_2: T, sin_2: T, turn: T) -> [T; 3] {
    let zero = T::zero();
    let unit = |p: Parameter| p.expected::<T>() * turn;
    match c {
        0 => [zero, sin_2 * unit(Parameter::DetectionRatio), cos_2 * unit(Parameter::DetectionSkew)],
        1 => [zero; 3],
        _ => [cos_2 * unit(Parameter::DetectionPhase), zero, zero],
    }
}

/// The rates of the three channels as far as they are known, for pushes over the amplitude and `r` = ½Q/√(E² − Q²).
#[inline]
pub(crate) fn known_rates<T: Float>(p: &Push<T>, r: T, (c2, s2): (T, T), known: &Vector<T>) -> [T; 3] {
    let k = |p| get(known, p);
    let (dc, ds) = (k(Parameter::AnisodampingCos), k(Parameter::AnisodampingSin));
    let (kc, ks) = (k(Parameter::SplitCos), k(Parameter::SplitSin));
    [
        p.along + r * p.quadrature - k(Parameter::Damping) - dc * c2 - ds * s2,
        p.aside + dc * s2 - ds * c2 + (kc * c2 + ks * s2) * r + k(Parameter::Rate),
        p.quadrature - T::half() * (kc * s2 - ks * c2) + k(Parameter::QuadratureRate) - r * p.along,
    ]
}

/// [`known_rates`] of any orbit, however far from a line: with ε its ellipticity, of an amplitude √E,
///
/// $$\frac{d}{dt}\tfrac12\ln E = f_u\cos\varepsilon + g_n\sin\varepsilon - \tfrac1\tau - d_2\cos 2\varepsilon + q_0\sin 2\varepsilon,\quad
///   \dot\theta = \frac{f_n\cos\varepsilon + g_u\sin\varepsilon - d_3}{\cos 2\varepsilon} + \chi r + b,\quad
///   \dot\varepsilon = g_n\cos\varepsilon - f_u\sin\varepsilon + d_2\sin 2\varepsilon + \tfrac12\kappa_3 + q_0\cos 2\varepsilon$$
///
/// with (d_2, d_3) and (χ, κ_3) the anisotropies along the orbit: d_2 = d_c c_2 + d_s s_2, d_3 = d_s c_2 − d_c s_2.
#[inline]
pub(crate) fn exact_rates<T: Float>(push: &Push<T>, p: &Pendulum<T>, (c2, s2): (T, T), known: &Vector<T>) -> [T; 3] {
    let k = |p| get(known, p);
    let f = push.over(T::one() / p.e.sqrt());
    let sin_2e = p.q / p.e;
    let cos_2e = (T::one() - sin_2e * sin_2e).sqrt();
    let cos = (T::half() * (T::one() + cos_2e)).sqrt();
    let sin = T::half() * sin_2e / cos;
    let along = |c, s| (k(c) * c2 + k(s) * s2, k(s) * c2 - k(c) * s2);
    let (d2, d3) = along(Parameter::AnisodampingCos, Parameter::AnisodampingSin);
    let (chi, k3) = along(Parameter::SplitCos, Parameter::SplitSin);
    let (half, q0) = (T::half(), k(Parameter::QuadratureRate));
    [
        f.along * cos + f.quadrature * sin - k(Parameter::Damping) - d2 * cos_2e + q0 * sin_2e,
        (f.aside * cos + f.across * sin - d3 + half * chi * sin_2e) / cos_2e + k(Parameter::Rate),
        f.quadrature * cos - f.along * sin + d2 * sin_2e + half * k3 + q0 * cos_2e,
    ]
}
