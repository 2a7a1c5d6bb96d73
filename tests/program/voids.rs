//! `voids`: what a part encloses, as a table.

use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};
use std::ffi::OsStr;

/// A block of 20³ with two cavities, boxes of 3³ and of 2 × 4 × 6, turned out of step with the cells.
fn block(dir: &Scratch) -> std::path::PathBuf {
    let path = dir.path("block.stl");
    let block = shapes::cuboid([0.0; 3], [20.0; 3]);
    let small = shapes::cuboid([-1.5; 3], [1.5; 3]).rotated([1.0, 2.0, 3.0], 0.7).translated([5.1, 6.2, 7.3]);
    let large = shapes::cuboid([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]).rotated([0.3, -1.0, 0.5], 0.4);
    let pieces = [block, small.flipped(), large.translated([13.3, 12.7, 11.9]).flipped()];
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(&pieces)).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn cavities_are_listed_with_their_sizes_for_any_number_of_threads() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.json"));
    run(&[&"build", &block(&dir), &"-o", &part, &"--depth", &"2", &"-q"]).ok();
    run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
    let text = std::fs::read_to_string(&out).unwrap();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((found["count"].as_u64(), found["solids"].as_u64()), (Some(2), Some(1)));
    for (row, volume, area) in [(0, 48.0, 88.0), (1, 27.0, 54.0)] {
        let row = &found["voids"][row];
        let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name} of {row}"));
        assert!((number("volume") - volume).abs() <= number("volume_error"), "{row}");
        assert!((number("volume") / volume - 1.0).abs() < 0.01, "{row}");
        assert!((number("surface") / area - 1.0).abs() < 0.02, "{row}");
        assert_eq!((row["euler"].as_i64(), row["sealed"].as_str()), (Some(1), Some("to_cell")));
    }
    let first = &found["voids"][0];
    assert!((first["inner_diameter"].as_f64().unwrap() - 2.0).abs() < 0.1, "{first}");
    assert!((first["x"].as_f64().unwrap() - 13.3).abs() < 0.02, "{first}");
    // What is left out changes nothing of the rest.
    let some = dir.path("some.json");
    run(&[&"voids", &part, &"-o", &some, &"-q", &"--min-volume", &"30"]).ok();
    let some: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&some).unwrap()).unwrap();
    assert_eq!((some["count"].as_u64(), some["left_out"].as_u64()), (Some(1), Some(1)), "{some}");
    assert!(first["gap"].is_number() && some["voids"][0] == *first, "{some}");
    assert_eq!((&some["void_volume"], &some["porosity"]), (&found["void_volume"], &found["porosity"]));
    for threads in ["1", "3"] {
        let again = dir.path("again.json");
        run(&[&"voids", &part, &"-o", &again, &"-q", &"--threads", &threads]).ok();
        assert_eq!(std::fs::read_to_string(&again).unwrap(), text);
    }
    let limited = run(&[&"voids", &part, &"-o", &out, &"-q", &"--max-porosity", &"0.001"]).failed();
    assert!(limited.contains("above --max-porosity"), "{limited}");
    let limited = run(&[&"voids", &part, &"-o", &out, &"-q", &"--max-equivalent-diameter", &"4mm"]).failed();
    assert!(limited.contains("above --max-equivalent-diameter"), "{limited}");
    let lines = run(&[&"voids", &part, &"-o", &out, &"-q", &"--lines"]).failed();
    assert!(lines.contains("--identity"), "{lines}");
}

#[test]
fn a_part_without_voids_is_an_empty_table() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.csv"));
    run(&[&"build", &stl("overlap_boxes.stl"), &"-o", &part, &"--depth", &"1", &"-q"]).ok();
    run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
    let text = std::fs::read_to_string(&out).unwrap();
    assert!(
        text.starts_with("id,class,volume,surface,equivalent_diameter,inner_diameter,diameter,"),
        "{text}"
    );
    assert_eq!(text.lines().count(), 1);
    let bad = run(&[&"voids", &part, &"-o", &dir.path("nowhere/v.csv"), &"-q"]).failed();
    assert!(bad.contains("create the directory first"), "{bad}");
    run(&[&"voids", &part, &"-o", &dir.path("v.txt")]).misused();
    for (option, value) in [("--min-volume", "nan"), ("--min-volume=-1", "-q"), ("--max-porosity", "1.5")] {
        run(&[&"voids", &part, &"-o", &out, &option, &value]).misused();
    }
}

