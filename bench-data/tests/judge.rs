//! The judge finds what was planted, in memory and through every file format.

use brickfield_bench_data::judge::mesh::{MeshFindings, check, check_file, check_soup};
use brickfield_bench_data::judge::read::{self, FileMesh};
use brickfield_bench_data::judge::winding::solid_angle_sum;
use brickfield_bench_data::pile::bead_pile;
use brickfield_bench_data::shapes::{cuboid, icosphere, tetrahedron, torus};
use brickfield_bench_data::{Mesh, write};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn judged(mesh: &Mesh) -> MeshFindings {
    check(&mesh.vertices, &mesh.triangles)
}

fn corner_tetrahedron(sign: f64) -> Mesh {
    tetrahedron([[0.0; 3], [sign, 0.0, 0.0], [0.0, sign, 0.0], [0.0, 0.0, sign]])
}

/// Two pieces as one, equal positions welded.
fn welded(pieces: &[Mesh]) -> MeshFindings {
    check_soup(&Mesh::merged(pieces).soup())
}

proptest! {
    #[test]
    fn one_bad_facet_is_found_anywhere(index in 0usize..320) {
        let sphere = icosphere(2, 1.0);
        prop_assert!(judged(&sphere).is_closed_manifold());

        let mut missing = sphere.clone();
        missing.triangles.swap_remove(index);
        let report = judged(&missing);
        prop_assert_eq!((report.open_edges, report.misoriented_edges, report.split_vertices), (3, 0, 0));
        prop_assert_eq!(report.genus(), None);

        let mut flipped = sphere.clone();
        flipped.triangles[index].swap(0, 2);
        let report = judged(&flipped);
        prop_assert_eq!((report.open_edges, report.misoriented_edges, report.crowded_edges), (0, 3, 0));
        prop_assert!(report.is_closed() && !report.is_balanced());

        let mut doubled = sphere.clone();
        let [a, b, c] = doubled.triangles[index];
        doubled.triangles.push([b, c, a]);
        let report = judged(&doubled);
        prop_assert_eq!((report.open_edges, report.crowded_edges, report.duplicate_triangles), (3, 3, 1));
        prop_assert!(!report.is_closed() && !report.is_edge_manifold() && !report.is_clean());
        doubled.triangles.push([c, b, a]);
        prop_assert_eq!(judged(&doubled).duplicate_triangles, 2);

        let mut broken = sphere;
        broken.triangles.push([a, a, b]);
        broken.triangles.push([a, b, 9999]);
        let report = judged(&broken);
        prop_assert_eq!(report.repeated_index_triangles, 2);
        prop_assert!(report.is_balanced() && !report.is_closed_manifold());
    }
}

#[test]
fn tetrahedra_that_share_an_edge_or_a_vertex() {
    let edge = welded(&[
        corner_tetrahedron(1.0),
        tetrahedron([[0.0; 3], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    ]);
    assert_eq!((edge.vertices, edge.edges, edge.crowded_edges), (6, 11, 1));
    assert!(edge.is_balanced() && !edge.is_edge_manifold());

    let vertex = welded(&[corner_tetrahedron(1.0), corner_tetrahedron(-1.0)]);
    assert_eq!((vertex.vertices, vertex.split_vertices, vertex.components), (7, 1, 2));
    assert!(vertex.is_balanced() && vertex.is_edge_manifold() && !vertex.is_vertex_manifold());
    assert_eq!(vertex.genus(), None);

    let apart = welded(&[corner_tetrahedron(1.0), corner_tetrahedron(1.0).translated([2.0; 3])]);
    assert!(apart.is_closed_manifold());
    assert_eq!((apart.components, apart.euler_characteristic, apart.genus()), (2, 4, Some(0)));
}

#[test]
fn a_pinched_fan_on_an_open_surface_is_found() {
    // Two triangles that meet in one point only.
    let bow = Mesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 3, 4]],
    };
    let report = judged(&bow);
    assert_eq!((report.split_vertices, report.open_edges, report.components), (1, 6, 2));
    let strip = Mesh { triangles: vec![[0, 1, 2], [0, 2, 3]], ..bow.clone() };
    let report = judged(&strip);
    assert_eq!(
        (report.split_vertices, report.open_edges, report.components, report.unused_vertices),
        (0, 4, 1, 1)
    );
    assert!(judged(&Mesh::default()).is_closed_manifold());
}

