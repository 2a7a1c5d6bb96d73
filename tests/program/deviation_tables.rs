//! `deviation --layers` and `--features`: how far the surface of each is from a reference.

use crate::support::*;

#[test]
fn layers_and_features_have_their_own_deviation() {
    let dir = Scratch::new();
    let [part, raised, out] = ["p.brf", "r.stl", "d.ply"].map(|name| dir.path(name));
    let [layers, features] = ["l.csv", "f.json"].map(|name| dir.path(name));
    // Two lines of one layer and one on top; the reference has that a tenth higher.
    let lines = |top: f64| {
        let line = |feature: &str, y: f64, z: f64| {
            format!(";TYPE:{feature}\n;LAYER_CHANGE\nG0 X0 Y{y} Z{z}\nG1 X20 E14.85\n")
        };
        let below = line("Perimeter", 0.0, 1.0) + "G0 X0 Y4\n;TYPE:Solid infill\nG1 X20 E14.85\n";
        format!("M83\n;HEIGHT:1\n;WIDTH:2\n{below}{}", line("Top solid infill", 8.0, top))
    };
    let (own, other) = (dir.file("p.gcode", lines(2.0)), dir.file("r.gcode", lines(2.1)));
    let beads: [&dyn AsRef<std::ffi::OsStr>; 7] =
        [&"--filament", &"1.75mm", &"--width", &"2mm", &"--height", &"1mm", &"-q"];
    let build =
        |more: &[&dyn AsRef<std::ffi::OsStr>]| run(&[&[&"build" as _], &beads[..], more].concat()).ok();
    build(&[&own, &"-o", &part, &"--cell", &"0.1", &"--identity"]);
    build(&[&other, &"-o", &dir.path("r.brf"), &"--cell", &"0.1", &"--mesh", &raised]);
    let found = run(&[
        &"deviation",
        &part,
        &raised,
        &"-o",
        &out,
        &"--layers",
        &layers,
        &"--features",
        &features,
        &"--json",
    ])
    .json();
    let names: Vec<_> = found["features"].as_array().unwrap().iter().map(|row| &row["feature"]).collect();
    assert_eq!(names, ["Perimeter", "Solid infill", "Top solid infill"], "{found}");
    let number = |table: &str, row: usize, name: &str| found[table][row][name].as_f64().unwrap();
    for row in 0..2 {
        assert!(number("features", row, "rms") < 0.01 && number("features", row, "area") > 80.0, "{found}");
    }
    let top = |name: &str| number("features", 2, name);
    assert!((top("max") - 0.1).abs() < 0.01 && (top("min") + 0.1).abs() < 0.01, "{found}");
    assert!(
        (number("layers", 0, "area") - number("features", 0, "area") - number("features", 1, "area")).abs()
            < 0.1
    );
    assert!(number("layers", 0, "rms") < 0.01 && (number("layers", 1, "rms") - top("rms")).abs() < 1e-6);
    let text = std::fs::read_to_string(&layers).unwrap();
    assert!(
        text.starts_with("layer,crossings,area,mean,rms,min,max\n1,") && text.lines().count() == 3,
        "{text}"
    );
    let told: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&features).unwrap()).unwrap();
    assert_eq!(told["features"], found["features"]);
    let plain = dir.path("r.brf");
    let text = run(&[&"deviation", &plain, &raised, &"-o", &out, &"--layers", &layers]).failed();
    assert!(text.contains("does not tell beads apart; build it from toolpaths with --identity"), "{text}");
}
