//! `mesh` far from the origin, with coordinates of 64 bits, and with numbers of the beads.

use crate::support::*;
use serde_json::Value;
use std::path::Path;

/// A mesh of a binary PLY: its header, positions, corners, and what numbers each triangle has.
pub type ReadMesh = (String, Vec<[f64; 3]>, Vec<[usize; 3]>, Vec<Vec<i32>>);

/// Reads what `mesh` writes, by the words of the header.
pub fn read_ply(path: &Path) -> ReadMesh {
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
    assert!(header.contains("property double x") && positions.len() == wanted.len());
    assert!(positions.iter().zip(&wanted).all(|(p, q)| (0..3).all(|a| (p[a] - q[a]).abs() < 1e-6)));
}

/// Whether a binary glTF has three vertices for each triangle, with the numbers of the triangle, as its accessors have them.
fn glb_holds(
    file: &[u8],
    positions: &[[f64; 3]],
    (triangles, numbers): (&[[usize; 3]], &[Vec<i32>]),
    has_names: bool,
) {
    let length = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((length(8), length(20 + length(12))), (file.len(), file.len() - 28 - length(12)));
    let json: Value = serde_json::from_slice(&file[20..20 + length(12)]).unwrap();
    let data = &file[28 + length(12)..];
    let mesh = &json["meshes"][0];
    assert_eq!(mesh["extras"].to_string().contains("Perimeter"), has_names);
    let primitive = &mesh["primitives"][0];
    assert!(primitive["indices"].is_null());
    let floats = |name: &str| -> Vec<f32> {
        let accessor = &json["accessors"][primitive["attributes"][name].as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [at, bytes] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap_or(0) as usize);
        assert_eq!(accessor["count"].as_u64().unwrap() as usize, 3 * triangles.len());
        data[at..at + bytes].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    };
    let corners = triangles.iter().flatten().flat_map(|&corner| positions[corner].map(|c| c as f32));
    assert!(floats("POSITION") == corners.collect::<Vec<f32>>());
    for (n, name) in ["_BEAD", "_LAYER", "_FEATURE"].into_iter().enumerate() {
        let column = numbers.iter().flat_map(|row| [row[n] as f32; 3]);
        assert!(floats(name) == column.collect::<Vec<f32>>(), "{name}");
    }
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
    let vtp = dir.path("m.vtp");
    run(&[&"mesh", &part, &"-o", &vtp, &"--attributes", &named, &"-q"]).ok();
    let file = std::fs::read(&vtp).unwrap();
    for (n, name) in named.split(',').enumerate() {
        let column: Vec<u8> = numbers.iter().flat_map(|row| row[n].to_le_bytes()).collect();
        assert_eq!(vtp_array(&file, name), column, "{name}");
    }
    let glb = dir.path("m.glb");
    run(&[&"mesh", &part, &"-o", &glb, &"--attributes", &named, &"-q"]).ok();
    let is_named = header.contains("Perimeter");
    glb_holds(&std::fs::read(&glb).unwrap(), &plain, (&triangles, &numbers), is_named);
    let refused = run(&[&"mesh", &other, &"-o", &mesh, &"--attributes", &"bead"]).failed();
    assert!(refused.contains("--identity"), "{refused}");
    assert!(
        run(&[&"mesh", &part, &"-o", &dir.path("m.stl"), &"--attributes", &"bead"])
            .misused()
            .contains(".ply")
    );
}

/// Corners of a binary STL.
fn read_stl(path: &Path) -> Vec<[f64; 3]> {
    let bytes = std::fs::read(path).unwrap();
    let number = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    let facets = bytes[84..].chunks_exact(50);
    facets.flat_map(|f| f[12..48].chunks_exact(12)).map(|p| [0, 4, 8].map(|a| number(&p[a..a + 4]))).collect()
}

