//! `brickfield beads`, and what the other commands make of toolpaths.

use crate::support::*;
use brickfield_bench_data::judge::mesh;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The file whose name begins so, among the example toolpaths.
fn gcode(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data");
    if name == "clover" { folder.join("clover.gcode") } else { folder.join("gcode").join(name) }
}

/// What is wrong with the beads of the clover: nothing but the skirt's absence.
const CLOVER: [&str; 2] = ["--skip", "Skirt/Brim"];

/// Runs a command that has warnings to give, and reads its JSON.
#[track_caller]
fn json_with_warnings(args: &[&dyn AsRef<OsStr>]) -> Value {
    let Run { status, stdout, stderr, .. } = run(args);
    assert_eq!(status, Some(0), "{stderr}");
    assert!(stderr.lines().all(|line| line.starts_with("brickfield: warning: ")), "{stderr}");
    serde_json::from_str(&stdout).expect("JSON")
}

#[test]
fn the_clover_is_swept_to_closed_tubes_and_reckoned_up() {
    let dir = Scratch::new();
    let out = dir.path("beads.stl");
    let json =
        json_with_warnings(&[&"beads", &gcode("clover"), &"-o", &out, &CLOVER[0], &CLOVER[1], &"--json"]);
    let number =
        |at: &str| json.pointer(at).and_then(Value::as_f64).unwrap_or_else(|| panic!("{at}: {json}"));
    let report = mesh::check_file(&out).unwrap();
    assert!(report.is_balanced(), "{report}");
    assert_eq!(number("/facets"), report.triangles as f64);
    assert_eq!(number("/bytes"), std::fs::metadata(&out).unwrap().len() as f64);
    assert!((number("/swept_volume") / report.signed_volume - 1.0).abs() < 1e-5, "{report}");
    // By hand from the file: 34 runs without travel outside the skirt, of which 204 corners make 238.
    assert_eq!([number("/beads"), number("/segments"), number("/joints/split_bends")], [34.0, 5867.0, 204.0]);
    assert_eq!(number("/toolpaths/0/layers"), 17.0);
    let fed = number("/toolpaths/0/fed_volume");
    assert!((number("/bead_volume") / fed - 1.0).abs() < 0.005, "{json}");
    // Caps come on top, and nothing is counted twice but overlaps.
    assert!(number("/swept_volume") > fed);
    assert_eq!(dir.names(), ["beads.stl"]);
}

#[test]
fn extrusions_are_read_back_as_the_same_beads() {
    let dir = Scratch::new();
    let (x3d, stl) = (dir.path("beads.x3d"), dir.path("beads.stl"));
    let beads = |out: &Path| {
        json_with_warnings(&[&"beads", &gcode("clover"), &"-o", &out, &CLOVER[0], &CLOVER[1], &"--json"])
    };
    let (written, swept) = (beads(&x3d), beads(&stl));
    assert_eq!(written["bytes"], std::fs::metadata(&x3d).unwrap().len());
    assert_eq!((&written["beads"], &written["segments"]), (&swept["beads"], &swept["segments"]));
    assert!(written["tubes"].as_u64().unwrap() >= 238);
    assert!(written["bytes"].as_u64().unwrap() * 10 < swept["bytes"].as_u64().unwrap());
    let union = |input: &Path| {
        let store = dir.path("o.brf");
        json_with_warnings(&[&"build", &input, &"-o", &store, &"--depth", &"3", &"--json"]);
        let json = run(&[&"info", &store, &"--volume", &"--json"]).json();
        json["volumes"]["union"].as_f64().unwrap()
    };
    assert!((union(&x3d) / union(&stl) - 1.0).abs() < 0.01);
}

#[test]
fn threads_do_not_show_in_beads() {
    let dir = Scratch::new();
    let bytes = |threads: &str| {
        let out = dir.path("beads.stl");
        run(&[
            &"beads",
            &gcode("nonplanar.gcode"),
            &"-o",
            &out,
            &"--threads",
            &threads,
            &"--sides",
            &"8",
            &"-q",
        ]);
        std::fs::read(out).unwrap()
    };
    let one = bytes("1");
    assert!(one.len() > 100_000 && one == bytes("3"));
}

