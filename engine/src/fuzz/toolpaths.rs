//! The readers of toolpaths and of X3D.

use crate::Silent;
use crate::toolpath::gcode::{GcodeOptions, read_gcode_from};
use crate::x3d::Sweeps;
use std::path::Path;

/// Any bytes are G-code with sound beads, or an error.
pub fn gcode(data: &[u8]) {
    let sizes = GcodeOptions { width: Some(0.5), height: Some(0.2), ..GcodeOptions::default() };
    for options in [GcodeOptions::default(), sizes] {
        let result = read_gcode_from(Path::new("input"), || Ok(data), &options, &mut |bead| {
            assert_eq!(bead.points.len(), bead.sections.len() + 1);
            assert!(bead.points.windows(2).all(|pair| pair[0] != pair[1]));
            assert!(bead.points.iter().chain(bead.axes).flatten().all(|x| x.is_finite()));
            assert!(bead.axes.is_empty() || bead.axes.len() == bead.points.len());
            assert!(bead.sections.iter().all(|s| s.width > 0.0 && s.height > 0.0));
            assert!(bead.sections.iter().all(|s| s.stadium_area().is_finite()));
            assert!(bead.attributes.lines.0 <= bead.attributes.lines.1);
            Ok(())
        });
        match result {
            Ok(report) => assert!(report.beads > 0 && report.bead_volume.is_finite()),
            Err(error) => assert!(!error.to_string().contains('\n')),
        }
    }
}

/// Triangles looked at: a short text may stand for very many.
const LOOKED_AT: u64 = 1 << 14;

/// Any bytes as an X3D file: an error or sweeps, never a panic, a hang or a coordinate that is no number.
pub fn x3d(bytes: &[u8]) {
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
}
