//! Programs of large machines: tables that carry layers, other units, regions in comments, codes that deposit.

use crate::support::*;
use serde_json::Value;
use std::f64::consts::{FRAC_PI_4, PI};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

/// What a command says as JSON, and its warnings.
#[track_caller]
fn told(args: &[&dyn AsRef<OsStr>]) -> (Value, String) {
    let Run { status, stdout, stderr, .. } = run(args);
    assert_eq!(status, Some(0), "{stderr}");
    (serde_json::from_str(&stdout).expect("JSON"), stderr)
}

#[track_caller]
fn info(file: &Path, more: &[&str]) -> (Value, String) {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"info", &file, &"--json"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    told(&args)
}

#[track_caller]
fn close(found: &Value, expected: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{found} is no number"));
    assert!((found - expected).abs() <= 1e-6 * expected.abs().max(1.0), "{found} instead of {expected}");
}

/// Area of a stadium.
fn stadium(width: f64, height: f64) -> f64 {
    height * (width - height) + FRAC_PI_4 * height * height
}

fn feature<'a>(json: &'a Value, name: &str) -> &'a Value {
    let features = json["features"].as_array().unwrap();
    features.iter().find(|feature| feature["name"] == name).unwrap_or_else(|| panic!("{name}: {json}"))
}

#[test]
fn a_table_carries_layers() {
    let file = data("reports/w_axis_layers.gcode");
    let (json, warnings) = info(&file, &["--width", "20mm"]);
    assert_eq!(warnings, "");
    assert_eq!([&json["layers"], &json["beads"], &json["segments"]], [2, 2, 4]);
    // Z 5 with W -5 and -10: two layers, 5 mm apart, each 5 mm high.
    close(&json["bounds"][0][2], 10.0);
    close(&json["bounds"][1][2], 15.0);
    close(&json["heights"]["range"][0], 5.0);
    close(&json["bead_volume"], 400.0 * stadium(20.0, 5.0));
    assert_eq!(json["machine"]["height"], "Z - W");
    assert_eq!(json["machine"]["unit_source"], "assumed");
    close(&feature(&json, "PERIMETER")["length"], 400.0);
    let text = run(&[&"info", &file, &"--width", &"20mm"]).ok();
    assert!(text.contains("deposition by M3, M4 to M5, height Z - W, mm assumed"), "{text}");
    // By option: the other way round, in another unit, or not at all.
    let (json, _) = info(&file, &["--width", "20mm", "--layer-axis", "W", "--height", "5mm"]);
    close(&json["bounds"][0][2], -5.0);
    let (json, _) = info(&file, &["--width", "20mm", "--units", "in"]);
    close(&json["bounds"][1][2], 15.0 * 25.4);
    close(&json["bounds"][1][0], 2540.0);
    let (json, warnings) = info(&file, &["--width", "20mm", "--layer-axis", "none"]);
    assert_eq!((&json["machine"]["height"], warnings.as_str()), (&"Z".into(), ""));
    let refused = run(&[&"info", &file, &"--layer-axis", &"X"]).misused();
    assert!(refused.contains("no axis that can carry layers"), "{refused}");
    // Another letter is never dropped without a word.
    let dir = Scratch::new();
    let other = dir.file("u.gcode", std::fs::read_to_string(&file).unwrap().replace('W', "U"));
    let (_, warnings) = info(&other, &["--width", "20mm"]);
    assert!(warnings.contains("--layer-axis U"), "{warnings}");
    let (json, _) = info(&other, &["--width", "20mm", "--layer-axis", "-U"]);
    close(&json["bounds"][1][2], 15.0);
}

#[test]
fn a_header_tells_inches_widths_and_regions() {
    let (json, warnings) = info(&data("large_format/cincinnati_inch.nc"), &[]);
    assert_eq!(warnings, "");
    assert_eq!([&json["layers"], &json["beads"], &json["segments"]], [2, 2, 3]);
    assert_eq!(
        (&json["machine"]["dialect"], &json["machine"]["unit_source"]),
        (&"Cincinnati".into(), &"header".into())
    );
    let inch = 25.4;
    // The wipe with S0 lays nothing.
    close(&feature(&json, "PERIMETER")["length"], 20.0 * inch);
    close(&feature(&json, "PERIMETER")["volume"], 20.0 * inch * stadium(0.5 * inch, 0.2 * inch));
    // A width in micrometres.
    close(&feature(&json, "SKELETON")["volume"], 8.0 * inch * stadium(10.16, 0.2 * inch));
    close(&json["bounds"][0][2], -5.8 * inch);
    close(&json["bounds"][1][2], -5.6 * inch);
    close(&json["heights"]["range"][1], 0.2 * inch);
}

#[test]
fn ingersoll_switches_by_a_command_and_tilts_by_vectors() {
    let (json, warnings) = info(&data("large_format/ingersoll.gcode"), &[]);
    // Surface normals of the path are not needed.
    assert!(warnings.lines().count() == 1 && warnings.contains("AN3"), "{warnings}");
    assert_eq!([&json["layers"], &json["beads"], &json["segments"]], [2, 2, 3]);
    assert_eq!(
        (&json["machine"]["dialect"], &json["machine"]["deposition"]),
        (&"Ingersoll".into(), &"EXTRUDER".into())
    );
    close(&feature(&json, "PERIMETER")["volume"], 800.0 * stadium(20.0, 5.0));
    close(&feature(&json, "INFILL")["length"], 500.0);
}

