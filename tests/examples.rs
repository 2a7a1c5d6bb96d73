//! The programs in `engine/examples`, as a user runs them, one after the other: later ones read what the first wrote.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A toolpath of a few lines.
const TOOLPATH: &str = "M82\nG90\n;TYPE:External perimeter\n;HEIGHT:0.4\n;WIDTH:0.8\nG1 Z0.4 F600\nG1 X0 Y0 F6000\n\
    G1 X6 Y0 E0.8 F1200\nG1 X6 Y3 E1.2\nG1 X0 Y3 E2.0\nG1 X0 Y0.4 E2.4\nG1 X5 Y0.6 E3.0\n";

/// Where Cargo puts examples: beside the folder of this test.
fn built(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("this test");
    let folder = test.parent().and_then(Path::parent).expect("the folder of the profile");
    let path = folder.join("examples").join(name);
    assert!(
        path.is_file(),
        "{} is not there: `cargo build --profile test --examples` builds it",
        path.display()
    );
    path
}

fn run(folder: &Path, name: &str, arguments: &[&str]) -> String {
    let output =
        Command::new(built(name)).args(arguments).current_dir(folder).output().expect("it can be started");
    let [out, error] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("text"));
    assert!(output.status.success(), "{name}: {error}");
    out
}

/// The number after `key` in the text.
fn number(text: &str, key: &str) -> f64 {
    let rest = &text[text.find(key).unwrap_or_else(|| panic!("no {key:?} in {text}")) + key.len()..];
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    rest[..end].parse().unwrap_or_else(|_| panic!("no number after {key:?} in {text}"))
}

#[test]
fn examples_do_what_they_say() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("part.gcode"), TOOLPATH).expect("the toolpath is written");

    let said = run(at, "union", &["part.gcode", "part.stl"]);
    // Two lines of 6 mm, two of some 3, one of 5 that lies half upon another; 0.8 by 0.4 less the rounding.
    let volume = number(&said, "around ");
    assert!((4.0..9.0).contains(&volume), "{said}");
    assert!(number(&said, "part.stl: ") > 1000.0, "{said}");
    assert!(at.join("part.stl").is_file());

    let said = run(at, "triangles", &[]);
    assert!(
        said.contains("[0.5, 0.5, 0.5] lies within 1 of 10") && said.contains("within 2 of 10"),
        "{said}"
    );
    assert!(said.contains("[9.0, 9.0, 9.0] lies within 0 of 10"), "{said}");

    // A ball of radius 10: π/6 · 20³ = 4189, π · 20² = 1257.
    let said = run(at, "scan", &[]);
    assert!((number(&said, "volume ") / 4188.8 - 1.0).abs() < 0.02, "{said}");
    assert!((number(&said, "area ") / 1256.6 - 1.0).abs() < 0.02, "{said}");

    let said = run(at, "overlaps", &["part.gcode"]);
    assert!(said.starts_with("lines ") && number(&said, ": ") > 0.1, "{said}");

    run(at, "sections", &["overlaps.brf", "2"]);
    run(at, "picture", &["overlaps.brf"]);
    for picture in ["section-0.png", "section-1.png", "overlap.png"] {
        let bytes = std::fs::read(at.join(picture)).expect("the picture is there");
        assert!(bytes.starts_with(b"\x89PNG") && bytes.len() > 2000, "{picture}");
    }

    let said = run(at, "voids", &["overlaps.brf"]);
    assert!(said.contains(" voids, porosity "), "{said}");
    let said = run(at, "dense", &["overlaps.brf", "1"]);
    assert!(
        number(&said, "w = 0: ") + number(&said, "w = 1: ") + number(&said, "w = 2: ") >= 262_144.0,
        "{said}"
    );

    let said = run(at, "progress", &["part.gcode"]);
    assert!(said.contains("done: "), "{said}");
}
