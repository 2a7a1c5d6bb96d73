//! `brickfield mesh` and `build --mesh`, judged by code that shares none with the engine.

use crate::support::*;
use brickfield_bench_data::judge::mesh::{MeshFindings, check_file};
use brickfield_core::sweep::part_or_all;
use std::ffi::OsStr;
use std::path::Path;

/// Closed, oriented, manifold, and of the volume expected.
#[track_caller]
fn judged(path: &Path, volume: f64, tolerance: f64) -> MeshFindings {
    let report = check_file(path).unwrap();
    let name = path.display();
    assert!(report.is_balanced(), "{name}: {report:?}");
    assert!(report.is_edge_manifold() && report.is_vertex_manifold(), "{name}: {report:?}");
    let deviation = report.signed_volume / volume - 1.0;
    assert!(deviation.abs() < tolerance, "{name}: {} is not {volume}", report.signed_volume);
    report
}

#[test]
fn the_boundary_has_the_known_volume_in_every_format() {
    let dir = Scratch::new();
    for (name, field, depth, ending) in [
        ("overlap_boxes", "union_volume", "3", "stl"),
        ("overlap_boxes", "union_volume", "3", "ply"),
        ("overlap_boxes", "union_volume", "3", "obj"),
        ("box_with_cavity", "volume", "3", "ply"),
        ("duplicate_box", "union_volume", "2", "ply"),
        ("touching_layers", "union_volume", "3", "ply"),
        ("ascii_two_solids", "volume", "3", "ply"),
        ("thinwall_ladder", "volume", part_or_all("3", "4"), "ply"),
        ("void_ladder", "volume", part_or_all("3", "4"), "obj"),
    ] {
        let mesh = dir.path(&format!("{name}.{ending}"));
        let store = dir.path(&format!("{name}.brf"));
        let json =
            run(&[&"build", &stl(name), &"-o", &store, &"--depth", &depth, &"--mesh", &mesh, &"--json"])
                .json();
        let expected = truth(name, field);
        judged(&mesh, expected, 0.01);
        let reported = json["mesh"]["volume"].as_f64().unwrap();
        assert!((reported / expected - 1.0).abs() < 0.01, "{name}: {reported}");
        // The same by the other command.
        let again = dir.path(&format!("again.{ending}"));
        run(&[&"mesh", &store, &"-o", &again]).ok();
        assert!(std::fs::read(&again).unwrap() == std::fs::read(&mesh).unwrap(), "{name}");
    }
    assert!(dir.names().iter().all(|name| !name.ends_with(".part")));
}

#[test]
fn a_glb_holds_the_mesh_of_the_ply_in_metres_and_a_3mf_names_the_unit() {
    let dir = Scratch::new();
    let (store, ply, glb) = (dir.path("a.brf"), dir.path("a.ply"), dir.path("a.glb"));
    let part = stl("overlap_boxes");
    run(&[&"build", &part, &"-o", &store, &"--depth", &"2", &"--units", &"in", &"--mesh", &glb]).ok();
    run(&[&"mesh", &store, &"-o", &ply]).ok();
    let read = |path: &Path| std::fs::read(path).unwrap();
    let (ply, first) = (read(&ply), read(&glb));
    let again = dir.path("again.glb");
    run(&[&"mesh", &store, &"-o", &again]).ok();
    assert!(read(&again) == first);
    let number = |at: usize| u32::from_le_bytes(first[at..at + 4].try_into().unwrap()) as usize;
    let data = &first[20 + number(12) + 8..];
    let json: serde_json::Value = serde_json::from_slice(&first[20..20 + number(12)]).unwrap();
    assert_eq!(json["nodes"][0]["matrix"][0], 0.0254);
    let end = b"end_header\n";
    let ply = &ply[ply.windows(end.len()).position(|w| w == end).unwrap() + end.len()..];
    let positions = 12 * json["accessors"][0]["count"].as_u64().unwrap() as usize;
    assert!(data[..positions] == ply[..positions] && positions > 1000);
    let ids: Vec<u8> = ply[positions..].chunks_exact(13).flat_map(|face| face[1..].to_vec()).collect();
    assert!(data[positions..] == ids);
    for name in ["a.3mf", "b.3mf"] {
        run(&[
            &"mesh",
            &store,
            &"-o",
            &dir.path(name),
            &"--threads",
            &if name == "a.3mf" { "1" } else { "3" },
        ])
        .ok();
    }
    let archive = read(&dir.path("a.3mf"));
    assert!(archive == read(&dir.path("b.3mf")) && archive.starts_with(b"PK\x03\x04"));
    // All that is written can be read again, and so be checked.
    for name in ["c.glb", "c.3mf", "c.obj"] {
        run(&[&"mesh", &store, &"-o", &dir.path(name), &"--check", &"--quiet"]).ok();
    }
}