#[test]
fn siemens_gives_areas_and_variables() {
    let (json, warnings) = info(&data("large_format/siemens.mpf"), &["--height", "4mm"]);
    assert!(warnings.lines().all(|line| line.contains("arcs became")), "{warnings}");
    assert_eq!([&json["layers"], &json["beads"]], [2, 2]);
    assert_eq!(json["machine"]["dialect"], "Siemens");
    close(&json["fed_volume"], 80.0 * (100.0 + 25.0 * PI) + 40.0 * 100.0);
    // Width of the stadium of 40 mm² at a height of 4 mm.
    close(&json["widths"]["range"][0], 10.0 + 4.0 * (1.0 - FRAC_PI_4));
    close(&json["bounds"][1][2], 8.0);
}

#[test]
fn haas_pulses_relays_and_goes_home() {
    let (json, warnings) = info(&data("large_format/haas_meltio.nc"), &[]);
    assert!(warnings.lines().all(|line| line.contains("arcs became")), "{warnings}");
    assert_eq!([&json["layers"], &json["beads"]], [2, 2]);
    assert_eq!(json["machine"]["dialect"], "Meltio");
    assert_eq!(json["machine"]["tool_lengths"], true);
    // R-10 over a chord of 20 mm: the half circle.
    let lost = json["arcs"]["length_lost"].as_f64().unwrap();
    close(&Value::from(feature(&json, "PERIMETER")["length"].as_f64().unwrap() + lost), 20.0 + 10.0 * PI);
    close(&json["bounds"][0][2], 1.2);
    close(&json["bounds"][1][2], 2.4);
    close(&json["heights"]["range"][1], 1.2);
}

#[test]
fn offsets_flows_and_another_feeding_axis() {
    let file = data("large_format/two_plates.gcode");
    let refused = run(&[&"info", &file]).failed();
    assert!(refused.contains("--extruder-axis A"), "{refused}");
    let (json, warnings) = info(&file, &["--extruder-axis", "A", "--filament", "2mm"]);
    assert_eq!(warnings, "");
    close(&json["fed_volume"], 0.5 * 80.0 * PI);
    close(&json["bead_volume"], 0.5 * 80.0 * PI);
    close(&json["bounds"][1][0], 300.0);
    close(&json["bounds"][1][1], 50.0);
    assert_eq!(json["machine"]["deposition"], "A");
}

#[test]
fn codes_by_option_and_variables() {
    let dir = Scratch::new();
    let text = "G0 Z[#200 + 2]\nM207 P1\nG1 X10\nM207 P0\nG1 Y5\nARC_ON\nG1 X0\nARC_OFF\nG1 Y0\n";
    let file = dir.file("weld.nc", text);
    let sizes = ["--width", "4mm", "--height", "2mm"];
    let with = |more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"info", &file, &"--json"];
        args.extend(sizes.iter().chain(more).map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args)
    };
    let refused = with(&["--deposit-on", "M207P1", "--deposit-off", "M207P0"]).failed();
    assert!(refused.contains("line 1") && refused.contains("--variable '#200=0'"), "{refused}");
    let known = ["--variable", "#200=1"];
    let refused = with(&known).failed();
    assert!(refused.contains("--deposit-on"), "{refused}");
    let on = ["--deposit-on", "M207P1", "--deposit-on", "ARC_ON"];
    let off = ["--deposit-off", "M207 P0", "--deposit-off", "ARC_OFF"];
    let run = with(&[&known[..], &on, &off].concat());
    assert_eq!((run.status, run.stderr.as_str()), (Some(0), ""));
    let json: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!([&json["beads"], &json["segments"]], [2, 2]);
    close(&json["bounds"][0][2], 3.0);
    assert!(with(&["--variable", "#200"]).misused().contains("name and a number"));
    assert!(with(&["--deposit-on", "5"]).misused().contains("neither a code"));
}

#[test]
fn a_store_of_inches_is_in_mm_and_goes_on_with_the_same_settings_only() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let file = dir.file("inch.nc", "G0 X0 Y0 Z0.2\nM3 S10\nG1 X4\nG1 Y4\nM5\n");
    let build: [&dyn AsRef<OsStr>; 12] = [
        &"build",
        &file,
        &"-o",
        &out,
        &"--units",
        &"in",
        &"--width",
        &"12.7mm",
        &"--cell",
        &"0.05",
        &"--json",
        &"--restart",
    ];
    let (json, _) = told(&build);
    let (length, area) = (8.0 * 25.4, stadium(12.7, 5.08));
    close(&json["toolpaths"][0]["bead_volume"], length * area);
    assert_eq!(json["toolpaths"][0]["machine"]["unit_source"], "option");
    let meta = run(&[&"info", &out, &"--json", &"--volume"]).json();
    let union = meta["volumes"]["union"].as_f64().unwrap();
    assert!((union / (length * area) - 1.0).abs() < 0.05, "{meta}");
    let text = run(&[&"info", &out]).ok();
    assert!(text.contains("mm"), "{text}");
    let mesh = dir.file("a.stl", "solid a\nendsolid a\n");
    let refused = run(&[&"build", &file, &mesh, &"-o", &out, &"--units", &"in", &"--width", &"1mm"]);
    assert_ne!(refused.status, Some(0));
}
