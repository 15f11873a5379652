//! Any bytes as the first draws of a small campaign with known values, damaged in a way of which its readers know nothing: no
//! panic, an end, and no answer that misses by more than the width of its 99.9 % interval without a word of warning.

use cvg_tests::broken::lies::of_bytes;

pub fn run(bytes: &[u8]) {
    let outcome = of_bytes(bytes);
    assert!(!(outcome.is_lie && outcome.is_silent), "{}", outcome.what);
}
