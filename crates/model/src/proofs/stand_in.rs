//! What a proof takes for √, sine and cosine, and the arctangent: any value that keeps a contract.
//!
//! `scalar.rs` calls these instead of `libm` when a prover compiles it. A claim that is proved with them holds for every
//! function that keeps the contract; the test at the end holds `libm`'s to it.

use crate::Float;

/// What is asked of `root` = √x.
pub fn root_keeps<T: Float>(x: T, root: T) -> bool {
    let (zero, one) = (T::zero(), T::one());
    if x == zero {
        root == zero
    } else if x > zero {
        let between = if x < one { x <= root && root <= one } else { one <= root && root <= x };
        between && root.is_finite() == x.is_finite()
    } else {
        super::is_nan(root)
    }
}

/// What is asked of (`sin`, `cos`) of `x`.
pub fn sin_cos_keep<T: Float>(x: T, sin: T, cos: T) -> bool {
    let one = T::one();
    if x == T::zero() {
        sin == T::zero() && cos == one
    } else if x.is_finite() {
        sin >= -one && sin <= one && cos >= -one && cos <= one
    } else {
        super::is_nan(sin) && super::is_nan(cos)
    }
}

/// What is asked of `angle` = atan2(y, x). `positive`: the sign bit of x is clear, which tells 0 from −0.
pub fn arctangent_keeps<T: Float>(y: T, x: T, positive: bool, angle: T) -> bool {
    let zero = T::zero();
    if super::is_nan(x) || super::is_nan(y) {
        return super::is_nan(angle);
    }
    let right =
        if x > zero || (x == zero && (positive || y != zero)) { angle.magnitude() <= T::PI * T::half() } else { true };
    let side = if y > zero {
        angle >= zero
    } else if y < zero {
        angle <= zero
    } else {
        true
    };
    let straight = if y == zero && x >= zero && positive { angle == zero } else { true };
    angle >= -T::PI && angle <= T::PI && right && side && straight
}

macro_rules! stand_ins {
    ($t:ident, $sqrt:ident, $sin_cos:ident, $atan2:ident) => {
        /// Any number that keeps the contract of √x.
        pub fn $sqrt(x: $t) -> $t {
            let root = kani::any();
            kani::assume(root_keeps(x, root));
            root
        }

        /// Any pair that keeps the contract of sine and cosine.
        pub fn $sin_cos(x: $t) -> ($t, $t) {
            let (sin, cos) = (kani::any(), kani::any());
            kani::assume(sin_cos_keep(x, sin, cos));
            (sin, cos)
        }

        /// Any angle that keeps the contract of atan2(y, x).
        pub fn $atan2(y: $t, x: $t) -> $t {
            let angle = kani::any();
            kani::assume(arctangent_keeps(y, x, x.is_sign_positive(), angle));
            angle
        }
    };
}
stand_ins!(f32, sqrtf, sincosf, atan2f);
stand_ins!(f64, sqrt, sincos, atan2);

#[cfg(test)]
mod tests {
    use super::{arctangent_keeps, root_keeps, sin_cos_keep};

    /// Every 65th bit pattern: all exponents, both signs, NaN and infinities.
    fn single() -> impl Iterator<Item = f32> {
        (0..=u32::MAX).step_by(65).map(f32::from_bits)
    }

    /// As many patterns, evenly over all of them.
    fn double() -> impl Iterator<Item = f64> {
        (0..1_u64 << 24).map(|i| f64::from_bits(i.wrapping_mul(0x0000_0100_0000_01b3)))
    }

    /// Zeros, ones, extremes and their neighbours.
    const EDGES: [f64; 14] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        1.0 - f64::EPSILON,
        1.0 + f64::EPSILON,
        f64::MIN_POSITIVE,
        -f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        f64::MIN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];

    #[test]
    fn the_real_root_keeps_its_contract() {
        assert!(single().all(|x| root_keeps(x, libm::sqrtf(x))));
        assert!(double().chain(EDGES).all(|x| root_keeps(x, libm::sqrt(x))));
    }

    #[test]
    fn the_real_sine_and_cosine_keep_their_contract() {
        let keeps = |x: f32| {
            let (sin, cos) = libm::sincosf(x);
            sin_cos_keep(x, sin, cos)
        };
        assert!(single().all(keeps));
        let keeps = |x: f64| {
            let (sin, cos) = libm::sincos(x);
            sin_cos_keep(x, sin, cos)
        };
        assert!(double().chain(EDGES).all(keeps));
    }

    #[test]
    fn the_real_arctangent_keeps_its_contract() {
        // the upper bits count through signs and exponents, the lower ones are any
        let singles = || {
            let spread = (0..1_u32 << 11).map(|i| f32::from_bits(i << 21 | i.wrapping_mul(1009) & 0x1f_ffff));
            spread.chain(EDGES.map(|x| x as f32)).chain([f32::MIN_POSITIVE, 1e-45])
        };
        for y in singles() {
            assert!(singles().all(|x| arctangent_keeps(y, x, x.is_sign_positive(), libm::atan2f(y, x))), "{y:e}");
        }
        let doubles = || {
            let spread =
                (0..1_u64 << 12).map(|i| f64::from_bits(i << 52 | i.wrapping_mul(0x3_0000_01b3) & 0xf_ffff_ffff_ffff));
            spread.chain(EDGES)
        };
        for y in doubles() {
            assert!(doubles().all(|x| arctangent_keeps(y, x, x.is_sign_positive(), libm::atan2(y, x))), "{y:e}");
        }
    }

    #[test]
    fn the_contracts_refuse_what_is_wrong() {
        assert!(!root_keeps(4.0, 4.5) && !root_keeps(0.25, 0.2) && !root_keeps(-1.0, 0.0) && !root_keeps(0.0, 1e-20));
        assert!(!sin_cos_keep(1.0, 1.5, 0.0) && !sin_cos_keep(0.0, 0.0, 0.5) && !sin_cos_keep(f64::NAN, 0.0, 0.0));
        let keeps = |y: f64, x: f64, angle| arctangent_keeps(y, x, x.is_sign_positive(), angle);
        assert!(!keeps(1.0, 1.0, -0.5) && !keeps(1.0, 1.0, 2.0) && !keeps(1.0, 0.0, 2.0));
        assert!(!keeps(0.0, 1.0, 1e-9) && !keeps(0.0, -1.0, 4.0) && !keeps(f64::NAN, 1.0, 0.0));
    }
}