pub fn json(path: &std::path::Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Writes meshes to one file.
fn written(path: std::path::PathBuf, pieces: &[Mesh]) -> std::path::PathBuf {
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(pieces)).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn voids_that_the_cad_part_has_are_pockets() {
    let dir = Scratch::new();
    let (part, cad, out) = (dir.path("a.brf"), dir.path("cad.brf"), dir.path("v.json"));
    run(&[&"build", &block(&dir), &"-o", &part, &"--depth", &"2", &"-q"]).ok();
    let large = shapes::cuboid([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]).rotated([0.3, -1.0, 0.5], 0.4);
    let pieces = [shapes::cuboid([0.0; 3], [20.0; 3]), large.translated([13.3, 12.7, 11.9]).flipped()];
    let model = written(dir.path("cad.stl"), &pieces);
    run(&[&"build", &model, &"-o", &cad, &"--like", &part, &"-q"]).ok();
    run(&[&"voids", &part, &"-o", &out, &"--cad", &cad, &"-q"]).ok();
    let rows = json(&out)["voids"].clone();
    let told = |row: usize| (rows[row]["class"].as_str(), rows[row]["cad_share"].as_f64());
    assert_eq!((told(0), told(1)), ((Some("pocket"), Some(0.0)), (Some("flaw"), Some(1.0))));
    // Pictures show these classes: without a CAD part nothing tells them.
    let picture = dir.path("v.png");
    let mut section: Vec<&dyn AsRef<OsStr>> =
        vec![&"slice", &part, &"-o", &picture, &"--z", &"12", &"--style", &"voids"];
    section.extend([&"--classes" as &dyn AsRef<OsStr>, &"flaw", &"-q"]);
    assert!(run(&section).failed().contains("--cad"));
    section.extend([&"--cad" as &dyn AsRef<OsStr>, &cad]);
    run(&section).ok();
    let flaws = std::fs::read(&picture).unwrap();
    section[9] = &"pocket";
    run(&section).ok();
    assert_ne!(std::fs::read(&picture).unwrap(), flaws);
    // On a lattice of its own.
    run(&[&"build", &model, &"-o", &cad, &"--cell", &"0.31", &"-q"]).ok();
    let refused = run(&[&"voids", &part, &"-o", &out, &"--cad", &cad, &"-q"]).failed();
    assert!(refused.contains("--like"), "{refused}");
    let moved = written(dir.path("far.stl"), &[shapes::cuboid([5.0; 3], [40.0; 3])]);
    let refused = run(&[&"build", &moved, &"-o", &cad, &"--like", &part, &"-q", &"--restart"]).failed();
    assert!(refused.contains("--like"), "{refused}");
}

/// A block with a cavity as OBJ, moved.
pub fn hollow_block(by: [f64; 3]) -> String {
    let cavity = shapes::cuboid([-0.7, -0.5, -0.3], [0.7, 0.5, 0.3]).rotated([1.0, 2.0, 3.0], 0.7);
    let pieces = [shapes::cuboid([0.0; 3], [8.0, 4.0, 2.0]), cavity.translated([3.1, 2.2, 1.1]).flipped()];
    let mut text = String::new();
    for [a, b, c] in pieces.iter().flat_map(Mesh::facets) {
        for at in [a, b, c] {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|n| at[n] + by[n]);
            text += &format!("v {x} {y} {z}\n");
        }
        text += "f -3 -2 -1\n";
    }
    text
}

#[test]
fn voids_of_parts_far_from_the_origin_have_the_same_sizes() {
    const FAR: [f64; 3] = [4_500_000.0, 5_350_000.0, 512.0];
    let dir = Scratch::new();
    let row = |name: &str, by: [f64; 3]| {
        let (part, out) = (dir.path(&format!("{name}.brf")), dir.path(&format!("{name}.json")));
        let mesh = dir.file(&format!("{name}.obj"), hollow_block(by));
        run(&[&"build", &mesh, &"-o", &part, &"--cell", &"0.05", &"-q"]).ok();
        run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
        json(&out)["voids"][0].clone()
    };
    let (near, far) = (row("near", [0.0; 3]), row("far", FAR));
    let number = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name}"));
    for name in ["volume", "surface", "sphericity", "elongation", "diameter", "area_x", "area_z"] {
        let (near, far) = (number(&near, name), number(&far, name));
        assert!((near - far).abs() < 2e-4 * near, "{name}: {near} {far}");
    }
    for (name, by) in ["x", "y", "z"].into_iter().zip(FAR) {
        assert!((number(&near, name) + by - number(&far, name)).abs() < 1e-4, "{name}");
    }
}

