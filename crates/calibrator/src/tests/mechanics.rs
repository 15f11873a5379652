//! Readout, drives and equation of motion: each regressor is the slope of what the device itself would show.

use core::f64::consts::PI;

use cvg_model::{AxisForces, Envelope, Pendulum};

use super::*;
use crate::Commands;
use crate::complex::{Complex, Matrix};
use crate::correction::Correction;
use crate::parameters::Parameter as P;
use crate::regressors::{exact_rates, known_rates, turned};
use crate::window::{Push, Sample};

const MECHANICAL: [P; 7] =
    [P::Damping, P::AnisodampingCos, P::AnisodampingSin, P::SplitCos, P::SplitSin, P::QuadratureRate, P::Rate];

/// Angles in every octant.
fn angles() -> impl Iterator<Item = f64> {
    (-12..=12).map(|k| 0.013 + f64::from(k) * PI / 12.0)
}

/// A sample at `theta`, of a vibration with these pushes.
fn sample(theta: f64, r: f64, push: Push<f64>) -> Sample<f64> {
    let (sin, cos) = theta.sin_cos();
    let (sin_2, cos_2) = (2.0 * theta).sin_cos();
    Sample { per_amplitude: 0.8, r, push, cos, sin, cos_2, sin_2, ..Sample::blank() }
}

fn push(along: f64, aside: f64, quadrature: f64, across: f64) -> Push<f64> {
    Push { along, aside, quadrature, across }
}

fn none() -> Push<f64> {
    push(0.0, 0.0, 0.0, 0.0)
}

/// The equation of motion at rest, from its textbook form and not from the calibrator's matrix.
fn moved_by(known: &Vector<f64>, e: &Envelope<f64>) -> Envelope<f64> {
    let k = |p: P| known[p as usize];
    let (x, y) = phasors(e);
    let half_i = |re: f64| Complex::new(0.0, 0.5 * re);
    let real = Complex::real;
    // damping, its difference along and across the axes, the split a quarter of a period ahead
    let xx = real(-k(P::Damping) - k(P::AnisodampingCos)) - half_i(k(P::SplitCos));
    let yy = real(-k(P::Damping) + k(P::AnisodampingCos)) + half_i(k(P::SplitCos));
    let both = real(-k(P::AnisodampingSin)) - half_i(k(P::SplitSin));
    // a rate turns X into Y, a rate of quadrature likewise a quarter of a period off
    let (b, q) = (real(k(P::Rate)), Complex::new(0.0, k(P::QuadratureRate)));
    envelope((xx * x + (both - b + q) * y, (both + b - q) * x + yy * y))
}

#[test]
fn what_is_known_moves_the_orbit_as_the_equation_of_motion_does() {
    let known = {
        let mut v = [0.0; N];
        for (p, value) in MECHANICAL.iter().zip([0.04, 0.011, -0.017, 1.3, -2.1, 0.06, 0.03]) {
            v[*p as usize] = value;
        }
        v
    };
    for theta in angles() {
        for epsilon in [0.0, 1e-3, -1e-3] {
            let e = orbit(1.0, epsilon, theta);
            let rate = moved_by(&known, &e);
            let (p, d) = (e.pendulum(), e.pendulum_rate(&rate));
            let ellipticity = 0.5 * (d.q * p.e - p.q * d.e) / (p.e * (p.e * p.e - p.q * p.q).sqrt());
            let expected = [0.5 * d.e / p.e, e.precession(&rate), ellipticity];
            let (sin_2, cos_2) = (2.0 * theta).sin_cos();
            let r = 0.5 * p.q / (p.e * p.e - p.q * p.q).sqrt();
            let got = known_rates(&none(), r, (cos_2, sin_2), &known);
            // of the first order in the ellipticity
            for (got, expected) in got.into_iter().zip(expected) {
                near(got, expected, 0.2 * epsilon.abs() + 1e-14);
            }
            // the angle feels the split through the quadrature, to the first order too
            near(got[1], expected[1], 10.0 * epsilon * epsilon + 1e-14);
        }
    }
}