#[test]
fn coordinates_of_32_bits_count_from_an_origin_near_the_part() {
    let dir = Scratch::new();
    let (part, stl, beside) = (dir.path("far.brf"), dir.path("f.stl"), dir.path("f.stl.origin.json"));
    let far = dir.file("far.obj", box_at(FAR));
    let built = dir.path("b.stl");
    let told = run(&[
        &"build",
        &far,
        &"-o",
        &part,
        &"--depth",
        &"1",
        &"--unit",
        &"m",
        &"--mesh",
        &built,
        &"--origin",
        &"auto",
        &"--json",
    ])
    .json();
    assert_eq!(told["mesh"]["origin"], serde_json::json!([4_500_004.0, 5_350_002.0, 513.0]));
    let told = run(&[&"mesh", &part, &"-o", &stl, &"--origin", &"auto", &"--json", &"--check"]).json();
    assert_eq!(std::fs::read(&built).unwrap(), std::fs::read(&stl).unwrap());
    let said: Value = serde_json::from_str(&std::fs::read_to_string(&beside).unwrap()).unwrap();
    assert_eq!(said["origin"], told["origin"]);
    assert_eq!((&said["file"], &said["unit"]), (&Value::from("f.stl"), &Value::from("m")));
    assert_eq!(told["coordinate_bits"], 32);
    let origin = [0, 1, 2].map(|a| said["origin"][a].as_f64().unwrap());
    // The corners of the box, as exactly as 32 bits say near the origin; of the mesh they are within a cell.
    let ends = |end: fn(f64, f64) -> f64, start: f64| {
        let corners = read_stl(&stl);
        [0, 1, 2].map(|a| origin[a] + corners.iter().map(|p| p[a]).fold(start, end))
    };
    let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
    for a in 0..3 {
        assert!((low[a] - FAR[a]).abs() < 1e-5, "{low:?}");
        assert!((high[a] - FAR[a] - [8.0, 4.0, 2.0][a]).abs() < 1e-5, "{high:?}");
        assert!((told["bounds"][0][a].as_f64().unwrap() - low[a]).abs() < 1e-9);
    }
    let text = run(&[&"mesh", &part, &"-o", &stl, &"--origin", &"4500000,5350000,0"]).ok();
    assert!(text.contains("origin   4500000,5350000,0 m, to be added"), "{text}");
    // Where nothing is to be shifted the file of before would mislead.
    let near = dir.path("near.brf");
    run(&[&"build", &dir.file("near.obj", box_at([0.0; 3])), &"-o", &near, &"--depth", &"1", &"-q"]).ok();
    let warned = run(&[&"mesh", &near, &"-o", &stl, &"--origin", &"auto", &"-q"]);
    assert!(warned.status == Some(0) && warned.stderr.contains("of an earlier mesh"), "{}", warned.stderr);
    // Formats of 64 bits stay where they are.
    let told = run(&[&"mesh", &part, &"-o", &dir.path("f.ply"), &"--origin", &"auto", &"--json"]).json();
    assert_eq!((&told["origin"], &told["coordinate_bits"]), (&Value::Null, &Value::from(64)));
    run(&[&"build", &far, &"-o", &part, &"--depth", &"1", &"--mesh", &dir.path("b.ply"), &"-q"]).ok();
    assert_eq!(std::fs::read(dir.path("b.ply")).unwrap(), std::fs::read(dir.path("f.ply")).unwrap());
    let wrong = run(&[&"mesh", &part, &"-o", &stl, &"--origin", &"near"]).misused();
    assert!(wrong.contains("neither auto nor three numbers"), "{wrong}");
    let too_far = run(&[&"mesh", &part, &"-o", &stl, &"--origin", &"0,0,0"]).failed();
    assert!(too_far.contains("--origin auto"), "{too_far}");
    let splats = run(&[&"splats", &part, &"-o", &dir.path("s.ply")]).failed();
    assert!(splats.contains("32 bits round") && splats.contains("write .bsp"), "{splats}");
}

#[test]
fn numbers_of_vertices_and_coarse_meshes_keep_far_places() {
    let dir = Scratch::new();
    let (near, far) = (dir.path("near.brf"), dir.path("far.brf"));
    let (near_box, far_box) = (dir.file("near.obj", box_at([0.0; 3])), dir.file("far.obj", box_at(FAR)));
    run(&[&"build", &near_box, &"-o", &near, &"--depth", &"1", &"-q"]).ok();
    run(&[&"build", &far_box, &"-o", &far, &"--depth", &"1", &"-q"]).ok();
    // Formats of 64 bits have the world's places, and the same numbers as nearer to the origin.
    let told = |name: &str, part: &Path, reference: &Path, mesh: &Path| match name {
        "thickness" => run(&[&name, &part, &"-o", &mesh, &"--json"]).json(),
        _ => run(&[&name, &part, &reference, &"-o", &mesh, &"--json"]).json(),
    };
    for (name, least) in [("thickness", "min"), ("deviation", "max_abs")] {
        let mesh = dir.path(&format!("{name}.vtp"));
        let of_near = told(name, &near, &near_box, &dir.path("near.vtp"));
        let of_far = told(name, &far, &far_box, &mesh);
        assert_eq!((&of_near["coordinate_bits"], &of_far["coordinate_bits"]), (&32.into(), &64.into()));
        assert_eq!(of_near["vertices"], of_far["vertices"]);
        let number = |told: &Value| {
            let told = if name == "thickness" { told } else { &told["part_to_reference"] };
            told[least].as_f64().unwrap()
        };
        assert!((number(&of_near) - number(&of_far)).abs() < 1e-4, "{of_near} {of_far}");
        let bytes = std::fs::read(&mesh).unwrap();
        let low = f64::from_le_bytes(vtp_array(&bytes, "Points")[..8].try_into().unwrap());
        assert!((low - FAR[0]).abs() < 8.01, "{low}");
    }
    // Others are refused, or count from an origin that is told.
    let glb = dir.path("d.glb");
    let refused = run(&[&"deviation", &far, &far_box, &"-o", &glb]).failed();
    assert!(refused.contains("write .ply or .vtp, which have 64, or give --origin auto"), "{refused}");
    let told = run(&[&"deviation", &far, &far_box, &"-o", &glb, &"--origin", &"auto", &"--json"]).json();
    let beside = std::fs::read_to_string(dir.path("d.glb.origin.json")).unwrap();
    let said: Value = serde_json::from_str(&beside).unwrap();
    assert!(told["origin"] == said["origin"] && told["coordinate_bits"] == 32 && said["origin"].is_array());
    let shown = run(&[&"thickness", &far, &"-o", &dir.path("t.glb"), &"--origin", &"4500000,5350000,0"]).ok();
    assert!(shown.contains("origin 4500000,5350000,0 mm, to be added"), "{shown}");
    // Coarse meshes are those of the part where it is near.
    let (stl, ply) = (dir.path("c.stl"), dir.path("c.ply"));
    run(&[&"mesh", &far, &"-o", &stl, &"--detail", &"0.6", &"-q"]).failed();
    let shifted =
        run(&[&"mesh", &far, &"-o", &stl, &"--detail", &"0.6", &"--origin", &"auto", &"--json"]).json();
    let double = run(&[&"mesh", &far, &"-o", &ply, &"--detail", &"0.6", &"--json"]).json();
    assert!(shifted["origin"].is_array() && dir.path("c.stl.origin.json").exists());
    assert_eq!((&double["origin"], &double["coordinate_bits"]), (&Value::Null, &64.into()));
    for told in [&shifted, &double] {
        assert!((told["volume"].as_f64().unwrap() / 64.0 - 1.0).abs() < 1e-3, "{told}");
        assert!((told["bounds"][0][0].as_f64().unwrap() - FAR[0]).abs() < 0.6, "{told}");
        let distances = &told["detail"]["distances"][0];
        assert!(distances["largest"].as_f64().unwrap() < 1.0, "{distances}");
    }
}

