//! Nodes that may be divided, evaluated on a device some at a time, before it is decided what becomes of them.

use super::batch::{BatchLeaf, unpack};
use super::check::check;
use super::device_queue::{DeviceQueue, Submission};
use super::node_brick::NodeBrick;
use super::trust::KernelSet;
use super::vulkan::Vulkan;
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
