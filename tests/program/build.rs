//! `brickfield build`.

use crate::support::*;

#[test]
fn the_summary_says_what_was_built() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let args: [&dyn AsRef<std::ffi::OsStr>; 7] =
        [&"build", &stl("overlap_boxes"), &"-o", &out, &"--depth", &"2", &"--json"];
    let json = run(&args).json();
    assert_eq!(json["facets"], 24);
    assert_eq!(json["depth"], 2);
    assert_eq!((&json["winding_min"], &json["winding_max"]), (&0.into(), &2.into()));
    assert_eq!(json["file_bytes"], std::fs::metadata(&out).unwrap().len());
    assert!(json["nodes"].as_u64() > json["leaves"].as_u64());
    assert!(json["facets_per_second"].as_f64().unwrap() > 0.0);
    for phase in ["open", "measure", "snap", "build", "finish"] {
        assert!(json["phases"][phase].is_f64(), "{phase}");
    }
    #[cfg(target_os = "linux")]
    assert!(json["peak_memory_bytes"].as_u64().unwrap() > 1 << 20);
    let text = run(&args[..6]).ok();
    assert!(text.contains("24 (0 without area") && text.contains("winding  0 to 2"), "{text}");
    assert_eq!(run(&[&args[..6], &[&"--quiet"]].concat()).ok(), "");
    assert_eq!(dir.names(), ["o.brf"]);
}

#[test]
fn several_inputs_are_one_soup() {
    let dir = Scratch::new();
    let one = dir.file("one.stl", binary_stl(12, &cuboid([0.0; 3], [4.0; 3])));
    let two = dir.file("two.stl", binary_stl(12, &cuboid([2.0; 3], [6.0; 3])));
    let json = run(&[&"build", &one, &two, &"-o", &dir.path("o.brf"), &"--depth", &"1", &"--json"]).json();
    assert_eq!((&json["facets"], &json["winding_max"]), (&24.into(), &2.into()));
    // Facets that close each other across files.
    let all = cuboid([0.0; 3], [4.0; 3]);
    let lid = dir.file("lid.stl", binary_stl(3, &all[..3]));
    let rest = dir.file("rest.stl", binary_stl(9, &all[3..]));
    run(&[&"build", &lid, &rest, &"-o", &dir.path("p.brf"), &"--depth", &"1"]).ok();
    let open = run(&[&"build", &rest, &"-o", &dir.path("q.brf"), &"--depth", &"1", &"--json"]).json();
    assert!(open["open_edges"].as_u64() > Some(0), "{open}");
}

#[test]
fn cells_and_units() {
    let dir = Scratch::new();
    let (input, out) = (stl("overlap_boxes"), dir.path("o.brf"));
    let build = |cell: &str, units: &str| {
        run(&[&"build", &input, &"-o", &out, &"--cell", &cell, &"--units", &units, &"--json"]).json()
    };
    for (cell, units, expected) in [
        ("0.25mm", "mm", 0.25),
        ("250um", "mm", 0.25),
        ("0.5", "in", 0.5),
        ("0.3m", "m", 0.3),
        ("5mm", "cm", 0.5),
    ] {
        let json = build(cell, units);
        assert_eq!((json["cell"].as_f64(), json["unit"].as_str()), (Some(expected), Some(units)));
        assert_eq!(run(&[&"info", &out, &"--json"]).json()["units"], units);
    }
    let line = run(&[&"build", &input, &"-o", &out, &"--cell", &"1e-9um"]).failed();
    assert!(line.contains("too small"), "{line}");
}

#[test]
fn refinement_and_backend() {
    let dir = Scratch::new();
    let nodes = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let out = dir.path("o.brf");
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"build"];
        let input = stl("overlap_boxes");
        args.extend([&input as &dyn AsRef<_>, &"-o", &out, &"--depth", &"3", &"--json"]);
        args.extend(more);
        let nodes = run(&args).json()["nodes"].as_u64().unwrap();
        run(&[&"verify", &out]).ok();
        nodes
    };
    let hidden = nodes(&[&"--backend", &"cpu"]);
    assert_eq!(nodes(&[&"--refine", &"hidden", &"--backend", &"auto"]), hidden);
    assert!(nodes(&[&"--refine", &"surface"]) < hidden);
    assert!(nodes(&[&"--refine", &"stddev"]) <= hidden);
    assert!(nodes(&[&"--refine", &"stddev", &"--stddev", &"0.4"]) < hidden);
}

