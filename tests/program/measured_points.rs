//! `deviation` from points that were measured on some of a part, and `thickness` at points that are given.

use super::distance::stl_of;
use crate::support::*;
use brickfield_bench_data::shapes;
use brickfield_engine::distance::deviation::Motion;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const HALF: [f64; 3] = [4.0, 3.0, 2.5];

/// A store of a block about the origin, in cells of 0.2.
fn block(dir: &Scratch) -> PathBuf {
    let (part, mesh) = (dir.path("p.brf"), shapes::cuboid(HALF.map(|h| -h), HALF));
    run(&[&"build", &stl_of(dir, "p.stl", &mesh), &"-o", &part, &"--cell", &"0.2", &"-q"]).ok();
    part
}

/// Numbers from 0 to 1 that follow no pattern (additive recurrences by roots of x³ = x + 1).
fn spread(n: usize) -> [f64; 2] {
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|step| (n as f64 * step).fract())
}

/// Points of the top, which bulges by 0.3 around a place, and of two sides, as a scanner sees them that stands elsewhere.
fn scan(dir: &Scratch, name: &str, motion: Motion) -> PathBuf {
    let mut text = String::new();
    for n in 0..30_000 {
        let [s, t] = spread(n).map(|c| 2.0 * c - 1.0);
        let point = match n % 3 {
            0 => {
                let (x, y) = (s * HALF[0], t * HALF[1]);
                [x, y, HALF[2] + 0.3 * (-4.0 * ((x - 1.0).powi(2) + (y + 0.5).powi(2))).exp()]
            }
            1 => [HALF[0], s * HALF[1], t * HALF[2]],
            _ => [s * HALF[0], HALF[1], t * HALF[2]],
        };
        let [x, y, z] = motion.apply(point);
        writeln!(text, "{x:.6} {y:.6} {z:.6}").unwrap();
    }
    dir.file(name, text)
}

/// Positions and numbers of a PLY of points.
fn points_with_numbers(path: &Path, property: &str) -> Vec<([f64; 3], f32)> {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|some| some == b"end_header\n").unwrap() + 11;
    let head = String::from_utf8_lossy(&bytes[..end]);
    assert!(head.contains(&format!("property double z\nproperty float {property}\nend_header")), "{head}");
    let number = |row: &[u8; 28], axis: usize| f64::from_le_bytes(row.as_chunks::<8>().0[axis]);
    let (rows, rest) = bytes[end..].as_chunks::<28>();
    assert!(rest.is_empty() && head.contains(&format!("element vertex {}\n", rows.len())), "{head}");
    let value = |row: &[u8; 28]| f32::from_le_bytes(*row.last_chunk::<4>().unwrap());
    rows.iter().map(|row| ([0, 1, 2].map(|axis| number(row, axis)), value(row))).collect()
}

#[test]
fn points_of_some_of_a_part_tell_where_it_differs() {
    let dir = Scratch::new();
    let (part, out, table) = (block(&dir), dir.path("d.ply"), dir.path("r.csv"));
    let measured = dir.path("m.ply");
    let (sin, cos) = 0.08f64.sin_cos();
    let motion =
        Motion { rotation: [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]], shift: [0.4, -0.2, 0.3] };
    for (name, motion, align) in [("a.xyz", Motion::NONE, "none"), ("b.xyz", motion, "icp")] {
        let found = run(&[
            &"deviation",
            &part,
            &scan(&dir, name, motion),
            &"-o",
            &out,
            &"--align",
            &align,
            &"--within",
            &"0.1mm",
            &"--regions",
            &table,
            &"--reference-points",
            &measured,
            &"--json",
        ]);
        assert!(found.stderr.contains("is above --within 0.1"), "{}", found.stderr);
        let told: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
        assert_eq!(told["reference_is"].as_str(), Some("cloud"));
        let align = &told["align"];
        assert!((align["degrees"].as_f64().unwrap() - motion.degrees()).abs() < 0.03, "{align}");
        for axis in 0..3 {
            let shift = align["shift"][axis].as_f64().unwrap();
            assert!((shift - motion.shift[axis]).abs() < 0.005, "{align}");
        }
        // Of six faces three were measured.
        let vertices = told["vertices"].as_f64().unwrap();
        let without = told["vertices_without_points"].as_f64().unwrap() / vertices;
        assert!((0.48..0.6).contains(&without), "{without}");
        let regions = told["regions"].as_array().unwrap();
        assert_eq!(regions.len(), 1, "{regions:?}");
        let number = |name: &str| regions[0][name].as_f64().unwrap();
        assert_eq!(regions[0]["side"].as_str(), Some("under"));
        assert!((number("max_deviation") + 0.3).abs() < 0.03, "{regions:?}");
        assert!((number("x") - 1.0).abs() < 0.05 && (number("y") + 0.5).abs() < 0.05, "{regions:?}");
        // What is measured, from the points: above 0 where they lie outside of the part.
        let back = &told["reference_to_part"];
        assert_eq!(back["points"].as_u64(), Some(30_000));
        assert!((back["max"].as_f64().unwrap() - 0.3).abs() < 0.005, "{back}");
        assert!(back["min"].as_f64().unwrap() > -0.01, "{back}");
        // Each point stands where it was measured, with how far it lies from the part.
        let points = points_with_numbers(&measured, "deviation");
        assert_eq!(points.len(), 30_000);
        for (place, number) in points {
            let [x, y, z] = motion.undo(place);
            let bulge = if z >= HALF[2] - 0.001 { z - HALF[2] } else { 0.0 };
            assert!((f64::from(number) - bulge).abs() < 0.01, "({x}, {y}, {z}): {number}");
        }
    }
    // The picture takes the same points.
    let picture = dir.path("d.png");
    let scan = dir.path("a.xyz");
    let small: [&dyn AsRef<std::ffi::OsStr>; 11] = [
        &"render",
        &part,
        &"-o",
        &picture,
        &"--style",
        &"deviation",
        &"--reference",
        &scan,
        &"--size",
        &"64x48",
        &"-q",
    ];
    run(&small).ok();
}

