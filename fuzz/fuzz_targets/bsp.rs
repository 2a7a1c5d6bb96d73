//! Any bytes as files of splats.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("bsp", bytes));