#[test]
fn a_replayed_orbit_moves_as_the_equation_of_motion_does_however_far_from_a_line_it_is() {
    let known = {
        let mut v = [0.0; N];
        for (p, value) in MECHANICAL.iter().zip([0.04, 0.011, -0.017, 1.3, -2.1, 0.06, 0.03]) {
            v[*p as usize] = value;
        }
        v
    };
    for theta in angles() {
        for epsilon in [0.0, 0.05, -0.2, 0.3] {
            let e = orbit(1.1, epsilon, theta);
            let f = push(0.3, 0.5, 0.7, 0.2);
            // forces along the orbit, turned onto the axes: a force in quadrature is a quarter of a period off
            let (u, n) = (Complex::new(f.along, -f.across), Complex::new(f.aside, -f.quadrature));
            let (sin, cos) = theta.sin_cos();
            let (c, s) = (Complex::real(cos), Complex::real(sin));
            let rate = moved_by(&known, &e) + envelope((c * u - s * n, s * u + c * n));
            let (p, d) = (e.pendulum(), e.pendulum_rate(&rate));
            let ellipticity = 0.5 * (d.q * p.e - p.q * d.e) / (p.e * (p.e * p.e - p.q * p.q).sqrt());
            let expected = [0.5 * d.e / p.e, e.precession(&rate), ellipticity];
            let (sin_2, cos_2) = (2.0 * theta).sin_cos();
            let got = exact_rates(&f, &p, (cos_2, sin_2), &known);
            for (got, expected) in got.into_iter().zip(expected) {
                near(got, expected, 1e-12);
            }
        }
    }
}

#[test]
fn a_push_moves_what_it_is_along() {
    let zeros = [0.0; N];
    let got = known_rates(&push(0.3, 0.5, 0.7, 0.9), 0.01, (0.6, 0.8), &zeros);
    near(got[0], 0.3 + 0.01 * 0.7, 1e-15);
    near(got[1], 0.5, 1e-15);
    near(got[2], 0.7 - 0.01 * 0.3, 1e-15);
}

#[test]
fn mechanical_regressors_are_the_slopes_of_the_equation_of_motion() {
    for theta in angles() {
        for r in [0.0, 0.02, -0.02] {
            let s = sample(theta, r, push(0.3, -0.2, 0.1, 0.05));
            let zeros = [0.0; N];
            for p in MECHANICAL {
                let at = |v: f64| known_rates(&s.push, r, (s.cos_2, s.sin_2), &unit(p, v));
                for c in 0..3 {
                    let slope = (at(1.0)[c] - at(-1.0)[c]) / 2.0;
                    near(rates(&s, &zeros, c, true).0[p as usize], slope * p.expected::<f64>(), 1e-15);
                }
            }
        }
    }
}

/// The push of wanted forces through drives, at `theta`: a force in sine phase against the vibration, one in cosine phase
/// along its quadrature.
fn through(drives: &Matrix<f64>, f: &AxisForces<f64>, theta: f64) -> Push<f64> {
    let (x, y) = drives.apply(Complex::new(f.x_s, f.x_c), Complex::new(f.y_s, f.y_c));
    let (sin, cos) = theta.sin_cos();
    push(-(x.re * cos + y.re * sin), x.re * sin - y.re * cos, y.im * cos - x.im * sin, x.im * cos + y.im * sin)
}

#[test]
fn regressors_of_the_drives_are_the_slopes_of_what_they_push() {
    let forces = [
        AxisForces { x_c: 0.0, x_s: 0.7, y_c: 0.0, y_s: -0.4 },
        AxisForces { x_c: 0.3, x_s: 0.0, y_c: -0.6, y_s: 0.0 },
        AxisForces { x_c: 0.3, x_s: 0.7, y_c: -0.6, y_s: 0.2 },
    ];
    let of_drives =
        [P::ForceScale, P::ForceRatio, P::ForceSkew, P::ForceRotation, P::ForcePhase, P::ForcePhaseDifference];
    let zeros = [0.0; N];
    for theta in angles() {
        for f in &forces {
            let s = sample(theta, 0.0, through(&Matrix::identity(), f, theta));
            for p in of_drives {
                let at = |v: f64| {
                    let moved = Correction::none(0.04).moved(&unit(p, v)).expect("a device");
                    let p = through(&moved.drives, f, theta);
                    [p.along, p.aside, p.quadrature]
                };
                for c in 0..3 {
                    let slope = (at(1e-3)[c] - at(-1e-3)[c]) / 2e-3;
                    let (h, direct) = rates(&s, &zeros, c, true);
                    near(h[p as usize], slope * p.expected::<f64>(), 1e-12);
                    assert_eq!(direct[p as usize], 0.0);
                }
            }
            let unscaled = rates(&s, &zeros, 0, false).0;
            assert_eq!(unscaled[P::ForceScale as usize], 0.0, "nothing tells the scale");
            assert_eq!(unscaled[P::ForceRatio as usize], rates(&s, &zeros, 0, true).0[P::ForceRatio as usize]);
        }
    }
}

