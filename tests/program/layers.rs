//! `layers` and `overlap`: tables of layers and of pairs of beads.

use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};
use brickfield_core::sweep::part_or_all;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The clover, with beads told apart.
fn clover(dir: &Scratch) -> PathBuf {
    let part = dir.path("clover.brf");
    run(&[&"build", &example("clover.gcode"), &"-o", &part, &"--identity", &"-q"]).ok_but_for("empty");
    part
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("{name} of {row}"))
}

#[test]
fn layers_add_up_to_the_part_for_any_number_of_threads() {
    let dir = Scratch::new();
    let (part, out) = (clover(&dir), dir.path("l.json"));
    run(&[&"layers", &part, &"-o", &out, &"-q", &"--threads", &"2"]).ok();
    let found = json(&out);
    let rows = found["layers"].as_array().unwrap();
    assert_eq!(rows.len(), 17);
    let sum = |name: &str| rows.iter().map(|row| number(row, name)).sum::<f64>();
    // Rows have the digits that their errors leave.
    assert!((sum("volume") / number(&found, "volume") - 1.0).abs() < 1e-3);
    // The source's own integrals are another method.
    assert!((sum("volume") / sum("source_volume") - 1.0).abs() < 0.02, "{found}");
    assert!((sum("overlap_volume") / number(&found, "overlap_of_samples") - 1.0).abs() < 0.05);
    assert!((sum("fed_volume") - 73_763.7).abs() < 1.0, "{}", sum("fed_volume"));
    for row in &rows[1..] {
        let [area, volume] = ["area", "volume"].map(|name| number(row, name));
        assert!(area > 0.9 * volume / 1.5 && area < 1.1 * volume / 1.5, "{row}");
        let fed = number(row, "fed_volume") - number(row, "source_volume");
        assert!((number(row, "fed_minus_union") - fed).abs() < number(row, "source_volume_error"), "{row}");
    }
    let text = std::fs::read_to_string(&out).unwrap();
    for threads in ["1", "3"] {
        let again = dir.path("again.json");
        run(&[&"layers", &part, &"-o", &again, &"-q", &"--threads", &threads]).ok();
        assert_eq!(std::fs::read_to_string(&again).unwrap(), text);
    }
    // Steps have no material fed, and as much volume.
    run(&[&"layers", &part, &"-o", &out, &"-q", &"--pitch", &"0.7mm"]).ok();
    let steps = json(&out);
    assert!((number(&steps, "volume") / number(&found, "volume") - 1.0).abs() < 1e-6);
    assert!(number(&steps, "porosity") < number(&steps, "porosity_error"), "{steps}");
    assert!(steps["layers"][0]["fed_volume"].is_null());
}

#[test]
fn layers_without_a_toolpath_need_a_pitch() {
    let dir = Scratch::new();
    let part = dir.path("a.brf");
    run(&[&"build", &stl("overlap_boxes.stl"), &"-o", &part, &"--depth", &"1", &"-q"]).ok();
    let refused = run(&[&"layers", &part, &"-q"]).failed();
    assert!(refused.contains("--pitch") && refused.lines().count() == 1, "{refused}");
    let printed = run(&[&"layers", &part, &"--pitch", &"1mm", &"-q"]).ok();
    let header = "layer,z_bottom,z_top,area,volume,void_volume,porosity,overlap_volume,fed_volume,perimeter,";
    assert!(printed.starts_with(header), "{printed}");
    run(&[&"layers", &part, &"-o", &dir.path("l.txt")]).misused();
    let bad = run(&[&"layers", &part, &"--pitch", &"1", &"-o", &dir.path("no/l.csv"), &"-q"]).failed();
    assert!(bad.contains("create the directory first"), "{bad}");
    let refused = run(&[&"overlap", &part, &"-q"]).failed();
    assert!(refused.contains("--identity") && refused.lines().count() == 1, "{refused}");
}

