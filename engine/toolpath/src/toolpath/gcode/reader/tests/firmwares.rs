//! Where firmwares read the same words differently: E after G91, turns of arcs, M200; and what was retracted.

use super::*;
use std::f64::consts::{FRAC_PI_4, PI};

/// mm³ in a mm of filament of 1.75 mm.
const AREA: f64 = FRAC_PI_4 * 1.75 * 1.75;

fn options(firmware: &str) -> GcodeOptions {
    GcodeOptions { firmware: Firmware::by_name(firmware), ..GcodeOptions::default() }
}

/// Material fed in moves that deposit, in units of E, by filaments of 1.75 mm.
fn fed(text: &str, firmware: &str) -> f64 {
    parse(text, &options(firmware)).map_or(0.0, |(report, _)| report.fed_volume.unwrap() / AREA)
}

fn length(text: &str, firmware: &str) -> f64 {
    let (report, _) = parse(text, &options(firmware)).unwrap();
    report.length + report.arcs.length_lost
}

fn notes(text: &str, options: &GcodeOptions) -> Vec<(String, u64)> {
    let report = parse(text, options).unwrap().0;
    report.notes.into_iter().filter(|note| note.line > 0).map(|note| (note.what, note.line)).collect()
}

#[test]
fn g91_makes_e_relative_as_each_firmware_has_it() {
    const HEAD: &str = "M82\nG1 Z0.2\nG1 X20 E1\n";
    // A line while G91 holds, and one after it.
    let hop = format!("{HEAD}G91\nG1 E-0.5 Z1\nG1 E0.5 Z-1\nG1 X5 E0.25\nG90\nG1 X0 E2.25\n");
    for firmware in ["", "marlin", "marlin2", "klipper", "repetier", "smoothie", "sprinter"] {
        assert!((fed(&hop, firmware) - 2.25).abs() < 1e-9, "{firmware}: {}", fed(&hop, firmware));
    }
    // RepRapFirmware and Prusa's 8-bit firmware: E goes to -0.5, 0.5, 0.25, 2.25, and only the last of them deposits.
    let segments = |firmware| parse(&hop, &options(firmware)).unwrap().0.segments;
    assert_eq!(["", "klipper", "reprapfirmware", "prusa"].map(segments), [3, 3, 2, 2]);
    // M82 while G91 holds counts for Marlin 2 alone; M83 before G90 holds on but for it.
    let m82 = format!("{HEAD}G91\nM82\nG1 X5 E1.25\n");
    let m83 = "M83\nG91\nG1 Z0.2\nG90\nG1 X20 E1\nG1 X0 E1\n";
    for (firmware, after_m82, after_m83) in
        [("klipper", 2.25, 2.0), ("marlin", 2.25, 2.0), ("marlin2", 1.25, 1.0), ("smoothie", 1.25, 1.0)]
    {
        assert!((fed(&m82, firmware) - after_m82).abs() < 1e-9, "{firmware}: {}", fed(&m82, firmware));
        assert!((fed(m83, firmware) - after_m83).abs() < 1e-9, "{firmware}: {}", fed(m83, firmware));
    }
    let told = notes(m83, &options(""));
    assert!(told.len() == 1 && told[0].1 == 5 && told[0].0.contains("Marlin 2"), "{told:?}");
    assert_eq!(notes(m83, &options("klipper")), []);
    assert_eq!(notes(&hop, &options("")), []);
}