/// How the vibration that is believed moves where a parameter of the readout does.
fn slope(p: P, e: &Envelope<f64>, by: f64) -> [f64; 3] {
    let c = calibrator();
    let with = |v: f64| c.readout(&c.start_from(&unit(p, v)).expect("a device"), e);
    apart(&with(-by), &with(by)).map(|d| d / (2.0 * by))
}

#[test]
fn an_offset_and_a_cubic_show_at_once_what_the_readout_makes_of_them() {
    let zeros = [0.0; N];
    for theta in angles() {
        // an amplitude of 1.25 times the set one: an offset counts less
        let s = sample(theta, 0.0, none());
        let e = orbit(1.25 * 1.6, 0.0, theta);
        for p in [P::OffsetX, P::OffsetY] {
            let shown = slope(p, &e, 1e-4);
            for c in 0..2 {
                near(rates(&s, &zeros, c, true).1[p as usize], shown[c] * p.expected::<f64>(), 1e-9);
            }
        }
        let e = orbit(1.6, 0.0, theta);
        let shown = slope(P::Cubic, &e, 1e-5);
        let unit = P::Cubic.expected::<f64>();
        // what is the same at every angle is no error of the angle's
        near(rates(&s, &zeros, 0, true).1[P::Cubic as usize], (shown[0] - 0.75) * unit, 1e-8);
        near(rates(&s, &zeros, 1, true).1[P::Cubic as usize], shown[1] * unit, 1e-8);
        assert_eq!(rates(&s, &zeros, 2, true).1, zeros);
    }
}

#[test]
fn a_turn_shows_of_the_detection_what_the_readout_makes_of_it() {
    for theta in angles() {
        for (place, p) in [P::DetectionPhase, P::DetectionRatio, P::DetectionSkew].into_iter().enumerate() {
            let turn = 1e-3;
            let at = |theta: f64| slope(p, &orbit(1.6, 0.0, theta), 1e-4);
            let (before, after) = (at(theta - 0.5 * turn), at(theta + 0.5 * turn));
            let (sin_2, cos_2) = (2.0 * theta).sin_cos();
            for c in [0, 2] {
                let got = turned(c, cos_2, sin_2, turn)[place];
                near(got, (after[c] - before[c]) * p.expected::<f64>(), 1e-8 * p.expected::<f64>());
            }
            assert_eq!(turned(1, cos_2, sin_2, turn), [0.0; 3], "the angle itself turns");
        }
    }
}

#[test]
fn a_readout_error_rotates_the_pushes_that_the_loops_see() {
    // seen along an axis that is off by t, and larger by a
    for theta in angles() {
        let s = sample(theta, 0.0, push(0.3, -0.2, 0.1, 0.05));
        let known = unit(P::SplitSin, 1.4);
        let chi = 1.4 * s.sin_2;
        let of = |p: P, c: usize| rates(&s, &known, c, true).0[p as usize] / p.expected::<f64>();
        let (sin, cos) = (s.sin * s.per_amplitude, s.cos * s.per_amplitude);
        let (sin_4, cos_4) = (4.0 * theta).sin_cos();
        for (p, a, t) in [(P::OffsetX, cos, -sin), (P::OffsetY, sin, cos), (P::Cubic, 0.25 * cos_4, -0.25 * sin_4)] {
            near(of(p, 0), a * 0.3 + t * 0.2, 1e-13);
            near(of(p, 1), t * 0.3 - a * 0.2, 1e-13);
            near(of(p, 2), t * chi + a * 0.1, 1e-13);
        }
    }
}

