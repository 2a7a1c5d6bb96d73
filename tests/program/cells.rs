//! The cells that a build chooses, and what it says of those that the user chose.

use crate::support::*;
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::Path;

/// A block of layers of lines side by side, 0.4 mm wide and 0.2 mm high, round ends included 8 mm long.
fn block(layers: u32) -> String {
    let mut text = "G21\nG90\nM83\n;TYPE:Solid infill\n;WIDTH:0.4\n;HEIGHT:0.2\nG1 F1200\n".to_owned();
    for layer in 1..=layers {
        let z = 0.2 * f64::from(layer);
        writeln!(text, ";LAYER_CHANGE\n;HEIGHT:0.2").unwrap();
        for line in 0..3 {
            // Aside by a part of a cell in each layer, so that rows of samples keep no step with lines.
            let y = 1.4 * f64::from(line) + 0.137 * f64::from(layer);
            writeln!(text, "G0 X0 Y{y:.3} Z{z:.3}\nG1 X7.6 Y{y:.3} E0.2").unwrap();
        }
    }
    text
}

fn build(input: &Path, output: &Path, more: &[&str]) -> Run {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &input, &"-o", &output];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    run(&args)
}

fn json(run: Run) -> serde_json::Value {
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap()
}

#[test]
fn the_default_cell_suits_the_least_bead_and_no_layer() {
    let dir = Scratch::new();
    let (part, store) = (dir.file("part.gcode", block(5)), dir.path("o.brf"));
    let ran = build(&part, &store, &[]);
    // Told before the work, and in the end the part's size.
    assert!(ran.notes.contains("cells of 0.0764 mm: about") && ran.notes.contains("bricks"), "{}", ran.notes);
    assert!(ran.stdout.contains("  size     8 × 3.748 × 1 mm"), "{}", ran.stdout);
    assert_eq!((ran.status, ran.stderr.contains("are lost")), (Some(0), false), "{}", ran.stderr);
    let quiet = build(&part, &store, &["--quiet", "--json"]);
    assert_eq!(quiet.notes, "");
    let said = json(quiet);
    let cell = said["cell"].as_f64().unwrap();
    assert!(cell <= 0.4 * 0.2 && (0.2 / cell).fract() > 0.55 && (0.2 / cell).fract() < 0.7, "{cell}");
    for (axis, side) in [8.0, 3.748, 1.0].into_iter().enumerate() {
        assert!((said["size"][axis].as_f64().unwrap() - side).abs() < 1e-6, "{}", said["size"]);
    }
}

#[test]
fn cells_in_step_with_layers_still_give_the_volume() {
    let dir = Scratch::new();
    let layers = 20;
    let (part, store) = (dir.file("part.gcode", block(layers)), dir.path("o.brf"));
    // A stadium of 0.4 by 0.2, 7.6 mm long with round ends: (w - h) h + π h² / 4, and the ends' bodies of revolution.
    let section = 0.2 * 0.2 + std::f64::consts::FRAC_PI_4 * 0.04;
    let ends = 4.0 / 3.0 * std::f64::consts::PI * 0.1f64.powi(3)
        + std::f64::consts::PI * 0.1 * 0.1 * 0.2
        + std::f64::consts::PI * std::f64::consts::PI * 0.1 * 0.01;
    let truth = f64::from(3 * layers) * (7.6 * section + ends);
    for (cell, exact) in [("0.2mm", 0.2), ("0.1mm", 0.1)] {
        let said = json(build(&part, &store, &["--cell", cell, "--json", "--quiet"]));
        // What was asked for, to the bit.
        assert_eq!(said["cell"].as_f64(), Some(exact));
        let csv = run(&[&"info", &store, &"--volume", &"--json"]).json();
        let union = csv["volumes"]["union"].as_f64().or_else(|| csv["union"].as_f64()).expect("a volume");
        assert!((union / truth - 1.0).abs() < 0.03, "{cell}: {union} of {truth}");
    }
}

#[test]
fn coarse_cells_are_told_before_the_work() {
    let dir = Scratch::new();
    let (part, store) = (dir.file("part.gcode", block(3)), dir.path("o.brf"));
    for (more, expected) in [
        (vec!["--cell", "0.6mm"], "cells of 0.6 mm are 3 times the bead height of 0.2 mm"),
        (vec!["--cell", "0.15mm"], "cells of 0.15 mm are 0.75 times the bead height of 0.2 mm"),
        (vec!["--depth", "0"], "times the bead height of 0.2 mm"),
    ] {
        let notes = build(&part, &store, &more).notes;
        assert!(notes.contains(expected), "{notes}");
        assert!(notes.contains("overlaps and gaps between layers are lost; --cell 0.076mm keeps"), "{notes}");
    }
    assert!(!build(&part, &store, &["--cell", "0.1mm"]).notes.contains("are lost"));
}

#[test]
fn cells_that_no_machine_can_finish_are_refused_at_once() {
    let dir = Scratch::new();
    let store = dir.path("o.brf");
    let part = dir.file("part.gcode", block(5));
    // Micrometres in the place of millimetres: of few lines a large disk holds more than of meshes.
    let cells =
        [(part.as_path(), "0.005um"), (&stl("overlap_boxes"), "0.05um"), (&stl("clover_model"), "0.05um")];
    for (input, cell) in cells {
        let line = build(input, &store, &["--cell", "0.001um", "--quiet"]).failed();
        assert!(line.contains("too small"), "{line}");
        let line = build(input, &store, &["--cell", cell, "--quiet"]).failed();
        for words in ["too small: about", "--cell ", "mm takes about"] {
            assert!(line.contains(words), "{line}");
        }
        assert_eq!(dir.names(), ["part.gcode"]);
    }
}

#[test]
fn parts_of_implausible_size_are_told_before_the_work() {
    let dir = Scratch::new();
    let store = dir.path("o.brf");
    let write = |name: &str, side: f32| {
        let facets = cuboid([0.0; 3], [side, side / 2.0, side / 4.0]);
        dir.file(name, binary_stl(facets.len() as u32, &facets))
    };
    let (tiny, huge) = (write("tiny.stl", 0.5), write("huge.stl", 300_000.0));
    let notes = build(&tiny, &store, &["--depth", "1"]).notes;
    assert!(notes.contains("0.5 × 0.25 × 0.125 mm") && notes.contains("--unit in"), "{notes}");
    let notes = build(&huge, &store, &["--depth", "1"]).notes;
    assert!(notes.contains("300000 × 150000 × 75000 mm") && notes.contains("--unit um"), "{notes}");
    assert_eq!(build(&tiny, &store, &["--depth", "1", "--unit", "in"]).notes, "");
}