#[test]
fn the_file_names_its_firmware_and_the_option_overrules() {
    let body = "M82\nG1 Z0.2\nG1 X20 E1\nG91\nG1 X5 E0.5\nG90\n";
    for (head, firmware, source) in [
        ("", "marlin or klipper", FirmwareSource::Assumed),
        (";FLAVOR:RepRap\n", "reprapfirmware", FirmwareSource::File),
        ("; gcode_flavor = reprapfirmware\n", "reprapfirmware", FirmwareSource::File),
        ("; gcode_flavor = klipper\n", "klipper", FirmwareSource::File),
        (";FIRMWARE_NAME:RepRapFirmware for Duet 3\n", "reprapfirmware", FirmwareSource::File),
    ] {
        for text in [format!("{head}{body}"), format!("{body}{head}")] {
            let report = parse(&text, &GcodeOptions::default()).unwrap().0;
            assert_eq!((report.firmware.name(), report.firmware_source), (firmware, source), "{text}");
            let expected = if firmware == "reprapfirmware" { 1.0 } else { 1.5 };
            assert!((report.fed_volume.unwrap() / AREA - expected).abs() < 1e-9, "{text}");
        }
    }
    let report = parse(format!(";FLAVOR:RepRap\n{body}"), &options("marlin")).unwrap().0;
    assert_eq!((report.firmware.name(), report.firmware_source), ("marlin", FirmwareSource::Option));
    assert_eq!(report.firmware_named_by.as_deref(), Some("FLAVOR:RepRap"));
    assert!((report.fed_volume.unwrap() / AREA - 1.5).abs() < 1e-9);
}

#[test]
fn arcs_turn_as_each_firmware_has_it() {
    let quarter =
        |p: &str| format!("M83\n;HEIGHT:0.5\n;WIDTH:0.5\nG0 X0 Y10 Z0.5\nG2 X10 Y0 I0 J-10 E30 {p}\n");
    let circle = |p: &str| format!("M83\n;HEIGHT:0.5\n;WIDTH:0.5\nG0 X0 Y10 Z0.5\nG2 I0 J-10 E30 {p}\n");
    for (text, firmware, turns) in [
        (quarter("P2"), "", 1.25),
        (quarter("P2"), "linuxcnc", 1.25),
        (quarter("P1"), "grbl", 0.25),
        (quarter("P1"), "marlin", 1.25),
        (quarter("P2"), "marlin2", 2.25),
        (quarter("P0"), "marlin", 0.25),
        (quarter("P2"), "klipper", 0.25),
        (quarter("P3"), "reprapfirmware", 0.25),
        (circle("P1"), "linuxcnc", 1.0),
        (circle("P3"), "linuxcnc", 3.0),
        (circle("P3"), "marlin", 4.0),
        (circle(""), "marlin", 1.0),
    ] {
        let found = length(&text, firmware) / (20.0 * PI);
        assert!((found - turns).abs() < 1e-9, "{firmware}: {found} instead of {turns} in {text}");
    }
    // Told where the file does not say, or the firmware does not know P; never where nothing is deposited.
    assert!(
        notes(&quarter("P2"), &options("")).iter().any(|(what, line)| what.contains("RS-274") && *line == 5)
    );
    assert!(notes(&quarter("P2"), &options("klipper")).iter().any(|(what, _)| what.contains("klipper")));
    assert_eq!(notes(&quarter("P2"), &options("marlin")), []);
    assert_eq!(notes("M83\nG1 Z.2\nG1 X9 E1\nG17\nG2 Z0.6 I0.86 J0.86 P1\n", &options("")), []);
    for (p, firmware) in [("P1.5", ""), ("P-1", "marlin"), ("P0", "linuxcnc"), ("P1001", "grbl")] {
        let error = parse(quarter(p), &options(firmware)).unwrap_err().to_string();
        assert!(error.contains("line 5") && error.contains("P (turns)"), "{error}");
    }
}

#[test]
fn helices_of_many_turns_rise_and_feed_evenly() {
    let text = ";FLAVOR:Marlin\nM83\n;HEIGHT:0.5\n;WIDTH:0.5\nG0 X0 Y10 Z0\nG3 X-10 Y0 Z9 I0 J-10 E90 P2\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    let angle = 2.25 * 2.0 * PI;
    let expected = ((10.0 * angle) * (10.0 * angle) + 81.0f64).sqrt();
    assert!((report.length + report.arcs.length_lost - expected).abs() < 1e-6, "{}", report.length);
    assert!((report.fed_volume.unwrap() / AREA - 90.0).abs() < 1e-9);
    // After each full turn the tip is above the start, by 4 mm of the 9.
    for z in [4.0, 8.0] {
        let above = path.points(0).iter().find(|p| (p[2] - z).abs() < 1e-9).unwrap();
        assert!((above[0]).abs() < 1e-9 && (above[1] - 10.0).abs() < 1e-9, "{above:?}");
    }
}

