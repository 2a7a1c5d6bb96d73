//! `--count`, what the commands make of passes, and layers with too little material.

use crate::support::*;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;

/// Builds a store quietly.
#[track_caller]
fn build(input: &Path, output: &Path, more: &[&str]) {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &input, &"-o", &output, &"--depth", &"3", &"-q"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    let run = run(&args);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
}

fn info(store: &Path) -> Value {
    run(&[&"info", &store, &"--json"]).json()
}

#[test]
fn retraced_lines_count_as_often_as_they_were_laid() {
    let dir = Scratch::new();
    let points = dir.path("p.csv");
    fs::write(&points, "65,50,0.1\n65,50.1,0.11\n10,10,10\n").unwrap();
    for (count, passes, w) in [(&[][..], Value::from(3), 3), (&["--count", "beads"], Value::Null, 1)] {
        let store = dir.path("r.brf");
        build(&of_passes("retraced.gcode"), &store, &[&["--identity"], count].concat());
        let json = info(&store);
        assert_eq!((&json["winding_max"], &json["beads"]["passes"]), (&w.into(), &passes), "{json}");
        assert_eq!(json["beads"]["counts"], if w == 3 { "passes" } else { "beads" });
        let input = of_passes("retraced.gcode");
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"winding", &input, &"--points", &points];
        args.extend(count.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        let found: Vec<String> =
            run(&args).ok().lines().skip(1).map(|line| line.rsplit(',').next().unwrap().to_owned()).collect();
        assert_eq!(found, [w.to_string(), w.to_string(), "0".to_owned()]);
    }
}

#[test]
fn laps_count_at_their_seam_as_winding_and_overlaps_have_it() {
    let dir = Scratch::new();
    // Three rounds of a square: the seam is the joint of the first two passes and of the last two.
    let mut program = "G21\nG90\nM83\n;HEIGHT:0.2\n;WIDTH:0.5\nG0 X0.0123 Y0.0071 Z0.2\n".to_owned();
    for _ in 0..3 {
        program += "G1 X4 E0.15\nG1 Y4 E0.15\nG1 X0.0123 E0.15\nG1 Y0.0071 E0.15\n";
    }
    let (laps, store) = (dir.file("laps.gcode", &program), dir.path("laps.brf"));
    let built = run(&[&"build", &laps, &"-o", &store, &"--cell", &"0.05mm", &"--identity", &"-q"]);
    assert_eq!(built.status, Some(0), "{}", built.stderr);
    let found = run(&[&"overlap", &store, &"--json"]).json();
    assert_eq!(found["unexplained_samples"], "0", "{found}");
    assert_eq!(found["pair_samples"], found["field_samples"], "{found}");
    assert_eq!(found["pairs"], 3, "{found}");
    // Samples around the seam are what the source says there.
    let (npy, points) = (dir.path("w.npy"), dir.path("p.csv"));
    let depth = info(&store)["depth"].to_string();
    run(&[&"export", &store, &"--level", &depth, &"-o", &npy, &"-q"]).ok();
    let array = Array::read(&npy);
    let told: Value = serde_json::from_str(&fs::read_to_string(dir.path("w.json")).unwrap()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let spacing = number(&told["spacing"]);
    let first: [f64; 3] = [0, 1, 2].map(|a| number(&told["origin"][a]));
    let (mut text, mut samples) = (String::new(), Vec::new());
    for (n, w) in array.values.iter().enumerate() {
        let axis = array.axis;
        let at = [n % axis, n / axis % axis, n / (axis * axis)];
        let place: [f64; 3] = [0, 1, 2].map(|a| first[a] + at[a] as f64 * spacing);
        if place[..2].iter().all(|c| c.abs() < 0.4) && (0.0..0.2).contains(&place[2]) {
            text += &format!("{},{},{}\n", place[0], place[1], place[2]);
            samples.push(*w);
        }
    }
    fs::write(&points, text).unwrap();
    let exact = run(&[&"winding", &laps, &"--points", &points]).ok();
    let exact: Vec<f64> =
        exact.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect();
    assert!(samples.contains(&3.0) && samples.contains(&1.0));
    assert_eq!(samples, exact);
}

#[test]
fn samples_name_passes_and_the_lines_of_their_segments() {
    let dir = Scratch::new();
    let (store, points) = (dir.path("r.brf"), dir.path("p.csv"));
    fs::write(&points, "65,50,0.1\n").unwrap();
    build(&of_passes("retraced.gcode"), &store, &["--identity"]);
    let csv = run(&[&"sample", &store, &"--points", &points, &"--beads"]).ok();
    let which = csv.lines().nth(1).unwrap().split('"').nth(1).unwrap();
    let named = |pass: u32, line: u32| format!("0.{pass}:0:1:0:{line}-{line}:Solid infill");
    assert_eq!(which, [named(0, 11), named(1, 12), named(2, 13)].join(";"));
    let json = run(&[&"sample", &store, &"--points", &points, &"--beads", &"--json"]).ok();
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["beads"][2]["pass"], &json["beads"][2]["first_line"]), (&2.into(), &13.into()));
    // Whole beads have the lines of all that they are.
    build(&of_passes("retraced.gcode"), &store, &["--identity", "--count", "beads"]);
    let csv = run(&[&"sample", &store, &"--points", &points, &"--beads"]).ok();
    assert!(csv.contains(",1,\"0:0:1:0:11-13:Solid infill\""), "{csv}");
}