#[test]
fn iso_and_level() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 3);
    let overlap = dir.path("overlap.ply");
    run(&[&"mesh", &store, &"-o", &overlap, &"--iso", &"1.5", &"--memory", &"8MiB"]).ok();
    judged(&overlap, truth("overlap_boxes", "overlap_volume"), 0.05);
    let [fine, coarse] = ["3", "1"].map(|level| {
        let out = dir.path(&format!("{level}.stl"));
        run(&[&"mesh", &store, &"-o", &out, &"--level", &level]).ok();
        judged(&out, truth("overlap_boxes", "union_volume"), 0.05);
        facets_of(&out).len()
    });
    assert!(fine > 10 * coarse, "{fine} {coarse}");
    for name in ["empty.obj", "empty.stl", "empty.ply"] {
        let empty = dir.path(name);
        let text = run(&[&"mesh", &store, &"-o", &empty, &"--iso", &"2.5"]).ok();
        assert!(text.contains("empty"), "{text}");
        let text = run(&[&"mesh", &"--check", &empty, &"--quiet"]).failed();
        assert!(text.contains(name) && text.contains("no triangles"), "{text}");
    }
}

#[test]
fn a_tolerance_makes_fewer_triangles() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 3);
    let meshed = |name: &str, tolerance: Option<&str>| {
        let out = dir.path(name);
        let mut words: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"mesh", &store, &"-o", &out];
        if let Some(tolerance) = &tolerance {
            words.extend([&"--tolerance" as &dyn AsRef<std::ffi::OsStr>, tolerance]);
        }
        run(&words).ok();
        out
    };
    let plain = std::fs::read(meshed("plain.ply", None)).unwrap();
    for (name, tolerance) in [("zero.ply", "0"), ("zero_um.ply", "0um")] {
        assert!(std::fs::read(meshed(name, Some(tolerance))).unwrap() == plain);
    }
    // A hundredth of the lattice's cell, in two units and two formats.
    let merged = meshed("merged.ply", Some("3um"));
    judged(&merged, truth("overlap_boxes", "union_volume"), 0.001);
    assert!(std::fs::read(&merged).unwrap().len() * 20 < plain.len());
    assert!(std::fs::read(meshed("mm.ply", Some("0.003 mm"))).unwrap() == std::fs::read(&merged).unwrap());
    let stl = meshed("merged.stl", Some("3um"));
    assert!(facets_of(&stl).len() * 20 < facets_of(&meshed("plain.stl", None)).len());
    judged(&stl, truth("overlap_boxes", "union_volume"), 0.001);
    // Beads, which touch each other in long creases.
    let beads = dir.path("beads.brf");
    let toolpath = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/clover.gcode");
    run(&[&"build", &toolpath, &"-o", &beads, &"--depth", &"2"]).ok_but_for("% empty");
    let [plain, merged] = ["0", "50um"].map(|tolerance| {
        let out = dir.path(&format!("beads{tolerance}.ply"));
        run(&[&"mesh", &beads, &"-o", &out, &"--tolerance", &tolerance]).ok();
        check_file(&out).unwrap()
    });
    assert!(merged.is_closed_manifold() && merged.is_oriented(), "{merged}");
    assert_eq!(merged.euler_characteristic, plain.euler_characteristic);
    assert_eq!(merged.components, plain.components);
    assert!(merged.triangles < plain.triangles, "{} of {}", merged.triangles, plain.triangles);
    let out = dir.path("no.ply");
    for wrong in ["-1mm", "3 furlongs", "NaN", ""] {
        run(&[&"mesh", &store, &"-o", &out, &format!("--tolerance={wrong}")]).misused();
    }
    assert!(run(&[&"mesh", &"--check", &stl, &"--tolerance", &"1um"]).misused().contains("--output"));
    assert!(!out.exists());
}

