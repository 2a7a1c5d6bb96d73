//! Hermite edges against all crossings of their lattice edge.

use crate::oracle::{Crossing, Oracle};
use crate::piles::{Place, Step, on_lattice};
use crate::scene::{Scene, nodes, position};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::{Mesh, shapes};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::brick::{Brick, HermiteEdge, OctNormal};
use brickfield_engine::lattice::{BRICK_POINTS, NodeKey};

/// What the edges of some bricks turned out to be.
#[derive(Default, Debug)]
struct Seen {
    edges: usize,
    /// With more than one crossing.
    several: usize,
    /// With crossings that the rounded offset cannot tell apart.
    coincident: usize,
}

/// All sign-changing edges of all leaves.
fn compare_leaves(scene: &Scene, depth: u8, seen: &mut Seen) {
    let oracle = scene.oracle();
    for (key, leaf, brick) in nodes(&scene.at_depth(depth)) {
        let Brick::Counts { hermite, .. } = &*brick else { continue };
        assert!(leaf || hermite.is_empty(), "{key}");
        for axis in (0..3).filter(|_| leaf) {
            compare_axis(&oracle, key, &brick, axis, &hermite.edges[axis], seen);
        }
    }
}

fn compare_axis(
    oracle: &Oracle,
    key: NodeKey,
    brick: &Brick,
    axis: usize,
    edges: &[HermiteEdge],
    seen: &mut Seen,
) {
    let mut edges = edges.iter();
    let until: [usize; 3] = std::array::from_fn(|a| BRICK_POINTS - usize::from(a == axis));
    for k in 0..until[2] {
        for j in 0..until[1] {
            for i in 0..until[0] {
                let mut upper = [i, j, k];
                upper[axis] += 1;
                let ends = [brick.sample([i, j, k]), brick.sample(upper)].map(i64::from);
                if (ends[0] >= 1) != (ends[1] >= 1) {
                    let edge = edges.next().expect("an entry per sign change");
                    compare_edge(oracle, (key, [i, j, k], axis), ends, *edge, seen);
                }
            }
        }
    }
    assert!(edges.next().is_none(), "{key}: more entries than sign changes");
}

fn compare_edge(
    oracle: &Oracle,
    (key, ijk, axis): (NodeKey, [usize; 3], usize),
    ends: [i64; 2],
    edge: HermiteEdge,
    seen: &mut Seen,
) {
    let spacing = 1 << key.spacing_bits();
    let lower = position(key, ijk);
    let mut crossings = oracle.crossings(lower, axis, spacing);
    crossings.sort_by_key(|c| c.offset);
    let place = || format!("{key} {ijk:?} axis {axis}: {edge:?}, {ends:?}, {crossings:?}");
    assert_eq!(ends[0] + crossings.iter().map(|c| c.jump).sum::<i64>(), ends[1], "{}", place());
    let steps: Vec<&[Crossing]> = crossings.chunk_by(|a, b| a.offset == b.offset).collect();
    seen.edges += 1;
    seen.several += usize::from(crossings.len() > 1);
    seen.coincident += usize::from(steps.len() < crossings.len());

    // The first step at which the running count passes 0.5.
    let mut w = ends[0];
    let passage = steps.iter().find(|step| {
        let before = w;
        w += step.iter().map(|c| c.jump).sum::<i64>();
        (before >= 1) != (w >= 1)
    });
    let passage = passage.unwrap_or_else(|| panic!("no passage: {}", place()));
    assert_eq!(i64::from(edge.offset), passage[0].offset, "{}", place());

    // A facet of that step whose normal and plane the entry has.
    let direction = if ends[0] < 1 { 1 } else { -1 };
    let here: [f64; 3] = std::array::from_fn(|a| {
        f64::from(lower[a]) + if a == axis { edge.fraction() * f64::from(spacing) } else { 0.0 }
    });
    let own = passage.iter().find(|c| {
        c.jump == direction && is_direction(edge.normal, c.normal) && {
            let distance =
                (0..3).map(|a| c.normal[a] as f64 * (here[a] - f64::from(c.vertex[a]))).sum::<f64>();
            // Along the edge: half a step of rounding, a whole one just before the upper sample.
            let along = (distance / c.normal[axis] as f64).abs();
            along <= f64::from(spacing) / 65536.0 + 1e-6
        }
    });
    assert!(own.is_some(), "{} {:?}", place(), edge.normal.to_vector());
}

fn is_direction(code: OctNormal, n: [i64; 3]) -> bool {
    let length = n.iter().map(|&c| (c as f64) * (c as f64)).sum::<f64>().sqrt();
    let unit = code.to_vector();
    let dot: f64 = (0..3).map(|a| unit[a] * n[a] as f64 / length).sum();
    // The code's step is 1/32767 of the octahedron's half edge.
    dot > 1.0 - 1e-8
}

#[test]
fn general_position() {
    let mut seen = Seen::default();
    for seed in 0..6 {
        compare_leaves(&Scene::of(&random_pile(seed, 8)), 2, &mut seen);
    }
    assert!(seen.edges > 50_000 && seen.several > 500, "{seen:?}");
}

#[test]
fn faces_through_samples_and_coincident_faces() {
    let mut seen = Seen::default();
    for seed in 0..16u64 {
        let place = Place {
            level: [2, 3, 9, 16][seed as usize % 4],
            step: [Step::Half, Step::One, Step::Two][seed as usize % 3],
            shift: [0, 1, 2].map(|a| seed >> a & 1 == 1),
            corner: seed,
        };
        compare_leaves(&on_lattice(seed, 8, place), place.level, &mut seen);
    }
    assert!(seen.edges > 20_000 && seen.coincident > 1_000, "{seen:?}");
}

/// Thin shells in one another: many crossings an edge, the surface among them in either order.
#[test]
fn many_walls_within_an_edge() {
    let mut seen = Seen::default();
    for seed in part_or_all(0..2, 0..4u64) {
        let mut pieces = random_pile(seed, 3);
        for n in 0..24 {
            let grow = 1.0 + 0.004 * f64::from(n);
            let shell = shapes::icosphere(2, 1.5 * grow).rotated([1.0, 2.0, 3.0], 0.1 * f64::from(n));
            pieces.push(if (n + seed as i32) % 3 == 0 { shell.flipped() } else { shell });
        }
        compare_leaves(&Scene::of(&pieces), 1, &mut seen);
    }
    assert!(seen.several > part_or_all(2_500, 5_000), "{seen:?}");
}

/// Pieces of a few units only: slopes and offsets at the limits of the lattice.
#[test]
fn pieces_as_fine_as_the_lattice() {
    let mut seen = Seen::default();
    for seed in 0..8u64 {
        let pile = Mesh::merged(&lattice_pile(seed, 6, 2, 200)).translated([8_388_500.0; 3]);
        compare_leaves(&Scene::in_units(&pile), 16, &mut seen);
    }
    assert!(seen.edges > 2_000, "{seen:?}");
}