/// A store of a cavity of 6³ whose channel, 1.2 wide, leads outside: no void, but behind a throat.
pub fn cavity_behind_a_throat(dir: &Scratch) -> std::path::PathBuf {
    let cavity = shapes::cuboid([7.1; 3], [13.1; 3]);
    let channel = shapes::cuboid([12.0, 9.6, 9.6], [21.0, 10.8, 10.8]);
    let pieces = [shapes::cuboid([0.0; 3], [20.0; 3]), cavity.flipped(), channel.flipped()];
    let (part, model) = (dir.path("a.brf"), written(dir.path("a.stl"), &pieces));
    run(&[&"build", &model, &"-o", &part, &"--cell", &"0.25", &"-q"]).ok_but_for("inside out");
    part
}

#[test]
fn a_void_behind_a_throat_is_listed_if_that_is_narrow_enough() {
    let dir = Scratch::new();
    let (part, out) = (cavity_behind_a_throat(&dir), dir.path("v.json"));
    run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
    assert_eq!(json(&out)["count"], 0);
    run(&[&"voids", &part, &"-o", &out, &"--closing", &"1", &"-q"]).ok();
    assert_eq!(json(&out)["count"], 0);
    run(&[&"voids", &part, &"-o", &out, &"--closing", &"2", &"-q", &"--threads", &"2"]).ok();
    let found = json(&out);
    assert_eq!(found["count"], 1);
    let row = &found["voids"][0];
    let number = |name: &str| row[name].as_f64().unwrap();
    assert_eq!(row["sealed"], "no");
    assert!((number("throat") - 1.2).abs() <= 0.25, "{row}");
    // Clearances are told apart only as far as is needed.
    assert!(row["inner_diameter"].is_null() && row["surface"].is_null(), "{row}");
    assert!(
        (number("volume") - 216.0).abs() <= number("volume_error") && number("volume_error") < 80.0,
        "{row}"
    );
    assert!((number("x") - 10.1).abs() < 0.6 && (number("y") - 10.1).abs() < 0.3, "{row}");
    let text = std::fs::read_to_string(&out).unwrap();
    for threads in ["1", "3"] {
        run(&[&"voids", &part, &"-o", &out, &"--closing", &"2", &"-q", &"--threads", &threads]).ok();
        assert_eq!(std::fs::read_to_string(&out).unwrap(), text);
    }
    // The array has it as well: of the grid's samples those that it was measured by, whose volume is told to four digits.
    let labels = dir.path("l.npy");
    run(&[&"voids", &part, &"-o", &out, &"--closing", &"2", &"--labels", &labels, &"-q"]).ok();
    let bytes = std::fs::read(&labels).unwrap();
    let words = bytes[bytes.len() - 4 * 128usize.pow(3)..].as_chunks::<4>().0;
    let counted = words.iter().filter(|word| u32::from_le_bytes(**word) == 1).count();
    let counted = counted as f64 * 0.25f64.powi(3);
    assert!((counted - number("volume")).abs() <= 0.5, "{counted} {row}");
    // With little memory the grid is coarser.
    let little = [&"voids" as &dyn AsRef<std::ffi::OsStr>, &part, &"-o", &out, &"--closing", &"2", &"-q"];
    run(&[&little[..], &[&"--memory", &"2MiB"]].concat()).ok();
    assert!(json(&out)["throat_cell"].as_f64() > found["throat_cell"].as_f64());
}

#[test]
fn voids_are_written_as_meshes_and_labels() {
    let dir = Scratch::new();
    let (part, out, mesh, labels) =
        (dir.path("a.brf"), dir.path("v.json"), dir.path("v.ply"), dir.path("l.npy"));
    run(&[&"build", &block(&dir), &"-o", &part, &"--depth", &"2", &"-q"]).ok();
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &mesh, &"--labels", &labels, &"-q"]).ok();
    let rows = json(&out)["voids"].clone();
    run(&[&"mesh", &mesh, &"--check", &"-q"]).ok();
    let bytes = std::fs::read(&labels).unwrap();
    let data = &bytes[bytes.len() - 4 * 128usize.pow(3)..];
    let mut counts = [0usize; 3];
    let word = |b: &[u8; 4]| u32::from_le_bytes(*b) as usize;
    data.as_chunks::<4>().0.iter().for_each(|bytes| counts[word(bytes)] += 1);
    let spacing = json(&dir.path("l.json"))["spacing"].as_f64().unwrap();
    for row in 0..2 {
        let counted = counts[row + 1] as f64 * spacing.powi(3);
        let volume = rows[row]["volume"].as_f64().unwrap();
        assert!((counted / volume - 1.0).abs() < 0.02, "{counted} {volume}");
    }
    let elongation = rows[0]["elongation"].as_f64().unwrap();
    assert!(elongation > 1.8 && elongation < 3.0, "{elongation}");
    let cube = rows[1]["elongation"].as_f64().unwrap();
    assert!((cube - 1.0).abs() < 0.02, "{cube}");
    let obj = dir.path("v.obj");
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &obj, &"-q"]).ok();
    let text = std::fs::read_to_string(&obj).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("g void_")).count(), 2);
    let three_mf = dir.path("v.3mf");
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &three_mf, &"-q"]).ok();
    run(&[&"mesh", &three_mf, &"--check", &"-q"]).ok();
    let told = run(&[&"info", &three_mf, &"--json"]).json();
    let names: Vec<&str> =
        told["objects"].as_array().unwrap().iter().filter_map(|o| o["name"].as_str()).collect();
    assert_eq!(names, ["void 1", "void 2"], "{told}");
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &dir.path("v.stl")]).misused();
    run(&[&"voids", &part, &"-o", &out, &"--labels", &dir.path("v.csv")]).misused();
    let bad = run(&[&"voids", &part, &"-o", &out, &"--mesh", &dir.path("no/v.ply"), &"-q"]).failed();
    assert!(bad.contains("create the directory first"), "{bad}");
}

