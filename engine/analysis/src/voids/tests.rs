//! Partitions of whole trees against a flood of the dense grid.

use super::components::tests::flooded;
use super::*;
use crate::brick::{Brick, Hermite, POINTS, Samples, point_position};
use crate::lattice::{BRICK_CELLS, NodeKey, Octant, RootCube, mix};
use crate::progress::Silent;
use crate::store::MemoryTree;
use brickfield_core::sweep::part_or_all;
use std::collections::HashMap;

/// Samples an axis of the deepest level of the trees.
const AXIS: usize = BRICK_CELLS << 2;

/// A random pile of balls and holes in the middle of the root, as samples of the deepest level.
fn pile(seed: u64) -> Vec<bool> {
    let random = |n: u64| mix(seed.wrapping_mul(1000).wrapping_add(n)) % 1024;
    let balls: Vec<([i64; 3], i64, bool)> = (0..60)
        .map(|n| {
            let at = [0, 1, 2].map(|a| 8 + (random(8 * n + a) % 112) as i64);
            (at, 2 + (random(8 * n + 3) % 12) as i64, random(8 * n + 4) % 3 > 0)
        })
        .collect();
    let inside = |at: [usize; 3]| {
        // Like a part: nothing on the root's own faces.
        let is_margin = at.iter().any(|&c| c < 2 || c + 2 >= AXIS);
        let mut solid = false;
        for (centre, radius, adds) in &balls {
            let squared: i64 = (0..3).map(|a| (at[a] as i64 - centre[a]).pow(2)).sum();
            // A shell of noise makes many small components.
            if squared <= radius * radius {
                solid = *adds;
            } else if squared <= radius * radius + radius {
                solid = mix(seed ^ (at[0] | at[1] << 8 | at[2] << 16) as u64).is_multiple_of(3);
            }
        }
        solid && !is_margin
    };
    (0..AXIS.pow(3)).map(|n| inside([n % AXIS, n / AXIS % AXIS, n / AXIS / AXIS])).collect()
}

/// The tree of such samples: leaves of level 1 where all samples are alike, of level 2 elsewhere.
fn tree_of(inside: &[bool]) -> MemoryTree {
    let at = |[x, y, z]: [usize; 3]| x < AXIS && y < AXIS && z < AXIS && inside[(z * AXIS + y) * AXIS + x];
    let brick = |key: NodeKey| {
        let step = 1usize << (2 - key.level());
        let first = key.position().map(|p| p as usize * BRICK_CELLS * step);
        let mut samples = Samples::filled(0);
        for n in 0..POINTS {
            let ijk = point_position(n);
            samples.0[n] = i16::from(at([0, 1, 2].map(|a| first[a] + ijk[a] * step)));
        }
        Brick::from_samples(samples, Hermite::default())
    };
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 1.0 });
    tree.insert(NodeKey::ROOT, false, brick(NodeKey::ROOT));
    for octant in Octant::all() {
        let child = NodeKey::ROOT.child(octant);
        let first = child.position().map(|p| p as usize * 2 * BRICK_CELLS);
        let all = |n: usize| {
            let n = [n % 65, n / 65 % 65, n / 65 / 65];
            at([0, 1, 2].map(|a| first[a] + n[a]))
        };
        let uniform = (1..65usize.pow(3)).all(|n| all(n) == all(0));
        tree.insert(child, uniform, brick(child));
        if !uniform {
            Octant::all().for_each(|o| tree.insert(child.child(o), true, brick(child.child(o))));
        }
    }
    tree
}

/// The component of each sample of the deepest level; `None` outside.
fn labels(tree: &MemoryTree, found: &Labelling) -> Vec<Option<usize>> {
    let mut labels = vec![None; AXIS.pow(3)];
    for (leaf, key) in found.order.keys().iter().enumerate() {
        let step = 1usize << (2 - key.level());
        let first = key.position().map(|p| p as usize * BRICK_CELLS * step);
        let brick = crate::store::BrickTree::brick(tree, *key).unwrap();
        let (components, _) = super::components::Components::of(&brick, found.connectivity);
        for n in 0..(BRICK_CELLS * step).pow(3) {
            let size = BRICK_CELLS * step;
            let at = [n % size, n / size % size, n / size / size];
            let [x, y, z] = [0, 1, 2].map(|a| first[a] + at[a]);
            labels[(z * AXIS + y) * AXIS + x] = found.of(leaf, components.at(at.map(|c| c / step)));
        }
    }
    labels
}

#[test]
fn the_partition_is_that_of_a_flood() {
    for seed in part_or_all(0..1, 0..3) {
        let inside = pile(seed);
        let tree = tree_of(&inside);
        for connectivity in [Connectivity::VoidSix, Connectivity::VoidTwentySix] {
            let found = label(&tree, connectivity, &Silent).unwrap();
            let levels: Vec<u8> = found.order.keys().iter().map(|key| key.level()).collect();
            assert!(levels.contains(&2));
            let flooded = flooded(&inside, AXIS, connectivity);
            let labels = labels(&tree, &found);
            // What touches the border of the grid is outside: by the pile it is one component.
            let outside = flooded[0];
            let mut names: HashMap<u32, Option<usize>> = HashMap::from([(outside, None)]);
            let mut counts = HashMap::new();
            for n in 0..inside.len() {
                assert_eq!(*names.entry(flooded[n]).or_insert(labels[n]), labels[n], "at {n}");
                *counts.entry(labels[n]).or_insert(0u128) += 1;
                assert!(labels[n].is_none_or(|c| found.components[c].solid == inside[n]));
            }
            // As many names as components, so none stands for two.
            assert_eq!(names.len(), found.components.len() + 1);
            let unit = 1u128 << (3 * crate::lattice::spacing_bits(2));
            for (number, component) in found.components.iter().enumerate() {
                assert_eq!(component.sums.samples, counts[&Some(number)] * unit);
            }
            assert_eq!(found.outside.samples, counts[&None] * unit);
        }
    }
}

#[test]
fn a_uniform_coarse_leaf_joins_what_touches_it() {
    let mut inside = vec![false; AXIS.pow(3)];
    // A shell around a void that fills one leaf of level 1 and reaches into its neighbour.
    for (n, inside) in inside.iter_mut().enumerate() {
        let at = [n % AXIS, n / AXIS % AXIS, n / AXIS / AXIS];
        let outer = at.iter().all(|&c| (2..126).contains(&c));
        let void = (4..70).contains(&at[0]) && at[1..].iter().all(|&c| (4..124).contains(&c));
        *inside = outer && !void;
    }
    let found = label(&tree_of(&inside), Connectivity::VoidSix, &Silent).unwrap();
    let solids = found.components.iter().filter(|c| c.solid).count();
    assert_eq!((found.components.len(), solids), (2, 1));
    let void = found.components.iter().find(|c| !c.solid).unwrap();
    assert_eq!(void.sums.euler, 1);
    let shell = found.components.iter().find(|c| c.solid).unwrap();
    // A shell has a hole: two boundaries of Euler number 2 each.
    assert_eq!(shell.sums.euler, 2);
}
