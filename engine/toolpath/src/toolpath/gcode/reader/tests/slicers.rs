//! Heads and bodies as slicers write them: what is read of them, and that there is nothing to complain about.

use super::*;

/// A file of the tests.
fn slicer(name: &str) -> (GcodeReport, Toolpath) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/gcode").join(name);
    let mut toolpath = Toolpath::default();
    let report = read_gcode(&path, &GcodeOptions::default(), &Silent, &mut |bead| {
        toolpath.push(bead);
        Ok(())
    });
    (report.unwrap(), toolpath)
}

#[test]
fn every_slicer_is_read_without_complaint() {
    for (name, firmware, diameters, layers, features) in [
        ("bambu_studio.gcode", "bambu", &[1.75][..], 2, &["Outer wall", "Inner wall"][..]),
        ("orca_klipper.gcode", "klipper", &[1.75], 2, &["Outer wall", "Sparse infill"]),
        ("prusaslicer_mk3.gcode", "prusa", &[1.75], 2, &["Skirt/Brim", "External perimeter"]),
        ("simplify3d.gcode", "marlin or klipper", &[1.75; 3], 2, &["skirt", "outer perimeter"]),
        ("kisslicer.gcode", "marlin or klipper", &[1.75], 2, &["Perimeter Path", "Solid Path"]),
        ("ideamaker.gcode", "marlin or klipper", &[2.85], 2, &["WALL-OUTER", "FILL"]),
        ("cura_ultimaker2.gcode", "ultigcode", &[], 2, &["WALL-OUTER", "SKIN"]),
    ] {
        let (report, path) = slicer(name);
        assert_eq!(report.firmware.name(), firmware, "{name}");
        assert_eq!(report.filament_diameters, diameters, "{name}");
        assert_eq!(report.layers, layers, "{name}");
        let named: Vec<&str> =
            report.features.iter().filter(|f| f.beads > 0).map(|f| f.name.as_str()).collect();
        for feature in features {
            assert!(named.contains(feature), "{name}: {named:?}");
        }
        assert!(report.slicer.is_some(), "{name}");
        assert!(
            report.settings.layer_height.is_some_and(|height| height == 0.2),
            "{name}: {:?}",
            report.settings
        );
        assert_eq!((&report.notes, &report.unknown), (&vec![], &vec![]), "{name}");
        assert_eq!(report.warnings(), Vec::<String>::new(), "{name}");
        let (fed, beads) = (report.fed_volume.unwrap(), report.bead_volume);
        assert!((beads / fed - 1.0).abs() < 0.05, "{name}: {beads} of {fed}");
        for bead in 0..path.len() {
            assert_eq!(path.section(bead, 0).height, 0.2, "{name}: {bead}");
        }
    }
}

#[test]
fn commands_that_are_not_known_are_told_in_one_line() {
    let text = "M83\nMY_MACRO A=1\nM1999\nMY_MACRO\nG1 Z1\nG1 X10 E1\n";
    let report = parse(text, &GcodeOptions::default()).unwrap().0;
    let lines: Vec<String> =
        report.warnings().into_iter().filter(|line| line.contains("not known")).collect();
    assert_eq!(lines, ["left out, since not known: \"MY_MACRO\" (line 2 and 1 more), \"M1999\" (line 3)"]);
}

#[test]
fn klipper_chooses_extruders_by_name() {
    let text = "M83\nG1 Z1\nG1 X10 E1\nACTIVATE_EXTRUDER EXTRUDER=extruder1\nG1 X0 E1\n\
                activate_extruder extruder=extruder\nG1 X10 E1\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    let tools: Vec<u16> = (0..path.len()).map(|bead| path.attributes(bead).tool).collect();
    assert_eq!((tools, report.unknown), (vec![0, 1, 0], vec![]));
}

#[test]
fn files_without_e_take_their_width_from_the_settings() {
    let text = "; extrusion_width = 6\nG1 Z2\nM3\nG1 X100\nM5\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    assert_eq!((path.section(0, 0).width, report.widths.setting), (6.0, 1));
}

#[test]
fn exponents_are_told_with_their_line() {
    let text = "M83\nG1 Z0.2\nG1 X20 E0.8\nG1 X20 Y1.2e-05\nG1 X40 E8.1e-01\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    assert_eq!(path.points(1), [[20.0, 1.2e-5, 0.2], [40.0, 1.2e-5, 0.2]]);
    let notes: Vec<_> = report.notes.iter().filter(|note| note.what.contains("exponent")).collect();
    assert_eq!((notes.len(), notes[0].line, notes[0].count), (1, 4, 2), "{notes:?}");
    // Unspaced, as RS-274 has it, in large and small letters.
    for text in ["M83\nG1Z1\nG1X10E5\nG1X0E1\n", "m83\ng1z1\ng1x10e5\ng1x0e1\n"] {
        let report = parse(text, &GcodeOptions::default()).unwrap().0;
        assert_eq!(report.segments, 2);
        assert!(report.notes.iter().all(|note| !note.what.contains("exponent")));
    }
    let report = parse("M83\nG1Z1\nG1X10E5\nG1X5.5Y5E1\nG1X1.5E-6\n", &GcodeOptions::default()).unwrap().0;
    let told = report.notes.iter().find(|note| note.what.contains("could be an exponent")).unwrap();
    assert_eq!(told.line, 5);
}
