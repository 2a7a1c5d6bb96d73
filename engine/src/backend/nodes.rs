//! Nodes that may be divided, evaluated on a device some at a time, before it is decided what becomes of them.

use super::leaves::{Leaf, LeafQueue, Next};
use super::vulkan::Vulkan;
use crate::brick::Brick;
use crate::lattice::NodeKey;
use std::collections::HashMap;

/// Evaluates nodes a few at a time; one per thread.
#[derive(Default)]
pub struct NodeQueue {
    queue: LeafQueue,
    ready: HashMap<NodeKey, NodeBrick>,
}

/// What a device made of a node.
#[derive(Clone, Debug)]
pub struct NodeBrick {
    /// The node as a leaf.
    pub brick: Brick,
    /// Whether an edge holds crossings where the winding number rises and some where it falls.
    pub has_hidden_crossings: bool,
}

impl NodeQueue {
    /// Evaluates some nodes, which [`NodeQueue::take`] then gives; none of those that the device cannot do.
    pub fn find(&mut self, vulkan: &Vulkan, nodes: &[Leaf<'_>]) {
        self.queue.begin_with(vulkan, true);
        for node in nodes {
            if let Next::There { brick, is_hidden } = self.queue.next_there(vulkan, nodes) {
                self.ready.insert(node.key, NodeBrick { brick, has_hidden_crossings: is_hidden });
            }
        }
    }

    /// What was found for a node, if anything was.
    pub fn take(&mut self, vulkan: &Vulkan, key: NodeKey) -> Option<NodeBrick> {
        let found = self.ready.remove(&key);
        if found.is_none() {
            vulkan.report().cpu_bricks += 1;
        }
        found
    }
}
