//! Leaves of subtrees, evaluated ahead of their turn in batches on a device.
//!
//! What the device cannot do, or fails to do, the processor does with the same result: bricks with too many triangles
//! or spans for the buffers, with jumps beyond 8 bits, or with too many crossings on an edge; winding numbers beyond 16
//! bits, which end in an error; and everything after the device was lost.

use super::vulkan::Vulkan;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples};
use crate::error::Result;
use crate::gpu::{BatchInput, BatchOutput, Failure, Lane};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle, Units};
use crate::winding::{Evaluation, Evaluator, Triangles};
use brickfield_shaders as shaders;
use std::collections::VecDeque;
use std::ops::Range;

/// Triangles of a brick that a device takes.
const PAIRS_OF_BRICK_MAX: usize = shaders::PAIRS_OF_BRICK_MAX as usize;

/// A leaf to evaluate, or a node that may become one.
#[derive(Clone, Copy)]
pub struct Leaf<'a, P = Triangle> {
    /// The brick.
    pub key: NodeKey,
    /// Its sample (0, 0, 0).
    pub corner: i16,
    /// Pieces of the field.
    pub array: &'a [P],
    /// Those of them that touch the brick.
    pub indices: &'a [u32],
}

impl<'a> Leaf<'a> {
    /// On the processor.
    ///
    /// # Errors
    /// As [`Evaluator::evaluate`].
    pub fn evaluate(&self, evaluator: &'a mut Evaluator) -> Result<Evaluation<'a>> {
        evaluator.evaluate(self.key, self.corner, Triangles { array: self.array, indices: self.indices })
    }
}

/// Some leaves, on their way.
enum Work {
    /// A batch on the device.
    Device(Range<usize>),
    /// For the processor.
    Cpu(Range<usize>),
}

/// Evaluates leaves in their order; one per thread.
#[derive(Default)]
pub struct LeafQueue {
    /// `None` before the first leaf; `Some(None)` if the device has no room.
    lane: Option<Option<Lane>>,
    /// Bricks in a batch, at most.
    limit: usize,
    input: BatchInput,
    /// Leaves that were sent.
    sent: usize,
    work: VecDeque<Work>,
    received: Option<Received>,
}

/// The next of some leaves.
pub(super) enum Next {
    /// A brick of the device's.
    There {
        brick: Brick,
        /// Whether it has hidden crossings, if that was asked for.
        is_hidden: bool,
    },
    /// One for the processor: the leaf's number.
    Here(usize),
}

/// A batch that the device is done with. Its bricks are unpacked one by one, when they are asked for: all 64 at once are
/// 6 MB, which leave the caches again and which the allocator returns to the system after every batch.
struct Received {
    /// Its leaves.
    leaves: Range<usize>,
    /// The next of them.
    next: usize,
    /// Whether its buffers were too small for one.
    is_full: bool,
}

// Bricks are the same on both sides.
const _: () = assert!(shaders::POINTS as usize == BRICK_POINTS && shaders::CELLS as usize == BRICK_CELLS);

impl LeafQueue {
    /// Begins with other leaves.
    pub fn begin(&mut self, vulkan: &Vulkan) {
        self.begin_with(vulkan, false);
    }

    /// The same; of bricks that may be divided hidden crossings are found, too.
    pub(super) fn begin_with(&mut self, vulkan: &Vulkan, may_divide: bool) {
        self.input.may_divide = may_divide;
        self.sent = 0;
        self.received = None;
        self.work.clear();
        let gpu = vulkan.of_thread();
        let moves = |lane: &Option<Lane>| lane.as_ref().is_some_and(|lane| !lane.is_on(gpu));
        if self.lane.as_ref().is_none_or(moves) {
            // Dropped first, for the next one needs its memory.
            self.lane = None;
            let lane = vulkan.lane(gpu);
            self.limit = lane.as_ref().map_or(0, |lane| lane.room().0);
            self.lane = Some(lane);
        }
        if let Some(Some(lane)) = &mut self.lane {
            if may_divide {
                self.limit = lane.room().0;
            }
            // What a run that ended early left behind.
            lane.release();
            while !lane.is_idle() {
                if let Err(failure) = lane.receive() {
                    vulkan.note_failure(failure);
                }
                lane.release();
            }
        }
    }

