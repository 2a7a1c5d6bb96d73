//! A small tree, given by a formula, for the tests of the store.

use super::{BrickTree, MemoryTree, Meta, Numbers, Refine, Source, StoreWriter};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Octant, RootCube};
use std::path::Path;

/// Metadata of the small tree.
pub fn meta(depth: u8) -> Meta {
    Meta {
        program: "brickfield 0.1.0".into(),
        sources: vec![Source {
            path: "parts/two boxes.stl".into(),
            bytes: 1284,
            facets: 24,
            format: "stl".into(),
            blake3: [7; 32],
        }],
        unit: "mm".into(),
        root: RootCube { origin: [-16.0, 0.0, 2.5], edge: 64.0 },
        bounds_min: [-15.0, 1.0, 3.5],
        bounds_max: [47.0, 63.0, 65.5],
        depth,
        refine: Refine::Hidden,
        stddev: 0.0,
        tolerance: None,
        numbers: Numbers { facets: 24, degenerate_facets: 0, nodes_per_level: vec![1, 8, 8] },
        beads: None,
    }
}

/// Winding number at a lattice position: two boxes, the second counted 200 times, so that differences need 16
/// bits; a box beside them, and one around a single sample, whose nodes need 8.
pub fn count_at(units: [i32; 3]) -> i16 {
    let inside = |min: [i32; 3], max: [i32; 3]| (0..3).all(|a| (min[a]..max[a]).contains(&units[a]));
    let first = inside([1 << 20, 1 << 20, 1 << 20], [7 << 20, 5 << 20, 6 << 20]);
    let second = inside([5 << 20, 3 << 20, 2 << 20], [9 << 20, 7 << 20, 4 << 20]);
    let third = inside([13 << 20, 1 << 20, 1 << 20], [15 << 20, 3 << 20, 2 << 20]);
    let corner = [9 << 20, 5 << 20, 5 << 20];
    let single = inside(corner, corner.map(|c| c + (1 << 17)));
    i16::from(first) + 200 * i16::from(second) + i16::from(third) + i16::from(single)
}

/// The brick of a node by formula.
pub fn brick_at(key: NodeKey, leaf: bool) -> Brick {
    let mut samples = Samples::filled(0);
    for index in 0..POINTS {
        let ijk = [index % BRICK_POINTS, index / BRICK_POINTS % BRICK_POINTS, index / BRICK_POINTS.pow(2)];
        let base = key.base();
        samples.0[index] = count_at([0, 1, 2].map(|a| base[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1));
    }
    let (min, max) = samples.range();
    if min == max {
        return Brick::Uniform(min);
    }
    let mut hermite = Hermite::default();
    if leaf {
        let counts = SignChanges::of(&samples).counts();
        for axis in Axis::ALL {
            let mut normal = [0; 3];
            normal[axis.index()] = 1;
            let normal = OctNormal::from_integer(normal);
            let edge = |i| HermiteEdge { offset: (i / 32 * 257 + i % 2 * 7919) as u16, normal };
            hermite.edges[axis.index()] = (0..counts[axis.index()]).map(edge).collect();
        }
    }
    Brick::Counts { samples, hermite }
}

/// Nodes of the small tree in key order: the root, its children, the children of child 1.
pub fn nodes() -> Vec<(NodeKey, bool)> {
    let children = |key: NodeKey| Octant::all().map(move |octant| key.child(octant));
    let divided = NodeKey::new(1, [1, 0, 0]).expect("a node");
    let mut nodes = vec![(NodeKey::ROOT, false)];
    nodes.extend(children(NodeKey::ROOT).map(|key| (key, key != divided)));
    nodes.extend(children(divided).map(|key| (key, true)));
    nodes
}

/// The small tree in memory.
pub fn tree() -> MemoryTree {
    let mut tree = MemoryTree::new(meta(2).root);
    for (key, leaf) in nodes() {
        tree.insert(key, leaf, brick_at(key, leaf));
    }
    tree
}

/// Writes the small tree, the children before their parents.
pub fn write(path: &Path) {
    let tree = tree();
    let mut keys = tree.keys();
    keys.sort_by_key(|key| key.post_order());
    let mut writer = StoreWriter::create(path, &meta(2)).expect("a writable directory");
    for key in keys {
        let leaf = tree.node(key).expect("its own key").leaf;
        writer.append_brick(key, leaf, &tree.brick(key).expect("its own key")).expect("room on the disk");
    }
    writer.finish(meta(2)).expect("a complete tree");
}
