//! Every equation in both precisions and in every quadrant against its formula in the standard library's double
//! precision, exactly where whole numbers make it exact.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use cvg_model::actuation::{actuation_gain_ratio, misaligned_forces};
use cvg_model::detection::{angle_error, angle_error_bound, measured_angle};
use cvg_model::resonator::averaged::Averages;
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, DetectionGains, Envelope, Float, Orbit, Pendulum, Real};

/// Near to `of` of its own size, in units of the last place.
#[track_caller]
fn near<T: Float>(got: T, expected: f64, of: f64, places: f64) {
    let tolerance = places * T::epsilon().to_f64() * of.max(expected.abs()) + 1e-44;
    assert!((got.to_f64() - expected).abs() <= tolerance, "{got:?} and not {expected}");
}

fn t<T: Float>(v: f64) -> T {
    T::from_f64(v)
}

/// Whole numbers of every sign, with zero: products of two are exact in either precision.
const WHOLE: [f64; 5] = [-3.0, -1.0, 0.0, 2.0, 5.0];

fn envelopes() -> impl Iterator<Item = [f64; 4]> {
    (0..625).map(|k| [WHOLE[k % 5], WHOLE[k / 5 % 5], WHOLE[k / 25 % 5], WHOLE[k / 125]])
}

fn of<T: Float>([x_c, x_s, y_c, y_s]: [f64; 4]) -> Envelope<T> {
    Envelope::new(t(x_c), t(x_s), t(y_c), t(y_s))
}

/// Angles over three turns, each eighth of a turn exactly among them.
fn angles() -> impl Iterator<Item = f64> {
    (-72..=72).flat_map(|k| [f64::from(k) * PI / 24.0, f64::from(k) * PI / 24.0 + 0.01])
}

fn pendulums<T: Float>() {
    for a in envelopes() {
        let [x_c, x_s, y_c, y_s] = a;
        let p = of::<T>(a).pendulum();
        // |X|² ± |Y|², 2 X̄Y, and X² + Y² with X = x_c − i x_s
        let expected = [
            x_c * x_c + x_s * x_s + y_c * y_c + y_s * y_s,
            2.0 * (x_c * y_s - x_s * y_c),
            x_c * x_c + x_s * x_s - y_c * y_c - y_s * y_s,
            2.0 * (x_c * y_c + x_s * y_s),
            2.0 * (x_c * x_s + y_c * y_s),
        ];
        assert_eq!([p.e, p.q, p.r, p.s, p.l].map(T::to_f64), expected, "{a:?}");
        for b in [[1.0, 0.0, 0.0, 0.0], [0.0, -2.0, 3.0, 1.0], [2.0, 1.0, -1.0, -4.0]] {
            // a quadratic form's slope is its central difference
            let (up, down) = (of::<T>(a) + of(b), of::<T>(a) - of(b));
            let (up, down, rate) = (up.pendulum(), down.pendulum(), of::<T>(a).pendulum_rate(&of(b)));
            let half = |u: T, d: T| 0.5 * (u.to_f64() - d.to_f64());
            let expected =
                [half(up.e, down.e), half(up.q, down.q), half(up.r, down.r), half(up.s, down.s), half(up.l, down.l)];
            assert_eq!([rate.e, rate.q, rate.r, rate.s, rate.l].map(T::to_f64), expected, "{a:?} {b:?}");
        }
        let e = of::<T>(a);
        assert_eq!(-e, of(a.map(|v| -v)));
        assert_eq!(e * t(2.0), of(a.map(|v| 2.0 * v)));
        assert_eq!(e.quarter_ahead(), of([x_s, -x_c, y_s, -y_c]));
        assert_eq!(e.turned(t(1.0), t(0.0)), of([-y_c, -y_s, x_c, x_s]), "by a quarter of a turn");
    }
}

fn precessions<T: Float>() {
    for theta in angles() {
        for (q, delta) in [(0.0, 0.0), (0.3, 0.4), (-0.3, -1.1)] {
            let at = |theta: f64, q: f64| Orbit { a: 1.0, q, theta, delta }.envelope();
            let (up, down) = (at(theta + 1e-5, q), at(theta - 1e-5, q));
            let rate = (up - down) * (0.7 / 2e-5);
            let [e, d] = [at(theta, q), rate].map(|e| of::<T>([e.x_c, e.x_s, e.y_c, e.y_s]));
            assert!((e.precession(&d).to_f64() - 0.7).abs() < 1e-9 + 8.0 * T::epsilon().to_f64(), "{theta}");
        }
    }
}

