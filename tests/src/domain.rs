//! The domains: what a whole-angle gyroscope can be and do, as strategies for random tests.

use core::f64::consts::PI;

use cvg_model::{ActuationGains, ControlOutputs, DetectionGains, Envelope, Orbit};
use cvg_prover::Interval;
use proptest::prelude::*;

use crate::Scalar;

/// Pattern angles over several turns in both directions, rad; multiples of 45° are among them.
pub fn angles() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -4.0 * PI..4.0 * PI, 1 => (-16..=16_i32).prop_map(|n| f64::from(n) * PI / 4.0)]
}

/// A size over six decades: volts, microns and force per volt are all in it.
pub fn sizes() -> impl Strategy<Value = f64> {
    (-3.0..3.0_f64).prop_map(|decades| 10_f64.powf(decades))
}

/// Ratios of two gains as far as an identification looks for them, those of real electronics (a few percent) often.
pub fn ratios() -> impl Strategy<Value = f64> {
    prop_oneof![3 => 0.95..1.05_f64, 2 => (0.2_f64.ln()..5_f64.ln()).prop_map(f64::exp), 1 => Just(1.0)]
}

/// Detection gains of one sign, at any scale.
pub fn detection_gains() -> impl Strategy<Value = DetectionGains<f64>> {
    (sizes(), ratios(), any::<bool>()).prop_map(|(x, ratio, negative)| {
        let x = if negative { -x } else { x };
        DetectionGains { x, y: x * ratio }
    })
}

/// Actuation gains, at any scale.
pub fn actuation_gains() -> impl Strategy<Value = ActuationGains<f64>> {
    (sizes(), ratios()).prop_map(|(y, ratio)| ActuationGains { x: y * ratio, y })
}

/// Controller outputs of either sign within a volt.
pub fn outputs() -> impl Strategy<Value = ControlOutputs<f64>> {
    (-1.0..1.0_f64, -1.0..1.0_f64).prop_map(|(v_as, v_qc)| ControlOutputs { v_as, v_qc })
}

/// Any vibration: four components within one size.
pub fn envelopes() -> impl Strategy<Value = Envelope<f64>> {
    let part = || -1.0..1.0_f64;
    (sizes(), part(), part(), part(), part())
        .prop_map(|(size, x_c, x_s, y_c, y_s)| Envelope::new(x_c, x_s, y_c, y_s) * size)
}

/// Orbits with |q| ≤ 0.9 a, at every orientation and at phase errors short of ±90°.
pub fn orbits() -> impl Strategy<Value = Orbit<f64>> {
    (sizes(), -0.9..0.9_f64, -PI..PI, -1.5..1.5_f64).prop_map(|(a, q, theta, delta)| Orbit {
        a,
        q: a * q,
        theta,
        delta,
    })
}

/// Line orbits in phase with the reference, as the quadrature and the phase-locked loop keep them.
pub fn line_orbits() -> impl Strategy<Value = Orbit<f64>> {
    (sizes(), angles()).prop_map(|(a, theta)| Orbit { a, q: 0.0, theta, delta: 0.0 })
}

/// Any number that the scalar can hold, by its bits: NaN, infinities, subnormals and signed zeros often.
pub fn patterns<T: Scalar>() -> impl Strategy<Value = T> {
    let special = [0.0, -0.0, 1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-310, 1e-40, 1e38, 1e308, PI];
    prop_oneof![
        3 => any::<u64>().prop_map(T::from_pattern),
        1 => proptest::sample::select(special.to_vec()).prop_map(T::from_f64),
    ]
}

/// Any envelope that the scalar can hold.
pub fn envelope_patterns<T: Scalar>() -> impl Strategy<Value = Envelope<T>> {
    let part = patterns::<T>;
    (part(), part(), part(), part()).prop_map(|(x_c, x_s, y_c, y_s)| Envelope::new(x_c, x_s, y_c, y_s))
}

/// Several turns in both directions: the angles of every interval bound.
pub fn any_angle() -> Interval {
    Interval::new(-4.0 * PI, 4.0 * PI)
}

/// Ratios of two gains as far as an identification looks for them.
pub fn any_ratio() -> Interval {
    Interval::new(0.2, 5.0)
}

/// −1 to 1
pub fn unit() -> Interval {
    Interval::new(-1.0, 1.0)
}

/// ½ to 1: every positive number times a power of two. Such a factor changes no rounding as long as nothing overflows or
/// underflows, so that a bound which is relative to it holds at every scale.
pub fn octave() -> Interval {
    Interval::new(0.5, 1.0)
}

/// Vectors of `n` components of which one is the largest in magnitude, at every scale and up to their common sign.
pub fn any_vector(n: usize) -> Vec<Vec<Interval>> {
    (0..n).map(|largest| (0..n).map(|k| if k == largest { octave() } else { unit() }).collect()).collect()
}

/// `angle` less the nearest multiple of `period`.
pub fn wrapped(angle: f64, period: f64) -> f64 {
    angle - period * (angle / period).round()
}