/// Slabs of a turned box against sections of its facets.
#[test]
fn volumes_of_slabs_are_within_their_errors() {
    let dir = Scratch::new();
    let (input, part, out) = (dir.path("box.stl"), dir.path("a.brf"), dir.path("l.json"));
    let mesh = shapes::cuboid([-5.0, -4.0, -3.0], [5.0, 4.0, 3.0]).rotated([1.0, 2.0, 3.0], 0.6);
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &mesh).unwrap();
    std::fs::write(&input, bytes).unwrap();
    run(&[&"build", &input, &"-o", &part, &"--depth", &"2", &"-q"]).ok();
    for pitch in ["1mm", "0.33mm"] {
        run(&[&"layers", &part, &"--pitch", &pitch, &"-o", &out, &"-q"]).ok();
        for row in json(&out)["layers"].as_array().expect("rows") {
            let below = |name: &str| volume_below(&mesh, number(row, name));
            let (volume, error) = (number(row, "volume"), number(row, "volume_error"));
            let truth = below("z_top") - below("z_bottom");
            assert!((volume - truth).abs() <= error + 1e-3, "{truth}: {row}");
            assert!(error < 0.02 * truth + 0.05, "{row}");
        }
    }
}

/// The volume of a convex body below a plane across z, from two thousand sections of it.
fn volume_below(mesh: &Mesh, z: f64) -> f64 {
    let low = mesh.facets().flatten().map(|corner| corner[2]).fold(f64::INFINITY, f64::min);
    let high = mesh.facets().flatten().map(|corner| corner[2]).fold(f64::NEG_INFINITY, f64::max);
    let steps = 2000;
    let step = (z.clamp(low, high) - low) / f64::from(steps);
    (0..steps).map(|n| section_area(mesh, low + (f64::from(n) + 0.5) * step) * step).sum()
}

/// The area in which a plane cuts a closed mesh, by the edges that its facets leave there.
fn section_area(mesh: &Mesh, z: f64) -> f64 {
    let mut area = 0.0;
    for facet in mesh.facets() {
        let mut ends = Vec::new();
        for n in 0..3 {
            let (p, q) = (facet[n], facet[(n + 1) % 3]);
            if (p[2] < z) != (q[2] < z) {
                let share = (z - p[2]) / (q[2] - p[2]);
                ends.push(([p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])], p[2] < z));
            }
        }
        if let [(a, a_rises), (b, _)] = ends[..] {
            let (from, to) = if a_rises { (a, b) } else { (b, a) };
            area += 0.5 * (from[0] * to[1] - from[1] * to[0]);
        }
    }
    area.abs()
}

#[test]
fn pairs_of_beads_add_up_to_the_samples_exactly() {
    let dir = Scratch::new();
    for count in ["passes", "beads"] {
        let (part, out) = (dir.path("clover.brf"), dir.path("o.json"));
        let gcode = example("clover.gcode");
        run(&[&"build", &gcode, &"-o", &part, &"--identity", &"--count", &count, &"-q"]).ok_but_for("empty");
        run(&[&"overlap", &part, &"-o", &out, &"-q", &"--threads", &"2"]).ok();
        let found = json(&out);
        assert_eq!(found["pair_samples"], found["field_samples"], "{count}");
        assert_eq!(found["unexplained_samples"], "0", "{count}");
        let rows = found["overlaps"].as_array().unwrap();
        let volume: f64 = rows.iter().map(|row| number(row, "volume")).sum();
        assert!((volume / number(&found, "sampled_volume") - 1.0).abs() < 0.02, "{count}: {volume}");
        assert!(rows.iter().all(|row| number(row, "volume") > 0.0 && row["lines_a"] != row["lines_b"]));
        for (by, most) in [("layer", 40), ("feature", 10)] {
            let other = dir.path("by.json");
            run(&[&"overlap", &part, &"-o", &other, &"--by", &by, &"-q"]).ok();
            let rows = json(&other)["overlaps"].as_array().unwrap().clone();
            let same: f64 = rows.iter().map(|row| number(row, "volume")).sum();
            // Each row is rounded to the digits that it deserves.
            assert!(rows.len() <= most && (same / volume - 1.0).abs() < 5e-4, "{by}: {same} {volume}");
        }
        let text = std::fs::read_to_string(&out).unwrap();
        for threads in part_or_all(&["3"][..], &["1", "3"]) {
            run(&[&"overlap", &part, &"-o", &out, &"-q", &"--threads", &threads]).ok();
            assert_eq!(std::fs::read_to_string(&out).unwrap(), text);
        }
    }
    let printed = run(&[&"overlap", &dir.path("clover.brf"), &"--min-volume", &"1e9", &"-q"]).ok();
    let header = "bead_a,bead_b,volume,x,y,z,layer_a,layer_b,lines_a,lines_b,feature_a,feature_b,";
    assert!(printed.starts_with(header) && printed.lines().count() == 1, "{printed}");
}