/// (R, S) on every eighth of the turn, with both spellings of zero.
fn orientations<T: Float>() {
    let diagonal = [
        ((1.0, 0.0), 0.0),
        ((1.0, 1.0), FRAC_PI_4),
        ((0.0, 1.0), FRAC_PI_2),
        ((-1.0, 1.0), 3.0 * FRAC_PI_4),
        ((-1.0, 0.0), PI),
        ((-1.0, -0.0), -PI),
        ((-1.0, -1.0), -3.0 * FRAC_PI_4),
        ((0.0, -1.0), -FRAC_PI_2),
        ((-0.0, -1.0), -FRAC_PI_2),
        ((1.0, -1.0), -FRAC_PI_4),
        ((1.0, -0.0), 0.0),
        ((0.0, 0.0), 0.0),
    ];
    for ((r, s), twice) in diagonal {
        for size in [1e-15, 1.0, 1e15] {
            let p = Pendulum { e: t(size), q: t(0.0), r: t::<T>(r * size), s: t(s * size), l: t(0.0) };
            near(p.angle(), 0.5 * twice, 0.0, 1.0);
        }
    }
    for theta in angles() {
        let p = Pendulum { e: t(1.0), q: t(0.0), r: t::<T>((2.0 * theta).cos()), s: t((2.0 * theta).sin()), l: t(0.0) };
        near(p.angle(), 0.5 * p.s.to_f64().atan2(p.r.to_f64()), 0.0, 2.0);
    }
    let none = Pendulum { e: t(1.0), q: t(0.0), r: t::<T>(f64::NAN), s: t(1.0), l: t(0.0) };
    assert!(!none.angle().is_finite() && !Pendulum { r: t(1.0), s: t::<T>(f64::NAN), ..none }.angle().is_finite());
}

fn orbits<T: Float>() {
    for theta in angles().filter(|theta| theta.abs() < PI - 0.02) {
        for (a, q, delta) in [(1.0, 0.0, 0.0), (2.0, 0.5, 0.9), (0.7, -0.3, -0.9)] {
            let e = Orbit { a: t::<T>(a), q: t(q), theta: t(theta), delta: t(delta) }.envelope();
            let o = e.orbit();
            let places = 40.0;
            near(o.a, a, 0.0, places);
            near(o.q, q, a, places);
            near(o.theta, theta, 1.0, places);
            near(o.delta, delta, 1.0, places);
        }
    }
}

fn detections<T: Float>() {
    for (x, y) in [(1.0, 1.0), (2.0, 0.5), (-1.0, 3.0), (0.5, -0.25)] {
        let gains = DetectionGains { x: t::<T>(x), y: t(y) };
        for a in envelopes() {
            let [x_c, x_s, y_c, y_s] = a;
            let seen = gains.measure(&of(a));
            assert_eq!(seen, of([x * x_c, x * x_s, y * y_c, y * y_s]));
            assert_eq!(gains.measured_quadrature(of::<T>(a).pendulum().q), seen.pendulum().q);
        }
        assert_eq!(gains.ratio().to_f64(), y / x);
        for theta in angles() {
            let theta_t = t::<T>(theta);
            let (sin, cos) = theta_t.to_f64().sin_cos();
            near(
                gains.measured_energy(t(3.0), theta_t),
                3.0 * (x * x * cos * cos + y * y * sin * sin),
                x * x + y * y,
                40.0,
            );
        }
    }
}

fn errors_of_the_angle<T: Float>() {
    for g in [0.2, 0.5, 0.99, 1.0, 1.0132, 2.0, 5.0] {
        let g_t = t::<T>(g);
        let g = g_t.to_f64();
        for theta in angles() {
            let theta_t = t::<T>(theta);
            let (sin, cos) = theta_t.to_f64().sin_cos();
            let expected = f64::atan2(g * sin, cos);
            let got = measured_angle(g_t, theta_t).to_f64();
            let apart = (got - expected) - 2.0 * PI * ((got - expected) / (2.0 * PI)).round();
            assert!(apart.abs() <= 20.0 * T::epsilon().to_f64(), "{g} {theta}: {got} and not {expected}");
            // atan2(g s, c) − θ without the wrap
            let error = f64::atan2((g - 1.0) * sin * cos, cos * cos + g * sin * sin);
            near(angle_error(g_t, theta_t), error, (g - 1.0).abs(), 20.0);
        }
        near(angle_error_bound(g_t), ((g - 1.0).abs() / (g + 1.0)).asin(), 0.0, 8.0);
    }
}