#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn walls_of_undivided_bricks_seal_for_certain() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.json"));
    let cavity = shapes::cuboid([8.6; 3], [11.4; 3]).flipped();
    let model = written(dir.path("a.stl"), &[shapes::cuboid([0.0; 3], [20.0; 3]), cavity]);
    for (depth, sealed) in [("1", "to_cell"), ("4", "certain")] {
        run(&[&"build", &model, &"-o", &part, &"--depth", &depth, &"-q"]).ok();
        run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
        assert_eq!(json(&out)["voids"][0]["sealed"], sealed, "{depth}");
    }
}

/// Three layers of ten lines within a loop; one line of the middle layer is missing. Also the numbers of the lines beside it.
fn without_a_line(dir: &Scratch, missing: usize) -> (std::path::PathBuf, [usize; 2]) {
    let mut text = vec!["; generated by PrusaSlicer".to_owned(), "G21\nG90\nM83".to_owned()];
    let mut beside = [0; 2];
    for layer in 0..3 {
        let z = 0.5 * f64::from(layer + 1);
        text.push(format!(
            ";LAYER_CHANGE\n;Z:{z}\n;HEIGHT:0.5\nG1 Z{z} F600\n;TYPE:External perimeter\n;WIDTH:1\nG0 X0 Y0"
        ));
        text.push("G1 X20 Y0 E1\nG1 X20 Y9.4 E1\nG1 X0 Y9.4 E1".to_owned());
        if layer == 1 && missing == 9 {
            beside[1] = text.join("\n").lines().count();
        }
        text.push("G1 X0 Y0 E1\n;TYPE:Solid infill\n;WIDTH:1".to_owned());
        for line in 0..10 {
            let y = 0.83 + 0.86 * line as f64;
            if layer == 1 && line == missing {
                continue;
            }
            text.push(format!("G0 X0.6 Y{y:.3}"));
            text.push(format!("G1 X19.4 Y{y:.3} E1"));
            if layer == 1 && (line + 1 == missing || line == missing + 1) {
                beside[usize::from(line > missing)] = text.join("\n").lines().count();
            }
        }
    }
    (dir.file("lines.gcode", text.join("\n") + "\n"), beside)
}

#[test]
fn the_lines_beside_a_missing_one_are_named_first() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.json"));
    // The last line lies beside the wall, which stands far before it in the program.
    for missing in [4, 9] {
        let (gcode, beside) = without_a_line(&dir, missing);
        let build = run(&[&"build", &gcode, &"-o", &part, &"--identity", &"--cell", &"0.1", &"-q"]);
        assert_eq!(build.status, Some(0), "{}", build.stderr);
        run(&[&"voids", &part, &"-o", &out, &"--lines", &"-q"]).ok();
        let found = json(&out);
        let row = &found["voids"][0];
        let expected = [beside[0].min(beside[1]), beside[0].max(beside[1])];
        assert_eq!(row["missing_between"], format!("{}-{}", expected[0], expected[1]), "{row}");
        let lines: Vec<&str> = row["lines"].as_str().unwrap().split(';').collect();
        let expected = beside.map(|line| line.to_string());
        assert!(lines[..2].iter().all(|line| expected.contains(&(*line).to_owned())), "{row}");
        assert_eq!(row["class"], "flaw", "{row}");
    }
}