#[test]
fn numbers_of_a_torus() {
    let report = judged(&torus(3.0, 1.0, 10, 6));
    assert_eq!((report.vertices, report.edges, report.triangles), (60, 180, 120));
    assert_eq!((report.euler_characteristic, report.genus()), (0, Some(1)));
    assert_eq!(report.max[0], 4.0);
}

#[test]
fn flat_and_infinite_triangles_are_counted() {
    let mesh = Mesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 1, 3]],
    };
    let report = judged(&mesh);
    assert_eq!((report.zero_area_triangles, report.non_finite_vertices), (1, 1));
    assert!(!report.is_clean());
}

#[test]
fn every_format_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(3.0, 1.0, 24, 9).rotated([1.0, 2.0, 3.0], 0.4);
    let stored = |name: &str, bytes: Vec<u8>| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let mut bytes = [const { Vec::new() }; 3];
    write::stl(&mut bytes[0], &mesh).unwrap();
    write::ply_binary(&mut bytes[1], &mesh).unwrap();
    write::obj(&mut bytes[2], &mesh).unwrap();
    let [stl, ply, obj] = bytes;
    let rounded = mesh.clone().mapped(|v| v.map(|c| f64::from(c as f32)));

    let path = stored("a.stl", stl.clone());
    assert_eq!(read::read(&path).unwrap(), FileMesh::Soup(mesh.soup()));
    assert_eq!(check_file(&path).unwrap(), check_soup(&mesh.soup()));
    let path = stored("a.ply", ply.clone());
    assert_eq!(read::read(&path).unwrap(), FileMesh::Indexed(rounded.vertices, mesh.triangles.clone()));
    let path = stored("a.obj", obj);
    assert_eq!(read::read(&path).unwrap(), FileMesh::Indexed(mesh.vertices.clone(), mesh.triangles.clone()));
    assert_eq!(check_file(&path).unwrap().genus(), Some(1));

    assert!(check_file(&stored("b.stl", stl[..stl.len() - 1].to_vec())).is_err());
    assert!(check_file(&stored("b.ply", ply[..ply.len() - 1].to_vec())).is_err());
    assert!(check_file(&stored("b.obj", b"v 1 2\n".to_vec())).is_err());
    assert!(check_file(&stored("c.obj", b"v 0 0 0\nf 1 2 3\n".to_vec())).is_err());
    assert!(check_file(&stored("a.txt", Vec::new())).is_err());
}

#[test]
fn faces_of_obj_files_come_in_several_spellings() {
    let text = b"# cube side\nv 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\nf -4 -2/1/1 -1\n";
    let (vertices, triangles) = read::obj(text).unwrap();
    assert_eq!(vertices.len(), 4);
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [0, 2, 3]]);
}

#[test]
fn text_formats_hold_every_digit() {
    let mesh = icosphere(1, 1.0 / 3.0);
    let mut text = Vec::new();
    write::stl_ascii(&mut text, "a part", &mesh).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.starts_with("solid a part\n") && text.ends_with("endsolid a part\n"));
    let numbers: Vec<f32> = text
        .lines()
        .filter_map(|l| l.trim().strip_prefix("vertex "))
        .flat_map(|l| l.split(' '))
        .map(|w| w.parse().unwrap())
        .collect();
    let wanted: Vec<f32> = mesh.soup().into_iter().flatten().flatten().collect();
    assert_eq!(numbers, wanted);

    let mut text = Vec::new();
    write::ply_ascii(&mut text, &mesh).unwrap();
    let text = String::from_utf8(text).unwrap();
    let body: Vec<&str> = text.lines().skip_while(|l| *l != "end_header").skip(1).collect();
    assert_eq!(body.len(), mesh.vertices.len() + mesh.triangles.len());
    let first: Vec<f64> = body[0].split(' ').map(|w| w.parse().unwrap()).collect();
    assert_eq!(first, mesh.vertices[0]);
}

