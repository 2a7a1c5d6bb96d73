//! Slivers that are taken away.

use super::meetings::report;
use super::*;
use crate::contour::adaptive::{TriangleCorners, wide};
use crate::contour::quality::{ImprovedSink, improve};
use crate::contour::shells::smallest_angle;
use brickfield_io::check::CheckReport;
use glam::DVec3;

/// The mesh of a tree as arrays.
fn arrays(tree: &MemoryTree, tolerance: f64) -> MeshArrays {
    let mut mesh = MeshArrays::default();
    contour(tree, &ContourOptions { tolerance, ..ContourOptions::default() }, &mut mesh, &Silent).unwrap();
    mesh
}

fn checked(mesh: &MeshArrays) -> CheckReport {
    let mut kept = TestMesh::default();
    kept.vertices(&mesh.positions).unwrap();
    let facet = |ids: &[u32; 3]| MeshTriangle { ids: *ids, corners: corners(mesh, ids) };
    let facets: Vec<MeshTriangle> = mesh.triangles.iter().map(facet).collect();
    MeshSink::triangles(&mut kept, &facets).unwrap();
    kept.finish().unwrap();
    kept.check();
    report(&kept)
}

fn corners(mesh: &MeshArrays, ids: &[u32; 3]) -> TriangleCorners {
    ids.map(|id| mesh.positions[id as usize])
}

fn below(mesh: &MeshArrays, least: f64) -> usize {
    mesh.triangles.iter().filter(|ids| smallest_angle(&corners(mesh, ids)) < least).count()
}

/// The distance of a point from a triangle, by the nearest point of a fine grid on it: a judge that shares nothing.
fn to_triangle(p: DVec3, triangle: &TriangleCorners) -> f64 {
    let [a, b, c] = triangle.map(wide);
    let grid = (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (f64::from(i) / 8.0, f64::from(j) / 8.0)));
    grid.map(|(u, v)| p.distance(a + (b - a) * u + (c - a) * v)).fold(f64::INFINITY, f64::min)
}

#[test]
fn slivers_vanish_and_all_else_holds() {
    let mut counts = [0; 2];
    for (seed, tolerance) in [(1, 0.0), (2, 0.4)] {
        let tree = tree(&noise(seed, 1, 3, 40, 4.0), &random_divide(seed, (1, 2), 60));
        let mesh = arrays(&tree, tolerance);
        let most = 0.1;
        let (better, numbers) = improve(mesh.clone(), most, &Silent).unwrap();
        assert_eq!(numbers.len(), better.positions.len());
        let [before, after] = [&mesh, &better].map(|mesh| (checked(mesh), below(mesh, 5.0)));
        assert_eq!(before.0.intersections.pairs, after.0.intersections.pairs);
        assert_eq!((before.0.genus, before.0.components), (after.0.genus, after.0.components));
        counts[0] += before.1;
        counts[1] += after.1;
        // Corners of the new mesh are near the old one. The judge's grid is an eighth of a triangle.
        for place in better.positions.iter().step_by(better.positions.len() / 20) {
            let near = |ids: &[u32; 3]| to_triangle(wide(*place), &corners(&mesh, ids));
            let found = mesh.triangles.iter().map(near).fold(f64::INFINITY, f64::min);
            assert!(found < most + 0.1, "{found}");
        }
        // The same again.
        assert!(improve(mesh, most, &Silent).unwrap().0 == better);
    }
    assert!(counts[0] > 200 && counts[1] * 4 < counts[0], "{counts:?}");
}

#[test]
fn a_ball_of_few_triangles_keeps_its_shape_where_nothing_may_move() {
    let ball = ImplicitField(|p: [f64; 3]| p.iter().map(|c| c * c).sum::<f64>().sqrt() - 5.5);
    let mesh = arrays(&tree(&ball, &|key| key.level() < 1), 0.0);
    let (same, _) = improve(mesh.clone(), 0.0, &Silent).unwrap();
    assert_eq!(checked(&same).euler_characteristic, 2);
    // Only flips within planes are left.
    assert_eq!(same.positions.len(), mesh.positions.len());
}

#[test]
fn a_mesh_that_does_not_fit_is_refused() {
    let ball = ImplicitField(|p: [f64; 3]| p.iter().map(|c| c * c).sum::<f64>().sqrt() - 5.5);
    let tree = tree(&ball, &|key| key.level() < 1);
    let mut sink = DiscardSink;
    let mut small = ImprovedSink::new(&mut sink, 0.1, 1000, &Silent);
    let error = contour(&tree, &ContourOptions::default(), &mut small, &Silent).unwrap_err();
    assert!(error.to_string().contains("memory"), "{error}");
}

/// A needle: two corners of a tetrahedron's face lie close to each other.
#[test]
fn a_needle_collapses_and_a_tetrahedron_does_not() {
    let positions = vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0], [0.1, 0.0, 0.0]];
    // The edge from 0 to 1 is divided at 4.
    let triangles = vec![[0, 2, 4], [4, 2, 1], [0, 4, 3], [4, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mesh = MeshArrays { positions, triangles };
    let (better, numbers) = improve(mesh.clone(), 0.2, &Silent).unwrap();
    assert_eq!((better.triangles.len(), numbers.len()), (4, 4));
    let (again, _) = improve(better.clone(), 10.0, &Silent).unwrap();
    assert_eq!(again.triangles.len(), 4);
    // A point on the edge costs nothing; without any distance it is still taken away.
    let (flat, _) = improve(mesh, 1e-9, &Silent).unwrap();
    assert_eq!(flat.triangles.len(), 4);
}