#[test]
fn volumes_are_told_by_m200_and_flavors() {
    let width = |text: &str, firmware: &str| parse(text, &options(firmware)).unwrap().1.section(0, 0).width;
    let by_volume = 0.08 / 0.2 + 0.2 * (1.0 - FRAC_PI_4);
    let by_length = 0.08 * AREA / 0.2 + 0.2 * (1.0 - FRAC_PI_4);
    const MOVE: &str = "M83\nG0 Z0.2\nG1 X100 E8\n";
    for (head, expected) in [
        ("M200 S1\n", by_volume),
        ("M200 D1.75\n", by_volume),
        ("M200 D1.75 S1\n", by_volume),
        ("M200 T0 D2.85\n", by_volume),
        ("M200 D1.75 S0\n", by_length),
        ("M200 D1.75\nM200 D0\n", by_length),
        ("M200 D1.75\nM200 S0\n", by_length),
        ("M200 D0 S1\n", by_length),
        ("; filament_diameter = 1.75\n; use_volumetric_e = 1\n", by_volume),
        (";FLAVOR:Marlin(Volumetric)\n", by_volume),
        (";FLAVOR:UltiGCode\n", by_volume),
        (";FLAVOR:Marlin\n", by_length),
    ] {
        let found = width(&format!("{head}{MOVE}"), "");
        assert!((found - expected).abs() < 1e-9, "{head}: {found} instead of {expected}");
    }
    assert!((width(&format!("M200 D1.75\n{MOVE}"), "klipper") - by_length).abs() < 1e-9);
    assert!(notes(&format!("M200 D1.75\n{MOVE}"), &options("klipper"))[0].0.contains("M200"));
    // Ultimaker's filament is wider, and nothing in the file says so.
    let griffin = parse(format!(";FLAVOR:Griffin\n{MOVE}"), &GcodeOptions::default()).unwrap().0;
    assert_eq!((griffin.filament_diameters, griffin.filament_source), (vec![2.85], FilamentSource::Assumed));
    let ulti = parse(format!(";FLAVOR:UltiGCode\n{MOVE}"), &GcodeOptions::default()).unwrap().0;
    assert_eq!((ulti.filament_source, ulti.notes), (FilamentSource::Volumetric, vec![]));
}

#[test]
fn two_diameters_and_two_ways_of_counting() {
    let moves = "M83\nG0 Z0.2\nT0\nG1 X100 E8\nT1\nG1 X0 E8\n";
    let sections = |head: &str, firmware: &str| {
        let path = parse(format!("{head}{moves}"), &options(firmware)).unwrap().1;
        [0, 1].map(|bead| path.section(bead, 0).stadium_area() * 100.0 / 8.0)
    };
    let thick = FRAC_PI_4 * 2.85 * 2.85;
    for (head, firmware, expected) in [
        ("; filament_diameter = 1.75,2.85\n", "", [AREA, thick]),
        ("M200 T0 D1.75 S0\nM200 T1 D2.85 S0\n", "", [AREA, thick]),
        ("M200 T0 D1.75\nM200 T1 D2.85\n", "", [1.0, 1.0]),
        ("M200 T1 D2.85\n; filament_diameter = 1.75,2.85\n", "repetier", [AREA, 1.0]),
        ("M200 D0:2.85\n; filament_diameter = 1.75,2.85\n", "reprapfirmware", [AREA, 1.0]),
        ("M200 D1.75:2.85\n", "reprapfirmware", [1.0, 1.0]),
    ] {
        let found = sections(head, firmware);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{head}: {found:?}");
    }
}

