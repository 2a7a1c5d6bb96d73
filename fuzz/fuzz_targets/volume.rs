//! Any bytes as volumes.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("volume", bytes));
