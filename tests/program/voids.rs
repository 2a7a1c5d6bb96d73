//! `voids`: what a part encloses, as a table.

use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};

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
    assert!(bad.contains("check the path"), "{bad}");
    run(&[&"voids", &part, &"-o", &dir.path("v.txt")]).misused();
    for (option, value) in [("--min-volume", "nan"), ("--min-volume=-1", "-q"), ("--max-porosity", "1.5")] {
        run(&[&"voids", &part, &"-o", &out, &option, &value]).misused();
    }
}
