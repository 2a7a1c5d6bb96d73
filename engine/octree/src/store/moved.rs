//! A tree that lies elsewhere in the world.

use super::{BrickTree, NodeInfo};
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use std::sync::Arc;

/// Trees that lie farther from the origin, in edges of their root cube, are looked at from their middle.
const FAR_EDGES: f64 = 64.0;

/// A tree whose world has another origin: what has large coordinates is worked on near 0, where 32 bits tell more.
pub struct MovedTree<'a> {
    tree: &'a dyn BrickTree,
    root: RootCube,
}

impl<'a> MovedTree<'a> {
    /// A tree in a world whose origin is a position of the tree's own.
    pub fn new(tree: &'a dyn BrickTree, origin: [f64; 3]) -> MovedTree<'a> {
        let RootCube { origin: corner, edge } = tree.root();
        let root = RootCube { origin: std::array::from_fn(|a| corner[a] - origin[a]), edge };
        MovedTree { tree, root }
    }

    /// An origin near the tree that is easy to say: the middle of the root cube in steps of the power of ten that is at most
    /// the cube's edge. It depends on nothing else.
    pub fn round_middle(tree: &dyn BrickTree) -> [f64; 3] {
        let edge = tree.root().edge;
        let (mut step, mut parts) = (1.0, 1.0);
        while step * 10.0 <= edge {
            step *= 10.0;
        }
        // Tenths have no exact numbers, but wholes to be divided by have.
        while step / parts > edge && parts < 1e18 {
            parts *= 10.0;
        }
        MovedTree::middle(tree).map(|c| (c * parts / step).round() * step / parts)
    }

    /// Whether a tree lies so far from the origin that coordinates of 32 bits would show.
    pub fn is_far(tree: &dyn BrickTree) -> bool {
        tree.root().farthest() > FAR_EDGES * tree.root().edge
    }

    /// A good origin for it: the middle of the root cube.
    pub fn middle(tree: &dyn BrickTree) -> [f64; 3] {
        let RootCube { origin, edge } = tree.root();
        origin.map(|c| c + edge / 2.0)
    }
}

impl BrickTree for MovedTree<'_> {
    fn root(&self) -> RootCube {
        self.root
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        self.tree.node(key)
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.tree.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.tree.deepest_level()
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.tree.brick(key)
    }

    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.tree.brick_once(key)
    }

    fn ahead(&self, keys: &[NodeKey]) -> usize {
        self.tree.ahead(keys)
    }

    fn is_elsewhere(&self) -> bool {
        self.tree.is_elsewhere()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::MemoryTree;

    #[test]
    fn origins_are_round_and_near() {
        let of = |origin: [f64; 3], edge: f64| {
            MovedTree::round_middle(&MemoryTree::new(RootCube { origin, edge }))
        };
        assert_eq!(of([500_121.2, 5_000_454.4, 117.9], 4.13), [500_123.0, 5_000_456.0, 120.0]);
        assert_eq!(of([500_121.2, 5_000_454.4, 117.9], 10.0), [500_130.0, 5_000_460.0, 120.0]);
        assert_eq!(of([-7312.0, 0.0, 1.0], 999.0), [-6800.0, 500.0, 500.0]);
        assert_eq!(of([3.333_333, 0.0, 0.0], 0.05), [3.36, 0.03, 0.03]);
        for edge in [1e-9, 0.7, 3.0, 1e5, 2e9] {
            let (corner, found) = ([1e7, -3.0, 0.123], of([1e7, -3.0, 0.123], edge));
            let middle = corner.map(|c| c + edge / 2.0);
            assert!((0..3).all(|a| (found[a] - middle[a]).abs() <= 0.51 * edge + 1e-8), "{edge} {found:?}");
        }
    }
}
