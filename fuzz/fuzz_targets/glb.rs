//! Any bytes as binary glTF.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("glb", bytes));