#[test]
fn voids_in_bricks_of_mixed_levels_have_no_wrong_euler_number() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.json"));
    let gap = shapes::cuboid([-4.0, -4.0, -0.05], [4.0, 4.0, 0.05]).rotated([1.0, 0.3, 0.2], 0.3);
    let cavity =
        shapes::cuboid([-2.0; 3], [2.0; 3]).rotated([1.0, 2.0, 3.0], 0.7).translated([5.0, 5.0, 15.0]);
    let pieces =
        [shapes::cuboid([0.0; 3], [20.0; 3]), gap.translated([10.2, 10.1, 7.3]).flipped(), cavity.flipped()];
    let model = written(dir.path("a.stl"), &pieces);
    let built = run(&[&"build", &model, &"-o", &part, &"--depth", &"1", &"--thin", &"4", &"-q"]);
    assert_eq!(built.status, Some(0), "{}", built.stderr);
    run(&[&"voids", &part, &"-o", &out, &"-q"]).ok();
    let found = json(&out);
    assert_eq!((found["count"].as_u64(), found["solids"].as_u64()), (Some(2), Some(1)), "{found}");
    for (row, volume) in [(0, 64.0), (1, 6.4)] {
        let row = &found["voids"][row];
        // Unknown where the faces of bricks do not match.
        assert!(row["euler"].is_null() || row["euler"] == 1, "{row}");
        let [found, error] = ["volume", "volume_error"].map(|name| row[name].as_f64().unwrap());
        assert!((found - volume).abs() <= error && (found / volume - 1.0).abs() < 0.05, "{row}");
    }
}

/// A block of 40³ with three cavities of 6³, which boxes lead out of to just below the top (`wall` from it), or through it with a
/// width of `hole`; the third has none.
fn cavities(dir: &Scratch, wall: f64, hole: f64) -> std::path::PathBuf {
    let path = dir.path("cavities.stl");
    let box_of = |low: [f64; 3], high: [f64; 3]| shapes::cuboid(low, high).flipped();
    let mut pieces = vec![shapes::cuboid([0.0; 3], [40.0; 3])];
    for x in [8.3, 20.3, 32.3] {
        pieces.push(box_of([x - 3.0, 17.0, 17.0], [x + 3.0, 23.0, 23.0]));
    }
    pieces.push(box_of([7.1, 19.2, 22.4], [9.4, 21.3, 40.0 - wall]));
    pieces.push(box_of([20.17, 20.13, 22.4], [20.17 + hole, 20.13 + hole, 41.0]));
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(&pieces)).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn meshes_tell_walls_and_leaks_that_no_sample_shows() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("a.brf"), dir.path("v.json"));
    // Cells of 1: a wall that samples see, with cells beside it that both surfaces touch, and a hole of a twentieth.
    let input = cavities(&dir, 1.3, 0.05);
    run(&[&"build", &input, &"-o", &part, &"--cell", &"1", &"-q"]).ok_but_for("inside out");
    let seals = |options: &[&dyn AsRef<std::ffi::OsStr>]| {
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"voids", &part, &"-o", &out, &"-q"];
        args.extend(options);
        run(&args).ok();
        let found = json(&out);
        let mut rows: Vec<(i64, String, serde_json::Value)> = found["voids"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| {
                let x = row["x"].as_f64().unwrap() as i64;
                (x, row["sealed"].as_str().unwrap().to_owned(), row["throat"].clone())
            })
            .collect();
        rows.sort_by_key(|row| row.0);
        rows
    };
    let without: Vec<String> = seals(&[]).into_iter().map(|row| row.1).collect();
    assert_eq!(without, ["to_cell"; 3]);
    let with = seals(&[&"--source", &input]);
    let told: Vec<&str> = with.iter().map(|row| row.1.as_str()).collect();
    assert_eq!(told, ["certain", "no", "certain"]);
    // How wide the leak is no sample tells; nothing leaves the others.
    assert!(with[1].2.is_null() && with[0].2 == 0.0, "{with:?}");
    let text = std::fs::read(&out).unwrap();
    seals(&[&"--source", &input, &"--threads", &"3"]);
    assert_eq!(std::fs::read(&out).unwrap(), text);
    // Only the file that the store was built from is asked.
    let other = run(&[&"voids", &part, &"-o", &out, &"-q", &"--source", &stl("overlap_boxes.stl")]).failed();
    assert!(other.contains("it was built from") && other.lines().count() == 1, "{other}");
    let twice =
        run(&[&"voids", &part, &"-o", &out, &"-q", &"--source", &input, &"--source", &input]).failed();
    assert!(twice.contains("each file once"), "{twice}");
}
