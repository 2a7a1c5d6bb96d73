//! Large machines: tables that carry layers, regions in comments, codes that switch deposition.

use super::*;
use crate::toolpath::{Section, UP};

const SIZES: GcodeOptions = GcodeOptions {
    skip_auxiliary: false,
    firmware: None,
    filament_diameter: None,
    width: Some(4.0),
    height: Some(2.0),
    skip_features: Vec::new(),
    arc_tolerance: None,
    unit: None,
    layer_axis: None,
    extruder_axis: None,
    deposit_on: Vec::new(),
    deposit_off: Vec::new(),
    variables: Vec::new(),
    plate: None,
};

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9 * b.abs().max(1.0)
}

fn table() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/reports/w_axis_layers.gcode");
    std::fs::read_to_string(path).unwrap()
}

fn names(report: &GcodeReport) -> Vec<(&str, u64)> {
    report.features.iter().filter(|f| f.beads > 0).map(|f| (&*f.name, f.segments)).collect()
}

/// The points of all beads.
fn points(path: &Toolpath) -> Vec<Vec<[f64; 3]>> {
    (0..path.len()).map(|bead| path.points(bead).to_vec()).collect()
}

fn notes(report: &GcodeReport) -> String {
    report.notes.iter().map(|note| note.what.clone()).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_table_that_goes_down_carries_layers() {
    let options = GcodeOptions { width: Some(20.0), ..GcodeOptions::default() };
    let (report, path) = parse(table(), &options).unwrap();
    assert_eq!((report.beads, report.layers, report.machine.height.as_str()), (2, 2, "Z - W"));
    assert_eq!(path.points(0), [[0.0, 0.0, 10.0], [100.0, 0.0, 10.0], [100.0, 100.0, 10.0]]);
    assert_eq!(path.points(1), [[0.0, 0.0, 15.0], [100.0, 0.0, 15.0], [100.0, 100.0, 15.0]]);
    // Nobody tells where the bed is: the first layer is as high as the second.
    assert_eq!([0, 1].map(|bead| path.section(bead, 0)), [Section { width: 20.0, height: 5.0 }; 2]);
    assert_eq!([0, 1].map(|bead| path.attributes(bead).layer), [0, 1]);
    assert_eq!(names(&report), [("PERIMETER", 4)]);
    assert_eq!((report.unknown, report.notes), (vec![], vec![]));
    assert_eq!(report.machine.deposition, "M3, M4 to M5");
    let area = Section { width: 20.0, height: 5.0 }.stadium_area();
    assert!(close(report.bead_volume, 400.0 * area));
}

#[test]
fn the_axis_of_layers_may_be_given() {
    for (axis, text, heights, formula) in [
        (None, table(), [10.0, 15.0], "Z - W"),
        (Some("-W"), table(), [10.0, 15.0], "Z - W"),
        (Some("W"), table(), [0.0, -5.0], "Z + W"),
        // Falling columns and a second vertical axis.
        (Some("U"), table().replace('W', "U").replace("U-", "U"), [10.0, 15.0], "Z + U"),
        (Some("-A"), table().replace(" W", " A").replace("Z5", "Z0"), [5.0, 10.0], "Z - A"),
        // Lifts the tool: otherwise the part would grow downwards.
        (None, table().replace("W-", "W"), [10.0, 15.0], "Z + W"),
        (Some("-Z"), table().replace("W-", "Z-").replace(" Z5", ""), [5.0, 10.0], "-Z"),
    ] {
        let layer_axis = axis.map(|axis| axis.parse().unwrap());
        let (report, path) = parse(text, &GcodeOptions { layer_axis, ..SIZES }).unwrap();
        assert_eq!([0, 1].map(|bead| path.points(bead)[0][2]), heights, "{axis:?}");
        assert_eq!((&*report.machine.height, report.notes), (formula, vec![]), "{axis:?}");
    }
    // Refused or told, never silent.
    let (report, path) =
        parse(table(), &GcodeOptions { layer_axis: Some(LayerAxis::NONE), ..SIZES }).unwrap();
    assert_eq!(([0, 1].map(|bead| path.points(bead)[0][2]), report.notes), ([5.0, 5.0], vec![]));
    let (report, _) = parse(table().replace('W', "V"), &SIZES).unwrap();
    assert!(notes(&report).contains("`layer_axis` V"), "{}", notes(&report));
    let both = GcodeOptions {
        layer_axis: Some("W".parse().unwrap()),
        extruder_axis: Some("W".parse().unwrap()),
        ..SIZES
    };
    assert!(parse(table(), &both).unwrap_err().to_string().contains("cannot feed and carry"));
}

#[test]
fn tables_move_in_every_way() {
    // Relative moves, inches, a change of the name, and a table that makes a spiral.
    for (text, expected) in [
        ("G0 Z5\nG91\nG0 W-5\nG90\nM3\nG1 X10\nM5\nG0 X0\nG91\nG0 W-5\nG90\nM3\nG1 X10", [10.0, 15.0]),
        ("G20\nG0 Z1 W-1\nM3\nG1 X10\nM5\nG0 X0 W-2\nM3\nG1 X10", [50.8, 76.2]),
        ("G0 Z5 W-5\nM3\nG1 X10\nM5\nG92 W0\nG0 X0 W-5\nM3\nG1 X10", [10.0, 15.0]),
        ("G0 W-5\nM3\nG1 X10\nM5\nG28 W\nG0 X0 W-6\nM3\nG1 X10", [5.0, 6.0]),
    ] {
        let path = parse(text, &SIZES).unwrap().1;
        let found = [0, 1].map(|bead| path.points(bead)[0][2]);
        assert!(found.iter().zip(expected).all(|(a, b)| close(*a, b)), "{text}: {found:?}");
    }
    let (report, path) = parse("G0 Z1\nM3\nG1 X10 W-1\nG1 X0 W-3", &SIZES).unwrap();
    assert_eq!(path.points(0), [[0.0, 0.0, 1.0], [10.0, 0.0, 2.0], [0.0, 0.0, 4.0]]);
    assert!(close(report.length, 101f64.sqrt() + 104f64.sqrt()));
    // Where it stands still while material is laid, heights stay as Z has them.
    let (report, path) = parse("G0 W-5\nG0 Z1\nM3\nG1 X10\nM5\nG0 W0", &SIZES).unwrap();
    assert_eq!((path.points(0)[0][2], &*report.machine.height), (1.0, "Z"));
}

#[test]
fn heights_on_tables_come_from_the_header() {
    let header = "(G-Code Syntax: Cincinnati)\n(Layer Height: 0.2in)\n(Default Extrusion Width: 0.5in)\n";
    let program = "G0 Z-6 W-0.2\nM3 S10\nG1 X10 (PERIMETER)\nM5\nG0 X0 W-0.4\nM3 S10\nG1 X10 (SKIN)\nM5\n";
    let (report, path) = parse(format!("{header}{program}"), &GcodeOptions::default()).unwrap();
    let section = Section { width: 12.7, height: 5.08 };
    assert_eq!([0, 1].map(|bead| path.section(bead, 0)), [section; 2]);
    assert!(close(path.points(0)[1][0], 254.0));
    assert_eq!((report.widths.setting, report.heights.step), (2, 2));
    let machine = &report.machine;
    assert_eq!((machine.dialect.as_deref(), machine.unit_source), (Some("Cincinnati"), UnitSource::Header));
    assert_eq!(machine.text(), "Cincinnati; deposition by M3, M4 to M5, height Z - W, inches by the header");
}

#[test]
fn inches_come_from_the_option_the_header_or_a_code() {
    let program = "G0 Z1\nM3\nG1 X2 Y1\nG2 X4 Y1 I1 J0\nM5\n";
    let mm = "G0 Z25.4\nM3\nG1 X50.8 Y25.4\nG2 X101.6 Y25.4 I25.4 J0\nM5\n";
    let expected = points(&parse(mm, &SIZES).unwrap().1);
    for (head, unit, source) in [
        ("", Some(25.4), UnitSource::Option),
        ("G20\n", None, UnitSource::Code),
        ("G21\nG20\n", None, UnitSource::Code),
        ("G70\n", None, UnitSource::Code),
        ("G700\n", None, UnitSource::Code),
        ("(Layer Height: 0.2in)\n", None, UnitSource::Header),
        ("; G-Code Syntax: Haas-Inch\n", None, UnitSource::Header),
        ("(Layer Height: 5mm)\n", Some(25.4), UnitSource::Option),
        ("G40 G20 G49\n", None, UnitSource::Code),
    ] {
        let (report, path) = parse(format!("{head}{program}"), &GcodeOptions { unit, ..SIZES }).unwrap();
        for (a, b) in points(&path).concat().iter().zip(expected.concat()) {
            assert!(a.iter().zip(b).all(|(a, b)| close(*a, b)), "{head}{unit:?}: {a:?} instead of {b:?}");
        }
        assert_eq!((report.machine.unit_source, report.machine.unit_mm), (source, Some(25.4)), "{head}");
    }
    // What the program says counts.
    let (report, path) = parse(format!("G21\n{mm}"), &GcodeOptions { unit: Some(25.4), ..SIZES }).unwrap();
    assert_eq!((points(&path), report.machine.unit_source), (expected, UnitSource::Code));
    assert!(notes(&report).contains("not `unit`"));
    // A cycle of lathes.
    let lathe = parse(format!("G70 P1 Q2\n{mm}"), &SIZES).unwrap().0;
    assert_eq!(lathe.machine.unit_mm, Some(1.0));
}

#[test]
fn regions_layers_and_widths_stand_in_comments() {
    let program = |open: &str, close: &str| {
        format!(
            "{open}LAYER COUNT: 2{close}\n{open}BEGINNING LAYER: 1{close}\nG0 X0 Y0 Z2 {open}TRAVEL{close}\nM3 S9\n\
             G1 X10 {open}PERIMETER{close}\nG1 Y10 {open}PERIMETER SLOW DOWN{close}\nG1 X0 {open}SKELETON-6.5{close}\n\
             G1 Y0 {open}SKELETON-12700.0 COASTING{close}\nM5\nG0 X1 Y1 {open}TRAVEL{close}\nM3 S9\nG1 X9\n\
             G1 Y9 {open}TRAVEL{close}\nG1 X1 {open}INFILL{close}\nM5\n{open}BEGINNING LAYER: 2{close}\nG0 X0 Y0\nM3 S9\n\
             G1 X10 {open}SKIN{close}\nM5\n"
        )
    };
    for (open, close) in [("(", ")"), (";", ""), ("; ", "")] {
        let head = format!("{open}Layer Height: 2mm{close}\n{open}Default Extrusion Width: 4mm{close}\n");
        let (report, path) = parse(head + &program(open, close), &GcodeOptions::default()).unwrap();
        let found: Vec<_> = (0..path.len())
            .map(|bead| {
                let name = &*report.features[usize::from(path.attributes(bead).feature)].name;
                (name, path.attributes(bead).layer, path.section(bead, 0).width, path.points(bead).len() - 1)
            })
            .collect();
        let expected = [
            ("PERIMETER", 0, 4.0, 2),
            ("SKELETON", 0, 6.5, 2),
            ("SKELETON", 0, 12.7, 1),
            ("TRAVEL", 0, 4.0, 1),
            ("INFILL", 0, 4.0, 1),
            ("SKIN", 1, 4.0, 1),
        ];
        assert_eq!(found, expected, "{open}");
        assert_eq!(path.section(1, 1).width, 12.7);
        assert_eq!((report.layers, report.widths.comment, report.widths.setting), (2, 3, 5));
        assert_eq!((report.unknown, report.notes), (vec![], vec![]), "{open}");
        let skipped =
            parse(program(open, close), &GcodeOptions { skip_features: vec!["travel".into()], ..SIZES });
        assert_eq!(skipped.unwrap().0.skipped.segments, 1);
    }
}

#[test]
fn comments_of_other_slicers_are_no_regions() {
    // In lower case, behind moves: what PrusaSlicer writes where it is verbose.
    let text = "M83\nG1 Z1\nG1 X9 E1 ; perimeter\nG1 X0 E1 ; INFILL OF SOMETHING\nM12 (SKIN)\nG1 X5 E1\n";
    let (report, _) = parse(text, &SIZES).unwrap();
    assert_eq!(names(&report), [(UNNAMED, 3)]);
    // Those in parentheses may be any slicer's.
    let text = "M83\n(TYPE:Outer wall)\n(WIDTH:3)\n(LAYER:0)\nG1 Z1\nG1 X9 E1\n(LAYER 1)\nG1 X0 E1\n";
    let (report, path) = parse(text, &GcodeOptions { width: None, ..SIZES }).unwrap();
    assert_eq!((names(&report), report.layers), (vec![("Outer wall", 2)], 2));
    assert_eq!(path.section(0, 0).width, 3.0);
}

/// A program that lays two beads of 10 mm between a code that switches on and one that switches off.
fn switched(on: &str, off: &str) -> String {
    format!(
        "G21 G90\nG0 X0 Y0 Z2\n{on}\nG1 X10 F600\n{off}\nG1 Y5\nG0 X0\nG1 Y9\n{on}\nG1 X10\nG0 X20\n{off}\nG1 X30\nM30\n"
    )
}

const TWO_BEADS: [[[f64; 3]; 2]; 2] =
    [[[0.0, 0.0, 2.0], [10.0, 0.0, 2.0]], [[0.0, 9.0, 2.0], [10.0, 9.0, 2.0]]];

#[test]
fn every_dialect_switches_deposition() {
    for (on, off, dialect) in [
        ("M3 S100", "M5", None),
        ("M4 S100 (TURN ON)", "M3 S0", None),
        ("M3", "M5 S0", None),
        ("EXTRUDER(120)", "EXTRUDER(0)", Some("Ingersoll")),
        ("N10 EXTRUDER(120.5) ; TURN EXTRUDER ON", "n20 extruder( 0 )", Some("Ingersoll")),
        ("BEAD_AREA=8.0", "WHEN TRUE DO EXTR_END=2.0", Some("Siemens")),
        ("N10 BEAD_AREA = 8", "N20 WHEN TRUE DO EXTR_END=2.0", Some("Siemens")),
        ("BEAD_AREA=8", "BEAD_AREA=0", Some("Siemens")),
        ("G441 (TURN LASER ON)", "G442 (TURN LASER OFF)", Some("Mazak")),
        ("M64 P8\nM66 P1 L3 Q10\nM65 P8", "M64 P9\nM66 P1 L3 Q10\nM65 P9", Some("Meltio")),
        ("M64 P0", "M65 P0", None),
        ("M4 S300 @714\nM34 S300 @714\nM54", "M35\nM5", Some("MELD")),
        ("M24 S300", "M25", Some("MELD")),
        ("M100 (WIRE ARC WELDER ON)", "M101 (WIRE ARC WELDER OFF)", None),
        ("M101", "M103", None),
        ("M52 (TURN GUN ON)\nM3 S5", "M53 (TURN GUN OFF)", Some("MVP")),
    ] {
        let (report, path) = parse(switched(on, off), &SIZES).unwrap();
        assert_eq!(points(&path), TWO_BEADS, "{on}");
        assert_eq!(report.machine.dialect.as_deref(), dialect, "{on}");
        assert_eq!((report.unknown, report.notes), (vec![], vec![]), "{on}");
        let area = Section { width: 4.0, height: 2.0 }.stadium_area();
        assert!(close(report.bead_volume, 20.0 * area));
    }
}

#[test]
fn commands_and_moves_share_lines() {
    let text = "G0 Z2\nEXTRUDER(5) G1 X10 ;PERIMETER\nEXTRUDER(0) G1 X20\nEXTRUDER( 5 )\nG1 X30 EXTRUDER=0\nG1 X40\n";
    let path = parse(text, &SIZES).unwrap().1;
    assert_eq!(points(&path), [[[0.0, 0.0, 2.0], [10.0, 0.0, 2.0]]]);
    let text = "G0 Z2\nBEAD_AREA = 8 G1 X10\nBEAD_AREA=0 G1 X20\nBEAD_AREA=8 ; G1 X9\nG1 X30\n";
    let path = parse(text, &GcodeOptions { width: None, ..SIZES }).unwrap().1;
    let expected = [[[0.0, 0.0, 2.0], [10.0, 0.0, 2.0]], [[20.0, 0.0, 2.0], [30.0, 0.0, 2.0]]];
    assert_eq!(points(&path), expected);
}

#[test]
fn any_code_switches_by_option() {
    let marks =
        |codes: &[&str]| codes.iter().map(|code| code.parse().unwrap()).collect::<Vec<DepositionCode>>();
    for (on, off, deposit_on, deposit_off) in [
        ("M207 P1", "M207 P0", marks(&["M207P1"]), marks(&["m207 p0"])),
        ("G82", "G83 (0)", marks(&["G82"]), marks(&["G83"])),
        ("LASER(5)", "LASER(0)", marks(&["LASER"]), vec![]),
        ("ARC_ON", "ARC_OFF", marks(&["ARC_ON"]), marks(&["ARC_OFF"])),
        ("M64 P3 Q1", "M65 P3", marks(&["M64 P3"]), marks(&["M65 P3"])),
        // In the place of those that are known, and of E.
        ("M3\nM7", "M9", marks(&["M7"]), marks(&["M9"])),
        ("M7\nG92 E0", "M9\nG1 E5", marks(&["M7"]), marks(&["M9"])),
    ] {
        let options = GcodeOptions { deposit_on, deposit_off, ..SIZES };
        let (report, path) = parse(switched(on, off), &options).unwrap();
        assert_eq!(points(&path), TWO_BEADS, "{on}");
        assert_eq!(report.unknown, [], "{on}");
    }
    let missing = GcodeOptions { deposit_on: marks(&["M7"]), ..SIZES };
    assert!(parse("G1 X1", &missing).unwrap_err().to_string().contains("`deposit_off`"));
    let missing = GcodeOptions { deposit_off: marks(&["M7"]), ..SIZES };
    assert!(parse("G1 X1", &missing).unwrap_err().to_string().contains("`deposit_on`"));
    let text = parse(switched("M7", "M9"), &SIZES).unwrap_err().to_string();
    assert!(text.contains("no move deposited anything") && text.contains("`deposit_on`"), "{text}");
    let two = parse(format!("{}M100\nM101\n", switched("M3 S5", "M5")), &SIZES);
    assert!(two.unwrap_err().to_string().contains("M100 to M101"));
}

#[test]
fn speeds_of_zero_deposit_nothing() {
    for (text, expected) in [
        ("G0 Z2\nM3 S0\nG1 X10\nM3 S5\nG1 X20\nM5", vec![[10.0, 20.0]]),
        ("G0 Z2\nM3 S5\nG1 X10\nG1 X20 S0\nG1 X30\nG1 X40 S9\nG1 X50\nM5", vec![[0.0, 10.0], [30.0, 50.0]]),
        ("G0 Z2\nS0\nM3\nG1 X10\nS7\nG1 X20\nS0\nG1 X30", vec![[10.0, 20.0]]),
        ("G0 Z2\nM3 S5\nG1 X10\nM5 S0\nG1 X20\nM3 S5 G1 X30", vec![[0.0, 10.0], [20.0, 30.0]]),
        ("M8 M3 S5\nG0 Z2\nG1 X10\nG0 X20\nG2 X30 I5 S0\nG1 X40 S1\nM9 M5", vec![[0.0, 10.0], [30.0, 40.0]]),
    ] {
        let (report, path) = parse(text, &SIZES).unwrap();
        let found: Vec<_> = points(&path).iter().map(|bead| [bead[0][0], bead[bead.len() - 1][0]]).collect();
        assert_eq!(found, expected, "{text}");
        assert_eq!(report.unknown, [], "{text}");
    }
}

#[test]
fn areas_that_the_file_gives_make_widths() {
    let text = switched("BEAD_AREA=12.5", "WHEN TRUE DO EXTR_END=2.0");
    let options = GcodeOptions { width: None, ..SIZES };
    let (report, path) = parse(&text, &options).unwrap();
    assert!((path.section(0, 0).stadium_area() - 12.5).abs() < 1e-9);
    assert!(close(report.bead_volume, 250.0) && close(report.fed_volume.unwrap(), 250.0));
    assert_eq!(report.filament_source, FilamentSource::None);
    // In inches, along an arc, of two areas.
    let text = "G700\nG0 X0 Y0 Z0.1\nBEAD_AREA=0.02\nG1 X1\nBEAD_AREA=0.04\nG2 X3 Y0 I1 J0\nBEAD_AREA=0";
    let (report, path) = parse(text, &options).unwrap();
    let volume = 25.4f64.powi(3) * (0.02 + 0.04 * std::f64::consts::PI);
    assert!(close(report.fed_volume.unwrap(), volume), "{report:?}");
    assert!((path.section(0, 0).stadium_area() - 0.02 * 645.16).abs() < 1e-9);
    assert!((path.section(0, 9).stadium_area() - 0.04 * 645.16).abs() < 0.02);
}

#[test]
fn vectors_tilt_the_head() {
    for (line, expected) in [
        ("G1 X10 A3=0 B3=0 C3=1", UP),
        ("G1 X10 A3=0.6 B3=0 C3=0.8", [0.6, 0.0, 0.8]),
        ("G1 X10 A3=3 C3=4 AN3=0 BN3=1", [0.6, 0.0, 0.8]),
        ("G1 X=10 A3 = 0 B3=-0.6 C3= 0.8 F100", [0.0, -0.6, 0.8]),
    ] {
        let (report, path) = parse(format!("G0 Z2\nEXTRUDER(5)\n{line}\nEXTRUDER(0)\n"), &SIZES).unwrap();
        let found = path.axis(0, 1);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{line}: {found:?}");
        assert_eq!((path.axis(0, 0), path.points(0)[1]), (UP, [10.0, 0.0, 2.0]));
        assert_eq!(report.beads, 1);
    }
    // The same as B by degrees; and by A, B and C again.
    let text = "G0 Z2\nM3\nG1 X10 B30\nG1 X20 A3=0.5 C3=0.8660254037844386\nG1 X30 B0\nG3 X40 I5 A3=1 C3=0";
    let path = parse(text, &SIZES).unwrap().1;
    let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(near(path.axis(0, 1), path.axis(0, 2)) && path.axis(0, 3) == UP);
    let last = path.points(0).len() - 1;
    assert!(near(path.axis(0, last), [1.0, 0.0, 0.0]));
    let middle = path.axis(0, (3 + last) / 2);
    assert!(
        (middle[0] - 0.5f64.sqrt()).abs() < 0.05 && close(middle.iter().map(|x| x * x).sum(), 1.0),
        "{middle:?}"
    );
    let text = parse("G0 Z2\nM3\nG1 X10 A3=0 B3=0 C3=0", &SIZES).unwrap_err().to_string();
    assert!(text.contains("line 3") && text.contains("no direction"), "{text}");
}

#[test]
fn assignments_and_variables() {
    let expected = points(&parse("G0 X1 Z2\nM3\nG1 X10 Y5\nG2 X20 Y5 R5", &SIZES).unwrap().1);
    for text in [
        "G0 X=1 Z = 2\nM3\nG1 X=10 Y=+5\nG2 X=20 Y=5 CR=5",
        "#200 = 1.5\nG0 X1 Z[#200 + 0.5]\nM3\nG1 X10 Y5\nG2 X20 Y5 R[10/2]",
        "R1 = 10\nR2=R1/2 ; half\nG0 X1 Z2\nM3\nG1 X=R1 Y=R2\nG2 X=2*R1 Y=R2 CR=R2",
        "#<high>=2 (mm)\n#5=1\nG0 X#5 Z#<High>\nM3\nG1 X[10*#5]Y5\nG2 X20 Y5 R5",
        "START=4\nG0 X=AC(1) Z=START-2\nM3\nG1 X=10 Y=5\nG2 X20 Y5 R5",
    ] {
        assert_eq!(points(&parse(text, &SIZES).unwrap().1), expected, "{text}");
    }
    for (text, what) in [
        ("G0 Z[#200]", "`variable` '#200=0'"),
        ("R1=R2*2\nG0 X=R1", "R1 has no value"),
        ("G0 X=IC(5)", "the function"),
        ("G0 X=[1", "closing bracket"),
        ("G0 X=", "has no number"),
        ("G10 L2 P1 X=R9", "R9 has no value"),
    ] {
        let text = parse(format!("G0 Z2\nM3\nG1 X5\n{text}\n"), &SIZES).unwrap_err().to_string();
        assert!(text.contains(what), "{text}");
    }
    // A variable without a value that nothing hangs on does no harm.
    parse("R1=SIN(5)\nDEF REAL TOP=3\nG0 Z2\nM3\nG1 X5", &SIZES).unwrap();
    let known = GcodeOptions { variables: vec![("#200".to_owned(), 0.5)], ..SIZES };
    let path = parse("G0 Z[#200 + 1.5]\nM3\nG1 X5", &known).unwrap().1;
    assert_eq!(path.points(0)[0][2], 2.0);
}

#[test]
fn another_axis_may_feed() {
    let options = |axis: &str| GcodeOptions {
        extruder_axis: Some(axis.parse().unwrap()),
        filament_diameter: Some(2.0),
        width: None,
        ..SIZES
    };
    for axis in ["A", "B", "C", "U", "V", "W", "E"] {
        let text = "G1 Z2\nG1 X10 E2\nG1 X20\nG92 E0\nG1 X30 E1\nG1 E0\nG1 X0\nG1 E1\nM83\nG1 X10 E1"
            .replace('E', axis);
        let (report, path) = parse(&text, &options(axis)).unwrap();
        assert_eq!((report.beads, report.retractions, &*report.machine.deposition), (3, 1, axis), "{axis}");
        assert!(close(report.fed_volume.unwrap(), 4.0 * std::f64::consts::PI));
        assert_eq!((path.axis(0, 1), report.unknown), (UP, vec![]));
    }
    // Not guessed, but told.
    let text = "G1 Z2\nG1 X10 A2\nG1 X20 A4\nG1 X30 A5.5\nG1 X40 A9\n";
    let told = parse(text, &SIZES).unwrap_err().to_string();
    assert!(told.contains("`extruder_axis` A"), "{told}");
    let told = parse(text.replace('A', "W"), &SIZES).unwrap_err().to_string();
    assert!(told.contains("`extruder_axis` W"), "{told}");
    let told = |axis: char| notes(&parse(format!("G0 Z2\nM3\nG1 X5 {axis}900"), &SIZES).unwrap().0);
    assert!(told('A').contains("`layer_axis` A or -A") && told('C').is_empty());
    let (report, _) = parse("G1 Z2\nM83\nG1 X5 A2 E1", &options("A")).unwrap();
    assert!(notes(&report).contains("E is left out"));
}