/// An array of a `.vtp`, by the words of its XML.
fn vtp_array<'a>(file: &'a [u8], name: &str) -> &'a [u8] {
    let mark = b"encoding=\"raw\">\n_";
    let data = file.windows(mark.len()).position(|word| word == mark).unwrap() + mark.len();
    let xml = std::str::from_utf8(&file[..data]).unwrap();
    let line = xml.lines().find(|line| line.contains(&format!("Name=\"{name}\""))).unwrap();
    let offset = line.split("offset=\"").nth(1).unwrap().split('"').next().unwrap();
    let at = data + offset.parse::<usize>().unwrap();
    let length = u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    &file[at + 8..at + 8 + length]
}

/// Files of VTK and of glTF hold what those of PLY do.
#[test]
fn thickness_and_deviation_are_written_in_each_format() {
    let dir = Scratch::new();
    let (input, part) = (dir.file("b.obj", box_at([0.0; 3])), dir.path("p.brf"));
    run(&[&"build", &input, &"-o", &part, &"--depth", &"1", &"-q"]).ok();
    for name in ["thickness", "deviation"] {
        let write = |ending: &str| {
            let path = dir.path(&format!("{name}.{ending}"));
            match name {
                "thickness" => run(&[&name, &part, &"-o", &path, &"-q"]).ok(),
                _ => run(&[&name, &part, &input, &"-o", &path, &"-q"]).ok(),
            };
            std::fs::read(path).unwrap()
        };
        let (ply, vtp) = (write("ply"), write("vtp"));
        let end = ply.windows(11).position(|word| word == b"end_header\n").unwrap() + 11;
        let bytes = 12;
        let points = vtp_array(&vtp, "Points");
        let count = points.len() / bytes;
        assert!(count > 100);
        let rows = ply[end..].chunks_exact(bytes + 4).take(count);
        assert!(rows.clone().zip(points.chunks_exact(bytes)).all(|(row, point)| row[..bytes] == *point));
        let numbers: Vec<u8> = rows.flat_map(|row| row[bytes..].to_vec()).collect();
        assert_eq!(vtp_array(&vtp, name), numbers);
        let faces: Vec<u8> = ply[end + count * (bytes + 4)..]
            .chunks_exact(13)
            .flat_map(|face| {
                face[1..].chunks_exact(4).flat_map(|id| [id, &[0; 4]].concat()).collect::<Vec<u8>>()
            })
            .collect();
        assert_eq!(vtp_array(&vtp, "connectivity"), faces);
        let glb = write("glb");
        let json = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let scene: Value = serde_json::from_slice(&glb[20..20 + json]).unwrap();
        let attribute = format!("_{}", name.to_uppercase());
        let accessor = scene["meshes"][0]["primitives"][0]["attributes"][&attribute].as_u64().unwrap();
        let view = scene["accessors"][accessor as usize]["bufferView"].as_u64().unwrap();
        let view = &scene["bufferViews"][view as usize];
        let at = 28 + json + view["byteOffset"].as_u64().unwrap() as usize;
        let found = &glb[at..at + view["byteLength"].as_u64().unwrap() as usize];
        let number = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
        for (a, b) in found.chunks_exact(4).zip(numbers.chunks_exact(4)) {
            let (a, b) = (number(a), number(b));
            assert!(a == b || a == -1.0 && b.is_nan(), "{a} {b}");
        }
        assert_eq!(found.len(), numbers.len());
    }
    assert!(run(&[&"thickness", &part, &"-o", &dir.path("t.stl")]).misused().contains(".vtp"));
}
