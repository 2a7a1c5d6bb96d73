//! Files of real slicers and the dialect test, against counts and lengths found without this reader.

use super::*;
use crate::toolpath::Section;

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

fn feature(report: &GcodeReport, name: &str) -> FeatureReport {
    report.features.iter().find(|feature| feature.name == name).expect("the feature").clone()
}

#[test]
fn prusaslicer_says_all() {
    let (report, path) = load("clover.gcode", &skipping(&["skirt/brim"])).unwrap();
    // 5,867 segments of 8.82 m and 72.782 cm³ were counted by another program. It cut runs at bends of more than
    // 45 degrees into 238 pieces; the file has two runs a layer.
    assert_eq!((report.segments, report.beads, report.layers), (5867, 34, 17));
    assert!(close(report.length, 8820.0, 1e-3) && close(report.bead_volume, 72782.0, 1e-4), "{report:?}");
    assert_eq!(feature(&report, "External perimeter").segments, 3541);
    assert_eq!(feature(&report, "Internal infill").segments, 2326);
    assert_eq!((report.skipped.beads, report.skipped.segments), (1, 77));
    assert_eq!((report.filament_diameters, report.filament_source), (vec![10.0], FilamentSource::Comment));
    assert_eq!((report.widths.comment, report.heights.comment), (5867, 5867));
    assert_eq!((report.unknown, report.notes), (vec![], vec![]));

    assert_eq!(path.len(), 34);
    let infill = path.attributes(1);
    assert_eq!((infill.layer, infill.tool, infill.lines), (0, 0, (325, 382)));
    assert_eq!(path.section(1, 0), Section { width: 3.0, height: 1.5 });
    assert_eq!(path.section(33, 0), Section { width: 6.0, height: 1.5 });
    assert_eq!(path.points(33)[0][2], 25.5);
}

#[test]
fn fed_volume_is_bead_volume_where_comments_tell_the_width() {
    // Segments counted by a script of a few lines: E grows and the tool moves.
    for (name, segments, layers, tools) in [
        ("clover.gcode", 5_944, 17, 1),
        ("gcode/spot40_relE_prusaslicer.gcode.xz", 32_261, 131, 1),
        ("gcode/spot40_2tool_prusaslicer.gcode.xz", 21_497, 98, 2),
        ("gcode/featuretype50_prusaslicer.gcode.xz", 32_940, 46, 1),
        ("gcode/thinwall_ladder_prusaslicer.gcode.gz", 6_089, 59, 1),
        ("gcode/void_ladder_prusaslicer.gcode.gz", 25_330, 99, 1),
    ] {
        let (report, path) = load(name, &GcodeOptions::default()).unwrap();
        let fed = report.fed_volume.unwrap();
        assert!(close(report.bead_volume, fed, 0.005), "{name}: {fed} fed, {} in beads", report.bead_volume);
        assert_eq!((report.segments, report.layers, report.tools.len()), (segments, layers, tools), "{name}");
        assert_eq!((report.blobs.count, report.merged), (0, 0), "{name}");
        assert_eq!(report.unknown, [], "{name}");
        let by_bead: f64 = (0..path.len()).map(|bead| path.attributes(bead).fed.unwrap()).sum();
        assert!(close(by_bead, fed, 1e-9), "{name}");
    }
}

#[test]
fn cura_says_layers_only() {
    let (report, path) = load("gcode/clover_cura.gcode.xz", &GcodeOptions::default()).unwrap();
    // `grep -c ';LAYER:'` and an independent count of moves with growing E.
    assert_eq!((report.layers, report.segments), (252, 135_487));
    assert_eq!(report.meshes, ["clover.stl"]);
    assert_eq!(report.filament_source, FilamentSource::Assumed);
    // Two lines of purge before the first layer.
    assert_eq!(feature(&report, UNNAMED).segments, 2);
    assert_eq!((report.widths.extrusion, report.heights.step), (135_487, 135_487));
    // Cura feeds rectangles of 0.4 mm: a stadium of the same area is wider by h(1 − π/4).
    assert_eq!(report.heights.range, Some((0.1, 0.3)));
    for bead in 2..path.len() {
        let Section { width, height } = path.section(bead, 0);
        let expected = 0.4 + height * (1.0 - std::f64::consts::FRAC_PI_4);
        assert!(close(width, expected, 0.01), "line {}: {width}", path.attributes(bead).lines.0);
        assert_eq!(height, if path.attributes(bead).layer == 0 { 0.3 } else { 0.1 });
    }
    assert!(close(report.bead_volume, report.fed_volume.unwrap(), 1e-9));
    let notes: Vec<&str> = report.notes.iter().map(|note| &*note.what).collect();
    assert!(notes[1].contains("placeholder") && report.notes[1].line == 153_458, "{notes:?}");
}

#[test]
fn slic3r_says_nothing() {
    let (report, path) = load("gcode/spot40_slic3r_nometa.gcode.xz", &GcodeOptions::default()).unwrap();
    assert_eq!((report.layers, report.segments), (130, 29_535));
    assert_eq!(report.filament_source, FilamentSource::Comment);
    assert_eq!(report.heights.range, Some((0.3, 0.35)));
    assert!(close(report.bead_volume, report.fed_volume.unwrap(), 1e-9));
    // Hardly more widths than beads, though the numbers of short segments are coarse.
    let runs: usize = (0..path.len())
        .map(|bead| {
            let sections: Vec<_> = (1..path.points(bead).len()).map(|i| path.section(bead, i - 1)).collect();
            sections.chunk_by(|a, b| a == b).count()
        })
        .sum();
    assert!(runs < path.len() * 5 / 4, "{runs} widths in {} beads", path.len());
}