#[test]
fn meshes_do_not_depend_on_what_is_counted() {
    let dir = Scratch::new();
    for input in [of_passes("raster.gcode"), of_passes("vase.gcode"), example("gcode/nonplanar.gcode")] {
        let mesh = |count: &str| {
            let (store, mesh) = (dir.path("m.brf"), dir.path("m.stl"));
            build(&input, &store, &["--count", count]);
            run(&[&"mesh", &store, &"-o", &mesh, &"-q"]);
            (fs::read(store).unwrap(), fs::read(mesh).unwrap())
        };
        let (passes, beads) = (mesh("passes"), mesh("beads"));
        assert!(passes.0 != beads.0 && passes.1 == beads.1, "{}", input.display());
    }
}

#[test]
fn shards_agree_on_passes() {
    let dir = Scratch::new();
    let (input, whole) = (of_passes("concentric.gcode"), dir.path("whole.brf"));
    build(&input, &whole, &["--identity"]);
    assert_eq!(info(&whole)["beads"]["passes"], 8);
    let shard = |number: &str, count: &str| {
        let path = dir.path(&format!("shard-{number}-{count}.brf"));
        build(&input, &path, &["--identity", "--count", count, "--shard", &format!("{number}/2")]);
        path
    };
    let (one, two, other) = (shard("1", "passes"), shard("2", "passes"), shard("2", "beads"));
    let joined = dir.path("joined.brf");
    run(&[&"cache", &"merge", &"-q", &"-o", &joined, &two, &one]).ok();
    assert!(fs::read(&joined).unwrap() == fs::read(&whole).unwrap());
    let told = run(&[&"cache", &"merge", &"-q", &"-o", &joined, &one, &other]).stderr;
    assert!(told.contains("unit of count is beads") && told.contains("is passes"), "{told}");
    // What is written anew keeps what it is.
    let packed = dir.path("packed.brf");
    run(&[&"cache", &"repack", &whole, &"-o", &packed, &"--compression", &"range", &"-q"]).ok();
    assert_eq!(info(&packed)["beads"]["counts"], "passes");
    run(&[&"verify", &packed]).ok();
}

#[test]
fn count_is_of_beads_as_solids_alone() {
    let dir = Scratch::new();
    let (out, points) = (dir.path("o.brf"), dir.path("p.csv"));
    fs::write(&points, "1,1,1\n").unwrap();
    let mesh = example("stl/overlap_boxes.stl");
    let told = run(&[&"build", &mesh, &"-o", &out, &"--count", &"passes"]).misused();
    assert!(told.contains("--count"), "{told}");
    let told = run(&[&"winding", &mesh, &"--points", &points, &"--count", &"beads"]).misused();
    assert!(told.contains("--count"), "{told}");
    let told =
        run(&[&"build", &of_passes("circle.gcode"), &"-o", &out, &"--beads", &"mesh", &"--count", &"beads"])
            .misused();
    assert!(told.contains("--count"), "{told}");
    assert_eq!(dir.names(), ["p.csv"]);
}

/// PrusaSlicer has drawn the first layer with beads of 3 mm, at the distances of those of 6 mm in all others.
#[test]
fn layers_with_gaps_are_told_without_asking() {
    let dir = Scratch::new();
    let input = example("clover.gcode");
    let line = "layer 1 is 48% empty: beads 3 mm wide, 5.68 mm apart, lines 119-382";
    let Run { status, stdout, stderr, .. } = run(&[&"info", &input, &"--json"]);
    assert_eq!(status, Some(0));
    assert_eq!(stderr.matches("% empty").count(), 1);
    assert!(stderr.contains(line), "{stderr}");
    let json: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(
        (&json["fill"][0]["layer"], &json["fill"][0]["feature"]),
        (&1.into(), &"Internal infill".into())
    );
    assert!(json["fill"][0]["room"].as_f64().unwrap() > 1.5 * json["fill"][0]["fed"].as_f64().unwrap());
    let Run { stdout, stderr, .. } = run(&[&"build", &input, &"-o", &dir.path("o.brf"), &"--depth", &"1"]);
    assert!(stdout.contains(line) && stderr.contains(line), "{stdout} {stderr}");
}

/// Infill of 15 and 20 per cent is as it was meant.
#[test]
fn sparse_infill_makes_no_noise() {
    for name in [
        "spot40_relE_prusaslicer.gcode.xz",
        "spot40_slic3r_nometa.gcode.xz",
        "void_ladder_prusaslicer.gcode.gz",
    ] {
        let Run { status, stderr, .. } = run(&[&"info", &example("gcode").join(name)]);
        assert_eq!(status, Some(0));
        assert!(!stderr.contains("% empty") && !stderr.contains("overfull"), "{name}: {stderr}");
    }
}
