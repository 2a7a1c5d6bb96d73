//! Any bytes as binary G-code.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("bgcode", bytes));
