//! Any bytes as tables of beads for picks.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("picks", bytes));
