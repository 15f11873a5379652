//! The direction of the major axis from cos 2θ and sin 2θ, as the instrument asks for it: at every angle, also exactly on
//! the axes and between them, in both senses of the vibration, and for what is no direction.

use core::f64::consts::PI;

use cvg_estimator::direction::{major_axis, major_axis_of};
use cvg_estimator::{Direction, Status};
use cvg_model::{Envelope, Float, Orbit, Real};

fn rounded<T: Float>(e: &Envelope<f64>) -> Envelope<T> {
    Envelope::new(T::from_f64(e.x_c), T::from_f64(e.x_s), T::from_f64(e.y_c), T::from_f64(e.y_s))
}

/// A vibration at `theta` and its direction.
fn off<T: Float>(orbit: Orbit<f64>) -> f64 {
    let e = rounded::<T>(&orbit.envelope());
    let (sin_2, cos_2) = Real::sin_cos(T::from_f64(2.0 * orbit.theta));
    let d = major_axis_of(&e, cos_2, sin_2);
    assert_eq!(d.status, Status::Valid, "{orbit:?}");
    let (cos, sin) = (d.cos.to_f64(), d.sin.to_f64());
    let tolerance = 4.0 * T::epsilon().to_f64();
    assert!((cos * cos + sin * sin - 1.0).abs() < tolerance, "{orbit:?}: {d:?}");
    // the sense in which the vibration is positive
    assert!(cos * orbit.theta.cos() + sin * orbit.theta.sin() > 0.0 || orbit.a < 0.0, "{orbit:?}: {d:?}");
    (sin * orbit.theta.cos() - cos * orbit.theta.sin()).abs()
}

#[test]
fn it_is_the_orbits_orientation_at_every_angle_of_the_full_turn() {
    for k in -720..720 {
        for (q, delta) in [(0.0, 0.0), (0.2, 0.1), (-0.2, -0.1)] {
            let orbit = Orbit { a: 1.0, q, theta: f64::from(k) * PI / 720.0, delta };
            assert!(off::<f64>(orbit) < 1e-15, "{orbit:?}");
            assert!(off::<f32>(orbit) < 4e-7, "{orbit:?}");
        }
    }
}

#[test]
fn its_angle_is_over_the_full_turn() {
    for k in -11..=12 {
        let theta = f64::from(k) * PI / 12.0;
        let d = Direction { cos: theta.cos(), sin: theta.sin(), status: Status::Valid };
        assert!((d.angle() - theta).abs() < 1e-15, "{theta}: {}", d.angle());
    }
}

#[test]
fn on_the_axes_and_exactly_between_them_it_is_exact() {
    let half = 0.5_f64.sqrt();
    let cases = [
        ((1.0, 0.0), (1.0, 0.0)),
        ((0.0, 1.0), (half, half)),
        ((-1.0, 0.0), (0.0, 1.0)),
        ((0.0, -1.0), (half, -half)),
        ((0.0, -1.0), (-half, half)),
        ((-1.0, -0.0), (0.0, -1.0)),
        ((-0.0, -1.0), (-half, half)),
        ((-0.0, 1.0), (-half, -half)),
    ];
    for ((cos_2, sin_2), (cos, sin)) in cases {
        let e = Envelope::new(2.0 * cos, 0.0, 2.0 * sin, 0.0);
        let d = major_axis_of(&e, cos_2, sin_2);
        assert_eq!(d.status, Status::Valid);
        assert!((d.cos - cos).abs() < 1e-15 && (d.sin - sin).abs() < 1e-15, "{cos_2} {sin_2}: {d:?}");
        let (single, double) =
            (major_axis_of(&rounded::<f32>(&e), cos_2 as f32, sin_2 as f32), major_axis(&e, &e.pendulum()));
        assert!((single.cos - cos as f32).abs() < 1e-7 && (single.sin - sin as f32).abs() < 1e-7, "{single:?}");
        assert!((double.cos - cos).abs() < 1e-15 && (double.sin - sin).abs() < 1e-15, "{double:?}");
    }
}

#[test]
fn what_is_no_direction_is_the_x_axis_and_says_why() {
    let line = Envelope::new(1.0, 0.0, 0.0, 0.0);
    let nan = f64::NAN;
    let cases = [
        (line, nan, 0.0, Status::Invalid),
        (line, 0.0, nan, Status::Invalid),
        (line, f64::INFINITY, 0.0, Status::Invalid),
        (line, 3.0, 0.0, Status::Undetermined),
        (Envelope::new(0.0, 1.0, 0.0, 0.0), 1.0, 0.0, Status::Undetermined),
        (Envelope::new(nan, 0.0, 0.0, 0.0), 1.0, 0.0, Status::Undetermined),
        (Envelope::new(0.0, 0.0, nan, 0.0), 1.0, 0.0, Status::Undetermined),
    ];
    for (e, cos_2, sin_2, status) in cases {
        let d = major_axis_of(&e, cos_2, sin_2);
        assert_eq!((d.cos, d.sin, d.status), (1.0, 0.0, status), "{e:?} {cos_2} {sin_2}");
    }
}

/// A unit vector of the machine may be longer than one.
#[test]
fn a_direction_that_rounding_made_too_long_is_one_still() {
    fn one<T: Float>() {
        let e = Envelope::new(T::one(), T::zero(), T::zero(), T::zero());
        for (units, sin_2) in [(1, T::zero()), (2, T::zero()), (0, T::epsilon())] {
            let d = major_axis_of(&e, T::one() + T::ratio(units, 1) * T::epsilon(), sin_2);
            assert!((d.cos - T::one()).magnitude() <= T::epsilon() && d.status == Status::Valid, "{units}: {d:?}");
        }
    }
    one::<f32>();
    one::<f64>();
}

/// Of an envelope whose squares are below what the machine holds in full the direction is not told.
#[test]
fn squares_that_rounding_took_are_no_direction() {
    fn tiny<T: Float>(a: f64) {
        for degrees in (-180..180).step_by(15) {
            let theta = f64::from(degrees).to_radians();
            let told = |a| {
                let e = rounded::<T>(&Orbit { a, q: 0.0, theta, delta: 0.0 }.envelope());
                major_axis(&e, &e.pendulum()).status
            };
            assert_eq!(told(a), Status::Undetermined, "{degrees}");
            assert_eq!(told(1e5 * a), Status::Valid, "{degrees}");
        }
    }
    tiny::<f32>(2e-11);
    tiny::<f64>(1e-78);
}
