//! Any bytes as LAS, packed or not.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("las", bytes));
