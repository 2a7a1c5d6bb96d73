//! Random piles of closed pieces, in general position and on the lattice.

use crate::oracle::Oracle;
use crate::scene::{Scene, compare_brick, nodes, random_sample, value_at};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::shapes::{Polygon, cuboid, extrude, slant, spiked_cube};
use brickfield_bench_data::{Mesh, Rng};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::brick::Brick;
use brickfield_engine::lattice::{NodeKey, Octant, ROOT_BITS, spacing_bits};
use brickfield_engine::store::BrickTree;
use proptest::prelude::*;

/// Where a pile on the lattice stands, so that its faces meet samples at one level.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The level whose spacing the pile goes by, and the depth of the tree.
    pub level: u8,
    /// Distance of neighbouring vertices in spacings: 1/2, 1 or 2.
    pub step: Step,
    /// Added to all vertices, 0 or 2 an axis. Samples lie at multiples of the spacing plus 1, so x − y = 0
    /// meets them if both shifts are alike and x + y = 0 if they differ.
    pub shift: [bool; 3],
    /// Chooses the brick.
    pub corner: u64,
}

#[derive(Clone, Copy, Debug)]
pub enum Step {
    Half,
    One,
    Two,
}

/// Lattice steps that a pile has room in, an axis.
const CELLS: u32 = 24;

impl Place {
    pub fn step(self) -> i32 {
        let spacing = 1 << spacing_bits(self.level);
        match self.step {
            Step::Half => spacing / 2,
            Step::One => spacing,
            Step::Two => 2 * spacing,
        }
    }

    /// Moves a pile that stands in 0..=24 steps.
    pub fn put(self, pile: Mesh) -> Mesh {
        let spacing = 1u32 << spacing_bits(self.level);
        let samples = 1u32 << (ROOT_BITS - spacing_bits(self.level));
        let mut rng = Rng::new(self.corner);
        pile.translated(std::array::from_fn(|a| {
            // Half of them in the middle, across the borders of bricks of every level.
            let middle = samples / 2 - 12;
            let free = samples - 2 * CELLS - 2;
            let first = if rng.one_in(2) { middle.min(free) } else { 1 + rng.below(free) };
            f64::from(first * spacing) + if self.shift[a] { 2.0 } else { 0.0 }
        }))
    }
}

pub fn place() -> impl Strategy<Value = Place> {
    let step = prop_oneof![Just(Step::Half), Just(Step::One), Just(Step::Two)];
    (1u8..=16, step, any::<[bool; 3]>(), any::<u64>()).prop_map(|(level, step, shift, corner)| Place {
        level,
        step,
        shift,
        corner,
    })
}

pub fn on_lattice(seed: u64, pieces: usize, place: Place) -> Scene {
    Scene::in_units(&place.put(Mesh::merged(&lattice_pile(seed, pieces, place.step(), CELLS))))
}

/// Every sample of every brick with different samples, and of every eighth other one.
fn compare_all(scene: &Scene, depth: u8) -> usize {
    let oracle = scene.oracle();
    let nodes = nodes(&scene.at_depth(depth));
    let telling =
        nodes.iter().enumerate().filter(|(n, (.., b))| n % 8 == 0 || matches!(**b, Brick::Counts { .. }));
    telling.map(|(_, (key, _, brick))| compare_brick(&oracle, *key, brick)).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(part_or_all(8, 32)) })]

    /// Overlapping, turned, nested, reversed and repeated pieces.
    #[test]
    fn piles_in_general_position(seed: u64, pieces in 1usize..10) {
        let scene = Scene::of(&random_pile(seed, pieces));
        let oracle = scene.oracle();
        let depth = 3;
        let tree = scene.at_depth(depth);
        for (key, _, brick) in nodes(&tree).iter().filter(|n| n.0.level() <= 1) {
            compare_brick(&oracle, *key, brick);
        }
        let mut rng = Rng::new(seed);
        for n in 0..4_000 {
            let p = random_sample(&mut rng, NodeKey::ROOT, depth);
            let w = value_at(&tree, depth, p).expect("coarse leaves are uniform");
            prop_assert_eq!(i64::from(w), oracle.at(p), "{:?}", p);
            if n < 200 && !oracle.may_lie_on_a_facet(p) {
                prop_assert!((oracle.solid_angles(p) - f64::from(w)).abs() < 1e-6, "{:?}", p);
            }
        }
    }

    /// Coincident faces, faces in common planes, 45° faces through samples, in all 48 orientations.
    #[test]
    fn piles_on_the_lattice(seed: u64, pieces in 1usize..8, place in place()) {
        prop_assert!(compare_all(&on_lattice(seed, pieces, place), place.level) > 0);
    }
}