fn forces<T: Float>() {
    let v = ControlOutputs { v_as: t::<T>(3.0), v_qc: t(-2.0) };
    for theta in angles() {
        let theta_t = t::<T>(theta);
        let (sin, cos) = theta_t.to_f64().sin_cos();
        let (sin_2, cos_2) = (2.0 * sin * cos, cos * cos - sin * sin);
        let m = misaligned_forces(t(2.0), &v, theta_t);
        for (got, expected) in [(m.a_s, 6.0 * cos), (m.q_s, 6.0 * sin), (m.a_c, 4.0 * sin), (m.q_c, -4.0 * cos)] {
            near(got, expected, 6.0, 4.0);
        }
        let gains = ActuationGains { x: t::<T>(1.5), y: t(0.75) };
        let f = gains.axis_forces(&v, theta_t);
        for (got, expected) in
            [(f.x_c, 1.5 * 2.0 * sin), (f.x_s, 1.5 * 3.0 * cos), (f.y_c, -0.75 * 2.0 * cos), (f.y_s, 0.75 * 3.0 * sin)]
        {
            near(got, expected, 6.0, 4.0);
        }
        assert_eq!(f, gains.axis_forces_along(&v, theta_t.sin_cos().1, theta_t.sin_cos().0));
        let turned = f.along_orbit(theta_t);
        let o = gains.orbit_forces(&v, theta_t);
        let (difference, x) = (0.5 * (0.75 - 1.5), 1.5);
        let expected = [
            3.0 * (difference * (1.0 - cos_2) + x),
            3.0 * difference * sin_2,
            -2.0 * difference * sin_2,
            -2.0 * (difference * (1.0 + cos_2) + x),
        ];
        for ((got, turned), expected) in
            [o.a_s, o.q_s, o.a_c, o.q_c].into_iter().zip([turned.a_s, turned.q_s, turned.a_c, turned.q_c]).zip(expected)
        {
            near(got, expected, 6.0, 20.0);
            near(turned, expected, 6.0, 20.0);
        }
    }
    let rate = AxisForces { x_c: t::<T>(1.0), x_s: t(2.0), y_c: t(3.0), y_s: t(5.0) }.envelope_rate(t(4.0));
    assert_eq!(rate, of([-0.5, 0.25, -1.25, 0.75]));
    assert_eq!(actuation_gain_ratio(t::<T>(2.0), t(8.0), t(5.0), t(3.0)).to_f64(), 15.0 / 16.0);
}

/// The averaged equations are those of the envelope, seen along its orbit.
fn averages<T: Float>() {
    let resonator = Resonator {
        omega_rad_s: 1e5,
        angular_gain: 0.8,
        centrifugal_gain: 0.4,
        damping_per_s: 0.05,
        anisodamping: Anisotropy::new(0.02, 0.4),
        anisoelasticity: Anisotropy::new(1.3, -0.9),
    };
    let single = Resonator {
        omega_rad_s: t::<T>(1e5),
        angular_gain: t(0.8),
        centrifugal_gain: t(0.4),
        damping_per_s: t(0.05),
        anisodamping: Anisotropy::new(t(0.02), t(0.4)),
        anisoelasticity: Anisotropy::new(t(1.3), t(-0.9)),
    };
    near(single.anisodamping.magnitude(), 0.02, 0.0, 4.0);
    near(single.anisoelasticity.axis_rad(), -0.9, 0.0, 4.0);
    assert_eq!(Anisotropy::<T>::none(), Anisotropy { cos2: t(0.0), sin2: t(0.0) });
    for theta in angles() {
        for (q, rate_rad_s) in [(0.0, 0.0), (0.4, 2.0), (-0.4, -3.0)] {
            let e = Orbit { a: 1.2, q, theta, delta: 0.3 }.envelope();
            let (p, rate) = (e.pendulum(), resonator.envelope_rate(&e, rate_rad_s, 7.0));
            let d = e.pendulum_rate(&rate);
            let got = single.averaged_rate(&Averages { e: t(p.e), q: t(p.q), theta: t(theta) }, t(rate_rad_s));
            near(got.e, d.e, 1.0, 40.0);
            near(got.q, d.q, 4.0, 40.0);
            near(got.theta, e.precession(&rate), 4.0, 40.0);
        }
    }
}

fn functions<T: Float>() {
    for k in -4000..=4000 {
        let x = t::<T>(f64::from(k) * 0.01);
        let (sin, cos) = Real::sin_cos(x);
        near(sin, x.to_f64().sin(), 1e-3, 2.0);
        near(cos, x.to_f64().cos(), 1e-3, 2.0);
        if k > 0 {
            near(Real::sqrt(x), x.to_f64().sqrt(), 0.0, 1.0);
        }
        let y = t::<T>(f64::from(k % 37) * 0.3);
        near(Real::atan2(x, y), x.to_f64().atan2(y.to_f64()), 0.0, 2.0);
        near(x.norm(y), x.to_f64().hypot(y.to_f64()), 0.0, 4.0);
        assert_eq!(Float::floor(x).to_f64(), x.to_f64().floor());
    }
    assert!(!Real::sqrt(t::<T>(-1.0)).is_finite());
    for v in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(!t::<T>(v).is_finite());
    }
    assert!((T::PI.to_f64() - PI).abs() <= T::epsilon().to_f64() * 2.0);
}

macro_rules! in_both_precisions {
    ($($name:ident $body:ident;)+) => { $(mod $name {
        #[test]
        fn in_f32() { super::$body::<f32>() }
        #[test]
        fn in_f64() { super::$body::<f64>() }
    })+ };
}

in_both_precisions! {
    the_pendulum_variables_are_exact_in_whole_numbers pendulums;
    an_envelope_precesses_as_its_orbit_turns precessions;
    the_angle_is_that_of_every_eighth_of_a_turn orientations;
    an_orbit_comes_back_from_its_envelope orbits;
    unequal_readout_gains_are_seen_as_derived detections;
    the_error_of_the_angle_is_that_of_the_arctangents errors_of_the_angle;
    forces_are_projected_in_every_quadrant forces;
    the_averages_are_those_of_the_envelope averages;
    functions_are_those_of_the_standard_library functions;
}