#[test]
fn clouds_that_cannot_be_compared_are_a_line() {
    let dir = Scratch::new();
    let (part, out) = (block(&dir), dir.path("d.ply"));
    let few = dir.file("few.xyz", "0 0 2.5\n1 0 2.5\n0 1 2.5\n1 1 2.5\n");
    let far = scan(&dir, "far.xyz", Motion { shift: [50.0, 0.0, 0.0], ..Motion::NONE });
    let scaled: String = std::fs::read_to_string(scan(&dir, "mm.xyz", Motion::NONE))
        .unwrap()
        .lines()
        .map(|line| {
            let metres = line.split(' ').map(|c| format!("{:.9}", c.parse::<f64>().unwrap() / 1000.0));
            metres.collect::<Vec<_>>().join(" ") + "\n"
        })
        .collect();
    let metres = dir.file("metres.xyz", scaled);
    let refused = |cloud: &Path, text: &str| {
        let told = run(&[&"deviation", &part, &cloud, &"-o", &out]).failed();
        assert!(told.contains(text), "{told}");
        assert!(!out.exists());
    };
    refused(&few, "few.xyz: a cloud of 4 different points tells no surface");
    refused(&far, "far.xyz: it does not overlap the part");
    refused(&metres, "metres.xyz: it is about 1000 times smaller than the part");
    let near = scan(&dir, "near.xyz", Motion::NONE);
    for (name, text) in [("m.csv", "m.csv: the name must end in .ply"), ("d.ply", "d.ply")] {
        let points = dir.path(name);
        let told = run(&[&"deviation", &part, &near, &"-o", &out, &"--reference-points", &points]);
        assert!(told.status != Some(0) && told.stderr.contains(text), "{}", told.stderr);
        assert!(!out.exists() && !points.exists());
    }
}

#[test]
fn thickness_is_told_at_points() {
    let dir = Scratch::new();
    let part = block(&dir);
    let points = dir.file("p.csv", "x,y,z\n0.5,0.25,2.6\n4,0.5,0.5\n0,0,0\n1,-3.05,0\n");
    for method in ["ray", "sphere"] {
        let told = run(&[&"thickness", &part, &"--points", &points, &"--method", &method]).ok();
        let lines: Vec<&str> = told.lines().collect();
        assert_eq!(lines[0], "x,y,z,thickness");
        // The middle is 2.5 from the surface, more than four cells.
        assert_eq!(lines[3], "0.0,0.0,0.0,");
        for (line, expected) in [(1, 5.0), (2, 8.0), (4, 6.0)] {
            let (place, value) = lines[line].rsplit_once(',').unwrap();
            let value: f64 = value.parse().unwrap();
            assert_eq!(place.split(',').count(), 3);
            // The largest ball at a face is bounded by the nearest others, too.
            let least = if method == "ray" { expected - 0.001 } else { 4.0 };
            assert!((least..expected + 0.001).contains(&value), "{method}: {}", lines[line]);
        }
    }
    let json = run(&[&"thickness", &part, &"--points", &points, &"--method", &"ray", &"--json"]).ok();
    let rows: Vec<serde_json::Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(rows.len() == 4 && rows[2]["thickness"].is_null());
    assert!((rows[0]["thickness"].as_f64().unwrap() - 5.0).abs() < 0.001, "{json}");
    let gaps = run(&[&"thickness", &part, &"--points", &points, &"--gaps"]).ok();
    assert!(gaps.lines().skip(1).all(|line| line.ends_with(',')), "{gaps}");
    run(&[&"thickness", &part, &"--points", &points, &"-o", &dir.path("t.ply")]).misused();
    let bad = dir.file("bad.csv", "1,2\n");
    assert!(run(&[&"thickness", &part, &"--points", &bad]).failed().contains("bad.csv: line 1"));
}
