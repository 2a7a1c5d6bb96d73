//! Triangles that meet where they should not.

use super::*;
use crate::contour::envelope::MinimalEdge;
use brickfield_io::check::CheckReport;
use brickfield_io::ingest::Input;
use proptest::prelude::*;

/// What an exact check says of a mesh.
pub fn report(mesh: &TestMesh) -> CheckReport {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    let mut sink = create_sink(&path, None).unwrap();
    sink.vertices(&mesh.positions).unwrap();
    sink.triangles(&mesh.facets).unwrap();
    sink.finish().unwrap();
    let input = Input::open(&path, &Silent).unwrap();
    brickfield_io::check::check(&input, false, &Silent).unwrap()
}

/// Pairs of triangles that cross, overlap or touch, by exact arithmetic; none is without area.
pub fn pairs(mesh: &TestMesh) -> u64 {
    let report = report(mesh);
    assert_eq!((report.flat_triangles.count, report.collapsed_triangles.count), (0, 0));
    report.intersections.pairs
}

/// Contours and checks the mesh by index and by place, and that nothing in it meets.
pub fn apart(tree: &MemoryTree, options: &ContourOptions) -> (TestMesh, MeshSummary) {
    let (mesh, summary) = mesh(tree, options);
    mesh.check();
    check(&mesh.welded()).unwrap();
    assert_eq!(pairs(&mesh), 0);
    (mesh, summary)
}

/// Noise has normals that have nothing to do with its crossings, so that vertices are anywhere in their cells.
#[test]
fn noise_on_uniform_trees_meets_nowhere() {
    let (mut on_edges, mut on_faces) = (0, 0);
    for seed in (0..5).step_by(part_or_all(2, 1)) {
        let density = 30 + 45 * seed;
        let boxes = vec![[[1 << 19; 3], [31 << 19; 3]]];
        let everywhere = NoiseField { seed, boxes, density, radius: 0.0, quiet_bits: 24 };
        for (shape, level) in [(everywhere, 0), (noise(seed, 1, 5, density, 3.9), 1)] {
            let (_, summary) = apart(&tree(&shape, &uniform(level)), &ContourOptions::default());
            on_edges += summary.edge_vertices;
            on_faces += summary.face_vertices;
        }
    }
    assert!(on_edges > 1000 && on_faces > 1000, "{on_edges} {on_faces}");
}

/// Normals of the other levels are differences of samples, one-sided at the borders of bricks, so the bricks at a border
/// differ in what they say of the crossings there.
#[test]
fn levels_of_noise_meet_nowhere_across_borders() {
    for seed in part_or_all(0..1, 0..3) {
        let layer = |n: u64| NoiseField { seed: 3 * seed + n, ..noise(seed, 1, 5, 128, 0.0) };
        let shape = Overlap(layer(0), Overlap(layer(1), layer(2)));
        for iso in [1.5, 2.5] {
            let options = ContourOptions { iso, ..Default::default() };
            let (mesh, summary) = mesh(&tree(&shape, &uniform(1)), &options);
            mesh.check();
            check(&mesh.welded()).unwrap();
            assert_eq!(pairs(&mesh), 0, "seed {seed} at {iso}");
            assert!(summary.triangles > 1000, "{summary:?}");
            let (mixed, _) = super::mesh(&tree(&shape, &random_divide(seed, (1, 2), 128)), &options);
            mixed.check();
        }
    }
}

/// Two turned boxes, the thinnest of which are less than a cell thick.
fn sharp_solids() -> impl Iterator<Item = impl SampledField> {
    [[3.0, 2.0, 4.0], [0.4, 5.0, 0.3], [5.0, 4.0, 0.07]].into_iter().map(|half: [f64; 3]| {
        let other = ImplicitField(move |p: [f64; 3]| {
            let q = to_box([p[2] + 0.7, p[0] - 0.3, p[1]]);
            (0..3).map(|a| q[a].abs() - half[(a + 1) % 3]).fold(f64::NEG_INFINITY, f64::max)
        });
        Overlap(rotated_box(half), other)
    })
}

#[test]
fn sharp_solids_meet_nowhere() {
    for solid in sharp_solids() {
        for level in 0..=2 {
            apart(&tree(&solid, &uniform(level)), &ContourOptions::default());
        }
    }
}

/// Leaves of up to four levels next to each other.
#[test]
fn sharp_solids_meet_nowhere_between_levels() {
    let (mut mixed, mut on_faces) = (0, 0);
    for solid in sharp_solids() {
        for seed in part_or_all(0..1, 0..5) {
            let tree = tree(&solid, &random_divide(seed, (1, 3 + u8::from(seed % 3 == 0)), 110));
            let (_, summary) = apart(&tree, &ContourOptions::default());
            mixed += summary.mixed_cells;
            on_faces += summary.face_vertices;
        }
    }
    let least = part_or_all(1000, 5000);
    assert!(mixed > least && on_faces > least, "{mixed} {on_faces}");
}

/// Cells next to finer leaves have up to a dozen loops here.
#[test]
fn noise_meets_nowhere_between_levels() {
    let (mut mixed, mut split) = (0, 0);
    for seed in [1, 3, 5, 7, 9, 10, 11, 14] {
        let (mesh, summary) = checked(&noise_between_levels(seed, 30 + 15 * seed));
        assert_eq!(pairs(&mesh), 0, "seed {seed}: {summary:?}");
        mixed += summary.mixed_cells;
        split += summary.split_faces;
    }
    assert!(mixed > 5000 && split > 5000, "{mixed} {split}");
}