#[test]
fn a_new_detection_sees_the_mechanics_and_the_drives_anew() {
    let mut known = [0.0; N];
    for (p, value) in MECHANICAL.iter().zip([0.05, 0.011, -0.017, 1.3, -2.1, 0.06, 0.03]) {
        known[*p as usize] = value;
    }
    let drives = Matrix {
        xx: Complex::new(1.1, 0.05),
        xy: Complex::real(0.04),
        yx: Complex::real(-0.03),
        yy: Complex::new(0.9, -0.02),
    };
    let before = Correction::of(known, Complex::new(1.05, -0.02), Complex::new(0.03, 0.01), drives).expect("a device");
    let (ratio, skew, phase) = (0.02, -0.015, 0.012);
    let mut delta = [0.0; N];
    (delta[P::DetectionRatio as usize], delta[P::DetectionSkew as usize]) = (ratio, skew);
    delta[P::DetectionPhase as usize] = phase;
    let after = before.moved(&delta).expect("a device");
    // what the new readout makes of the old one's envelope
    let old = |e: &Envelope<f64>| before.readout(e, 1.6, 1.0 / 1.6);
    let new = |e: &Envelope<f64>| after.readout(e, 1.6, 1.0 / 1.6);
    let through_new = |e: &Envelope<f64>| {
        let (x, y) = phasors(e);
        let (sin, cos) = f64::sin_cos(phase);
        let y_of_y = Complex::new((1.0 + ratio) * cos, -((1.0 + ratio) * sin));
        envelope((x, Complex::real(skew) * x + y_of_y * y))
    };
    for theta in angles() {
        let e = orbit(1.6, 0.1, theta);
        let gap = old(&e) - through_new(&new(&e));
        near(gap.pendulum().e, 0.0, 1e-28);
    }
    // the equation of motion of the one, seen by the other: what its seven numbers can say of it
    let seen = |x: Complex<f64>, y: Complex<f64>| {
        let (sin, cos) = f64::sin_cos(phase);
        let y_of_y = Complex::new((1.0 + ratio) * cos, -((1.0 + ratio) * sin));
        let old = moved_by(&before.known, &through_new(&envelope((x, y))));
        let (x, y) = phasors(&old);
        (x, (y - Complex::real(skew) * x) * y_of_y.inverse())
    };
    let (zero, one) = (Complex::real(0.0), Complex::real(1.0));
    let gap = |x, y| {
        let (got, expected) = (phasors(&moved_by(&after.known, &envelope((x, y)))), seen(x, y));
        (got.0 - expected.0, got.1 - expected.1)
    };
    let ((xx, yx), (xy, yy)) = (gap(one, zero), gap(zero, one));
    for left in [xx.re, xy.re, xy.im, yx.re, yx.im, yy.re, xx.im - yy.im] {
        near(left, 0.0, 1e-15);
    }
    // a push through the drives is the same, seen by either
    let f = (Complex::new(0.3, 0.4), Complex::new(-0.2, 0.6));
    let (x, y) = after.drives.apply(f.0, f.1);
    let (sin, cos) = f64::sin_cos(phase);
    let back = (x, Complex::real(skew) * x + Complex::new((1.0 + ratio) * cos, -((1.0 + ratio) * sin)) * y);
    let (x, y) = before.drives.apply(f.0, f.1);
    for (got, expected) in [(back.0, x), (back.1, y)] {
        // but for the phase of a skew, which is not kept
        near(got.re, expected.re, 2e-3);
        near(got.im, expected.im, 2e-3);
    }
    assert_eq!((after.drives.xy.im, after.drives.yx.im), (0.0, 0.0));
    near(after.detection_phase(), before.detection_phase() + phase, 1e-15);
    near(1.0 + after.detection_ratio(), (1.0 + before.detection_ratio()) * (1.0 + ratio), 1e-15);
}

