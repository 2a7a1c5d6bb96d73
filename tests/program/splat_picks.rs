//! What picks in pages of splats tell, as users ask for it.

use crate::support::*;
use std::path::{Path, PathBuf};

/// A toolpath that is the test's own, and a store of it.
fn part(dir: &Scratch, name: &str, options: &[&str]) -> (PathBuf, PathBuf) {
    let gcode = dir.file(&format!("{name}.gcode"), std::fs::read(example("gcode/nonplanar.gcode")).unwrap());
    let store = dir.path(&format!("{name}.brf"));
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"build", &gcode, &"-o", &store, &"--depth", &"2", &"--quiet"];
    args.extend(options.iter().map(|option| option as &dyn AsRef<std::ffi::OsStr>));
    run(&args).ok_but_for("1.75 mm");
    (gcode, store)
}

fn table(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("part.picks")).unwrap()
}

#[test]
fn beads_come_from_the_store_or_from_the_toolpath_alike() {
    let dir = Scratch::new();
    let (_, listed) = part(&dir, "listed", &["--identity"]);
    let (_, plain) = part(&dir, "plain", &[]);
    let made = |store: &PathBuf, name: &str, threads: &str| {
        let folder = dir.path(name);
        let named = format!("{}/", folder.display());
        let told = run(&[&"splats", store, &"-o", &named, &"--json", &"--threads", &threads]).json();
        assert_eq!(told["bead_bytes"].as_u64().unwrap(), table(&folder).len() as u64);
        folder
    };
    let folders = [made(&listed, "a", "1"), made(&listed, "b", "3"), made(&plain, "c", "2")];
    let [one, three, again] = folders.each_ref().map(|folder| table(folder));
    assert!(one == three && one.starts_with(b"\x89BPK"));
    assert!(
        std::fs::read_to_string(folders[0].join("index.html"))
            .unwrap()
            .contains("data-beside=\"part.picks\"")
    );
    // Files are named as they are called.
    let names = |table: &[u8]| table.windows(6).any(|text| text == b"listed");
    assert!(names(&one) && !names(&again) && again.len() + 1 == one.len());
    // In a page that is one file they are letters behind its program.
    let page = dir.path("page.html");
    run(&[&"splats", &listed, &"-o", &page, &"--quiet"]).ok();
    let text = std::fs::read_to_string(&page).unwrap();
    let letters = text.split("id=\"picks\" data-beside=\"\">").nth(1).unwrap().split('<').next().unwrap();
    assert_eq!(letters.len(), one.len().div_ceil(3) * 4);
    assert!(letters.starts_with("iUJQ"));
}

#[test]
fn where_beads_cannot_be_had_a_line_says_why() {
    let dir = Scratch::new();
    let page = dir.path("page.html");
    let (gcode, store) = part(&dir, "part", &[]);
    let (_, wide) = part(&dir, "wide", &["--width", "1.1mm"]);
    let refused = |store: &PathBuf, words: &str| {
        let told = run(&[&"splats", store, &"-o", &page]);
        assert!(
            told.notes.contains("picks tell positions alone") && told.notes.contains(words),
            "{}",
            told.notes
        );
        assert!(told.ok().contains("splats in"));
        let said = run(&[&"splats", store, &"-o", &page, &"--picks", &"beads"]).failed();
        assert!(said.contains(words) && said.contains("--identity"), "{said}");
        run(&[&"splats", store, &"-o", &page, &"--picks", &"positions"]).ok();
        assert!(std::fs::read_to_string(&page).unwrap().contains("id=\"picks\" data-beside=\"\"></script>"));
    };
    refused(&wide, "with other options");
    let mut text = std::fs::read(&gcode).unwrap();
    text.extend(b"; more\n");
    std::fs::write(&gcode, text).unwrap();
    refused(&store, "has been changed");
    std::fs::remove_file(&gcode).unwrap();
    refused(&store, "is not there any more");
    // Meshes have no beads, and nobody misses them.
    let facets = cuboid([0.0; 3], [10.0, 8.0, 6.0]);
    let mesh = dir.path("mesh.brf");
    run(&[&"build", &dir.file("mesh.stl", binary_stl(12, &facets)), &"-o", &mesh, &"--depth", &"1"]).ok();
    run(&[&"splats", &mesh, &"-o", &page]).ok();
    assert!(run(&[&"splats", &mesh, &"-o", &page, &"--picks", &"beads"]).failed().contains("knows no beads"));
    let misused = run(&[&"splats", &mesh, &"-o", &dir.path("a.bsp"), &"--picks", &"beads"]).misused();
    assert!(misused.contains("--picks: pages are written"), "{misused}");
}
