//! The cases of the specification against a reference, and a toolpath against its mesh.

use super::*;
use crate::x3d::scp;
use serde_json::Value;
use std::fs;

fn bench_data(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bench-data").join(name)).unwrap()
}

/// The Extrusion elements of a file, each as a file of its own.
fn one_by_one(text: &str) -> Vec<String> {
    let elements = text.split("<Shape>").skip(1).map(|part| part.split("</Shape>").next().unwrap());
    elements.map(|element| file(&format!("<Shape>{element}</Shape>"))).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn assert_close(name: &str, what: &str, found: &[f64], expected: &[f64], within: f64) {
    let is_close = found.len() == expected.len()
        && found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= within * (1.0 + e.abs()));
    assert!(is_close, "{name}: {what} is {found:?}, expected {expected:?}");
}

#[test]
fn every_case_agrees_with_the_reference() {
    let text = bench_data("x3d/extrusion_cases.x3d");
    let expected: Value = serde_json::from_str(&bench_data("x3d/extrusion_cases.json")).unwrap();
    let expected = expected.as_array().unwrap();
    let files = one_by_one(&text);
    assert_eq!((files.len(), expected.len()), (25, 25));
    for (file, case) in files.iter().zip(expected) {
        let name = case["DEF"].as_str().unwrap();
        if case.get("error").is_some() {
            let told = refusal(file);
            assert!(told.contains("line 3: Extrusion") && told.contains("scale"), "{name}: {told}");
            continue;
        }
        if case["triangles"] == 0 {
            assert!(refusal(file).contains("nothing to render"), "{name}");
            continue;
        }
        let triangles = all(&opened(file).unwrap());
        assert_eq!(triangles.len() as u64, case["triangles"].as_u64().unwrap(), "{name}");
        let degenerate = triangles.iter().filter(|t| area(t) < 1e-12).count();
        assert_eq!(degenerate as u64, case["degenerate"].as_u64().unwrap(), "{name}");
        let measured = [volume(&triangles), triangles.iter().map(area).sum()];
        // The reference says which faces are drawn: a clockwise outline, or ccw="false", shows the inner ones. The sweep is
        // a solid all the same.
        let truth = [&case["signed_volume"], &case["area"]].map(|v| v.as_f64().unwrap().abs());
        assert_close(name, "volume and area", &measured, &truth, 1e-9);
        let [low, high] = bounds(&triangles);
        assert_close(
            name,
            "bounds",
            &[low.to_array(), high.to_array()].concat(),
            &numbers(&case["bbox"]),
            1e-9,
        );
        assert_planes(name, file, case);
    }
}

fn assert_planes(name: &str, file: &str, case: &Value) {
    let mut spine = Vec::new();
    read(Path::new("a.x3d"), file.as_bytes(), &Silent, &mut |piece| {
        if let X3dItem::Extrusion(extrusion) = piece {
            spine = extrusion.spine.iter().map(|p| DVec3::from(*p)).collect();
        }
        Ok(())
    })
    .unwrap();
    let mut frames = Vec::new();
    scp::planes(&spine, |_, frame| frames.push(frame.to_cols_array())).unwrap();
    for (frame, key) in [(frames[0], "first"), (frames[frames.len() - 1], "last")] {
        // The reference holds a matrix in rows whose columns are X, Y and Z.
        let rows = numbers(&case[format!("scp_columns_XYZ_{key}")]);
        let columns: Vec<f64> = (0..9).map(|i| rows[i % 3 * 3 + i / 3]).collect();
        assert_close(name, key, &frame, &columns, 2e-9);
    }
}

#[test]
fn the_cases_are_read_together_and_the_bad_ones_named() {
    let sweeps = opened(&bench_data("x3d/extrusion_cases.x3d")).unwrap();
    let report = sweeps.report();
    assert_eq!((report.extrusions, report.placed, report.empty, report.refused_count), (23, 23, 2, 2));
    assert_eq!((report.turned, report.turned_line), (2, 21));
    let warnings = report.warnings();
    let wanted = [
        "line 24: Extrusion \"too_few_scale_undefined\": scale has 2 values for 3 spine points",
        "line 25: Extrusion \"scale_zero_not_allowed\": scale holds 0",
        "line 16: 2 Extrusions, this the first, of fewer than two distinct points",
    ];
    for (line, wanted) in warnings.iter().zip(wanted) {
        assert!(line.starts_with(wanted), "{line}");
    }
    assert_eq!(warnings.len(), wanted.len());
}

#[test]
fn sweeps_with_caps_and_closed_outline_are_closed() {
    for file in one_by_one(&bench_data("x3d/extrusion_cases.x3d")) {
        let Ok(sweeps) = opened(&file) else { continue };
        let has_open_ends = file.contains("Cap='false'") && !file.contains("closed_square_spine");
        let has_open_outline = file.contains("open_section");
        let open = open_edges(&all(&sweeps));
        assert_eq!(open > 0, has_open_ends || has_open_outline, "{open} open edges: {file}");
    }
}

#[test]
fn the_clover_is_the_mesh_that_was_swept_along_it() {
    let sweeps = opened(&bench_data("x3d/clover_beads.x3d")).unwrap();
    assert!(sweeps.report().warnings().is_empty());
    let triangles = all(&sweeps);
    assert_eq!(triangles.len(), 111_960);
    assert_eq!(open_edges(&triangles), 0);
    // The text has three decimals.
    assert!((volume(&triangles) - 77084.28).abs() < 0.005, "{}", volume(&triangles));
    let stl = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bench-data/stl/clover_beads.stl");
    let bytes = fs::read(stl).unwrap();
    let float = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    let mesh: Vec<Triangle> = (0..111_960)
        .map(|t| [0, 1, 2].map(|v| [0, 1, 2].map(|a| float(84 + t * 50 + 12 + v * 12 + a * 4))))
        .collect();
    assert!((volume(&mesh) - 77088.65).abs() < 0.01);
    let [low, high] = bounds(&triangles);
    let [mesh_low, mesh_high] = bounds(&mesh);
    assert!((low - mesh_low).length() < 0.01 && (high - mesh_high).length() < 0.01, "{low} {high}");
}