#[test]
fn what_is_added_is_added_and_what_is_composed_composed() {
    let start = Correction::none(0.04);
    // a common phase turns skews that are there, and no parameter is theirs
    let skewed = start.moved(&unit(P::ForceRotation, 0.01)).expect("a device");
    let turned = skewed.moved(&unit(P::ForcePhase, 0.02)).expect("a device").drives;
    assert_eq!((turned.xy, turned.yx), (Complex::real(-0.01), Complex::real(0.01)));
    for p in P::ALL {
        let (one, two) = (0.3 * p.expected::<f64>(), 0.2 * p.expected::<f64>());
        let once = start.moved(&unit(p, one)).expect("a device");
        let twice = once.moved(&unit(p, two)).expect("a device");
        let index = p as usize;
        let composed = matches!(
            p,
            P::ForceScale
                | P::ForceRatio
                | P::ForceSkew
                | P::ForceRotation
                | P::ForcePhase
                | P::ForcePhaseDifference
                | P::DetectionPhase
                | P::DetectionRatio
                | P::DetectionSkew
        );
        let expected = if composed { 0.0 } else { start.known[index] + one + two };
        near(twice.known[index], expected, 1e-16);
        // nothing is moved where nothing changed
        assert_eq!(start.moved(&[0.0; N]).expect("a device"), start);
        // the drives' inverse undoes them
        let f = AxisForces { x_c: 0.3, x_s: 0.7, y_c: -0.6, y_s: 0.2 };
        let d = twice.drive(&f);
        let (x, y) = twice.drives.apply(Complex::new(d.x_s, d.x_c), Complex::new(d.y_s, d.y_c));
        for (got, expected) in [(x.re, f.x_s), (x.im, f.x_c), (y.re, f.y_s), (y.im, f.y_c)] {
            near(got, expected, 1e-14);
        }
    }
}

#[test]
fn no_device_is_beyond_twelve_expectations_or_its_matrices_bounds() {
    let one = Complex::real(1.0);
    let zero = Complex::real(0.0);
    let of = |known, y, x, drives| Correction::<f64>::of(known, y, x, drives).is_some();
    let identity = Matrix::identity();
    assert!(of([0.0; N], one, zero, identity));
    for p in P::ALL {
        for sign in [1.0, -1.0] {
            let at = |n: f64| of(unit(p, sign * n * p.expected::<f64>()), one, zero, identity);
            assert!(at(11.99) && !at(12.01), "{p:?}");
        }
        assert!(!of(unit(p, f64::NAN), one, zero, identity), "{p:?}");
    }
    for (reach, which) in [(0.36, 0), (0.12, 1), (0.5, 2), (0.5, 3), (0.2, 4), (0.2, 5)] {
        for off in
            [Complex::new(reach, 0.0), Complex::new(-reach, 0.0), Complex::new(0.0, reach), Complex::new(0.0, -reach)]
        {
            let at = |share: f64| {
                let off = Complex::new(off.re * share, off.im * share);
                let (mut y, mut x, mut m) = (one, zero, identity);
                match which {
                    0 => y = y + off,
                    1 => x = x + off,
                    2 => m.xx = m.xx + off,
                    3 => m.yy = m.yy + off,
                    4 => m.xy = m.xy + off,
                    _ => m.yx = m.yx + off,
                }
                of([0.0; N], y, x, m)
            };
            assert!(at(0.999) && !at(1.001), "{which} {off:?}");
        }
    }
}

#[test]
fn a_matrix_times_its_inverse_changes_nothing() {
    let m = Matrix {
        xx: Complex::new(1.1, 0.2),
        xy: Complex::new(0.3, -0.4),
        yx: Complex::new(-0.2, 0.5),
        yy: Complex::new(0.7, -0.6),
    };
    let back = m.inverse().expect("regular").times(&m);
    for (got, expected) in back.numbers().into_iter().zip(Matrix::<f64>::identity().numbers()) {
        near(got, expected, 1e-15);
    }
    // the product does what its right factor does first
    let first = Matrix { xx: Complex::real(2.0), yx: Complex::new(0.1, 0.3), ..Matrix::identity() };
    let (x, y) = (Complex::new(0.4, -0.2), Complex::new(-0.6, 0.9));
    let [(bx, by), (cx, cy)] = [m.times(&first).apply(x, y), {
        let (x, y) = first.apply(x, y);
        m.apply(x, y)
    }];
    for (got, expected) in [(bx, cx), (by, cy)] {
        near(got.re, expected.re, 1e-15);
        near(got.im, expected.im, 1e-15);
    }
    assert_eq!(Matrix::from_numbers(&m.numbers()), m);
    // a determinant of a thousandth is none
    let flat = |d: f64| Matrix { yy: Complex::real(d), ..Matrix::identity() };
    assert!(flat(1.001e-3).inverse().is_some() && flat(0.999e-3).inverse().is_none());
    assert!(flat(-1.001e-3).inverse().is_some() && flat(f64::NAN).inverse().is_none());
    let z = Complex::new(0.3, -0.7) * Complex::new(0.3, -0.7).inverse();
    near(z.re, 1.0, 1e-15);
    near(z.im, 0.0, 1e-15);
}

