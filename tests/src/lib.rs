//! What the evidence has in common: the domains the instrument is tested on, the tolerances it is held to, and the
//! scalars every equation runs in.
//!
//! One file of `tests/` is one equation of the paper, one view of the mechanics, or one promise of the repository. The
//! prefix of a test says what kind of evidence it is: `identity_` is proved for all reals, `interval_` is a bound for all
//! inputs of a box with rounding included, `prop_` was tried at random over a whole domain, `paper_` reproduces a number
//! that the paper states, `snapshot_` keeps a table of derived values from changing unseen. Each proof `x` has a
//! `x_twin`: the same claim with an error planted in it, which passes where the engine refutes it.
#![forbid(unsafe_code)]

#[cfg(feature = "recordings")]
pub mod angle_sensor;
#[cfg(feature = "recordings")]
pub mod bench;
#[cfg(feature = "recordings")]
pub mod blind;
#[cfg(feature = "recordings")]
pub mod broken;
#[cfg(feature = "recordings")]
pub mod carrier;
pub mod domain;
pub mod effects;
pub mod envelope_loop;
pub mod proof;
pub mod scalar;
#[cfg(feature = "recordings")]
pub mod soak;
pub mod tolerances;

#[doc(no_inline)]
pub use cvg_model as model;
pub use scalar::Scalar;
pub use tolerances::Tolerance;

use proptest::test_runner::{Config, FailurePersistence, FileFailurePersistence};

/// How the random tests run: a counter-example that was found once is kept beside the test and tried first, unless
/// `PROPTEST_DISABLE_FAILURE_PERSISTENCE` is set.
pub fn config() -> Config {
    let default = Config::default();
    let beside = |_| Box::new(FileFailurePersistence::WithSource("regressions")) as Box<dyn FailurePersistence>;
    Config {
        failure_persistence: default.failure_persistence.clone().map(beside),
        max_global_rejects: 1 << 20,
        ..default
    }
}

/// Runs the properties inside for `T = f64` and for `T = f32`.
#[macro_export]
macro_rules! for_each_scalar {
    ($($properties:tt)*) => {
        mod in_f64 {
            use super::*;
            #[allow(unused_imports, reason = "not every file needs every conversion")]
            use $crate::{Scalar as _, model::Float as _};
            type T = f64;
            proptest::proptest! { #![proptest_config($crate::config())] $($properties)* }
        }
        mod in_f32 {
            use super::*;
            #[allow(unused_imports, reason = "not every file needs every conversion")]
            use $crate::{Scalar as _, model::Float as _};
            type T = f32;
            proptest::proptest! { #![proptest_config($crate::config())] $($properties)* }
        }
    };
}

/// Runs the proofs inside for `T = f64` and for `T = f32`.
#[macro_export]
macro_rules! for_each_precision {
    ($($proofs:tt)*) => {
        mod in_f64 {
            use super::*;
            type T = f64;
            $($proofs)*
        }
        mod in_f32 {
            use super::*;
            type T = f32;
            $($proofs)*
        }
    };
}

/// `actual` is within `tolerance` of `expected` (both as `f64`), or the test fails and shows all three.
#[macro_export]
macro_rules! prop_assert_near {
    ($actual:expr, $expected:expr, $tolerance:expr) => {{
        let (actual, expected, tolerance): (f64, f64, f64) = ($actual, $expected, $tolerance);
        proptest::prop_assert!(
            (actual - expected).abs() <= tolerance,
            "{} = {actual:e}, but {} = {expected:e}: apart by {:e}, allowed {tolerance:e}",
            stringify!($actual),
            stringify!($expected),
            (actual - expected).abs(),
        );
    }};
}
