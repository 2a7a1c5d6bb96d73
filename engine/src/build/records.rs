//! What a subtree leaves behind: its nodes in post-order, encoded for the store or kept as they are.

use crate::brick::Brick;
use crate::lattice::NodeKey;

/// Receives the nodes of a subtree.
pub(super) trait Recorder: Default + Send {
    /// Adds a node.
    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick);
}

/// Bricks as they are, for trees in memory.
#[derive(Default)]
pub(super) struct KeptBricks(pub Vec<(NodeKey, bool, Brick)>);

impl Recorder for KeptBricks {
    fn push(&mut self, key: NodeKey, leaf: bool, brick: &Brick) {
        self.0.push((key, leaf, brick.clone()));
    }
}
