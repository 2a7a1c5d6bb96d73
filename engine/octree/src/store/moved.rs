//! A tree that lies elsewhere in the world.

use super::{BrickTree, NodeInfo};
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use std::sync::Arc;

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
