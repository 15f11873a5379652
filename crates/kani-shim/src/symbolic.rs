//! `any`, `assume` and `cover` as imports of the compiled harness: whoever runs the module gives them their meaning.

mod host {
    #[link(wasm_import_module = "k")]
    unsafe extern "C" {
        pub(super) safe fn any_f32() -> f32;
        pub(super) safe fn any_f64() -> f64;
        pub(super) safe fn any_u64() -> u64;
        pub(super) safe fn assume(condition: u32);
        pub(super) safe fn cover(fingerprint: u32, condition: u32);
    }
}

/// Any bit pattern.
pub fn any_f32() -> f32 {
    host::any_f32()
}

/// Any bit pattern.
pub fn any_f64() -> f64 {
    host::any_f64()
}

/// Any bit pattern.
pub fn any_u64() -> u64 {
    host::any_u64()
}

/// Only what satisfies the condition goes on from here.
pub fn assume(condition: bool) {
    host::assume(u32::from(condition));
}

/// What [`cover!`](crate::cover) calls.
pub fn cover_hit(fingerprint: u32, _text: &'static str, condition: bool) {
    host::cover(fingerprint, u32::from(condition));
}
