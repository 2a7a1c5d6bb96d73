//! A thread's outlet to a device: batches of bricks of closed soups, and what becomes of those that fail.

use super::batch::{BatchLeaf, fitting, pack};
use super::vulkan::Vulkan;
use crate::gpu::{BatchInput, BatchOutput, DeviceFailure, DeviceLane};

/// A thread's outlet to a device.
#[derive(Default)]
pub(super) struct DeviceQueue {
    /// `None` before the first batch; `Some(None)` if the device has no room.
    lane: Option<Option<DeviceLane>>,
    /// Bricks in a batch, at most.
    limit: usize,
    input: BatchInput,
}

/// What became of some leaves, from the first on.
pub(super) enum Submission {
    /// So many are a batch on the device.
    There(usize),
    /// So many are the processor's.
    Here(usize),
    /// A batch must be received, and released, before.
    Later,
}

impl DeviceQueue {
    /// Begins with other leaves, while nothing is under way; those that are read back may be of bricks that `may_divide`.
    pub fn begin(&mut self, vulkan: &Vulkan, may_divide: bool) {
        self.input.may_divide = may_divide;
        let gpu = vulkan.of_thread();
        let moves = |lane: &Option<DeviceLane>| lane.as_ref().is_some_and(|lane| !lane.is_on(gpu));
        if self.lane.as_ref().is_none_or(moves) {
            // Dropped first, for the next one needs its memory.
            self.lane = None;
            let lane = vulkan.lane(gpu);
            self.limit = lane.as_ref().map_or(0, |lane| lane.room().0);
            self.lane = Some(lane);
        }
    }

    /// Receives and forgets what is under way.
    pub fn drain(&mut self, vulkan: &Vulkan) {
        if let Some(Some(lane)) = &mut self.lane {
            lane.release();
            while !lane.is_idle() {
                if let Err(failure) = lane.receive() {
                    vulkan.note_failure(failure);
                }
                lane.release();
            }
        }
    }

    /// Whether it has no lane, because the device has no room or failed.
    pub fn is_shut(&self) -> bool {
        !matches!(self.lane, Some(Some(_)))
    }

    /// Whether its lane is on the second device of the hardware.
    pub fn is_on_second(&self, vulkan: &Vulkan) -> bool {
        matches!(&self.lane, Some(Some(lane)) if !lane.is_on(vulkan.gpu()))
    }

    /// Sends some of the leaves, from the first on, of which there is at least one.
    pub fn send(&mut self, vulkan: &Vulkan, leaves: &[BatchLeaf<'_>]) -> Submission {
        loop {
            let Some(Some(lane)) = &mut self.lane else { return Submission::Here(leaves.len()) };
            if lane.is_full() {
                return Submission::Later;
            }
            let bricks = fitting(leaves, self.limit, lane.room().1);
            if bricks == 0 {
                return Submission::Here(1);
            }
            pack(&mut self.input, &leaves[..bricks]);
            match lane.submit(&self.input, self.limit) {
                Ok(()) => return Submission::There(bricks),
                Err(failure) => self.give_way(vulkan, failure, bricks),
            }
        }
    }

    /// Waits for the oldest batch, of so many bricks; whether it is there to be read.
    pub fn receive(&mut self, vulkan: &Vulkan, bricks: usize) -> bool {
        let Some(Some(lane)) = &mut self.lane else { return false };
        match lane.receive() {
            Ok(seconds) => {
                vulkan.note_batch(seconds, bricks);
                true
            }
            Err(failure) => {
                self.give_way(vulkan, failure, bricks);
                false
            }
        }
    }

    /// What was received last.
    pub fn output(&self) -> Option<BatchOutput<'_>> {
        self.lane.as_ref()?.as_ref()?.output()
    }

    /// Gives the place of what was received to the next batch. Where buffers were too small for one of its bricks the next
    /// have fewer, so that these share the room for edges.
    pub fn release(&mut self, was_full: bool) {
        if was_full && self.limit > 1 {
            self.limit /= 2;
        }
        if let Some(Some(lane)) = &mut self.lane {
            lane.release();
        }
    }

    /// After a failed batch: the next has half as many bricks, or the processor takes over.
    fn give_way(&mut self, vulkan: &Vulkan, failure: DeviceFailure, bricks: usize) {
        vulkan.note_failure(failure);
        if failure.may_pass_with_less() && bricks > 1 {
            self.limit = bricks / 2;
            vulkan.report().retries += 1;
        } else {
            self.lane = Some(None);
        }
    }
}
