//! Planted defects, laws, and pairs of triangles against exact rational arithmetic.

mod oracle;
mod planted;

use super::{CheckReport, Mesh, Tally, examine};
use crate::Silent;
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::shapes::{icosphere, torus};
use brickfield_bench_data::{Mesh as Shape, judge};
use brickfield_core::sweep::part_or_all;
use oracle::{GridPoint, expected};
use proptest::prelude::*;

/// The report on an indexed mesh.
#[track_caller]
fn checked(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> CheckReport {
    let mut mesh = Mesh { positions: positions.into(), triangles: triangles.into(), non_finite: Tally::NONE };
    mesh.take_stock().expect("coordinates in range");
    examine(&mesh, &Silent).expect("nobody interrupts")
}

fn of_shape(shape: &Shape) -> CheckReport {
    checked(&shape.vertices, &shape.triangles)
}

/// The report on triangles with vertices found by position.
fn welded(shape: &Shape) -> CheckReport {
    let facets: Vec<crate::ingest::Facet> = shape.facets().collect();
    let mut mesh = super::weld::weld(&facets, &Silent).expect("nobody interrupts");
    mesh.take_stock().expect("coordinates in range");
    examine(&mesh, &Silent).expect("nobody interrupts")
}

/// All counts, but not the places, which follow the numbering.
fn counts(report: &CheckReport) -> Vec<u64> {
    let mut counts = vec![report.triangles, report.vertices, report.edges, report.components];
    counts.push(report.euler_characteristic as u64);
    let defects = [
        report.open_edges,
        report.misoriented_edges,
        report.crowded_edges,
        report.split_vertices,
        report.flat_triangles,
        report.duplicate_triangles,
    ];
    counts.extend(defects.map(|defect| defect.count));
    let found = &report.intersections;
    counts.extend([found.pairs, found.crossing, found.overlapping, found.touching]);
    counts
}

/// Some vertices on a small grid, and triangles of three different ones.
fn soups() -> impl Strategy<Value = (Vec<GridPoint>, Vec<[u32; 3]>)> {
    let vertices = prop::collection::vec(prop::array::uniform3(-3i64..=3), 4..16);
    vertices.prop_flat_map(|vertices| {
        let count = vertices.len() as u32;
        let triangle = (0..count, 1..count, 1..count - 1).prop_map(move |(a, b, c)| {
            let c = if c >= b { c + 1 } else { c };
            [a, (a + b) % count, (a + c) % count]
        });
        (Just(vertices), prop::collection::vec(triangle, 1..24))
    })
}

fn real(vertices: &[GridPoint]) -> Vec<[f64; 3]> {
    vertices.iter().map(|v| v.map(|c| c as f64)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    /// Small grids are full of common planes, lines and points.
    #[test]
    fn intersections_are_those_of_rational_arithmetic((vertices, triangles) in soups(), scale in -60i32..60) {
        let report = checked(
            // Exact, whatever the power of two.
            &real(&vertices).iter().map(|v| v.map(|c| c * 2f64.powi(scale))).collect::<Vec<_>>(),
            &triangles,
        );
        let (flat, found) = expected(&vertices, &triangles);
        prop_assert_eq!(report.flat_triangles.count, flat);
        let Intersections { crossing, overlapping, touching, first, pairs } = &report.intersections;
        prop_assert_eq!((*crossing, *overlapping, *touching), (found.crossing, found.overlapping, found.touching));
        prop_assert_eq!(*pairs, crossing + overlapping + touching);
        let named: Vec<_> = first.iter().map(|pair| (pair.faces, pair.meeting)).collect();
        prop_assert_eq!(&named[..], &found.pairs[..found.pairs.len().min(10)]);
    }

    /// The judge of the meshes that the engine makes shares no code with this.
    #[test]
    fn edges_and_vertices_are_as_the_judge_counts_them((vertices, triangles) in soups()) {
        let positions = real(&vertices);
        let report = checked(&positions, &triangles);
        let judged = judge::mesh::check(&positions, &triangles);
        prop_assert_eq!(report.vertices, judged.vertices);
        prop_assert_eq!(report.unused_vertices, judged.unused_vertices);
        prop_assert_eq!(report.edges, judged.edges);
        prop_assert_eq!(report.euler_characteristic, judged.euler_characteristic);
        prop_assert_eq!(report.components, judged.components);
        prop_assert_eq!(report.open_edges.count, judged.open_edges);
        prop_assert_eq!(report.misoriented_edges.count, judged.misoriented_edges);
        prop_assert_eq!(report.crowded_edges.count, judged.crowded_edges);
        prop_assert_eq!(report.split_vertices.count, judged.split_vertices);
        prop_assert_eq!(report.duplicate_triangles.count, judged.duplicate_triangles);
        prop_assert_eq!(report.flat_triangles.count, judged.zero_area_triangles);
        prop_assert!((report.area - judged.area).abs() <= 1e-12 * judged.area);
    }

    /// Which corner comes first, which triangle, and how vertices are numbered changes no count, nor does it matter
    /// along which axis things lie.
    #[test]
    fn numbering_does_not_matter((vertices, triangles) in soups(), turn in 0usize..3, step in 1usize..5) {
        let report = checked(&real(&vertices), &triangles);
        let count = vertices.len();
        let renumbered = |v: u32| (count - 1 - v as usize) as u32;
        let mut other: Vec<[u32; 3]> = triangles
            .iter()
            .enumerate()
            .map(|(n, t)| std::array::from_fn(|i| renumbered(t[(i + n * step) % 3])))
            .collect();
        other.reverse();
        let middle = step % other.len();
        other.rotate_left(middle);
        let moved: Vec<[f64; 3]> =
            real(&vertices).iter().rev().map(|v| [v[turn], v[(turn + 1) % 3], v[(turn + 2) % 3]]).collect();
        prop_assert_eq!(counts(&report), counts(&checked(&moved, &other)));
    }

    /// Four points that are in one plane but for the last bits of f32.
    #[test]
    fn signs_near_a_plane_are_exact(
        base in prop::array::uniform3(prop::array::uniform3(8_388_608i64..16_777_216)),
        weights in (0.0f64..1.0, 0.0f64..1.0),
        off in prop::array::uniform3(-1i64..=1),
    ) {
        let [p, q, r] = base;
        let (u, v) = weights;
        let near = |a: usize| p[a] + (u * (q[a] - p[a]) as f64 + v * (r[a] - p[a]) as f64).round() as i64 + off[a];
        let s: GridPoint = std::array::from_fn(near);
        let determinant = oracle::determinant(p, q, r, s);
        let point = |g: GridPoint| g.map(|c| c as f64);
        // The fourth corner is on a side of the plane, or in it, as the determinant says.
        let side = crate::predicates::side_of_plane(point(p), point(q), point(r), point(s));
        prop_assert_eq!(i128::from(side), -determinant.signum());
    }
}

use super::report::Intersections;

#[test]
fn shapes_are_sound_and_have_their_genus() {
    for (shape, genus) in [(icosphere(4, 3.0), 0), (torus(5.0, 2.0, 60, 24), 1)] {
        let report = of_shape(&shape);
        assert!(report.is_sound(), "{report:?}");
        assert_eq!((report.genus, report.components), (Some(genus), 1));
        assert_eq!(report.euler_characteristic, 2 - 2 * genus);
        assert!((report.volume / shape.signed_volume() - 1.0).abs() < 1e-12);
        assert!((report.area / shape.area() - 1.0).abs() < 1e-12);
        let (min, max) = shape.bounds();
        assert_eq!(report.bounds, Some([min, max]));
        assert_eq!(report.defects(), []);
        assert_eq!(counts(&welded(&shape)), counts(&report));
    }
}

#[test]
fn a_cavity_far_from_the_origin_keeps_its_volume() {
    // The corners of a cube at 10^6 with cells of 2^-10 times f32 can hold; its inner cube is a cell.
    let at = |size: f64| Shape::merged(&[icosphere(1, size)]).translated([1e6, -1e6, 1e6]);
    let outer = at(64.0);
    let inner = at(0.5).flipped();
    let report = of_shape(&Shape::merged(&[outer.clone(), inner.clone()]));
    assert!(report.is_sound());
    assert_eq!((report.components, report.inward_components), (2, 1));
    let alone = |shape: Shape| of_shape(&shape).shells[0].volume;
    assert_eq!(report.shells.iter().map(|s| s.volume).collect::<Vec<_>>(), [alone(outer), alone(inner)]);
    // 20 faces of an icosphere, once divided: the same at the origin, but for the rounding of its vertices.
    let near = of_shape(&icosphere(1, 0.5)).volume;
    assert!((report.shells[1].volume / -near - 1.0).abs() < 1e-8);
}

#[test]
fn reports_do_not_depend_on_threads() {
    let pile = Shape::merged(&random_pile(7, 60));
    let copies: Vec<Shape> = (0..12).map(|n| pile.clone().translated([0.37 * f64::from(n); 3])).collect();
    let many = Shape::merged(&copies);
    assert!(many.triangles.len() > 3 * super::CHUNK, "{} triangles are one task", many.triangles.len());
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| welded(&many))
    };
    let alone = with(1);
    assert!(alone.intersections.crossing > 1000, "{:?}", alone.intersections);
    for &threads in part_or_all(&[3][..], &[2, 5]) {
        assert!(with(threads) == alone, "{threads} threads");
    }
}