#[test]
fn the_stl_writer_keeps_its_count() {
    let facet = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut writer = write::StlWriter::new(Vec::new(), 1).unwrap();
    writer.facet(&facet).unwrap();
    assert!(writer.facet(&facet).is_err());
    assert_eq!(writer.finish().unwrap().len(), 134);
    assert!(write::StlWriter::new(Vec::new(), 1).unwrap().finish().is_err());
    assert!(write::StlWriter::new(Vec::new(), 1 << 32).is_err());
}

fn part(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("stl").join(name)
}

#[test]
fn the_parts_are_what_their_truth_says() {
    let volume = |name: &str| {
        let report = check_file(&part(name)).unwrap();
        assert!(report.is_balanced(), "{name}: {report}");
        report.signed_volume
    };
    for (name, wanted) in [
        ("thinwall_ladder.stl", 4080.0),
        ("void_ladder.stl", 23568.437084962865),
        ("overlap_boxes.stl", 2000.0),
        ("box_with_cavity.stl", 936.0),
        ("inverted_box.stl", -1000.0),
        ("duplicate_box.stl", 2000.0),
        ("touching_layers.stl", 400.0),
    ] {
        let volume = volume(name);
        assert!((volume / wanted - 1.0).abs() < 1e-5, "{name}: {volume} is not {wanted}");
    }
    for name in ["clover_beads.stl", "clover_model.stl", "spot40_model.stl", "featuretype50_model.stl"] {
        assert!(volume(name) > 0.0);
    }
    assert!((volume("clover_beads.stl") / 77084.28 - 1.0).abs() < 1e-3);
    assert_eq!(check_file(&part("duplicate_box.stl")).unwrap().duplicate_triangles, 12);
    assert_eq!(check_file(&part("open_box_no_lid.stl")).unwrap().open_edges, 4);
    assert!(check_file(&part("truncated.stl")).is_err());
    let mixed = check_file(&part("degenerate_mix.stl")).unwrap();
    assert_eq!((mixed.triangles, mixed.non_finite_vertices), (17, 2));
}

#[test]
fn winding_numbers_of_the_parts() {
    let at = |name: &str, p| {
        let FileMesh::Soup(facets) = read::read(&part(name)).unwrap() else { panic!("{name} is no soup") };
        let facets: Vec<_> = facets.iter().map(|f| f.map(|v| v.map(f64::from))).collect();
        solid_angle_sum(&facets, p)
    };
    for (name, p, w) in [
        ("overlap_boxes.stl", [8.0, 5.0, 5.0], 2.0),
        ("overlap_boxes.stl", [3.0, 5.0, 5.0], 1.0),
        ("inverted_box.stl", [5.0; 3], -1.0),
        ("box_with_cavity.stl", [5.0; 3], 0.0),
        ("box_with_cavity.stl", [1.0; 3], 1.0),
        ("duplicate_box.stl", [5.0; 3], 2.0),
        ("open_box_no_lid.stl", [5.0; 3], 5.0 / 6.0),
        ("touching_layers.stl", [5.0, 5.0, 1.999], 1.0),
        ("touching_layers.stl", [5.0, 5.0, 2.001], 1.0),
    ] {
        let sum = at(name, p);
        assert!((sum - w).abs() < 1e-6, "{name} {p:?}: {sum} is not {w}");
    }
}

fn hash(pieces: impl ExactSizeIterator<Item = Mesh>, facets_each: u64) -> u64 {
    let mut writer =
        write::StlWriter::new(write::HashingWriter::new(std::io::sink()), pieces.len() as u64 * facets_each)
            .unwrap();
    for piece in pieces {
        writer.mesh(&piece).unwrap();
    }
    writer.finish().unwrap().hash()
}

/// Benchmarks are compared across years and machines: the files must not change.
#[test]
fn generated_bytes_stay_what_they_were() {
    let box_hash = hash([cuboid([0.0; 3], [10.0; 3])].into_iter(), 12);
    let pile_hash = hash(bead_pile(1, 10_000, [100.0, 100.0, 12.0]), 500);
    assert_eq!(format!("{box_hash:016x} {pile_hash:016x}"), "1b867d19890fcb0a b0d17d3a856e1f6d");
}
