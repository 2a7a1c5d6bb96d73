//! Sound meshes with one thing wrong, and whether that and nothing else is found.

use super::{checked, of_shape, welded};
use crate::Silent;
use crate::check::{CheckReport, Meeting, check};
use crate::ingest::Input;
use brickfield_bench_data::Mesh as Shape;
use brickfield_bench_data::shapes::{cuboid, icosphere};

/// What is wrong, by name and count.
fn wrong(report: &CheckReport) -> Vec<(&'static str, u64)> {
    report.defects().into_iter().map(|(what, defect)| (what, defect.count)).collect()
}

const OPEN: &str = "open edges";
const MISORIENTED: &str = "edges where triangles face opposite ways";
const CROWDED: &str = "edges of more than two triangles";
const SPLIT: &str = "vertices of more than one fan";
const CROSS: &str = "pairs of triangles that cross";
const OVERLAP: &str = "pairs of triangles that overlap";
const TOUCH: &str = "pairs of triangles that touch";

fn cube() -> Shape {
    cuboid([0.0; 3], [2.0; 3])
}

#[test]
fn a_hole() {
    let mut shape = icosphere(2, 1.0);
    let gone = shape.triangles.swap_remove(17);
    let report = of_shape(&shape);
    assert_eq!(wrong(&report), [(OPEN, 3)]);
    assert!(!report.is_closed() && report.is_oriented() && report.is_manifold() && report.genus.is_none());
    let at = report.open_edges.at.expect("a place");
    assert!(gone.iter().any(|&v| shape.vertices[v as usize] == at));
}

#[test]
fn a_flipped_face() {
    let mut shape = icosphere(2, 1.0);
    shape.triangles[5].swap(0, 1);
    let report = of_shape(&shape);
    assert_eq!(wrong(&report), [(MISORIENTED, 3)]);
    assert!(report.is_closed() && !report.is_oriented() && report.is_manifold());
}

#[test]
fn two_cubes_at_a_vertex() {
    let shape = Shape::merged(&[cube(), cuboid([2.0; 3], [4.0; 3])]);
    let report = welded(&shape);
    assert_eq!(wrong(&report), [(SPLIT, 1)]);
    assert_eq!(report.split_vertices.at, Some([2.0; 3]));
    assert_eq!((report.components, report.genus), (2, None));
    assert!(report.is_edge_manifold() && !report.is_vertex_manifold());
}

#[test]
fn two_cubes_at_an_edge() {
    let shape = Shape::merged(&[cube(), cuboid([2.0, 2.0, 0.0], [4.0, 4.0, 2.0])]);
    let report = welded(&shape);
    assert_eq!(wrong(&report), [(CROWDED, 1)]);
    assert!(report.is_closed() && report.is_oriented() && !report.is_edge_manifold());
    // With vertices of their own they touch: two triangles of each are on that edge and have both ends of it, and the
    // faces that end there have one.
    let report = of_shape(&shape);
    assert!(report.is_closed() && report.is_manifold() && !report.is_sound());
    assert_eq!(wrong(&report).iter().map(|(what, _)| *what).collect::<Vec<_>>(), [TOUCH]);
}

#[test]
fn spheres_through_each_other() {
    let shape = Shape::merged(&[icosphere(3, 1.0), icosphere(3, 1.0).translated([0.9, 0.11, 0.07])]);
    let report = of_shape(&shape);
    assert_eq!(wrong(&report), [(CROSS, report.intersections.pairs)]);
    assert!(report.intersections.pairs > 50 && report.is_manifold() && report.is_closed());
    let [a, b] = report.intersections.first[0].faces;
    assert!(a < 1280 && b >= 1280, "{a} {b}");
    let near = report.intersections.first[0].near;
    let center = |c: [f64; 3]| (0..3).map(|n| (near[n] - c[n]).powi(2)).sum::<f64>().sqrt();
    assert!((center([0.0; 3]) - 1.0).abs() < 0.1 && (center([0.9, 0.11, 0.07]) - 1.0).abs() < 0.1);
    let apart = Shape::merged(&[icosphere(3, 1.0), icosphere(3, 1.0).translated([2.001, 0.0, 0.0])]);
    assert!(of_shape(&apart).is_sound());
}

#[test]
fn boxes_on_each_other() {
    // The upper one stands inside the lower one's lid: two triangles on two.
    let report = of_shape(&Shape::merged(&[cube(), cuboid([0.5, 0.25, 2.0], [1.5, 1.0, 3.0])]));
    assert!(report.intersections.overlapping > 0 && report.intersections.crossing == 0);
    assert!(!report.is_sound() && report.genus == Some(0));
    // A hair above it stands free.
    let above = 2.0f64.next_up();
    assert!(of_shape(&Shape::merged(&[cube(), cuboid([0.5, 0.25, above], [1.5, 1.0, 3.0])])).is_sound());
    let below = 2.0f64.next_down();
    let report = of_shape(&Shape::merged(&[cube(), cuboid([0.5, 0.25, below], [1.5, 1.0, 3.0])]));
    assert!(report.intersections.crossing > 0 && report.intersections.overlapping == 0);
}

