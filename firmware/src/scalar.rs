//! `f32` with the square root of the processor.
//!
//! The crates for firmware are free of unsafe code, and safe code without the standard library has no way to a processor's
//! square root: `libm` computes it in some 70 instructions. A target that has one brings it here. Both round correctly,
//! so the bits are the same, which the comparison with the host's `f32` shows.

use core::arch::asm;
use core::ops::{Add, Div, Mul, Neg, Sub};

use cvg_model::{Float, Real};

/// A single-precision number on a processor with VSQRT.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[repr(transparent)]
pub struct Single(pub f32);

macro_rules! operator {
    ($($trait:ident $method:ident),+) => {$(
        impl $trait for Single {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($trait::$method(self.0, other.0))
            }
        }
    )+};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Single {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Single {
    #[inline(always)]
    fn ratio(numerator: i32, denominator: i32) -> Self {
        Self(<f32 as Real>::ratio(numerator, denominator))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let mut bits = self.0.to_bits();
        // stable Rust hands no floating-point register to assembly for this target, but takes it that one is changed
        // SAFETY: changes nothing but the two registers that it names, and the flags of inexactness, which nobody reads
        unsafe {
            asm!(
                "vmov s0, {bits}", "vsqrt.f32 s0, s0", "vmov {bits}, s0",
                bits = inout(reg) bits,
                out("s0") _,
                options(pure, nomem, nostack, preserves_flags)
            );
        }
        Self(f32::from_bits(bits))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Real::sin_cos(self.0);
        (Self(sin), Self(cos))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Self(Real::atan2(self.0, x.0))
    }
    #[inline(always)]
    fn epsilon() -> Self {
        Self(f32::EPSILON)
    }
}

impl Float for Single {
    const PI: Self = Self(core::f32::consts::PI);
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self(<f32 as Float>::from_f64(value))
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self.0.to_f64()
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.0.is_finite()
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(Float::floor(self.0))
    }
    #[inline(always)]
    fn magnitude(self) -> Self {
        Self(self.0.abs())
    }
}
