//! `mesh` far from the origin, with coordinates of 64 bits, and with numbers of the beads.

use crate::support::*;
use serde_json::Value;
use std::path::Path;

/// A mesh of a binary PLY: its header, positions, corners, and what numbers each triangle has.
type ReadMesh = (String, Vec<[f64; 3]>, Vec<[usize; 3]>, Vec<Vec<i32>>);

/// Reads what `mesh` writes, by the words of the header.
fn read_ply(path: &Path) -> ReadMesh {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|word| word == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let count = |name: &str| -> usize {
        header.lines().find_map(|line| line.strip_prefix(name)).unwrap().trim().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let is_double = header.contains("property double x");
    let numbers = header.matches("property int ").count();
    let size = if is_double { 8 } else { 4 };
    let number = |at: usize| match is_double {
        true => f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()),
        false => f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())),
    };
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let positions = (0..vertices).map(|n| [0, 1, 2].map(|a| number(end + (3 * n + a) * size))).collect();
    let first = end + 3 * vertices * size;
    let row = 13 + 4 * numbers;
    assert_eq!(bytes.len(), first + faces * row);
    let corners = |n: usize| [0, 1, 2].map(|a| word(first + n * row + 1 + 4 * a) as usize);
    let of = |n: usize| (0..numbers).map(|m| word(first + n * row + 13 + 4 * m) as i32).collect();
    (header, positions, (0..faces).map(corners).collect(), (0..faces).map(of).collect())
}

/// A box as OBJ at a place.
fn box_at(place: [f64; 3]) -> String {
    let mut text = String::new();
    for n in 0..8 {
        let [x, y, z]: [f64; 3] =
            std::array::from_fn(|a| place[a] + [8.0, 4.0, 2.0][a] * f64::from(n >> a & 1));
        text += &format!("v {x} {y} {z}\n");
    }
    for f in ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"] {
        text += &format!("f {f}\n");
    }
    text
}

/// A part in metres somewhere in a country's grid.
const FAR: [f64; 3] = [4_500_000.0, 5_350_000.0, 512.0];

#[test]
fn far_coordinates_have_64_bits() {
    let dir = Scratch::new();
    let (near, far) = (dir.path("near.brf"), dir.path("far.brf"));
    run(&[&"build", &dir.file("near.obj", box_at([0.0; 3])), &"-o", &near, &"--depth", &"1", &"-q"]).ok();
    run(&[&"build", &dir.file("far.obj", box_at(FAR)), &"-o", &far, &"--depth", &"1", &"-q"]).ok();
    let (truth, ply, obj) = (dir.path("n.ply"), dir.path("f.ply"), dir.path("f.obj"));
    run(&[&"mesh", &near, &"-o", &truth, &"-q"]).ok();
    let told: Value =
        serde_json::from_str(&run(&[&"mesh", &far, &"-o", &ply, &"--json", &"--check"]).ok()).unwrap();
    assert_eq!(told["coordinate_bits"], 64);
    let (header, positions, triangles, _) = read_ply(&ply);
    let (_, wanted, others, _) = read_ply(&truth);
    assert!(header.contains("property double z") && positions.len() == wanted.len() && triangles == others);
    let low = |a: usize| positions.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min);
    for (p, q) in positions.iter().zip(&wanted) {
        for a in 0..3 {
            assert!((p[a] - FAR[a] - q[a]).abs() < 2e-6, "{p:?} {q:?}");
        }
    }
    assert_eq!(told["bounds"][0][0].as_f64().unwrap(), low(0));
    run(&[&"mesh", &far, &"-o", &obj, &"-q"]).ok();
    let text = std::fs::read_to_string(&obj).unwrap();
    let read = text.lines().filter_map(|line| line.strip_prefix("v "));
    let read: Vec<Vec<f64>> =
        read.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
    assert!(read.len() == positions.len() && read.iter().zip(&positions).all(|(p, q)| p == q));
    let refused = run(&[&"mesh", &far, &"-o", &dir.path("f.stl")]).failed();
    assert!(refused.contains("round coordinates by up to") && !dir.path("f.stl").exists(), "{refused}");
    let nearer = dir.path("nearer.brf");
    let place = FAR.map(|c| c / 64.0);
    run(&[&"build", &dir.file("nearer.obj", box_at(place)), &"-o", &nearer, &"--depth", &"1", &"-q"]).ok();
    let warned = run(&[&"mesh", &nearer, &"-o", &dir.path("f.stl")]);
    assert!(
        warned.status == Some(0) && warned.stderr.contains("round coordinates by up to"),
        "{}",
        warned.stderr
    );
    assert!(run(&[&"mesh", &far, &"-o", &dir.path("g.stl"), &"--double"]).misused().contains("--double"));
    // Where 32 bits will do they stay, unless more are asked for.
    let double = dir.path("d.ply");
    run(&[&"mesh", &near, &"-o", &double, &"--double", &"-q", &"--keep-largest"]).ok();
    let (header, positions, ..) = read_ply(&double);
    assert!(header.contains("property double x"));
    assert!(positions.iter().zip(&wanted).all(|(p, q)| (0..3).all(|a| (p[a] - q[a]).abs() < 1e-6)));
}

