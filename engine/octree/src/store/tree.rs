//! The one view of a brick octree that everything above the store works on.

use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, RootCube};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is known of a node without reading its brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeInfo {
    /// True for a leaf; an interior node has all eight children.
    pub leaf: bool,
    /// Smallest sample, apron included.
    pub min: i16,
    /// Largest sample, apron included.
    pub max: i16,
    /// Whether samples have binary places; `min` and `max` are rounded then.
    pub fractions: bool,
}

impl NodeInfo {
    /// The one value of all samples, where it is known without reading the brick.
    pub fn uniform(&self) -> Option<i16> {
        (self.min == self.max && !self.fractions).then_some(self.min)
    }
}

/// A complete brick octree: every node is a leaf or has all eight children.
pub trait BrickTree: Sync {
    /// Where the lattice lies in the world.
    fn root(&self) -> RootCube;
    /// The node, if the tree has it.
    fn node(&self, key: NodeKey) -> Option<NodeInfo>;
    /// All nodes in key order: by level, along the Morton curve within a level.
    fn keys(&self) -> Vec<NodeKey>;
    /// The deepest level that has a node; 0 of an empty tree.
    fn deepest_level(&self) -> u8 {
        self.keys().last().map_or(0, |key| key.level())
    }
    /// The node's brick, verified and decoded.
    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>>;
    /// The same for who does not come back for it, so that it need not be kept.
    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.brick(key)
    }
    /// Tells which bricks will be asked for next, in this order, so that the tree can have the first of them fetched
    /// meanwhile. Returns how many it took note of; of the others it is to be told again. See [`super::Walk`].
    fn ahead(&self, keys: &[NodeKey]) -> usize {
        keys.len()
    }
    /// Whether a brick takes a while to come, so that it pays to know before which ones are needed.
    fn is_elsewhere(&self) -> bool {
        false
    }
}

/// Fails if a tree has no node of a level.
///
/// # Errors
/// [`Error::Setting`] with the levels that it has.
pub fn require_level(tree: &dyn BrickTree, level: u8) -> Result<()> {
    let deepest = tree.deepest_level();
    if level <= deepest {
        return Ok(());
    }
    let what = format!("there is no level {level}, the deepest is {deepest}");
    Err(Error::setting(what, format!("choose a level from 0 to {deepest}")))
}

/// A tree in memory, for tests and small work.
pub struct MemoryTree {
    root: RootCube,
    nodes: BTreeMap<NodeKey, (bool, Arc<Brick>)>,
}

impl MemoryTree {
    /// An empty tree in `root`.
    pub fn new(root: RootCube) -> MemoryTree {
        MemoryTree { root, nodes: BTreeMap::new() }
    }

    /// Adds or replaces a node.
    pub fn insert(&mut self, key: NodeKey, leaf: bool, brick: Brick) {
        self.nodes.insert(key, (leaf, Arc::new(brick)));
    }
}

impl BrickTree for MemoryTree {
    fn root(&self) -> RootCube {
        self.root
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        let (leaf, brick) = self.nodes.get(&key)?;
        let (min, max) = brick.range();
        Some(NodeInfo { leaf: *leaf, min, max, fractions: brick.has_fractions() })
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.nodes.keys().copied().collect()
    }

    fn deepest_level(&self) -> u8 {
        self.nodes.last_key_value().map_or(0, |(key, _)| key.level())
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(Arc::clone(&self.nodes[&key].1))
    }
}
