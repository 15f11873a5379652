//! Kani's interface where Kani is not.
//!
//! Harnesses in the `proofs` of the crates for firmware are written for [Kani](https://github.com/model-checking/kani).
//! Where `cargo kani` runs them, this crate is not there. Elsewhere it stands in, twice:
//!
//! - under `cargo test` it **samples**: every harness is run some thousand times on edge cases and random bit patterns.
//!   That proves nothing; it finds what is plainly wrong, and counter-examples can be replayed and debugged.
//! - compiled to wasm by `cargo xtask prove` it is **symbolic**: `any` and `assume` are imports that CBMC gives their
//!   meaning. That proves, within what `docs/src/audit` says of the route.
//!
//! The names and the meaning are Kani's; what the harnesses do not use is not here.
#![cfg_attr(target_family = "wasm", no_std)]

pub use cvg_kani_macros::{proof, should_panic, solver, unwind};

#[cfg(not(target_family = "wasm"))]
mod sampled;
#[cfg(target_family = "wasm")]
mod symbolic;

#[cfg(not(target_family = "wasm"))]
pub use sampled::{Expected, any_f32, any_f64, any_u64, assume, cover_hit, drive};
#[cfg(target_family = "wasm")]
pub use symbolic::{any_f32, any_f64, any_u64, assume, cover_hit};

/// A type of which every value can be drawn.
pub trait Arbitrary: Sized {
    /// Any value.
    fn any() -> Self;
}

impl Arbitrary for f32 {
    fn any() -> Self {
        any_f32()
    }
}

impl Arbitrary for f64 {
    fn any() -> Self {
        any_f64()
    }
}

impl Arbitrary for bool {
    fn any() -> Self {
        any_u64() & 1 == 1
    }
}

macro_rules! integers {
    ($($t:ident)+) => {$(
        impl Arbitrary for $t {
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "the lower bits are any value")]
            fn any() -> Self {
                any_u64() as $t
            }
        }
    )+};
}
integers!(u8 i8 u16 i16 u32 i32 u64 i64 usize isize);

impl<T: Arbitrary, const N: usize> Arbitrary for [T; N] {
    fn any() -> Self {
        core::array::from_fn(|_| T::any())
    }
}

/// Any value of the type.
pub fn any<T: Arbitrary>() -> T {
    T::any()
}

/// Any value of the type for which `holds`.
pub fn any_where<T: Arbitrary>(holds: impl FnOnce(&T) -> bool) -> T {
    let value = T::any();
    assume(holds(&value));
    value
}

/// A place that has to be reachable with a condition that has to be possible, or the proof around it says nothing.
///
/// The text names the cover in reports and has to be a literal.
#[macro_export]
macro_rules! cover {
    ($condition:expr, $text:literal) => {
        $crate::cover_hit(const { $crate::fingerprint($text) }, $text, $condition)
    };
}

/// FNV-1a of a cover's text: by this number the compiled harness names it.
pub const fn fingerprint(text: &str) -> u32 {
    let bytes = text.as_bytes();
    let (mut hash, mut i) = (0x811c_9dc5_u32, 0);
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u32).wrapping_mul(0x0100_0193);
        i += 1;
    }
    hash
}