/// How many samples of the level inside the mesh's box lie on one of its facets.
fn samples_on_facets(oracle: &Oracle, place: Place, mesh: &Mesh) -> usize {
    let (low, high) = mesh.bounds();
    let spacing = 1 << spacing_bits(place.level);
    let range = |a: usize| {
        let first = (low[a] as i32 / spacing) * spacing + 1;
        (first..=high[a] as i32).step_by(spacing as usize)
    };
    let mut on = 0;
    for z in range(2) {
        for y in range(1) {
            on += range(0).filter(|&x| oracle.may_lie_on_a_facet([x, y, z])).count();
        }
    }
    on
}

/// The pieces with 45° faces one by one, in each of the 48 orientations and all eight shifts: of the faces
/// at 45° about half run exactly through samples, whichever the orientation.
#[test]
fn faces_at_45_degrees_through_samples_in_every_orientation() {
    let pieces = [
        extrude(&Polygon::diamond(3.0), 0.0, 4.0),
        slant([4.0, 3.0, 4.0]),
        spiked_cube(2.0, 2.0),
        // A roof on a box: the slopes of two pieces meet along a line of samples.
        Mesh::merged(&[slant([2.0, 6.0, 3.0]), cuboid([0.0, 0.0, 0.0], [5.0, 6.0, 3.0])]),
    ];
    let mut on_facets = 0;
    for turn in 0..48usize {
        // Two shifts of each orientation in any case, so that each level and piece meets all of them.
        let is_wanted = |shift: &usize| part_or_all((shift + turn + turn / 8).is_multiple_of(4), true);
        for shift in (0..8usize).filter(is_wanted) {
            let level = [2, 4, 8, 16][(turn + shift) % 4];
            let place = Place {
                level,
                step: Step::One,
                shift: [0, 1, 2].map(|a| shift >> a & 1 == 1),
                corner: turn as u64,
            };
            let piece = oriented(pieces[(turn / 4 + shift) % 4].clone(), turn);
            let (low, _) = piece.bounds();
            let mesh = place.put(piece.translated(low.map(|c| -c)).scaled([f64::from(place.step()); 3]));
            let scene = Scene::in_units(&mesh);
            compare_all(&scene, level);
            on_facets += samples_on_facets(&scene.oracle(), place, &mesh);
        }
    }
    assert!(on_facets > part_or_all(1_200, 5_000), "only {on_facets} samples tested the ties");
}

/// A 45° face through the corner of eight bricks, in each orientation: it touches some of them along an edge or
/// in a corner alone, and a sample of their apron may lie behind it. All samples of these eight.
#[test]
fn faces_that_touch_bricks_in_an_edge_or_a_corner_only() {
    let wedge = extrude(&Polygon(vec![[0.0, 0.0], [8.0, 0.0], [8.0, 8.0]]), -8.0, 8.0);
    for turn in 0..48usize {
        let is_wanted = |shift: &usize| part_or_all((shift + turn + turn / 8).is_multiple_of(4), true);
        for shift in (0..4usize).filter(is_wanted) {
            let level = [2, 5, 16][(turn + shift) % 3];
            let spacing = f64::from(1u32 << spacing_bits(level));
            // Half the root is a corner of bricks at every level.
            let corner =
                [0, 1, 2].map(|a| f64::from(1 << (ROOT_BITS - 1)) + f64::from(shift as u32 >> a & 1) * 2.0);
            let mesh = oriented(wedge.clone(), turn).scaled([spacing; 3]).translated(corner);
            let scene = Scene::in_units(&mesh);
            let oracle = scene.oracle();
            let tree = scene.at_depth(level);
            for octant in Octant::all() {
                let middle = (1u32 << level) / 2;
                let at = octant.offset().map(|o| middle - 1 + o as u32);
                let key = NodeKey::new(level, at).expect("inside");
                if tree.node(key).is_some() {
                    compare_brick(&oracle, key, &tree.brick(key).expect("in memory"));
                }
            }
        }
    }
}

/// One of the 48 symmetries of the cube.
fn oriented(mesh: Mesh, turn: usize) -> Mesh {
    const ORDER: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let order = ORDER[turn / 8];
    let swapped = mesh.mapped(|v| order.map(|a| v[a]));
    let outward = if turn / 8 >= 3 { swapped.flipped() } else { swapped };
    outward.scaled([0, 1, 2].map(|a| if turn >> a & 1 == 1 { -1.0 } else { 1.0 }))
}