#[test]
fn builds_from_toolpaths_are_audited() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let build = |more: &[&str]| {
        let clover = gcode("clover");
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"build", &clover, &"-o", &out, &"--depth", &"3", &"--json"];
        args.extend(CLOVER.iter().chain(more).map(|arg| arg as &dyn AsRef<OsStr>));
        json_with_warnings(&args)
    };
    let number =
        |json: &Value, at: &str| json.pointer(at).and_then(Value::as_f64).unwrap_or_else(|| panic!("{at}"));
    let good = build(&[]);
    let (union, overlap) = (number(&good, "/volumes/union"), number(&good, "/volumes/overlap"));
    assert_eq!((number(&good, "/winding_min"), number(&good, "/volumes/negative")), (0.0, 0.0));
    // Beads with round joints, sampled analytically at voxels of 0.125 mm, have a union of 65,611 mm³.
    assert!((union / 65_611.0 - 1.0).abs() < 0.02, "{union}");
    assert!(union < number(&good, "/toolpaths/0/fed_volume") && overlap > 0.0);
    let told = |json: &Value| json.to_string().contains("check --filament");
    let warned = |more: &[&str]| {
        let clover = gcode("clover");
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &clover, &"-o", &out, &"--depth", &"1"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).stderr
    };
    assert!(!told(&good) && !warned(&[]).contains("check --filament"));
    let thin = warned(&["--filament", "1.75mm"]);
    assert!(thin.contains("check --filament (now 1.75 mm)"), "{thin}");
    assert!(warned(&["--width", "8mm"]).contains("--width"));
    let text = run(&[&"info", &out, &"--volume"]).ok();
    assert!(text.contains("mm³ of union"), "{text}");
    let json = run(&[&"info", &out, &"--volume", &"--json"]).json();
    assert!(number(&json, "/volumes/union") > 0.0);
}

#[test]
fn points_are_asked_of_packed_toolpaths_and_of_any_section() {
    let dir = Scratch::new();
    // One bead along x, 2 mm wide and 1 mm high, its upper side at z = 1.
    let line = "M83\nG1 X0 Y0 Z1 F600\nG1 X20 E1\n";
    let input = dir.file("line.txt", line);
    let points = dir.file("p.csv", "10,0,0.5\n10,0.95,0.95\n10,0,1.05\n10,0.7,0.8\n-0.9,0,0.5\n");
    let w = |input: &Path, section: &str| -> Vec<String> {
        let run = run(&[
            &"winding",
            &input,
            &"--points",
            &points,
            &"--width",
            &"2mm",
            &"--height",
            &"1mm",
            &"--section",
            &section,
        ]);
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        run.stdout.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().to_owned()).collect()
    };
    assert_eq!(w(&input, "stadium"), ["1", "0", "0", "1", "1"]);
    assert_eq!(w(&input, "rectangle"), ["1", "1", "0", "1", "1"]);
    let diamond = dir.file("diamond.csv", "across,up\n0,-0.5\n0.5,0\n0,0.5\n-0.5,0\n");
    assert_eq!(w(&input, diamond.to_str().unwrap()), ["1", "0", "0", "0", "1"]);
    let store = dir.path("ladder.brf");
    let packed = gcode("thinwall_ladder_prusaslicer.gcode.gz");
    let json = json_with_warnings(&[&"build", &packed, &"-o", &store, &"--depth", &"1", &"--json"]);
    assert!(json["segments"].as_u64().unwrap() > 1000);
}

