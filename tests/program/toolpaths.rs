//! `brickfield info` of toolpaths, `--firmware`, and what each of the small files that are easily misread holds.

use crate::support::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn report(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/reports").join(name)
}

fn slicer(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/gcode").join(name)
}

/// What `info` says as JSON, and its warnings.
#[track_caller]
fn info(file: &Path, more: &[&str]) -> (Value, Vec<String>) {
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"info", &file, &"--json"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
    let Run { status, stdout, stderr, .. } = run(&args);
    assert_eq!(status, Some(0), "{stderr}");
    let json: Value = serde_json::from_str(&stdout).expect("JSON");
    let told: Vec<String> = json["warnings"].as_array().unwrap().iter().map(|w| w.to_string()).collect();
    assert_eq!(stderr.lines().count(), told.len(), "{stderr}");
    (json, told)
}

#[track_caller]
fn close(found: &Value, expected: f64, tolerance: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() < tolerance, "{found} instead of {expected}");
}

#[test]
fn e_is_relative_while_g91_holds() {
    let file = report("g91_after_m82.gcode");
    let (json, told) = info(&file, &[]);
    close(&json["fed_volume"], 7.70, 0.005);
    assert_eq!(json["segments"], 4);
    close(&json["bounds"][0][2], 0.2, 1e-9);
    close(&json["bounds"][1][2], 0.2, 1e-9);
    assert_eq!(
        (&json["firmware"], &json["firmware_source"]),
        (&"marlin or klipper".into(), &"assumed".into())
    );
    // Only that nothing tells the filament.
    assert!(told.len() == 1 && told[0].contains("1.75 mm"), "{told:?}");
    let (json, _) = info(&file, &["--firmware", "RepRapFirmware"]);
    assert_eq!((&json["firmware"], &json["firmware_source"]), (&"reprapfirmware".into(), &"option".into()));
    // There E goes from 1.6 to -0.5, so that the next move but one must first make up for 2.1.
    assert!(json["length"].as_f64().unwrap() < 70.0 && json["made_up"]["count"] == 2, "{json}");
    let wrong = run(&[&"info", &file, &"--firmware", &"nonsense"]).misused();
    assert!(wrong.contains("klipper"), "{wrong}");
}

#[test]
fn e_counts_volume() {
    for name in ["marlin_volumetric.gcode", "m200_s1.gcode"] {
        let (json, told) = info(&report(name), &[]);
        close(&json["widths"]["range"][0], 0.443, 5e-4);
        close(&json["widths"]["range"][1], 0.443, 5e-4);
        close(&json["heights"]["range"][0], 0.2, 1e-9);
        assert_eq!((&json["filament_source"], told), (&"volumetric".into(), vec![]));
    }
}

#[test]
fn arcs_have_turns() {
    let file = report("arc_turns_p.gcode");
    let turns = |more: &[&str]| {
        let (json, told) = info(&file, more);
        let length = json["length"].as_f64().unwrap() + json["arcs"]["length_lost"].as_f64().unwrap();
        (length / (20.0 * std::f64::consts::PI), told)
    };
    let (found, told) = turns(&[]);
    assert!((found - 1.25).abs() < 1e-6, "{found}");
    assert!(told.iter().any(|line| line.contains("--firmware") && line.contains("line 6")), "{told:?}");
    for (firmware, expected) in [("linuxcnc", 1.25), ("grbl", 1.25), ("marlin", 2.25), ("klipper", 0.25)] {
        let (found, _) = turns(&["--firmware", firmware]);
        assert!((found - expected).abs() < 1e-6, "{firmware}: {found}");
    }
}

#[test]
fn numbers_have_exponents() {
    let (json, told) = info(&report("exponent_coordinate.gcode"), &[]);
    close(&json["bounds"][1][1], 0.000012, 1e-12);
    close(&json["length"], 40.0, 1e-6);
    close(&json["fed_volume"], 1.6 * std::f64::consts::FRAC_PI_4 * 1.75 * 1.75, 1e-9);
    assert!(told.iter().any(|line| line.contains("Y1.2e-05") && line.contains("line 4")), "{told:?}");
}

#[test]
fn checks_of_the_printer_are_no_news() {
    let (json, told) = info(&report("m862_noise.gcode"), &[]);
    assert_eq!((&json["beads"], told), (&1.into(), vec![]));
}

#[test]
fn only_the_net_leaves_the_nozzle() {
    let (json, told) = info(&report("refeed_in_move.gcode"), &[]);
    close(&json["fed_volume"], 72.2, 0.05);
    close(&json["bead_volume"], 72.2, 0.05);
    assert!(told.iter().any(|line| line.contains("retracted before")), "{told:?}");
}

#[test]
fn info_tells_all_of_a_toolpath_for_people() {
    let text = run(&[&"info", &slicer("bambu_studio.gcode")]);
    assert_eq!(text.status, Some(0), "{}", text.stderr);
    for part in [
        "slicer   BambuStudio 01.08.00.62",
        "firmware bambu (by",
        "beads    3, of 12 segments, in 2 layers",
        "bounds   (0.000000, 0.000000, 0.200000) to (20.000000, 20.000000, 0.400000)",
        "length   232.000 mm",
        "by a filament of 1.75 mm (by the file)",
        "widths   0.4200 to 0.4500 mm (by comments)",
        "tools    0",
        "settings layer height 0.2 mm, first layer 0.2 mm, line width 0.42 mm, nozzle 0.4 mm",
        "feature  Outer wall: 2 beads, 8 segments, 160.000 mm",
        "feature  Inner wall: 1 beads, 4 segments, 72.000 mm",
    ] {
        assert!(text.stdout.contains(part), "{part} is not in {}", text.stdout);
    }
    // Lifts in circles are arcs, but nobody need know.
    assert!(text.stderr.lines().count() <= 1, "{}", text.stderr);
}

#[test]
fn info_reads_packed_toolpaths_and_no_volume() {
    let packed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds/gcode/clover_head.gcode.gz");
    let (json, _) = info(&packed, &[]);
    assert!(json["beads"].as_u64().unwrap() > 0 && json["format"] == "G-code", "{json}");
    let wrong = run(&[&"info", &packed, &"--volume"]).misused();
    assert!(wrong.contains("toolpath"), "{wrong}");
}

#[test]
fn the_summary_names_the_firmware() {
    let dir = Scratch::new();
    let store = dir.path("o.brf");
    let file = report("m862_noise.gcode");
    let text = run(&[&"build", &file, &"-o", &store, &"--depth", &"2", &"--firmware", &"klipper"]);
    assert_eq!(text.status, Some(0), "{}", text.stderr);
    assert!(text.stdout.contains("firmware klipper (by --firmware)"), "{}", text.stdout);
}
