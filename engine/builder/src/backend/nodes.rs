//! Nodes that may be divided, evaluated on a device some at a time, before it is decided what becomes of them.

use super::batch::{BatchLeaf, unpack};
use super::check::{KernelSet, check};
use super::device_queue::{DeviceQueue, Submission};
use super::vulkan::Vulkan;
use crate::brick::{Brick, Hermite, Samples};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::winding::Evaluator;
use std::collections::{HashMap, VecDeque};

/// Evaluates nodes a few at a time; one per thread.
#[derive(Default)]
pub struct NodeQueue {
    outlet: DeviceQueue,
    /// Batches that are under way, the oldest first.
    pending: VecDeque<Vec<NodeKey>>,
    ready: HashMap<NodeKey, NodeBrick>,
}

/// What a device made of a node.
#[derive(Clone, Debug)]
pub struct NodeBrick {
    /// The node's samples.
    pub samples: Samples,
    /// Its Hermite edges; `None` if all samples are equal.
    pub hermite: Option<Hermite>,
    /// Crossings of triangles with its lattice edges.
    pub crossings: u32,
}

impl NodeBrick {
    pub(super) fn new(brick: Brick, crossings: u32) -> NodeBrick {
        match brick {
            Brick::Uniform(w) => NodeBrick { samples: Samples::filled(w), hermite: None, crossings },
            Brick::Counts { samples, hermite } => NodeBrick { samples, hermite: Some(hermite), crossings },
        }
    }

    /// Whether an edge holds crossings where the winding number rises and some where it falls. The samples at its ends
    /// differ by the sum of the jumps of 1 at its crossings: by as many as there are if all go one way, and by fewer if not.
    pub fn has_hidden_crossings(&self) -> bool {
        self.samples.variation() != u64::from(self.crossings)
    }

    /// Whether something may lie between its samples: crossings that cancel, or, where all samples are equal, something that
    /// has no crossing.
    pub fn may_hide(&self) -> bool {
        self.hermite.is_none() || self.has_hidden_crossings()
    }

    /// Whether the node as a leaf would be this brick.
    pub(super) fn is_brick(&self, brick: &Brick) -> bool {
        match (brick, &self.hermite) {
            (Brick::Uniform(w), None) => self.samples.0[0] == *w,
            (Brick::Counts { samples, hermite }, Some(found)) => *samples == self.samples && hermite == found,
            _ => false,
        }
    }

    /// The node as a leaf.
    pub fn into_leaf(self) -> Brick {
        match self.hermite {
            Some(hermite) => Brick::Counts { samples: self.samples, hermite },
            None => Brick::Uniform(self.samples.0[0]),
        }
    }
}

impl NodeQueue {
    /// Sends some nodes, which [`NodeQueue::take`] then gives.
    pub fn find(&mut self, vulkan: &Vulkan, nodes: &[BatchLeaf<'_>]) {
        if self.pending.is_empty() {
            self.outlet.begin(vulkan, true);
        }
        let mut left = nodes;
        while !left.is_empty() {
            match self.outlet.send(vulkan, left) {
                Submission::There(count) => {
                    self.pending.push_back(left[..count].iter().map(|node| node.key).collect());
                    left = &left[count..];
                }
                Submission::Here(count) => left = &left[count..],
                Submission::Later => self.receive(vulkan),
            }
        }
    }

    /// What the device made of a node, if it was sent and the device could do it.
    pub fn take(&mut self, vulkan: &Vulkan, key: NodeKey) -> Option<NodeBrick> {
        while self.pending.iter().any(|batch| batch.contains(&key)) {
            self.receive(vulkan);
        }
        let found = self.ready.remove(&key);
        if found.is_none() {
            vulkan.report().cpu_bricks += 1;
        }
        found
    }

    /// As [`NodeQueue::take`], compared with the processor's if it is to be checked.
    ///
    /// # Errors
    /// [`Error::Distrusted`](crate::error::Error::Distrusted) if it is another; as [`Evaluator::evaluate`].
    pub fn take_checked(
        &mut self,
        vulkan: &Vulkan,
        evaluator: &mut Evaluator,
        node: &BatchLeaf<'_>,
    ) -> Result<Option<NodeBrick>> {
        let found = self.take(vulkan, node.key);
        if let Some(found) = &found {
            let is_seconds = self.outlet.is_on_second(vulkan);
            check(vulkan, (KernelSet::Nodes, is_seconds), node, found, evaluator)?;
        }
        Ok(found)
    }

    /// Receives the oldest batch.
    fn receive(&mut self, vulkan: &Vulkan) {
        let Some(batch) = self.pending.pop_front() else { return };
        if !self.outlet.receive(vulkan, batch.len()) {
            return;
        }
        let output = self.outlet.output().expect("it was just received");
        for (number, key) in batch.into_iter().enumerate() {
            match unpack(&output, number) {
                Some(brick) => {
                    let crossings = output.bricks[number].crossings;
                    self.ready.insert(key, NodeBrick::new(brick, crossings));
                }
                None => vulkan.report().bricks -= 1,
            }
        }
        self.outlet.release(false);
    }
}