#[test]
fn beads_are_solids_unless_triangles_are_asked_for() {
    let dir = Scratch::new();
    let store = dir.path("part.brf");
    // Two beads that cross, each with a joint of its own.
    let lines =
        "M83\nG1 X0 Y0 Z1 F600\nG1 X20 E1\nG1 Y10 E1\nG1 X10 Y5 Z3\nG1 X10 Y-5 Z1\nG1 Y-6 E1\nG1 Y5 E1\n";
    let input = dir.file("cross.gcode", lines);
    let sizes = ["--width", "2mm", "--height", "1mm"];
    let build = |more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"build", &input, &"-o", &store, &"--depth", &"3", &"--json"];
        args.extend(sizes.iter().chain(more).map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args)
    };
    let points = dir.file("p.csv", "5,0,0.5\n10,0,0.5\n20,0,0.5\n15,8,0.5\n");
    let sampled = build(&["--identity"]);
    assert_eq!(sampled.status, Some(0), "{}", sampled.stderr);
    let json: Value = serde_json::from_str(&sampled.stdout).expect("JSON");
    assert_eq!([&json["facets"], &json["segments"]].map(Value::as_u64), [Some(0), Some(4)]);
    let out = run(&[&"sample", &store, &"--points", &points, &"--beads"]);
    assert_eq!(out.status, Some(0), "{}", out.stderr);
    let counts: Vec<&str> = out.stdout.lines().skip(1).map(|line| line.split(',').nth(4).unwrap()).collect();
    // The crossing counts two beads, the joint of one bead counts one.
    assert_eq!(counts, ["1", "2", "1", "0"], "{}", out.stdout);
    let which = out.stdout.lines().nth(2).unwrap();
    assert!(which.contains("\"0.0:0:1:0:3-3:") && which.contains(";1.0:0:1:0:8-8:"), "{which}");
    let info = run(&[&"info", &store]).stdout;
    assert!(info.contains("2 in 2 passes as solids, stadium section, 4 segments, told apart"), "{info}");
    assert_eq!(run(&[&"verify", &store]).status, Some(0));
    assert_eq!(build(&["--identity", "--beads", "mesh"]).status, Some(2));
    assert_eq!(build(&["--beads", "analytic", "--section", "rectangle"]).status, Some(2));
    let mesh = build(&["--beads", "mesh"]);
    let json: Value = serde_json::from_str(&mesh.stdout).expect("JSON");
    assert_eq!(json["segments"], 0);
    let refused = run(&[&"sample", &store, &"--points", &points, &"--beads"]).failed();
    assert!(refused.contains("--identity"), "{refused}");
}

#[test]
fn what_is_no_toolpath_leaves_nothing() {
    let dir = Scratch::new();
    let out = dir.path("out.stl");
    let refused = |input: &Path, why: &str| {
        let line = run(&[&"beads", &input, &"-o", &out]).failed();
        let name = input.file_name().and_then(OsStr::to_str).unwrap();
        assert!(line.contains(name) && line.contains(why), "{line}");
        let line = run(&[&"build", &input, &"-o", &dir.path("out.brf")]).status;
        assert_eq!(line, Some(if name.ends_with("stl") { 0 } else { 1 }));
        std::fs::remove_file(dir.path("out.brf")).ok();
    };
    refused(&dir.file("empty.gcode", ""), "is empty");
    refused(&gcode("malformed.gcode"), "line 5");
    refused(&gcode("only_comments.gcode"), "deposited");
    refused(&dir.path("missing.gcode"), "No such file");
    refused(&dir.file("noise.gcode.gz", [0x1f, 0x8b, 8, 0, 9, 9, 9, 9, 9]), "");
    refused(&stl("clover_model"), "is a mesh");
    std::fs::remove_file(dir.path("empty.gcode")).unwrap();
    std::fs::remove_file(dir.path("noise.gcode.gz")).unwrap();
    assert!(dir.names().is_empty(), "{:?}", dir.names());
    let bad = dir.file("section.csv", "0,0\n0.5,0\n0.5,0.7\n");
    let line = run(&[&"beads", &gcode("clover"), &"-o", &out, &"--section", &bad]).failed();
    assert!(line.contains("section.csv: line 3"), "{line}");
    assert_eq!(dir.names(), ["section.csv"]);
}

#[test]
fn options_that_make_no_sense() {
    let dir = Scratch::new();
    let out = dir.path("out.stl");
    for more in
        [["--sides", "7"], ["--bend", "200"], ["--bend", "nan"], ["--width", "0"], ["--filament", "x"]]
    {
        run(&[&"beads", &gcode("clover"), &"-o", &out, &more[0], &more[1]]).misused();
        run(&[&"build", &gcode("clover"), &"-o", &dir.path("o.brf"), &more[0], &more[1]]).misused();
    }
    run(&[&"beads", &gcode("clover"), &"-o", &dir.path("out.obj")]).misused();
    run(&[&"build", &gcode("clover"), &"-o", &dir.path("o.brf"), &"--units", &"furlong"]).misused();
    assert!(dir.names().is_empty());
}
