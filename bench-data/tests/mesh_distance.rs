//! `mesh-distance` as a user runs it.

use brickfield_bench_data::shapes::cuboid;
use brickfield_bench_data::{Mesh, write};
use std::fs::File;
use std::path::Path;
use std::process::{Command, Output};

fn save(path: &Path, mesh: &Mesh) {
    let file = File::create(path).unwrap();
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("ply") => write::ply_binary(file, mesh).unwrap(),
        _ => write::stl(file, mesh).unwrap(),
    }
}

fn asked(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mesh-distance")).args(args).current_dir(folder).output().unwrap()
}

#[test]
fn a_box_that_is_too_large_is_told_in_both_ways() {
    let folder = tempfile::tempdir().unwrap();
    save(&folder.path().join("soup.stl"), &cuboid([0.0; 3], [8.0; 3]));
    for mesh in ["mesh.stl", "mesh.ply"] {
        save(&folder.path().join(mesh), &cuboid([-0.25; 3], [8.25; 3]));
        let args = ["soup.stl", mesh, "--cell", "0.5", "--samples", "2000", "--creases", "500"];
        let told = asked(&args, folder.path());
        let text = String::from_utf8(told.stdout).unwrap();
        assert!(told.status.success() && told.stderr.is_empty(), "{text}");
        assert!(
            text.contains("boundary to mesh: mean 0.5000, rms 0.5000, 99.9 % 0.5000, max 0.5000"),
            "{text}"
        );
        assert!(text.contains("mesh to boundary") && text.contains("creases to mesh: mean 0.5000"), "{text}");
        let told = asked(&[&args[..], &["--json"]].concat(), folder.path());
        let text = String::from_utf8(told.stdout).unwrap();
        assert!(
            text.starts_with("{\"cell\": 0.5, \"triangles\": 12, \"mesh\": {\"samples\": 2000, "),
            "{text}"
        );
    }
}

#[test]
fn what_cannot_be_compared_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    save(&folder.path().join("soup.stl"), &cuboid([0.0; 3], [8.0; 3]));
    save(&folder.path().join("hollow.stl"), &cuboid([0.0; 3], [8.0; 3]).flipped());
    std::fs::write(folder.path().join("empty.stl"), [0; 84]).unwrap();
    std::fs::write(folder.path().join("cut.stl"), [7; 100]).unwrap();
    let refused = [
        (["soup.stl", "empty.stl", "--cell", "1"], "empty.stl: it has no triangle"),
        (["soup.stl", "cut.stl", "--cell", "1"], "cut.stl: 117901063 facets take"),
        (["cut.stl", "soup.stl", "--cell", "1"], "cut.stl: 117901063 facets take"),
        (["none.stl", "soup.stl", "--cell", "1"], "none.stl: cannot read"),
        (["hollow.stl", "soup.stl", "--cell", "1"], "the soup encloses nothing"),
        (["soup.stl", "soup.stl", "--cell", "0"], "--cell takes a positive length"),
    ];
    for (args, reason) in refused {
        let told = asked(&args, folder.path());
        let text = String::from_utf8(told.stderr).unwrap();
        assert_eq!((told.status.code(), text.lines().count()), (Some(1), 1), "{text}");
        assert!(text.starts_with("mesh-distance: ") && text.contains(reason), "{text}");
    }
}