#[test]
fn what_is_fed_forward_holds_the_split_and_makes_the_virtual_precession() {
    let c = calibrator();
    let mut state = c.start();
    state.correction.known = [0.0; N];
    (state.correction.known[P::SplitCos as usize], state.correction.known[P::SplitSin as usize]) = (1.3, -2.1);
    state.precession = 0.4;
    for theta in angles() {
        let (sin, cos) = theta.sin_cos();
        for share in [1.0, 0.9] {
            let forward = c.forward(&state, cos, sin, 1.6 * share);
            let commands =
                Commands { energy_v: 0.0, precession_v: forward.precession_v, quadrature_v: forward.quadrature_v };
            let pushed = c.push(&Pendulum { e: 1.0, q: 0.0, r: 1.0, s: 0.0, l: 0.0 }, &commands);
            let (sin_2, cos_2) = (2.0 * theta).sin_cos();
            let [_, turn, ellipticity] =
                known_rates(&pushed.over(1.0 / share), 0.0, (cos_2, sin_2), &state.correction.known);
            near(turn, 0.4, 1e-15);
            near(ellipticity, 0.0, 1e-15);
            // the mode along the pattern against the mean of both
            near(forward.detuning_rad_s, -0.5 * (1.3 * cos_2 - 2.1 * sin_2), 1e-14);
        }
    }
}

#[test]
fn what_is_no_rotation_is_what_is_known_of_the_angle_but_its_constant_rate() {
    let c = calibrator();
    let mut state = c.start();
    for (p, value) in MECHANICAL.iter().zip([0.05, 0.011, -0.017, 1.3, -2.1, 0.06, 0.0]) {
        state.correction.known[*p as usize] = value;
    }
    for (theta, epsilon) in angles().flat_map(|theta| [(theta, 0.01), (theta, -0.01)]) {
        let e = orbit(1.5, epsilon, theta);
        let p = e.pendulum();
        let commands = Commands { energy_v: -0.2, precession_v: 0.3, quadrature_v: 0.1 };
        let got = c.not_rotation(&state, &p, (theta.cos(), theta.sin()), &commands);
        let a = 1.5 / 1.6;
        let (sin_2, cos_2) = (2.0 * theta).sin_cos();
        let pushed = push(0.2, -0.3, 0.1, 0.0).over(2.5 / 1.6 / a);
        let [_, expected, _] = known_rates(&pushed, epsilon, (cos_2, sin_2), &state.correction.known);
        near(got, expected, 1e-5);
        // a phase that the loop has not nulled turns a command of quadrature into one of precession
        let ahead = Pendulum { l: -2.0 * 0.01 * p.e, ..p };
        let turned = c.not_rotation(&state, &ahead, (theta.cos(), theta.sin()), &commands) - got;
        near(turned, -0.01 * 0.1 * 2.5 / 1.6 / a, 1e-6);
    }
}

/// What a record or a commit hands over comes into force as a whole or not at all, whichever number is the wrong one.
#[test]
fn a_number_that_no_device_has_keeps_the_rest_out_of_force() {
    let made = |at: usize, value: f64| {
        let mut numbers = [0.0; N + 12];
        // of a perfect instrument
        (numbers[N], numbers[N + 4], numbers[N + 10]) = (1.0, 1.0, 1.0);
        if let Some(slot) = numbers.get_mut(at) {
            *slot = value;
        }
        let mut rest = numbers.into_iter();
        let known = core::array::from_fn(|_| rest.next().expect("a number"));
        let mut complex = || Complex::new(rest.next().expect("re"), rest.next().expect("im"));
        let (y_of_y, y_of_x) = (complex(), complex());
        let drives = Matrix { xx: complex(), xy: complex(), yx: complex(), yy: complex() };
        Correction::of(known, y_of_y, y_of_x, drives)
    };
    assert!(made(usize::MAX, 0.0).is_some());
    for at in 0..N + 12 {
        for value in [f64::NAN, f64::INFINITY, -1e6, 1e6] {
            assert!(made(at, value).is_none(), "number {at} is {value}");
        }
    }
}

