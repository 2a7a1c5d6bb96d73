//! Leaves of subtrees, evaluated ahead of their turn in batches on a device.
//!
//! What the device cannot do, or fails to do, the processor does with the same result. These are bricks with too many
//! triangles or spans for the buffers, with jumps beyond 8 bits, or with too many crossings on an edge. Winding
//! numbers beyond 16 bits end in an error. After a device was lost, everything is the processor's.

use super::batch::{BatchLeaf, unpack};
use super::check::check;
use super::device_queue::{DeviceQueue, Submission};
use super::node_brick::NodeBrick;
use super::trust::KernelSet;
use super::vulkan::Vulkan;
use crate::brick::{Brick, ThinFeatures, ThinLines};
use crate::error::Result;
use crate::winding::Evaluator;
use brickfield_shaders as shaders;
use std::collections::VecDeque;
use std::ops::Range;

/// Some leaves, on their way.
enum Work {
    /// A batch on the device.
    There(Range<usize>),
    /// For the processor.
    Here(Range<usize>),
}

/// Evaluates leaves in their order; one per thread.
#[derive(Default)]
pub struct LeafQueue {
    outlet: DeviceQueue,
    /// Leaves that were sent.
    sent: usize,
    work: VecDeque<Work>,
    received: Option<ReceivedBatch>,
}

/// A batch that the device is done with. Its bricks are unpacked one by one, when they are asked for: all 64 at once are
/// 6 MB, which leave the caches again and which the allocator returns to the system after every batch.
struct ReceivedBatch {
    /// Its leaves that are left.
    leaves: Range<usize>,
    /// The next of them in the batch.
    number: usize,
    /// Whether its buffers were too small for one.
    is_full: bool,
}

/// A leaf by the processor, in place of the device.
fn here(vulkan: &Vulkan, evaluator: &mut Evaluator, leaf: &BatchLeaf<'_>) -> Result<(Brick, ThinFeatures)> {
    vulkan.report().cpu_bricks += 1;
    let evaluation = leaf.evaluate(evaluator)?;
    let thin = evaluation.thin(ThinLines::Sixteenth);
    Ok((evaluation.into_leaf()?, thin))
}

impl LeafQueue {
    /// Begins with other leaves.
    pub fn begin(&mut self, vulkan: &Vulkan) {
        // What a run that ended early left behind.
        self.outlet.drain(vulkan);
        self.sent = 0;
        self.received = None;
        self.work.clear();
        self.outlet.begin(vulkan, false);
    }

    /// The brick of the next leaf; must be called once for each of the leaves, which are the same in every call.
    ///
    /// # Errors
    /// [`Error::Distrusted`](crate::error::Error::Distrusted) if the device computes otherwise than the processor; as
    /// [`Evaluator::evaluate`].
    pub fn next(
        &mut self,
        vulkan: &Vulkan,
        evaluator: &mut Evaluator,
        leaves: &[BatchLeaf<'_>],
    ) -> Result<(Brick, ThinFeatures)> {
        loop {
            self.send(vulkan, leaves);
            if let Some(received) = self.received.take() {
                let number = received.leaves.start;
                let is_seconds = self.outlet.is_on_second(vulkan);
                let found = self.take(vulkan, received);
                if let Some(found) = &found {
                    check(vulkan, (KernelSet::Leaves, is_seconds), &leaves[number], found, evaluator)?;
                }
                return match found {
                    // The processor looks where something may hide.
                    Some(found) if found.may_hide() => {
                        let thin = leaves[number].evaluate(evaluator)?.thin(ThinLines::Sixteenth);
                        Ok((found.into_leaf(), thin))
                    }
                    Some(found) => Ok((found.into_leaf(), ThinFeatures::default())),
                    None => here(vulkan, evaluator, &leaves[number]),
                };
            }
            match self.work.pop_front() {
                Some(Work::Here(range)) => {
                    if range.len() > 1 {
                        self.work.push_front(Work::Here(range.start + 1..range.end));
                    }
                    return here(vulkan, evaluator, &leaves[range.start]);
                }
                Some(Work::There(leaves)) if self.outlet.receive(vulkan, leaves.len()) => {
                    self.received = Some(ReceivedBatch { leaves, number: 0, is_full: false });
                }
                Some(Work::There(range)) => self.work.push_front(Work::Here(range)),
                None => unreachable!("the queue is asked for as many bricks as there are leaves"),
            }
        }
    }

    /// Sends batches as long as the lane takes any.
    fn send(&mut self, vulkan: &Vulkan, leaves: &[BatchLeaf<'_>]) {
        while self.sent < leaves.len() {
            let from = self.sent;
            let work = match self.outlet.send(vulkan, &leaves[from..]) {
                Submission::There(count) => Work::There(from..from + count),
                Submission::Here(count) => Work::Here(from..from + count),
                Submission::Later => break,
            };
            let (Work::There(range) | Work::Here(range)) = &work;
            self.sent = range.end;
            self.work.push_back(work);
        }
        if self.outlet.is_shut()
            && let Some(received) = self.received.take()
        {
            self.work.push_front(Work::Here(received.leaves));
        }
    }

    /// What the device found of the next brick of the batch that was received; `None` if the device did not do it.
    fn take(&mut self, vulkan: &Vulkan, received: ReceivedBatch) -> Option<NodeBrick> {
        let ReceivedBatch { leaves, number, mut is_full } = received;
        let output = self.outlet.output().expect("it is not released yet");
        let crossings = output.bricks[number].crossings;
        let brick = unpack(&output, number).map(|brick| NodeBrick::new(brick, crossings));
        is_full |= output.bricks[number].flags & shaders::FULL != 0;
        let leaves = leaves.start + 1..leaves.end;
        if leaves.is_empty() {
            self.outlet.release(is_full);
        } else {
            self.received = Some(ReceivedBatch { leaves, number: number + 1, is_full });
        }
        if brick.is_none() {
            vulkan.report().bricks -= 1;
        }
        brick
    }
}