#[test]
fn a_fold() {
    // A tetrahedron pressed flat: two of its faces lie on the other two.
    let positions = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [1.0, 1.0, 0.0]];
    let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let report = checked(&positions, &triangles);
    // The large one has an edge in common with each of the others.
    assert_eq!(wrong(&report), [(OVERLAP, 3)]);
    assert_eq!((report.volume, report.genus), (0.0, Some(0)));
    assert_eq!(report.intersections.first[0].faces, [0, 1]);
    // Lifted by the least that there is, it is a solid.
    let mut lifted = positions;
    lifted[3][2] = 1e-45;
    assert!(checked(&lifted, &triangles).is_sound());
}

#[test]
fn a_vertex_on_a_face() {
    let tip = |z: f64| {
        let positions = vec![[0.5, 0.75, z], [0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
        let triangles = vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
        Shape::merged(&[cube(), Shape { vertices: positions, triangles }])
    };
    // Three triangles at the tip, one or two below it, as the diagonal runs.
    let report = of_shape(&tip(2.0));
    assert_eq!(wrong(&report), [(TOUCH, 3)]);
    assert_eq!(report.intersections.first[0].meeting, Meeting::Touching);
    assert!(of_shape(&tip(2.0f64.next_up())).is_sound());
    assert_eq!(wrong(&of_shape(&tip(2.0f64.next_down()))), [(CROSS, 3)]);
}

#[test]
fn a_duplicate() {
    let mut shape = icosphere(1, 1.0);
    shape.triangles.push({
        let [a, b, c] = shape.triangles[3];
        [b, c, a]
    });
    let report = of_shape(&shape);
    assert_eq!(report.duplicate_triangles.count, 1);
    assert_eq!((report.open_edges.count, report.crowded_edges.count), (3, 3));
    // The copy lies on its original, and leans over its neighbours' edges as that does.
    assert_eq!((report.intersections.pairs, report.intersections.overlapping), (1, 1));
    assert_eq!(report.intersections.first[0].faces, [3, 80]);
}

#[test]
fn triangles_without_area() {
    // A cube's edge with a triangle let in that has its third corner on that edge, and one that has two corners.
    let mut shape = cube();
    let [a, b, _] = shape.triangles[0];
    let middle: [f64; 3] =
        std::array::from_fn(|n| (shape.vertices[a as usize][n] + shape.vertices[b as usize][n]) / 2.0);
    shape.vertices.push(middle);
    shape.triangles.extend([[a, 8, b], [a, a, b]]);
    let report = of_shape(&shape);
    assert_eq!((report.flat_triangles.count, report.collapsed_triangles.count), (1, 1));
    assert!(!report.is_sound());
    assert_eq!(report.intersections.pairs, 0);
}

#[test]
fn signs_of_zero_do_not_matter() {
    let mut shape = cube();
    let flipped = welded(&shape);
    for (number, vertex) in shape.vertices.iter_mut().enumerate() {
        for c in vertex.iter_mut().filter(|c| **c == 0.0) {
            *c = if number % 2 == 0 { -0.0 } else { 0.0 };
        }
    }
    // Each triangle has corners of its own here.
    let facets: Vec<[[f64; 3]; 3]> = shape.facets().collect();
    let vertices: Vec<[f64; 3]> = facets
        .iter()
        .flatten()
        .enumerate()
        .map(|(n, v)| v.map(|c| if c == 0.0 && n % 3 == 1 { -c } else { c }))
        .collect();
    let triangles = (0..facets.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let report = welded(&Shape { vertices, triangles });
    assert!(report.is_sound() && report.vertices == 8);
    assert_eq!(report.bounds, flipped.bounds);
    assert!(report.bounds.is_some_and(|b| b[0].iter().all(|c| c.is_sign_positive())));
}

#[test]
fn what_is_not_finite_is_left_out() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut shape = icosphere(1, 1.0);
        shape.vertices[4][1] = bad;
        let report = of_shape(&shape);
        let around = shape.triangles.iter().filter(|t| t.contains(&4)).count() as u64;
        assert_eq!(report.non_finite_triangles.count, around);
        assert_eq!(report.open_edges.count, around);
        assert!(report.area.is_finite() && report.bounds.is_some_and(|b| b[1][1].is_finite()));
        assert!(!report.is_closed() && !report.is_sound());
    }
}

#[test]
fn what_cannot_be_exact_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("small.obj");
    for (vertex, is_sound) in [("1e-91 0 0", false), ("1e101 0 0", false), ("1e-90 0 0", true)] {
        let text = format!("v {vertex}\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
        std::fs::write(&path, text).expect("written");
        let input = Input::open(&path, &Silent).expect("an OBJ");
        match check(&input, false, &Silent) {
            Ok(report) => assert!(is_sound && report.triangles == 1),
            Err(error) => assert!(!is_sound && error.to_string().contains("scale the mesh"), "{error}"),
        }
    }
}

#[test]
fn indices_count_unless_positions_are_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("loose.obj");
    let mut text = String::new();
    for (number, facet) in cube().facets().enumerate() {
        facet.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
        text += &format!("f {} {} {}\n", 3 * number + 1, 3 * number + 2, 3 * number + 3);
    }
    std::fs::write(&path, text).expect("written");
    let input = Input::open(&path, &Silent).expect("an OBJ");
    let loose = check(&input, false, &Silent).expect("in range");
    assert_eq!((loose.open_edges.count, loose.components), (36, 12));
    assert!(loose.intersections.touching > 12);
    assert!(check(&input, true, &Silent).expect("in range").is_sound());
}

#[test]
fn no_triangles_are_no_solid() {
    let report = checked(&[[0.0; 3]], &[]);
    assert!(!report.is_sound() && !report.is_closed() && report.unused_vertices == 1);
}