/// A skew of the readout has the phase of Y, one of the drives the mean of the phases of both.
#[test]
fn skews_in_phase_have_the_phases_of_what_they_are_skews_of() {
    let drives = Matrix {
        xx: Complex::new(1.1, 0.022),
        xy: Complex::new(0.05, 0.0),
        yx: Complex::new(-0.08, 0.0),
        yy: Complex::new(0.9, -0.054),
    };
    let correction = Correction::of([0.0; N], Complex::new(1.02, -0.051), Complex::new(0.03, 0.0), drives);
    let turned = correction.and_then(|c| c.skews_in_phase()).expect("a device");
    let slope = |z: Complex<f64>| z.im / z.re;
    near(slope(turned.y_of_x), -0.05, 1e-15);
    for z in [turned.drives.xy, turned.drives.yx] {
        near(slope(z), 0.5 * (0.02 - 0.06), 1e-15);
    }
    // what is in phase with itself stays
    assert_eq!((turned.y_of_x.re, turned.drives.xy.re, turned.drives.yx.re), (0.03, 0.05, -0.08));
    assert_eq!((turned.drives.xx, turned.drives.yy), (drives.xx, drives.yy));
}

/// A cubic c makes z = x(1 + c|x|²) of x: undone up to its third power.
#[test]
fn a_cubic_in_force_is_undone_to_second_order() {
    let c = calibrator();
    let mut state = c.start();
    for m in [0.01, -0.01] {
        state.correction.known[P::Cubic as usize] = m;
        // X and Y as large as the set amplitude, each in a phase of its own
        let (x, y) = (Complex::new(1.6 * 0.6, 1.6 * 0.8), Complex::new(1.6, 0.0));
        let bent = |z: Complex<f64>| Complex::new(z.re * (1.0 + m), z.im * (1.0 + m));
        let straight = c.readout(&state, &envelope((bent(x), bent(y))));
        let (found_x, found_y) = phasors(&straight);
        for (found, there) in [(found_x.re, x.re), (found_x.im, x.im), (found_y.re, y.re), (found_y.im, y.im)] {
            near(found, there, 25.0 * f64::abs(m * m * m));
        }
    }
}

#[test]
fn a_phase_that_is_not_nulled_turns_every_push_as_a_phasor() {
    let c = calibrator();
    let commands = Commands { energy_v: -0.2, precession_v: 0.3, quadrature_v: 0.1 };
    let of = |lead: f64| c.push(&Pendulum { e: 1.0, q: 0.0, r: 1.0, s: 0.0, l: -2.0 * lead }, &commands);
    let still = of(0.0);
    for lead in [1e-4_f64, -1e-4] {
        let (sin, cos) = lead.sin_cos();
        let turned = of(lead);
        near(turned.along, still.along * cos, 1e-7);
        near(turned.across, still.along * sin, 1e-7);
        near(turned.aside, still.aside * cos - still.quadrature * sin, 1e-7);
        near(turned.quadrature, still.quadrature * cos + still.aside * sin, 1e-7);
    }
}

#[test]
fn what_is_told_of_the_detection_is_what_is_in_force_and_what_was_learned_since() {
    let mut values = [0.0; N];
    let told = [(P::DetectionRatio, 0.02), (P::DetectionPhase, -0.015), (P::DetectionSkew, 0.004)];
    for (p, value) in told {
        values[p as usize] = value;
    }
    let mut state = calibrator().start_from(&values).expect("a device");
    for (p, value) in told {
        near(state.estimate(p).expect("told").value, value, 1e-12);
        state.filter.mean[p as usize] = 0.1;
        near(state.estimate(p).expect("told").value, value + 0.1 * p.expected::<f64>(), 1e-12);
    }
}
