//! Any bytes as point clouds as text.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("xyz", bytes));
