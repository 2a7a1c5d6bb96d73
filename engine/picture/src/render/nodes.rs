//! The tree as rays see it: which nodes hold nothing to be seen.

use crate::lattice::NodeKey;
use crate::store::BrickTree;

/// Bytes that a node of a tree takes for pictures: what rays know of it, and its key, by which bricks are found.
pub const NODE_BYTES: u64 = (size_of::<RayNode>() + size_of::<NodeKey>()) as u64;

/// What is known of a node and of all below it.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayNode {
    /// Number of its first child, the others following; 0 where it has none, or none that count.
    pub children: u32,
    /// Smallest and largest sample of the leaves below, or of the node's own as a leaf.
    pub range: (i16, i16),
    /// Of the node's own samples.
    pub own: (i16, i16),
    /// Whether samples below have binary places, so that `range` is rounded.
    pub fractions: bool,
}

/// All nodes down to a level, level by level.
pub(super) struct Nodes(Vec<RayNode>);

impl Nodes {
    /// The nodes of a complete tree, which come along the Morton curve level by level, so that the children of a level's
    /// interior nodes are the next level.
    pub fn new(tree: &dyn BrickTree, level: u8) -> Nodes {
        let keys = tree.keys();
        let keys = &keys[..keys.partition_point(|key| key.level() <= level)];
        // Where each has room from the beginning, none is held twice while room is made.
        let mut nodes = Vec::with_capacity(keys.len());
        let mut interior = Vec::new();
        for &key in keys {
            let Some(info) = tree.node(key) else { continue };
            if !info.leaf && key.level() < level {
                interior.push(nodes.len());
            }
            let own = (info.min, info.max);
            nodes.push(RayNode { children: 0, range: own, own, fractions: info.fractions });
        }
        for (rank, &parent) in interior.iter().enumerate().rev() {
            let first = 1 + 8 * rank;
            // A tree that contradicts itself has holes; they show as coarse bricks.
            let Some(children) = nodes.get(first..first + 8) else { continue };
            let low = children.iter().map(|child| child.range.0).min().unwrap_or(0);
            let high = children.iter().map(|child| child.range.1).max().unwrap_or(0);
            let fractions = children.iter().any(|child| child.fractions);
            let node: &mut RayNode = &mut nodes[parent];
            (node.children, node.range, node.fractions) = (first as u32, (low, high), fractions);
        }
        Nodes(nodes)
    }

    pub fn get(&self, number: u32) -> RayNode {
        self.0[number as usize]
    }

    pub fn iter(&self) -> impl Iterator<Item = &RayNode> {
        self.0.iter()
    }

    /// The keys of as many first nodes: those of `tree` as [`Nodes::new`] counts them.
    pub fn keys(&self, tree: &dyn BrickTree) -> Vec<NodeKey> {
        let there = tree.keys().into_iter().filter(|key| tree.node(*key).is_some());
        there.take(self.0.len()).collect()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
