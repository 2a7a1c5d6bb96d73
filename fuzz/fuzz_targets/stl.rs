//! Any bytes as STL, binary or text.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("stl", bytes));