#[test]
fn what_was_retracted_is_fed_before_anything_leaves() {
    for (moves, expected, made_up) in [
        // Standing, in full: nothing happens.
        ("G1 X50 E10\nG1 E-2\nG0 X0 Y5\nG1 E2\nG1 X50 E10\n", 20.0, 0),
        // With restart: the rest is a blob.
        ("G1 X50 E10\nG1 E-2\nG0 X0 Y5\nG1 E2.5\nG1 X50 E10\n", 20.0, 0),
        // Wiped, primed while the nozzle comes down.
        ("G1 X50 E10\nG1 X45 E-2\nG1 Z1.2\nG1 Z1 E2\nG1 X50 Y1 E1\n", 11.0, 0),
        // Fed again in the very move that deposits.
        ("G1 X50 E10\nG1 E-2\nG0 X0 Y5\nG1 X50 E12\n", 20.0, 1),
        // Made up for in several moves.
        ("G1 X50 E10\nG1 E-2\nG0 X0 Y5\nG1 X10 E1\nG1 X20 E3\nG1 X30 E2\n", 14.0, 2),
        // Rounded: no more than the digits.
        ("G1 X50 E10.00\nG1 X49 E-0.67\nG1 X48 E-0.67\nG1 X47 E-0.67\nG1 E2.00\nG1 X50 Y9 E10.00\n", 20.0, 0),
        // Each tool for itself.
        (
            "G1 X50 E10\nG1 E-2\nT1\nG1 X0 E10\nG1 E-1\nT0\nG1 E2\nG1 X50 Y5 E10\nT1\nG1 E1\nG1 X0 E1\n",
            31.0,
            0,
        ),
        ("G1 X50 E10\nG1 E-2\nT1\nG1 X0 E10\nT0\nG1 X50 E10\n", 28.0, 1),
        // The firmware loads another filament.
        ("G1 X50 E10\nG1 E-2\nM600\nG1 X0 E10\n", 20.0, 0),
        // Called otherwise, it is retracted all the same.
        ("G1 X50 E10\nG1 E-2\nG92 E0\nG1 X0 E10\n", 18.0, 1),
    ] {
        let text = format!("M83\nG1 Z1\n{moves}");
        let (report, path) = parse(&text, &GcodeOptions::default()).unwrap();
        let found = report.fed_volume.unwrap() / AREA;
        assert!((found - expected).abs() < 1e-9, "{found} instead of {expected} in {moves}");
        assert_eq!(report.made_up.count, made_up, "{moves}");
        let beads: f64 = (0..path.len()).map(|bead| path.attributes(bead).fed.unwrap()).sum();
        assert!((beads - report.fed_volume.unwrap()).abs() < 1e-9);
        assert!((report.bead_volume / beads - 1.0).abs() < 1e-9, "{moves}");
    }
}

#[test]
fn beads_begin_where_the_filament_is_back() {
    let text = "M83\nG1 Z1\nG1 X40 E8\nG1 E-2\nG0 X0 Y5\nG1 X40 E8\n";
    let (_, path) = parse(text, &GcodeOptions::default()).unwrap();
    assert_eq!(path.points(1), [[10.0, 5.0, 1.0], [40.0, 5.0, 1.0]]);
    assert!((path.section(0, 0).width - path.section(1, 0).width).abs() < 1e-12);
    // Arcs as well: a half circle of which the first half makes up.
    let text = "M83\nG1 Z1\nG1 X40 E8\nG1 E-4\nG0 X0 Y0\nG3 X20 I10 E8\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    let points = path.points(1);
    assert!((points[0][0] - 10.0).abs() < 1e-9 && (points[0][1] + 10.0).abs() < 1e-9, "{:?}", points[0]);
    assert_eq!(points[points.len() - 1], [20.0, 0.0, 1.0]);
    assert!((report.fed_volume.unwrap() / AREA - 12.0).abs() < 1e-9);
    // Filaments that share a nozzle share what was retracted.
    let text = "M83\nG1 Z1\nT0\nG1 X40 E8\nG1 E-50\nT1\nG1 X0 E50\nG1 X40 E8\n";
    let shared = format!("; single_extruder_multi_material = 1\n{text}");
    assert!((fed(text, "") - 66.0).abs() < 1e-9 && (fed(&shared, "") - 16.0).abs() < 1e-9);
}
