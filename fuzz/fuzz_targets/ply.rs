//! Any bytes as PLY, meshes and point clouds.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| brickfield_engine::fuzz::feed("ply", bytes));