/// Vertices of noise are anywhere in their cells, and one that stays there may be in the way of all places of another.
#[test]
fn cones_are_separated_from_places_near_their_lines() {
    for seed in [1029, 1206, 1232, 1282, 1379] {
        let (mesh, summary) = checked(&noise_of_many_kinds(seed));
        assert_eq!((pairs(&mesh), summary.unseparated_cells), (0, 0), "seed {seed}: {summary:?}");
    }
}

/// Leaves of the tree beside interior nodes that stand for their descendants: these may differ in what they say of crossings
/// on their common border.
#[test]
fn noise_meets_nowhere_in_truncated_trees() {
    let (mut mixed, mut split) = (0, 0);
    for seed in (part_or_all(1, 0)..8).step_by(part_or_all(3, 1)) {
        let shape = noise_of_several_sizes(seed, 40 + 20 * seed);
        let tree = tree(&shape, &random_divide(seed, (0, 4), 100));
        for level in 1..4 {
            let options = ContourOptions { level: Some(level), ..Default::default() };
            let (mesh, summary) = mesh(&tree, &options);
            mesh.check();
            assert_eq!(pairs(&mesh), 0, "seed {seed} at level {level}: {summary:?}");
            mixed += summary.mixed_cells;
            split += summary.split_faces;
        }
    }
    assert!(mixed > part_or_all(1000, 3000) && split > part_or_all(1300, 4000), "{mixed} {split}");
}

/// Twice the area of a triangle in the plane.
fn area(a: [i128; 2], b: [i128; 2], c: [i128; 2]) -> i128 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether both triangles of the quadrilateral a, b, c, d along ac are within the envelope of the edge from 0 to `high`,
/// in whole numbers: where a triangle or a spoke meets another one in the same place seen along the edge, which is
/// above.
fn is_within([a, b, c, d]: [[i128; 3]; 4], high: i128) -> bool {
    let flat = |p: [i128; 3]| [p[0], p[1]];
    let origin = [0, 0];
    let side = area(origin, flat(a), flat(c));
    // The side of ac on which the edge is not.
    let (tip, other) = if side >= 0 { (b, d) } else { (d, b) };
    // The height of ac over the ray to the tip, and the share of the ray that is before it: both over `whole`.
    let (to_c, to_a) = (area(origin, flat(tip), flat(c)).abs(), area(origin, flat(a), flat(tip)).abs());
    let whole = to_c + to_a;
    let height = a[2] * to_c + c[2] * to_a;
    let before = side.abs();
    let over_spoke =
        before < whole && tip[2] * before < height && height < (whole - before) * high + tip[2] * before;
    // The height at which the triangle with the other tip meets the edge.
    let weights =
        [area(origin, flat(c), flat(other)).abs(), area(origin, flat(other), flat(a)).abs(), before];
    let sum: i128 = weights.iter().sum();
    let at_edge = weights[0] * a[2] + weights[1] * c[2] + weights[2] * other[2];
    over_spoke && 0 < at_edge && at_edge < sum * high
}

#[test]
fn crossings_stay_within_their_edges() {
    for (fraction, expected) in [(0.0, 2.0f32.next_up()), (0.25, 2.25), (1.0, 3.0f32.next_down())] {
        let edge = MinimalEdge { axis: Axis::Y, at: [7.0, 5.0], ends: [2.0, 3.0], fraction };
        assert_eq!(edge.crossing(), [5.0, expected, 7.0]);
    }
}

proptest! {
    #[test]
    fn diagonals_are_judged_as_in_whole_numbers(
        places in prop::array::uniform4((1i32..60, 1i32..60, -20i32..120)),
        axis in 0usize..3,
    ) {
        let signs = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
        let corners: [[i128; 3]; 4] = std::array::from_fn(|n| {
            let (x, y, z) = places[n];
            [x * signs[n][0], y * signs[n][1], z].map(i128::from)
        });
        let axis = Axis::ALL[axis];
        let (u, v) = axis.others();
        // Off the origin by what 32 bits still hold exactly.
        let placed = corners.map(|corner| {
            let mut place = [0.0f32; 3];
            (place[u.index()], place[v.index()]) = (corner[0] as f32 + 1000.0, corner[1] as f32 - 500.0);
            place[axis.index()] = corner[2] as f32 + 64.0;
            place
        });
        let edge = MinimalEdge { axis, at: [1000.0, -500.0], ends: [64.0, 164.0], fraction: 0.5 };
        let [a, b, c, d] = corners;
        let expected = [is_within([a, b, c, d], 100), is_within([b, c, d, a], 100)];
        prop_assert_eq!(edge.diagonals(placed), expected);
    }

    #[test]
    fn triangles_are_pierced_as_in_whole_numbers(places in prop::array::uniform3(prop::array::uniform3(-40i32..60))) {
        let corners = places.map(|place| place.map(i128::from));
        let flat = corners.map(|p| [p[0], p[1]]);
        let weights: [i128; 3] = std::array::from_fn(|n| area([0, 0], flat[(n + 1) % 3], flat[(n + 2) % 3]));
        let sum: i128 = weights.iter().sum();
        let height: i128 = (0..3).map(|n| weights[n] * corners[n][2]).sum();
        let expected = weights.iter().all(|&w| w > 0) && 0 < height && height < 30 * sum;
        let edge = MinimalEdge { axis: Axis::Z, at: [0.0; 2], ends: [0.0, 30.0], fraction: 0.5 };
        prop_assert_eq!(edge.pierces(places.map(|place| place.map(|c| c as f32))), expected);
    }
}