#[test]
fn a_tolerance_leaves_flat_walls_undivided() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let built = |input: &std::path::Path, more: &[&str]| {
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"build", &input, &"-o", &out, &"--depth", &"4"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        run(&args)
    };
    let leaves = |input: &std::path::Path, more: &[&str]| {
        let leaves = built(input, &[more, &["--json"]].concat()).json()["leaves"].as_u64().unwrap();
        run(&[&"verify", &out]).ok();
        leaves
    };
    let model = stl("clover_model");
    let all = leaves(&model, &[]);
    assert_eq!(run(&[&"info", &out, &"--json"]).json()["tolerance"], serde_json::Value::Null);
    assert_eq!(leaves(&model, &["--tolerance", "0"]), all);
    let [some, few] = ["0.01mm", "50um"].map(|tolerance| leaves(&model, &["--tolerance", tolerance]));
    assert!(few < some && 5 * some < all, "{few}, {some} of {all}");
    assert_eq!(run(&[&"info", &out, &"--json"]).json()["tolerance"], 0.05);
    assert!(run(&[&"info", &out]).ok().contains("standard deviation 0, tolerance 0.05 mm, depth 4"));
    let mesh = dir.path("o.stl");
    run(&[&"mesh", &out, &"-o", &mesh, &"--quiet"]).ok();
    run(&[&"mesh", &"--check", &mesh, &"--quiet"]).ok();
    // What it is measured against.
    let beads = built(&example("clover.gcode"), &["--tolerance", "0.05mm"]).misused();
    assert!(
        beads.contains("--boundary-error: beads as solids") && beads.contains("--beads-as mesh"),
        "{beads}"
    );
    let points = dir.file("p.xyz", "0 0 1 0 0 1\n0 0 -1 0 0 -1\n0 1 0 0 1 0\n0 -1 0 0 -1 0\n");
    let points = built(&points, &["--tolerance", "0.05mm"]).misused();
    assert!(points.contains("--boundary-error: points"), "{points}");
    let open = built(&stl("open_box_no_lid"), &["--tolerance", "0.05mm"]).failed();
    assert!(open.contains("closed meshes") && open.contains("--tolerance"), "{open}");
}

#[test]
fn too_little_memory_is_said_before_the_work() {
    let dir = Scratch::new();
    let (input, out) = (stl("clover_beads"), dir.path("o.brf"));
    let line = run(&[&"build", &input, &"-o", &out, &"--memory", &"20MiB"]).failed();
    assert!(line.contains("20.0 MiB are allowed; allow more with --memory"), "{line}");
    assert!(dir.names().is_empty());
    run(&[&"build", &input, &"-o", &out, &"--depth", &"2", &"--memory", &"1GiB", &"--threads", &"1"]).ok();
}

#[test]
fn inward_facets_are_pointed_out() {
    let dir = Scratch::new();
    let (out, mesh) = (dir.path("o.brf"), dir.path("o.stl"));
    let ran = run(&[&"build", &stl("inverted_box"), &"-o", &out, &"--depth", &"2", &"--mesh", &mesh]);
    assert_eq!(ran.status, Some(0));
    assert_eq!(ran.stderr.lines().count(), 1);
    assert!(ran.stderr.contains("nothing lies inside: facets, or normals, face inwards"), "{}", ran.stderr);
    assert!(ran.stdout.contains("nothing lies inside: facets, or normals, face inwards"), "{}", ran.stdout);
    assert_eq!(facets_of(&mesh).len(), 0);
    assert_eq!(dir.names(), ["o.brf", "o.stl"]);
}

#[test]
fn x3d_beads_are_an_input_and_what_is_left_out_is_told() {
    let dir = Scratch::new();
    let beads = dir.file(
        "beads.x3d",
        "<X3D version='3.3'><Scene>\n<Shape><Extrusion spine='0 0 0 0 4 0'/></Shape>\n\
         <Shape><Extrusion DEF='bad' scale='0 1'/></Shape>\n</Scene></X3D>",
    );
    let out = dir.path("o.brf");
    let output =
        program().args(["build", "-o"]).args([&out, &beads]).args(["--depth", "1"]).output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{told}");
    assert!(told.contains("beads.x3d: line 3: Extrusion \"bad\": scale holds 0"), "{told}");
    assert!(run(&[&"info", &out]).ok().contains("X3D"));
    let points = dir.file("p.csv", "0,2,0\n0,5,0\n");
    let sound = "<X3D><Scene><Shape><Extrusion spine='0 0 0 0 4 0'/></Shape></Scene></X3D>";
    let text = run(&[&"winding", &dir.file("sound.x3d", sound), &"--points", &points]).ok();
    let values: Vec<&str> = text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(values, ["1", "0"], "{text}");
    let broken = dir.file("broken.x3d", "<X3D><Scene>\n<Shape>");
    let told = run(&[&"build", &broken, &"-o", &out]).failed();
    assert!(told.contains("broken.x3d: line 2: the file ends inside 3 open elements"), "{told}");
}
