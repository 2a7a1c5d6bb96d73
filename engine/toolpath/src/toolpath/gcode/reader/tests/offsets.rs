//! Offsets of coordinates, saved states, flow factors: where beads lie, and how much is fed.

use super::*;

fn options() -> GcodeOptions {
    GcodeOptions {
        width: Some(1.0),
        height: Some(0.5),
        filament_diameter: Some(2.0),
        ..GcodeOptions::default()
    }
}

/// From and to of each bead.
fn ends(text: &str) -> Vec<[[f64; 3]; 2]> {
    let path = parse(text, &options()).unwrap_or_else(|error| panic!("{text}: {error}")).1;
    (0..path.len())
        .map(|bead| [path.points(bead)[0], path.points(bead)[path.points(bead).len() - 1]])
        .collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[track_caller]
fn assert_ends(text: &str, expected: &[[[f64; 3]; 2]]) {
    let found = ends(text);
    assert_eq!(found.len(), expected.len(), "{text}: {found:?}");
    for (a, b) in found.iter().flatten().flatten().zip(expected.iter().flatten().flatten()) {
        assert!(close(*a, *b), "{text}: {found:?} instead of {expected:?}");
    }
}

#[test]
fn machine_coordinates_are_travel_on_one_line() {
    let beads = [[[0.0, 0.0, 1.0], [10.0, 0.0, 1.0]], [[5.0, 5.0, 1.0], [9.0, 5.0, 1.0]]];
    for text in [
        "G0 G90 G53 Z0.\nG0 X0 Y0 Z1\nM3 S5\nG1 X10\nG53 G1 X500 Y500\nG0 X5 Y5\nG1 X9\nM5\nG53 Y0.0\nG0 G90 G53 Z0.",
        "G90 G0 G54 X0 Y0\nG43 H60 Z1.0\nM3 S5\nG1 X10\nG53 Z100\nG0 X5 Y5 Z1\nG1 X9\nM5\nG0 G53 Z0",
        "G10 L2 P1 X100 Y100 Z100\nG54\nG0 X-100 Y-100 Z-99\nM3\nG1 X-90\nG53 G0 X5 Y5 Z1\nG1 X-91",
        "G0 Z1\nM3\nG1 X10\nM5\nG0 SUPA Z=500 D0\nG153 X7\nG0 X5 Y5 Z1\nM3\nG1 X9\nG1 SUPA Z500",
        "M83\nG1 Z1\nG1 X10 E1\nG53 G1 X50 Y50 E1\nG1 X5 Y5\nG1 X9 E1",
    ] {
        assert_ends(text, &beads);
    }
    // The offset is not known: a bead that begins where G53 led is told.
    let (report, _) = parse("G54\nG0 Z1\nG53 G0 X5\nM3\nG1 Y5", &options()).unwrap();
    assert!(report.notes[0].what.contains("where G53 left X"), "{:?}", report.notes);
}

#[test]
fn work_offsets_place_beads() {
    let program = "G0 X0 Y0 Z1\nM3\nG1 X10\nM5\n";
    let at = |x: f64, y: f64, z: f64| [[x, y, z + 1.0], [x + 10.0, y, z + 1.0]];
    for (text, expected) in [
        (format!("G54\n{program}"), vec![at(0.0, 0.0, 0.0)]),
        (format!("G10 L2 P1 X100 Y20 Z3\n{program}"), vec![at(100.0, 20.0, 3.0)]),
        (
            format!("G10 P2 L2 X100\nG55\n{program}G54\n{program}"),
            vec![at(100.0, 0.0, 0.0), at(0.0, 0.0, 0.0)],
        ),
        (format!("G10 L2 P9 Y7\nG59.3\n{program}"), vec![at(0.0, 7.0, 0.0)]),
        (format!("G10 L2 P7 Y7\nG59.1\n{program}"), vec![at(0.0, 7.0, 0.0)]),
        (format!("G59\nG10 L2 P0 Z4\n{program}"), vec![at(0.0, 0.0, 4.0)]),
        (format!("G54.1 P3\n{program}"), vec![at(0.0, 0.0, 0.0)]),
        (format!("G0 X5 Y6 Z7\nG10 L20 P1 X0 Y0 Z0\n{program}"), vec![at(5.0, 6.0, 7.0)]),
        (format!("G0 X5\nG10 L20 P2 X1\nG55\n{program}"), vec![at(4.0, 0.0, 0.0)]),
        (format!("G52 X3 Y4\n{program}G52 X0 Y0\n{program}"), vec![at(3.0, 4.0, 0.0), at(0.0, 0.0, 0.0)]),
        (format!("G10 L2 P2 X9\nG52 X3\nG55\n{program}"), vec![at(12.0, 0.0, 0.0)]),
        (format!("G20\nG10 L2 P1 X1\nG21\n{program}"), vec![at(25.4, 0.0, 0.0)]),
        (format!("G0 X8\nG92 X0\n{program}G92.1\n{program}"), vec![at(8.0, 0.0, 0.0), at(0.0, 0.0, 0.0)]),
        (
            format!("G0 X8\nG92 X0\nG92.2\n{program}G92.3\n{program}"),
            vec![at(0.0, 0.0, 0.0), at(8.0, 0.0, 0.0)],
        ),
        (format!("G10 L2 P2 X9\nG0 X8\nG92 X0\nG55\n{program}"), vec![at(17.0, 0.0, 0.0)]),
        (format!("G40 G49 G80 G90 G10 L2 P1 Y3\n{program}"), vec![at(0.0, 3.0, 0.0)]),
    ] {
        assert_ends(&text, &expected);
    }
    let notes = |text: &str| parse(text, &options()).unwrap().0.notes;
    assert_eq!(notes(&format!("G54\n{program}")), []);
    assert_eq!(notes(&format!("G10 L2 P2 X9\nG55\n{program}")), []);
    for text in
        [format!("G54\n{program}G55\n{program}"), format!("G10 L2 P1 X9\nG54\n{program}G55\n{program}")]
    {
        assert!(notes(&text)[0].what.contains("G10 L2 P1"), "{text}");
    }
    for (text, what) in
        [("G10 L2 P10 X1", "no machine has"), ("G10 L2 P1 R5", "turns"), ("G10 L2 P1.5", "no machine")]
    {
        let found = parse(format!("{text}\n{program}"), &options()).unwrap_err().to_string();
        assert!(found.contains("line 1") && found.contains(what), "{found}");
    }
}

#[test]
fn firmware_retracts_without_beads() {
    let text = "M207 S3 Z0.5\nM208 S0.1\nM83\nG1 Z1\nG1 X10 E1\nG10\nG1 X20\nG11\nG1 X30 E1\nG10 S1\nG11\n";
    let (report, path) = parse(text, &options()).unwrap();
    assert_eq!((path.len(), report.retractions, report.blobs.count), (2, 2, 0));
    assert!(close(report.fed_volume.unwrap(), 2.0 * std::f64::consts::PI));
    // RepRapFirmware: temperatures and offsets of tools.
    let (report, _) = parse("G10 P0 S200 R150\nM83\nG1 Z1\nG1 X10 E1\n", &options()).unwrap();
    assert_eq!((report.retractions, report.notes), (0, vec![]));
    let (report, _) = parse("G10 P0 X5 Y5\nM83\nG1 Z1\nG1 X10 E1\n", &options()).unwrap();
    assert!(report.notes[0].what.contains("offsets of tools"));
}

#[test]
fn flow_factors_scale_what_is_fed() {
    let unit = std::f64::consts::PI;
    for (text, fed) in [
        ("M221 S50\nM83\nG1 Z1\nG1 X10 E2", 1.0),
        ("M221 S200\nG1 Z1\nG1 X10 E1\nM221 S100\nG1 X20 E2", 3.0),
        ("M221 S50 T1\nM83\nG1 Z1\nG1 X10 E2\nT1\nG1 X20 E2", 3.0),
        ("M221 T1 S50\nT1\nM83\nG1 Z1\nG1 X10 E2\nM221 S200\nG1 X20 E1\nT0\nG1 X30 E1", 4.0),
        ("M221 S0\nM83\nG1 Z1\nG1 X10 E2\nM221 S100\nG1 X20 E1", 1.0),
        ("M221 S; push\nM221 Z0\nM83\nG1 Z1\nG1 X10 E2", 2.0),
        ("M221 S50\nM82\nG1 Z1\nG1 X10 E2\nG1 E1\nG1 X20\nG1 E2\nG1 X30 E4", 2.0),
    ] {
        let (report, path) = parse(text, &GcodeOptions { width: None, ..options() }).unwrap();
        assert!(close(report.fed_volume.unwrap(), fed * unit), "{text}: {:?}", report.fed_volume);
        assert!(close(report.bead_volume, fed * unit) && report.notes.is_empty(), "{text}");
        assert!(!path.is_empty() && report.blobs.count == 0, "{text}");
    }
}

#[test]
fn klipper_saves_and_restores_states() {
    let line = |y: f64| [[0.0, y, 1.0], [10.0, y, 1.0]];
    for (text, expected) in [
        // Modes.
        (
            "M82\nG1 Z1\nSAVE_GCODE_STATE NAME=a\nG91\nM83\nG1 X5\nRESTORE_GCODE_STATE NAME=a\nG1 X0\nG1 X10 E1",
            vec![line(0.0)],
        ),
        // The tool goes back with MOVE=1 only.
        (
            "M83\nG1 Z1\nSAVE_GCODE_STATE NAME=a\nG1 X50 Y50\nRESTORE_GCODE_STATE NAME=a MOVE=1 MOVE_SPEED=50\nG1 X10 E1",
            vec![line(0.0)],
        ),
        (
            "M83\nG1 Z1\nSAVE_GCODE_STATE\nG1 X50 Y7\nRESTORE_GCODE_STATE MOVE=0\nG1 X0\nG1 X10 E1",
            vec![line(7.0)],
        ),
        // Offsets by G92 are part of the state.
        (
            "M83\nG1 Z1\nSAVE_GCODE_STATE NAME=a\nG92 Y5\nRESTORE_GCODE_STATE NAME=a\nG1 Y5\nG1 X10 E1",
            vec![line(5.0)],
        ),
        // E goes on as it was counted when the state was saved.
        (
            "M82\nG1 Z1\nG92 E7\nSAVE_GCODE_STATE NAME=a\nG92 E0\nG1 E-2\nG1 E0\nRESTORE_GCODE_STATE NAME=a\nG1 X10 E8",
            vec![line(0.0)],
        ),
        // Offsets of SET_GCODE_OFFSET move what comes, not the tool, unless it says so.
        ("M83\nG1 Z1\nSET_GCODE_OFFSET Y=3\nG1 X10 E1\nG1 X0 Y0\nG1 X10 E1", vec![line(0.0), line(3.0)]),
        ("M83\nG1 Z1\nSET_GCODE_OFFSET Y=3 MOVE=1\nG1 X10 E1", vec![line(3.0)]),
        (
            "M83\nG1 Z1\nSET_GCODE_OFFSET Y=3\nSET_GCODE_OFFSET Y_ADJUST=-1 MOVE=1\nG1 Y0\nG1 X10 E1",
            vec![line(2.0)],
        ),
        (
            "M83\nG1 Z1\nset_gcode_offset y=3\nSAVE_GCODE_STATE NAME=a\nSET_GCODE_OFFSET Y=9\nRESTORE_GCODE_STATE NAME=a\nG1 Y0\nG1 X10 E1",
            vec![line(3.0)],
        ),
    ] {
        assert_ends(text, &expected);
        assert_eq!(parse(text, &options()).unwrap().0.unknown, [], "{text}");
    }
    let (report, _) = parse("M83\nG1 Z1\nRESTORE_GCODE_STATE NAME=b\nG1 X1 E1", &options()).unwrap();
    assert!(report.notes[0].what.contains("was not saved"));
    let text =
        "M83\nG1 Z1\nSAVE_GCODE_STATE NAME=a\nM221 S50\nG1 X10 E2\nRESTORE_GCODE_STATE NAME=a\nG1 X0 E2";
    let fed = parse(text, &options()).unwrap().0.fed_volume.unwrap();
    assert!(close(fed, 3.0 * std::f64::consts::PI));
}

#[test]
fn radii_of_both_signs_in_all_planes() {
    // From (0, 0) to (2, 0) about (1, 0) ± 1: a quarter circle of √2, or the other three quarters.
    let quarter = std::f64::consts::FRAC_PI_2 * 2f64.sqrt();
    for (plane, words) in [("G17", ["X2", "Y0"]), ("G18", ["Z2", "X0"]), ("G19", ["Y2", "Z0"])] {
        for (radius, turns, length) in [
            ("1.4142135623730951", "G2", quarter),
            ("1.4142135623730951", "G3", quarter),
            ("-1.4142135623730951", "G2", 3.0 * quarter),
            ("-1.4142135623730951", "G3", 3.0 * quarter),
        ] {
            let text = format!("M3\n{plane}\n{turns} {} {} R{radius}\n", words[0], words[1]);
            let options = GcodeOptions { arc_tolerance: Some(1e-6), ..options() };
            let (report, _) = parse(&text, &options).unwrap();
            let found = report.length + report.arcs.length_lost;
            assert!(close(found, length), "{text}: {found} instead of {length}");
        }
    }
}
