//! What the calibrator believes of a device against what the device does, written out here: by differences of its own
//! readout and drives, by dense matrices, and by hand.
#![allow(clippy::needless_range_loop, reason = "vectors and matrices are written with their indices")]

extern crate std;

mod commits;
mod cycles;
mod mechanics;
mod precision;
mod schedule;
mod sums;

use cvg_model::Envelope;

use crate::complex::Complex;
use crate::parameters::{N, Parameter, Vector};
use crate::regressors::{PARTS, part};
use crate::window::Sample;
use crate::{Calibrator, Settings};

/// No two of the settings are the same number, and none is one.
pub(crate) fn settings() -> Settings {
    Settings { amplitude_v: 1.6, drive_per_s: 2.5, damping_per_s: 0.04, steps: 80, ..Settings::default() }
}

pub(crate) fn calibrator() -> Calibrator<f64> {
    Calibrator::new(&settings()).expect("inside its domain")
}

#[test]
fn a_cycle_lasts_ten_to_a_hundred_milliseconds() {
    let of = |control_s: f64, steps: u16| Calibrator::<f64>::new(&Settings { control_s, steps, ..settings() });
    for (control_s, steps) in [(1.3e-4, 80), (1e-3, 80), (1e-3, 99), (5e-4, 200)] {
        of(control_s, steps).expect("inside");
    }
    for (control_s, steps) in [(1.2e-4, 80), (1e-3, 101), (1e-3, 79), (f64::NAN, 80)] {
        assert_eq!(of(control_s, steps).expect_err("outside").parameter, "steps", "{control_s} {steps}");
    }
}

/// Every parameter by itself, in the order in which they stand: what is expected of it, and what it may wander in a root second.
#[test]
fn what_is_expected_of_a_device_and_what_may_wander() {
    let table = [
        (1e-3, 2e-7),
        (1e-3, 2e-7),
        (7.5e-3, 1e-6),
        (0.1, 1e-5),
        (0.04, 1.2e-5),
        (8e-3, 1.2e-5),
        (8e-3, 2e-6),
        (0.02, 1e-6),
        (0.01, 1e-6),
        (0.1, 3e-6),
        (0.01, 1e-6),
        (0.01, 1e-6),
        (2.0, 3e-5),
        (2.0, 3e-5),
        (0.1, 1e-6),
        (0.02, 3e-6),
        (0.01, 1e-6),
        (0.03, 1.2e-5),
        (6e-3, 1.2e-5),
    ];
    assert_eq!(Parameter::ALL.map(|p| (p.expected::<f64>(), p.wander::<f64>())), table);
    assert_eq!(Parameter::ALL.map(|p| p as usize), core::array::from_fn(|j| j));
}

/// A channel's whole row, and what shows at once.
fn rates(s: &Sample<f64>, known: &Vector<f64>, c: usize, scaled_forces: bool) -> (Vector<f64>, Vector<f64>) {
    let (mut h, mut direct) = ([0.0; N], [0.0; N]);
    for n in 0..PARTS {
        let part = part(s, known, c, scaled_forces, n);
        for (k, j) in (part.first..part.end).enumerate() {
            let unit = Parameter::ALL[j].expected::<f64>();
            (h[j], direct[j]) = (part.rate[k] * unit, part.direct[k] * unit);
        }
    }
    (h, direct)
}

/// One parameter moved by a value in its own unit.
fn unit(p: Parameter, value: f64) -> Vector<f64> {
    let mut v = [0.0; N];
    v[p as usize] = value;
    v
}

/// X and Y as phasors x_c − i x_s.
fn phasors(e: &Envelope<f64>) -> (Complex<f64>, Complex<f64>) {
    (Complex::new(e.x_c, -e.x_s), Complex::new(e.y_c, -e.y_s))
}

fn envelope((x, y): (Complex<f64>, Complex<f64>)) -> Envelope<f64> {
    Envelope::new(x.re, -x.im, y.re, -y.im)
}

/// A thin ellipse of amplitude `a`, ellipticity `epsilon`, at `theta`.
fn orbit(a: f64, epsilon: f64, theta: f64) -> Envelope<f64> {
    cvg_model::Orbit { a: a * epsilon.cos(), q: a * epsilon.sin(), theta, delta: 0.0 }.envelope()
}

/// ln of the amplitude, angle, ellipticity.
fn shape(e: &Envelope<f64>) -> [f64; 3] {
    let p = e.pendulum();
    [0.5 * p.e.ln(), p.angle(), 0.5 * (p.q / p.e).asin()]
}

/// The difference of two shapes, the angle within a quarter turn.
fn apart(a: &Envelope<f64>, b: &Envelope<f64>) -> [f64; 3] {
    let ([l0, t0, e0], [l1, t1, e1]) = (shape(a), shape(b));
    let turn = t0 - t1;
    [l0 - l1, turn - core::f64::consts::PI * (turn / core::f64::consts::PI).round(), e0 - e1]
}

#[track_caller]
pub(crate) fn near(got: f64, expected: f64, tolerance: f64) {
    assert!((got - expected).abs() <= tolerance, "{got} and not {expected}");
}
