//! The little arithmetic that the paper needs.
//!
//! [`Real`] is what an equation may ask of a number: the field operations, an order, √, sine and cosine together, and
//! the two-argument arctangent. `f32` and `f64` have it here; dual numbers, exact polynomials and intervals have it
//! where they live. [`Float`] adds what running code needs of a machine number and a proof does not.
//!
//! Every transcendental call of the shipping crates goes through this file, so that a proof can stub them in one
//! place and the numbers agree bit for bit between a host and a target (`libm`, not the platform's library).

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A scalar on which the paper's equations can run.
///
/// Comparisons are part of it because anti-windup and saturation branch; a scalar that proves forks there.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The rational number `numerator / denominator`, as exactly as the scalar can hold it.
    ///
    /// Domain: `denominator ≠ 0`. Constants of the equations are written this way so that an exact scalar keeps them
    /// exact.
    fn ratio(numerator: i32, denominator: i32) -> Self;

    /// √self. Domain: `self ≥ 0`; floats return NaN outside.
    fn sqrt(self) -> Self;

    /// (sin, cos) of an angle in radians.
    fn sin_cos(self) -> (Self, Self);

    /// The angle of the point (`x`, `self`) in radians, in (−π, π]; 0 for the origin.
    fn atan2(self, x: Self) -> Self;

    /// The distance from 1 to the next larger number; 0 for a scalar that does not round.
    #[inline]
    fn epsilon() -> Self {
        Self::zero()
    }

    /// 0
    #[inline]
    fn zero() -> Self {
        Self::ratio(0, 1)
    }

    /// 1
    #[inline]
    fn one() -> Self {
        Self::ratio(1, 1)
    }

    /// 2
    #[inline]
    fn two() -> Self {
        Self::ratio(2, 1)
    }

    /// ½
    #[inline]
    fn half() -> Self {
        Self::ratio(1, 2)
    }

    /// self²
    #[inline]
    fn squared(self) -> Self {
        self * self
    }

    /// √(self² + other²), without guarding against overflow.
    #[inline]
    fn norm(self, other: Self) -> Self {
        (self.squared() + other.squared()).sqrt()
    }
}

/// A machine number: what running code may ask of a scalar beyond [`Real`].
pub trait Float: Real {
    /// π
    const PI: Self;
    /// The nearest value to `value`.
    fn from_f64(value: f64) -> Self;
    /// The value as `f64`, exactly.
    fn to_f64(self) -> f64;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
    /// The largest integer not above `self`.
    fn floor(self) -> Self;

    /// |self|
    #[inline]
    fn magnitude(self) -> Self {
        if self < Self::zero() { -self } else { self }
    }

    /// `self` where it lies in [−`limit`, `limit`], the nearer end where not, and 0 where `self` or `limit` is NaN or
    /// `limit` is negative: a bound that holds for every bit pattern.
    #[inline]
    fn bounded(self, limit: Self) -> Self {
        if self.within(limit) { self } else { nearer_end(self, limit) }
    }

    /// −`limit` ≤ `self` ≤ `limit`; false where either is NaN or `limit` is negative.
    #[inline(always)]
    fn within(self, limit: Self) -> bool {
        self.magnitude() <= limit
    }
}

/// The end of [−`limit`, `limit`] that `value`, which is not in it, is beyond; 0 where there is none.
#[cold]
#[inline(never)]
fn nearer_end<T: Float>(value: T, limit: T) -> T {
    if limit >= T::zero() && value > limit {
        limit
    } else if limit >= T::zero() && value < -limit {
        -limit
    } else {
        T::zero()
    }
}

macro_rules! machine_float {
    ($t:ident, $sqrt:path, $sincos:path, $atan2:path, $floor:path, $pi:expr) => {
        impl Real for $t {
            #[inline]
            fn ratio(numerator: i32, denominator: i32) -> Self {
                numerator as $t / denominator as $t
            }
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sincos(self)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }
            #[inline]
            fn epsilon() -> Self {
                $t::EPSILON
            }
        }
        impl Float for $t {
            const PI: Self = $pi;
            #[inline]
            #[allow(clippy::cast_possible_truncation, reason = "rounding to the scalar is what the function is for")]
            fn from_f64(value: f64) -> Self {
                value as $t
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn is_finite(self) -> bool {
                <$t>::is_finite(self)
            }
            #[inline]
            fn floor(self) -> Self {
                $floor(self)
            }
            #[inline]
            fn magnitude(self) -> Self {
                self.abs()
            }
        }
    };
}

// a prover cannot reason about these: it takes anything that keeps their contract
#[cfg(any(kani, cvg_prove))]
use crate::proofs::stand_in as functions;
#[cfg(not(any(kani, cvg_prove)))]
use libm as functions;

machine_float!(f32, functions::sqrtf, functions::sincosf, functions::atan2f, libm::floorf, core::f32::consts::PI);
machine_float!(f64, functions::sqrt, functions::sincos, functions::atan2, libm::floor, core::f64::consts::PI);