    /// The brick of the next leaf; must be called once for each of the leaves, which are the same in every call.
    ///
    /// # Errors
    /// As [`Evaluator::evaluate`].
    pub fn next(&mut self, vulkan: &Vulkan, evaluator: &mut Evaluator, leaves: &[Leaf<'_>]) -> Result<Brick> {
        match self.next_there(vulkan, leaves) {
            Next::There { brick, .. } => Ok(brick),
            Next::Here(number) => {
                vulkan.report().cpu_bricks += 1;
                leaves[number].evaluate(evaluator)?.into_leaf()
            }
        }
    }

    /// The same, but for what falls to the processor.
    pub(super) fn next_there(&mut self, vulkan: &Vulkan, leaves: &[Leaf<'_>]) -> Next {
        loop {
            self.send(vulkan, leaves);
            if self.received.is_some() {
                return self.take(vulkan);
            }
            match self.work.pop_front() {
                Some(Work::Cpu(range)) => {
                    if range.len() > 1 {
                        self.work.push_front(Work::Cpu(range.start + 1..range.end));
                    }
                    return Next::Here(range.start);
                }
                Some(Work::Device(range)) => self.receive(vulkan, range),
                None => unreachable!("the queue is asked for as many bricks as there are leaves"),
            }
        }
    }

    /// Sends batches as long as the lane takes any.
    fn send(&mut self, vulkan: &Vulkan, leaves: &[Leaf<'_>]) {
        while self.sent < leaves.len() {
            let Some(Some(lane)) = &mut self.lane else {
                self.work.push_back(Work::Cpu(self.sent..leaves.len()));
                self.sent = leaves.len();
                return;
            };
            if lane.is_full() {
                return;
            }
            let pairs_max = lane.room().1;
            let range = self.sent..self.sent + fitting(&leaves[self.sent..], self.limit, pairs_max).max(1);
            let batch = &leaves[range.clone()];
            if batch[0].indices.len() > pairs_max.min(PAIRS_OF_BRICK_MAX) {
                self.sent = range.end;
                self.work.push_back(Work::Cpu(range));
                continue;
            }
            pack(&mut self.input, batch);
            match lane.submit(&self.input, self.limit) {
                Ok(()) => {
                    self.sent = range.end;
                    self.work.push_back(Work::Device(range));
                }
                Err(failure) => self.give_way(vulkan, failure, range.len()),
            }
        }
    }

    /// After a failed batch: the next has half as many bricks, or the processor takes over.
    fn give_way(&mut self, vulkan: &Vulkan, failure: Failure, bricks: usize) {
        vulkan.note_failure(failure);
        if failure.may_pass_with_less() && bricks > 1 {
            self.limit = bricks / 2;
            vulkan.report().retries += 1;
        } else {
            self.lane = Some(None);
            let left = self.received.take().map(|received| received.next..received.leaves.end);
            left.into_iter().for_each(|range| self.work.push_front(Work::Cpu(range)));
        }
    }
}

impl LeafQueue {
    /// Receives the oldest batch.
    fn receive(&mut self, vulkan: &Vulkan, range: Range<usize>) {
        let Some(Some(lane)) = &mut self.lane else {
            self.work.push_front(Work::Cpu(range));
            return;
        };
        match lane.receive() {
            Ok(seconds) => {
                vulkan.note_batch(seconds, range.len());
                self.received = Some(Received { next: range.start, leaves: range, is_full: false });
            }
            Err(failure) => {
                self.give_way(vulkan, failure, range.len());
                self.work.push_front(Work::Cpu(range));
            }
        }
    }

    /// The next brick of the batch that was received; what the device did not do is the processor's.
    fn take(&mut self, vulkan: &Vulkan) -> Next {
        let (Some(Some(lane)), Some(received)) = (&mut self.lane, &mut self.received) else {
            unreachable!("a lane that fails takes what was received along");
        };
        let output = lane.output().expect("it is not released yet");
        let (leaf, number) = (received.next, received.next - received.leaves.start);
        let (brick, flags) = (unpack(&output, number), output.bricks[number].flags);
        received.is_full |= flags & shaders::FULL != 0;
        received.next += 1;
        if received.next == received.leaves.end {
            // What may be divided has more edges the farther up it is; leaves are much like each other.
            if received.is_full && self.limit > 1 && !self.input.may_divide {
                // Fewer bricks share the room for edges.
                self.limit /= 2;
            }
            self.received = None;
            lane.release();
        }
        match brick {
            Some(brick) => Next::There { brick, is_hidden: flags & shaders::HIDDEN != 0 },
            None => {
                vulkan.report().bricks -= 1;
                Next::Here(leaf)
            }
        }
    }
}

/// How many of the leaves, from the first on, make a batch of at most so many bricks and pairs.
fn fitting(leaves: &[Leaf<'_>], bricks: usize, pairs: usize) -> usize {
    let mut sum = 0;
    let fits = |leaf: &&Leaf<'_>| {
        sum += leaf.indices.len();
        sum <= pairs && leaf.indices.len() <= PAIRS_OF_BRICK_MAX
    };
    leaves.iter().take(bricks).take_while(fits).count()
}

/// Writes a batch down.
fn pack(input: &mut BatchInput, leaves: &[Leaf<'_>]) {
    input.clear();
    for (number, leaf) in (0..).zip(leaves) {
        input.bricks.push(shaders::Brick { corner: leaf.corner.into(), ..shaders::Brick::default() });
        let origin = leaf.key.base().map(|base| base + 1);
        let owner = number | leaf.key.spacing_bits() << 16;
        let relative = |v: Units| std::array::from_fn(|axis| v[axis] - origin[axis]);
        let pair = |&index: &u32| shaders::Pair { vertices: leaf.array[index as usize].map(relative), owner };
        input.pairs.extend(leaf.indices.iter().map(pair));
    }
}

/// The brick with this number in a batch; `None` if the device could not do it.
fn unpack(output: &BatchOutput<'_>, number: usize) -> Option<Brick> {
    const FAILED: u32 = shaders::EXCESS | shaders::FULL | shaders::TORN | shaders::CROWDED;
    let brick = &output.bricks[number];
    if brick.flags & FAILED != 0 {
        return None;
    }
    if brick.flags & shaders::VARIES == 0 {
        return Some(Brick::Uniform(brick.corner as i16));
    }
    let from = brick.edges_from as usize;
    let along_x = from + brick.edges_x as usize;
    let along_y = along_x + brick.edges_y as usize;
    let of = |range: Range<usize>| -> Vec<HermiteEdge> {
        let edge =
            |&[offset, normal]: &[u32; 2]| HermiteEdge { offset: offset as u16, normal: OctNormal(normal) };
        output.hermite[range].iter().map(edge).collect()
    };
    let edges = [of(from..along_x), of(along_x..along_y), of(along_y..from + brick.edges as usize)];
    Some(Brick::Counts { samples: unpack_samples(output, number), hermite: Hermite { edges } })
}

/// By edge of a row: all bits of the samples behind it, none of the others.
static BEHIND: [[i16; BRICK_POINTS]; BRICK_CELLS] = {
    let mut behind = [[0; BRICK_POINTS]; BRICK_CELLS];
    let mut edge = 0;
    while edge < BRICK_CELLS {
        let mut sample = edge + 1;
        while sample < BRICK_POINTS {
            behind[edge][sample] = -1;
            sample += 1;
        }
        edge += 1;
    }
    behind
};

fn unpack_samples(output: &BatchOutput<'_>, number: usize) -> Samples {
    const LINE_WORDS: usize = shaders::LINE_WORDS as usize;
    let lines = output.jumps[number].as_chunks::<LINE_WORDS>().0;
    let mut samples = Vec::with_capacity(POINTS);
    for ([start, touched], words) in output.rows[number].iter().zip(lines) {
        let mut row = [*start as i16; BRICK_POINTS];
        let biased = words.map(|word| word.wrapping_add(shaders::JUMP_BIAS));
        let biased: &[u8] = bytemuck::cast_slice(&biased);
        let mut left = *touched;
        while left != 0 {
            let edge = left.trailing_zeros() as usize;
            let jump = i16::from(biased[edge]) - 128;
            // All of them, so that it is done in vectors.
            row.iter_mut().zip(&BEHIND[edge]).for_each(|(w, bits)| *w = w.wrapping_add(jump & bits));
            left &= left - 1;
        }
        samples.extend_from_slice(&row);
    }
    Samples(samples.into_boxed_slice().try_into().expect("the length is POINTS"), 0)
}
