//! The arithmetic of the equations: what a scalar gives by itself, and what the traits give to one that says the least.

use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

use cvg_model::{Float, Real};

/// A scalar that defines what it must and leaves the rest to the traits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Least(f64);

impl PartialOrd for Least {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.0.partial_cmp(&other.0)
    }
}

macro_rules! operator {
    ($($trait:ident $method:ident),+) => {$(
        impl $trait for Least {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self($trait::$method(self.0, other.0))
            }
        }
    )+};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Least {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Least {
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self(f64::from(numerator) / f64::from(denominator))
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn sin_cos(self) -> (Self, Self) {
        (Self(self.0.sin()), Self(self.0.cos()))
    }
    fn atan2(self, x: Self) -> Self {
        Self(self.0.atan2(x.0))
    }
}

impl Float for Least {
    const PI: Self = Self(core::f64::consts::PI);
    fn from_f64(value: f64) -> Self {
        Self(value)
    }
    fn to_f64(self) -> f64 {
        self.0
    }
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    fn floor(self) -> Self {
        Self(self.0.floor())
    }
}

fn constants_and_squares<T: Float>() {
    let of = |v: f64| T::from_f64(v);
    assert_eq!([T::zero(), T::one(), T::two(), T::half()], [of(0.0), of(1.0), of(2.0), of(0.5)]);
    assert_eq!((T::ratio(3, 4), T::ratio(-7, 2)), (of(0.75), of(-3.5)));
    assert_eq!((of(-3.0).squared(), of(0.5).squared()), (of(9.0), of(0.25)));
    // two triangles with whole sides
    assert_eq!((of(3.0).norm(of(-4.0)), of(-12.0).norm(of(5.0))), (of(5.0), of(13.0)));
    assert_eq!((of(2.5).floor(), of(-2.5).floor()), (of(2.0), of(-3.0)));
    assert_eq!(T::PI.to_f64() as f32, core::f32::consts::PI);
    assert!(of(1e30).is_finite() && !of(f64::NAN).is_finite() && !of(f64::INFINITY).is_finite());
}

fn magnitudes<T: Float>() {
    for v in [0.0, 0.25, 1.0, 7.5, f64::INFINITY] {
        assert_eq!(T::from_f64(v).magnitude(), T::from_f64(v));
        assert_eq!(T::from_f64(-v).magnitude(), T::from_f64(v));
    }
    assert!(T::from_f64(0.0).magnitude().to_f64().is_sign_positive());
    assert!(!T::from_f64(f64::NAN).magnitude().is_finite());
}

fn bounds<T: Float>() {
    let bounded = |v: f64, limit: f64| T::from_f64(v).bounded(T::from_f64(limit)).to_f64();
    for limit in [0.0, 0.5, 3.0] {
        assert_eq!((bounded(limit, limit), bounded(-limit, limit)), (limit, -limit), "the ends belong to it");
        assert_eq!((bounded(limit + 1.0, limit), bounded(-limit - 1.0, limit)), (limit, -limit));
        assert_eq!((bounded(f64::INFINITY, limit), bounded(-f64::INFINITY, limit)), (limit, -limit));
        assert_eq!((bounded(0.5 * limit, limit), bounded(-0.5 * limit, limit)), (0.5 * limit, -0.5 * limit));
        assert_eq!(bounded(f64::NAN, limit), 0.0);
    }
    // no bound at all
    for v in [-5.0, -2.0, -1.0, 0.0, 1.0, 2.0, 5.0, f64::NAN, f64::INFINITY] {
        assert_eq!((bounded(v, -2.0), bounded(v, f64::NAN)), (0.0, 0.0), "{v}");
    }
}

#[test]
fn constants_squares_and_norms_are_exact_where_they_can_be() {
    constants_and_squares::<f32>();
    constants_and_squares::<f64>();
    constants_and_squares::<Least>();
}

#[test]
fn a_magnitude_has_no_sign() {
    magnitudes::<f32>();
    magnitudes::<f64>();
    magnitudes::<Least>();
}

#[test]
fn a_bound_holds_for_every_number_and_for_none() {
    bounds::<f32>();
    bounds::<f64>();
    bounds::<Least>();
}

fn within<T: Float>() {
    let within = |v: f64, limit: f64| T::from_f64(v).within(T::from_f64(limit));
    for v in [0.0, 0.5, 3.0, -0.5, -3.0] {
        assert!(within(v, 3.0), "{v}");
    }
    for (v, limit) in [(3.5, 3.0), (-3.5, 3.0), (f64::NAN, 3.0), (0.0, f64::NAN), (0.0, -1.0), (f64::INFINITY, 3.0)] {
        assert!(!within(v, limit), "{v} {limit}");
    }
}

#[test]
fn within_a_bound_are_its_ends_and_no_number_is() {
    within::<f32>();
    within::<f64>();
    within::<Least>();
}

#[test]
fn a_scalar_rounds_as_it_says() {
    assert_eq!((<f32 as Real>::epsilon(), <f64 as Real>::epsilon()), (f32::EPSILON, f64::EPSILON));
    assert_eq!(Least::epsilon(), Least(0.0), "one that doesn't say does not");
}
