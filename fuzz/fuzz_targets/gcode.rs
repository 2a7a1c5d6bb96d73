//! Any bytes are G-code with sound beads, or an error.
#![no_main]

use brickfield_engine::toolpath::gcode::{GcodeOptions, read_gcode_from};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|data: &[u8]| {
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
});