#[test]
fn triangles_have_the_numbers_of_their_beads() {
    let dir = Scratch::new();
    let mut text = "; filament_diameter = 1.75\n; layer_height = 0.4\nG21\nG90\nM83\n".to_owned();
    for (layer, kind) in [(1, "Perimeter"), (2, "Solid infill"), (3, "Perimeter")] {
        let z = 0.4 * f64::from(layer);
        text +=
            &format!(";LAYER_CHANGE\n;Z:{z:.1}\n;HEIGHT:0.4\nG1 Z{z:.1} F600\n;TYPE:{kind}\n;WIDTH:0.8\n");
        for y in [0.0, 3.0] {
            text += &format!("G1 X0 Y{y}\nG1 X5 Y{y} E0.6\n");
        }
    }
    let (part, mesh) = (dir.path("p.brf"), dir.path("m.ply"));
    run(&[&"build", &dir.file("p.gcode", &text), &"-o", &part, &"--identity", &"--depth", &"2", &"-q"]).ok();
    let named = "bead,layer,feature";
    run(&[&"mesh", &part, &"-o", &mesh, &"--attributes", &named, &"--check", &"-q"]).ok();
    let (header, positions, triangles, numbers) = read_ply(&mesh);
    assert!(header.contains("property int bead\nproperty int layer\nproperty int feature\n"), "{header}");
    let feature = |name: &str| -> i32 {
        let line = header.lines().find(|line| line.starts_with("comment feature ") && line.ends_with(name));
        line.unwrap().split(' ').nth(2).unwrap().parse().unwrap()
    };
    let (perimeter, infill) = (feature("Perimeter"), feature("Solid infill"));
    let mut seen = [0; 6];
    for (corners, of) in triangles.iter().zip(&numbers) {
        let middle: [f64; 3] =
            std::array::from_fn(|a| corners.iter().map(|&n| positions[n][a]).sum::<f64>() / 3.0);
        let layer = (middle[2] / 0.4).floor();
        // Where two layers touch either will do.
        if (middle[2] / 0.4 - (middle[2] / 0.4).round()).abs() < 0.1 {
            continue;
        }
        let line = i32::from(middle[1] > 1.5);
        assert_eq!(of[1], layer as i32 + 1, "{middle:?} {of:?}");
        assert_eq!(of[0], 2 * layer as i32 + line, "{middle:?} {of:?}");
        assert_eq!(of[2], if layer == 1.0 { infill } else { perimeter }, "{middle:?} {of:?}");
        seen[of[0] as usize] += 1;
    }
    assert!(seen.iter().all(|&count| count > 50), "{seen:?}");
    assert!(numbers.iter().filter(|of| of[0] < 0).count() * 100 < numbers.len());
    let bytes = std::fs::read(&mesh).unwrap();
    run(&[&"mesh", &part, &"-o", &mesh, &"--attributes", &named, &"-q", &"--threads", &"1"]).ok();
    assert!(bytes == std::fs::read(&mesh).unwrap());
    let (_, plain, ..) = read_ply(&mesh);
    let (double, both) = (dir.path("d.ply"), read_ply);
    run(&[&"mesh", &part, &"-o", &double, &"--attributes", &"layer", &"--double", &"-q"]).ok();
    let (_, positions, _, layers) = both(&double);
    assert!(
        positions.len() == plain.len()
            && layers.iter().zip(&numbers).filter(|(a, b)| a[0] != b[1]).count() < 20
    );
    let other = dir.path("o.brf");
    run(&[&"build", &stl("overlap_boxes"), &"-o", &other, &"--depth", &"1", &"-q"]).ok();
    let refused = run(&[&"mesh", &other, &"-o", &mesh, &"--attributes", &"bead"]).failed();
    assert!(refused.contains("--identity"), "{refused}");
    assert!(
        run(&[&"mesh", &part, &"-o", &dir.path("m.stl"), &"--attributes", &"bead"])
            .misused()
            .contains(".ply")
    );
}
