//! `brickfield export`, held against `winding` and `sample`.

use crate::support::*;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// Exports a level; the array and its description.
fn export(dir: &Scratch, store: &Path, level: u8, dtype: &str) -> (Array, Value) {
    let out = dir.path(&format!("{level}{dtype}.npy"));
    let printed =
        run(&[&"export", &store, &"--level", &level.to_string(), &"-o", &out, &"--dtype", &dtype, &"--json"]);
    let text = std::fs::read_to_string(out.with_extension("json")).unwrap();
    let description: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(printed.json(), description);
    let array = Array::read(&out);
    assert_eq!(description["shape"], serde_json::json!([array.axis, array.axis, array.axis]));
    assert_eq!((array.axis, &description["dtype"]), (32 << level, &array.descr.clone().into()));
    (array, description)
}

/// Some of the grid's points, spread over it, and their coordinates as CSV.
fn points(array: &Array, description: &Value) -> (Vec<[usize; 3]>, String) {
    let number = |value: &Value| value.as_f64().unwrap();
    let (origin, spacing) = (&description["origin"], number(&description["spacing"]));
    let total = array.axis.pow(3);
    let at = |n: usize| [n % array.axis, n / array.axis % array.axis, n / array.axis / array.axis];
    let chosen: Vec<[usize; 3]> = (0..total).step_by((total / 5000) | 1).map(at).collect();
    let mut csv = String::from("x,y,z\n");
    for ijk in &chosen {
        let p: [f64; 3] = std::array::from_fn(|a| number(&origin[a]) + ijk[a] as f64 * spacing);
        writeln!(csv, "{},{},{}", p[0], p[1], p[2]).unwrap();
    }
    (chosen, csv)
}

/// The last column.
fn values(csv: &str) -> Vec<f64> {
    csv.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn every_level_holds_the_exact_winding_numbers() {
    let dir = Scratch::new();
    for name in ["clover_beads", "overlap_boxes", "duplicate_box", "touching_layers"] {
        let store = dir.store(name, 2);
        for level in 0..=2 {
            let (array, description) = export(&dir, &store, level, "i2");
            let (chosen, csv) = points(&array, &description);
            let expected: Vec<f64> = chosen.iter().map(|ijk| array.at(*ijk)).collect();
            let exact = run_with(&[&"winding", &stl(name), &"--points", &"-"], &csv).ok();
            assert!(values(&exact) == expected, "{name} level {level}: winding");
            assert!(expected.iter().any(|w| *w != 0.0));
            if level == 2 {
                let sampled = run_with(&[&"sample", &store, &"--points", &"-"], &csv).ok();
                assert!(values(&sampled) == expected, "{name}: sample");
            }
        }
    }
}

#[test]
fn floats_are_what_sample_says_above_coarser_leaves_too() {
    let dir = Scratch::new();
    // A large box is refined, a small one in the opposite corner deviates too little.
    let mut facets = cuboid([0.0; 3], [10.0; 3]);
    facets.extend(cuboid([17.0; 3], [19.0; 3]));
    let input = dir.file("boxes.stl", binary_stl(24, &facets));
    let store = dir.path("o.brf");
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"build", &input, &"-o", &store, &"--depth", &"2"];
    args.extend([&"--refine" as &dyn AsRef<_>, &"stddev", &"--stddev", &"0.2"]);
    run(&args).ok();
    let (array, description) = export(&dir, &store, 2, "f4");
    let (chosen, csv) = points(&array, &description);
    let sampled = values(&run_with(&[&"sample", &store, &"--points", &"-"], &csv).ok());
    let mut between = 0;
    for (ijk, w) in chosen.iter().zip(&sampled) {
        assert!((array.at(*ijk) - w).abs() < 1e-6, "{ijk:?}");
        between += usize::from(w.fract() != 0.0);
    }
    assert!(between > 0, "no leaf ends above the level");
    let (integers, _) = export(&dir, &store, 2, "i2");
    let cell = description["spacing"].as_f64().unwrap().powi(3);
    for array in [array, integers] {
        let sum = array.sum() * cell;
        assert!((sum / 1008.0 - 1.0).abs() < 0.05, "{sum}");
    }
}

#[test]
fn levels_beyond_the_deepest_are_refused() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    for command in ["export", "mesh"] {
        let ending = if command == "export" { "npy" } else { "stl" };
        let out = dir.path(&format!("w.{ending}"));
        let line = run(&[&command, &store, &"--level", &"2", &"-o", &out]).failed();
        assert!(line.contains("overlap_boxes-1.brf") && line.contains("from 0 to 1"), "{line}");
    }
    assert_eq!(dir.names(), ["overlap_boxes-1.brf"]);
}
