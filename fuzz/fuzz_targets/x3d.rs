//! Any bytes as an X3D file: an error or sweeps, never a panic, a hang or a coordinate that is no number.
#![no_main]

use brickfield_engine::Silent;
use brickfield_engine::x3d::Sweeps;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

/// Triangles looked at: a short text may stand for very many.
const LOOKED_AT: u64 = 1 << 14;

fuzz_target!(|bytes: &[u8]| {
    let Ok(sweeps) = Sweeps::read(Path::new("a.x3d"), bytes, &Silent) else { return };
    sweeps.report().warnings();
    let facets = sweeps.facets();
    let mut whole = Vec::new();
    sweeps.append(0..LOOKED_AT, &mut whole);
    assert_eq!(whole.len() as u64, facets.min(LOOKED_AT));
    let middle = facets.min(LOOKED_AT) / 2;
    let mut parts = Vec::new();
    sweeps.append(0..middle, &mut parts);
    sweeps.append(middle..LOOKED_AT, &mut parts);
    // Bits, for huge scales may overflow to what equals nothing.
    let bits = |t: &[[f64; 3]; 3]| t.map(|corner| corner.map(f64::to_bits));
    assert!(whole.iter().map(bits).eq(parts.iter().map(bits)));
    sweeps.append(facets - 1..facets, &mut parts);
});
