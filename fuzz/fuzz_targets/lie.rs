#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| cvg_fuzz::target("lie")(bytes));