/// Numbers of the vertices of a PLY, so many each, and the bytes of its faces.
fn vertices_of_ply(bytes: &[u8], each: usize) -> (Vec<Vec<f32>>, &[u8]) {
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..at]).unwrap();
    let count = header.split("element vertex ").nth(1).unwrap().split('\n').next().unwrap();
    let (vertices, faces) = bytes[at..].split_at(4 * each * count.parse::<usize>().unwrap());
    let numbers = vertices.as_chunks::<4>().0.iter().map(|number| f32::from_le_bytes(*number));
    (numbers.collect::<Vec<f32>>().chunks(each).map(<[f32]>::to_vec).collect(), faces)
}

#[test]
fn formats_that_have_normals_get_the_same() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let written = |name: &str, more: &[&str]| {
        let out = dir.path(name);
        let mut words: Vec<&dyn AsRef<OsStr>> = vec![&"mesh", &store, &"-o", &out];
        words.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
        run(&words).ok();
        std::fs::read(out).unwrap()
    };
    let (plain, ply) = (written("plain.ply", &[]), written("a.ply", &["--normals", "--check"]));
    judged(&dir.path("a.ply"), truth("overlap_boxes", "union_volume"), 0.01);
    let ((plain, plain_faces), (vertices, faces)) = (vertices_of_ply(&plain, 3), vertices_of_ply(&ply, 6));
    assert!(vertices.iter().map(|v| &v[..3]).eq(plain.iter().map(|v| &v[..])) && faces == plain_faces);
    // Sides lie along the axes: most normals do, those at edges lie between.
    let along_axis = |v: &&Vec<f32>| v[3..].iter().filter(|c| c.abs() == 1.0).count() == 1;
    assert!(vertices.iter().filter(along_axis).count() * 10 > vertices.len() * 8);
    for vertex in &vertices {
        let length = vertex[3..].iter().map(|c| c * c).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-3, "{vertex:?}");
    }

    let obj = String::from_utf8(written("a.obj", &["--normals", "--check"])).unwrap();
    judged(&dir.path("a.obj"), truth("overlap_boxes", "union_volume"), 0.01);
    let of = |name: &str| -> Vec<Vec<f32>> {
        let lines = obj.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        lines.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect()
    };
    let joined: Vec<Vec<f32>> = of("v").into_iter().zip(of("vn")).map(|(v, n)| [v, n].concat()).collect();
    assert!(joined == vertices);
    for corner in obj.lines().filter_map(|line| line.strip_prefix("f ")).flat_map(|line| line.split(' ')) {
        let (vertex, normal) = corner.split_once("//").unwrap();
        assert_eq!(vertex, normal);
    }

    let glb = written("a.glb", &["--normals"]);
    let json_bytes = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&glb[20..20 + json_bytes]).unwrap();
    let data = &glb[20 + json_bytes + 8..];
    let attributes = &json["meshes"][0]["primitives"][0]["attributes"];
    for (attribute, first) in [("POSITION", 0), ("NORMAL", 3)] {
        let accessor = &json["accessors"][attributes[attribute].as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let (stride, start) = (view["byteStride"].as_u64().unwrap(), accessor["byteOffset"].as_u64());
        assert_eq!(accessor["count"], vertices.len());
        for (n, vertex) in vertices.iter().enumerate() {
            let at = n * stride as usize + start.unwrap_or(0) as usize;
            let numbers =
                data[at..at + 12].as_chunks::<4>().0.iter().map(|number| f32::from_le_bytes(*number));
            assert!(numbers.eq(vertex[first..first + 3].iter().copied()), "{attribute} {n}");
        }
    }
    assert!(!String::from_utf8_lossy(&written("plain.glb", &[])).contains("NORMAL"));

    for name in ["a.stl", "a.3mf"] {
        let refused = run(&[&"mesh", &store, &"-o", &dir.path(name), &"--normals"]).misused();
        assert!(refused.contains(name) && refused.contains(".ply, .obj, .glb"), "{refused}");
        assert!(refused.lines().next().is_some_and(|line| line.contains(".glb")), "{refused}");
        assert!(!dir.path(name).exists() && !dir.path(&format!("{name}.part")).exists());
    }
    assert!(run(&[&"mesh", &"--check", &dir.path("a.ply"), &"--normals"]).misused().contains("--output"));
    let out = dir.path("cubes.ply");
    let words: [&dyn AsRef<OsStr>; 7] =
        [&"mesh", &store, &"-o", &out, &"--follow-creases", &"--method", &"mc"];
    assert!(run(&words).misused().contains("--method") && !out.exists());
}

