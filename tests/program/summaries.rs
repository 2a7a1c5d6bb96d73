//! The lines that commands print: every number that is not exact has its error, and both hold.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use std::path::{Path, PathBuf};

/// The numbers before and after each "±" of a text.
fn measured(text: &str) -> Vec<[f64; 2]> {
    let number = |text: &str| text.trim().parse::<f64>().unwrap_or_else(|_| panic!("{text}"));
    let parts: Vec<&str> = text.split('±').collect();
    let before = |part: &str| number(part.trim_end().rsplit(' ').next().unwrap());
    let after = |part: &str| number(part.trim_start().split(' ').next().unwrap());
    parts.windows(2).map(|pair| [before(pair[0]), after(pair[1])]).collect()
}

/// The line says these values, as near as it claims, and claims no less than `nearness` of each.
fn assert_says(line: &str, truth: &[f64], nearness: f64) {
    let found = measured(line);
    assert_eq!(found.len(), truth.len(), "{line}");
    for ([value, error], truth) in found.into_iter().zip(truth) {
        assert!((value - truth).abs() <= error, "{truth}: {line}");
        assert!(error <= nearness * truth, "{truth}: {line}");
    }
    let said = line.split_once(": ").unwrap().1;
    let longest = said.split(' ').filter_map(|word| word.split_once('.')).map(|(_, after)| after.len()).max();
    assert!(longest.unwrap_or(0) <= 6, "more digits than deserved: {line}");
}

/// Two cylinders of radius 0.5 that cross: they have 16/3 r³ in common.
fn crossing(dir: &Scratch) -> PathBuf {
    let head = "G21\nG90\nM83\n;LAYER_CHANGE\n;Z:1\n;HEIGHT:1\nG1 Z1 F600\n";
    let beads = "G0 X0.013 Y10\nG1 X20 Y10 E1 F600\nG0 X10.007 Y0\nG1 X10.007 Y20 E1\n";
    dir.file("crossing.gcode", format!("{head}{beads}"))
}

fn table(dir: &Scratch, command: &str, part: &Path, options: &[&str]) -> String {
    let out = dir.path("table.csv");
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&command, &part, &"-o", &out];
    args.extend(options.iter().map(|option| option as &dyn AsRef<std::ffi::OsStr>));
    run(&args).ok()
}

#[test]
fn tables_say_what_they_hold_in_the_digits_that_it_deserves() {
    let dir = Scratch::new();
    let part = dir.path("cavity.brf");
    run(&[&"build", &stl("box_with_cavity.stl"), &"-o", &part, &"--cell", &"0.13", &"-q"]).ok();
    assert_says(&table(&dir, "voids", &part, &[]), &[64.0, 6.4], 0.1);
    // The union is exact: 936.
    let line = table(&dir, "layers", &part, &["--pitch", "1"]);
    assert_says(&line, &[64.0, 6.4], 0.15);
    assert!(line.contains("935.999976 mm³ of union") || line.contains("936"), "{line}");
    let beads = dir.path("crossing.brf");
    let gcode = crossing(&dir);
    let bead = ["--width", "1mm", "--height", "1mm", "--cell", "0.0625mm"];
    let mut build = program();
    build.arg("build").arg(&gcode).arg("-o").arg(&beads).args(["--identity", "-q"]).args(bead);
    assert!(build.status().unwrap().success());
    let line = table(&dir, "overlap", &beads, &[]);
    assert_says(&line, &[16.0 / 3.0 * 0.125], 0.05);
    assert!(line.contains("1 pairs"), "{line}");
}

#[test]
fn errors_of_many_voids_and_pairs_do_not_add_up_to_all_of_them() {
    let dir = Scratch::new();
    let part = dir.path("clover.brf");
    // All seventeen layers, or the first four.
    let whole = std::fs::read_to_string(example("clover.gcode")).unwrap();
    let layers: Vec<&str> = whole.split_inclusive(";LAYER_CHANGE\n").collect();
    // After the last layer come the slicer's settings.
    let settings = whole.rsplit_once("M107\n").unwrap().1;
    let first = layers[..5].concat() + settings;
    let input = dir.file("clover.gcode", part_or_all(first, whole.clone()));
    run(&[&"build", &input, &"-o", &part, &"--identity", &"-q"]).ok_but_for("empty");
    for command in ["layers", "overlap"] {
        let line = table(&dir, command, &part, &[]);
        let [value, error] = measured(&line)[0];
        assert!(error < 0.01 * value, "{line}");
    }
    // Of voids that are thinner than a cell little is known, of all together as of each.
    let found = run(&[&"voids", &part, &"-o", &dir.path("v.json"), &"--json"]).json();
    let rows = found["voids"].as_array().unwrap();
    let single: f64 = rows.iter().map(|row| row["volume_error"].as_f64().unwrap()).sum();
    let all = found["void_volume_error"].as_f64().unwrap();
    assert!(rows.len() > part_or_all(200, 1000) && all < 0.95 * single, "{all} {single}");
}
