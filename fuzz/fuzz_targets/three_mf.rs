//! Any bytes as the archive of a 3MF file.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("three_mf", bytes));