/// The faster way to a mesh of beads with a tolerance leaves pairs of triangles that meet, and nothing else is wrong with it.
#[test]
fn intersections_stay_only_if_that_is_asked_for() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 2);
    let checked = |answer: &str, status: i32| {
        let out = dir.path(&format!("{answer}.stl"));
        let words: [&dyn AsRef<OsStr>; 10] = [
            &"mesh",
            &store,
            &"-o",
            &out,
            &"--tolerance",
            &"0.05",
            &"--intersection-free",
            &answer,
            &"--check",
            &"--json",
        ];
        let told = run(&words);
        assert_eq!(told.status, Some(status), "{}", told.stderr);
        assert!(
            check_file(&out).unwrap().is_edge_manifold() && check_file(&out).unwrap().is_vertex_manifold()
        );
        let json: serde_json::Value = serde_json::from_str(&told.stdout).unwrap();
        (json["check"]["intersections"]["pairs"].as_u64().unwrap(), json["triangles"].as_u64().unwrap())
    };
    let (none, triangles) = checked("yes", 0);
    let (left, fewer) = checked("no", 1);
    assert!(none == 0 && left > 2 && fewer < triangles, "{none} {left} {fewer} {triangles}");
    let plain = dir.path("plain.stl");
    run(&[&"mesh", &store, &"-o", &plain, &"--intersection-free", &"no", &"--check"]).ok();
    assert!(
        run(&[&"mesh", &store, &"-o", &plain, &"--intersection-free", &"maybe"])
            .misused()
            .contains("yes, no")
    );
}

/// Of bricks of several sizes, merged vertices, marching cubes, coarser levels and other surfaces.
#[test]
fn normals_depend_on_neither_threads_nor_memory() {
    let dir = Scratch::new();
    let mixed = dir.path("mixed.brf");
    let deviating: [&dyn AsRef<OsStr>; 4] = [&"--refine", &"stddev", &"--stddev", &"0.2"];
    let mut words: Vec<&dyn AsRef<OsStr>> = vec![&"build"];
    let part = stl("clover_model");
    let depth = part_or_all("3", "4");
    words.extend([&part as &dyn AsRef<OsStr>, &"-o", &mixed, &"--depth", &depth, &"--quiet"]);
    words.extend(deviating);
    run(&words).ok();
    let beads = dir.store("clover_beads", part_or_all(2, 3));
    let level = part_or_all("1", "2");
    let all = [
        (&mixed, &[][..], "ply"),
        (&beads, &["--tolerance", "0.1"][..], "obj"),
        (&beads, &["--method", "mc", "--iso", "1.5"][..], "glb"),
        (&beads, &["--level", level][..], "ply"),
        (&beads, &["--follow-creases"][..], "ply"),
        (&mixed, &["--follow-creases", "--tolerance", "0.1"][..], "obj"),
    ];
    for (store, more, ending) in all.into_iter().skip(part_or_all(1, 0)).step_by(part_or_all(2, 1)) {
        let written = |threads: &str, memory: &str| {
            let out = dir.path("a").with_extension(ending);
            let mut words: Vec<&dyn AsRef<OsStr>> = vec![&"mesh", store, &"-o", &out, &"--normals"];
            words.extend([&"--threads" as &dyn AsRef<OsStr>, &threads, &"--memory", &memory]);
            words.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
            run(&words).ok();
            std::fs::read(out).unwrap()
        };
        let one = written("1", "1GiB");
        for &(threads, memory) in part_or_all(&[("3", "8MiB")][..], &[("2", "1GiB"), ("3", "8MiB")]) {
            assert!(written(threads, memory) == one, "{more:?}, {threads} threads, {memory}");
        }
    }
}
