//! A thread's way to the device: a ring of batches, so that one is packed or read here while another is computed there.

use super::batch::{BatchInput, BatchOutput, KERNELS, Seconds};
use super::device::Gpu;
use super::exchange::BufferSet;
use super::failure::{DeviceFailure, WrongAnswer};
use super::kernels::{DescriptorSets, Kernels};
use super::memory::Range;
use super::sizes::{BatchCapacity, CHAINS, READ, UPLOADED, ZEROED};
use super::slot::BatchSlot;
use ash::vk;
use brickfield_shaders::{
    Batch, Brick, JUMP_WORDS, LINE_WORDS, PAIRS_OF_BRICK_MAX, POINTS, ROWS, VARIES, WORKGROUP,
};
use std::collections::VecDeque;

/// Batches under way.
const RING: usize = 2;
/// Spans that one invocation follows at most, of 33 lines each: see [`brickfield_shaders::STEPS_MAX`] for what bounds the
/// steps of its loops.
const SPANS_OF_INVOCATION: u32 = 16;
/// Spans that a triangle has in a brick at most, on the way to samples and in all.
const SPANS_OF_PAIR: [u32; 2] = [POINTS + 2, 3 * POINTS];
/// Workgroups for each brick that share the edges with several crossings.
const RESOLVE_GROUPS: u32 = 4;

/// Buffers and commands of one thread.
pub struct DeviceLane {
    // Dropped first: they wait for the device.
    slots: Vec<BatchSlot>,
    buffers: BufferSet,
    sets: DescriptorSets,
    gpu: Gpu,
    sizes: BatchCapacity,
    /// By slot: bytes of the chains that are 0, because a batch that was done has left them so.
    clean: [u64; RING],
    /// Batches under way by slot, oldest first.
    pending: VecDeque<(usize, BatchCapacity)>,
    /// The batch that is being read.
    received: Option<(usize, BatchCapacity)>,
    next: usize,
}

impl DeviceLane {
    /// A lane with as much as fits in `bytes`.
    ///
    /// # Errors
    /// If the device has less memory, or fails.
    pub fn new(gpu: &Gpu, bytes: u64) -> Result<DeviceLane, DeviceFailure> {
        gpu.check()?;
        let context = &gpu.context;
        let sizes = BatchCapacity::within(
            bytes / RING as u64,
            context.hardware.range_max,
            !context.hardware.shares_memory(),
        );
        let buffers = BufferSet::new(context, &sizes.layout(), RING)?;
        let sets = gpu.kernels.sets(RING as u32)?;
        (0..RING).for_each(|slot| sets.point(slot, 0, buffers.buffer(slot), buffers.ranges()));
        let slots = (0..RING).map(|_| BatchSlot::new(context)).collect::<Result<_, _>>()?;
        let (clean, pending) = ([0; RING], VecDeque::new());
        Ok(DeviceLane {
            slots,
            buffers,
            sets,
            gpu: gpu.clone(),
            sizes,
            clean,
            pending,
            received: None,
            next: 0,
        })
    }

    /// Whether its batches are this device's.
    pub fn is_on(&self, gpu: &Gpu) -> bool {
        self.gpu == *gpu
    }

    /// The most bricks, and pairs, that a batch may have.
    pub fn room(&self) -> (usize, usize) {
        (self.sizes.bricks as usize, self.sizes.pairs as usize)
    }

    /// Whether a batch must be received, and released, before the next is sent.
    pub fn is_full(&self) -> bool {
        self.pending.len() + usize::from(self.received.is_some()) == RING
    }

    /// Whether nothing is under way.
    pub fn is_idle(&self) -> bool {
        self.pending.is_empty()
    }

    /// Sends a batch. Each brick has the room for edges that it would have in a batch of `limit` bricks, if it cannot be
    /// divided.
    ///
    /// # Errors
    /// If the device fails; the batch is not under way then.
    ///
    /// # Panics
    /// If the lane is full, or the batch is larger than its room, or empty, or has a triangle of no brick, or a brick has
    /// more than [`PAIRS_OF_BRICK_MAX`].
    pub fn submit(&mut self, input: &BatchInput, limit: usize) -> Result<(), DeviceFailure> {
        assert!(!self.is_full(), "a batch must be received first");
        self.gpu.check()?;
        let load = self.load(input, limit);
        let batch = Batch {
            pairs: load.pairs,
            way_max: load.way_spans,
            other_max: load.other_spans,
            edges_max: load.edges,
            more_max: load.more,
            ..Batch::default()
        };
        let parts: [&[u8]; UPLOADED] = [
            bytemuck::bytes_of(&batch),
            bytemuck::cast_slice(&input.bricks),
            bytemuck::cast_slice(&input.pairs),
        ];
        let slot = self.next;
        let lengths = load.lengths();
        let zeros = self.zeros(slot, &load);
        let upload = self.buffers.write(slot, &parts, zeros);
        let read_back = self.buffers.read_back(slot, &READ.map(|number| lengths[number]));
        let (kernels, set) = (&self.gpu.kernels, self.sets.sets[slot]);
        self.slots[slot].run(|slot| {
            slot.reset_times();
            slot.note_time(0);
            upload.record(slot);
            slot.note_time(1);
            record_kernels(slot, kernels, set, &load);
            read_back.record(slot);
            slot.note_time(KERNELS as u32 + 2);
        })?;
        self.clean[slot] = self.clean[slot].max(lengths[CHAINS]);
        self.pending.push_back((slot, load));
        self.next = (slot + 1) % RING;
        Ok(())
    }

    /// Offset and length of what must be 0 before a batch begins.
    fn zeros(&self, slot: usize, load: &BatchCapacity) -> Vec<Range> {
        let (ranges, lengths) = (self.buffers.ranges(), load.lengths());
        let clean = self.clean[slot];
        let chains = (ranges[CHAINS].0 + clean, lengths[CHAINS].saturating_sub(clean));
        let zeros = ZEROED.iter().map(|&number| (ranges[number].0, lengths[number])).chain([chains]);
        zeros.filter(|(_, length)| *length > 0).collect()
    }

    /// How much room a batch takes; checks that it is sound.
    fn load(&self, input: &BatchInput, limit: usize) -> BatchCapacity {
        let BatchInput { bricks, pairs, may_divide } = input;
        let fits = |count: usize, room: u32| (1..=room as usize).contains(&count);
        assert!(
            fits(bricks.len(), self.sizes.bricks) && fits(pairs.len(), self.sizes.pairs),
            "the batch does not fit"
        );
        let mut of_bricks = vec![0; bricks.len()];
        for pair in pairs {
            let (brick, spacing_bits) = ((pair.owner & 0xffff) as usize, pair.owner >> 16);
            assert!(brick < bricks.len() && (1..=24).contains(&spacing_bits), "a triangle of no brick");
            of_bricks[brick] += 1;
        }
        assert!(of_bricks.iter().all(|count| *count <= PAIRS_OF_BRICK_MAX), "a brick has too many");
        // A share of the room, so that no more is read back than there may be; all of it for bricks that may be divided, for
        // coarse ones have ten times the edges of leaves.
        let edges = match may_divide {
            true => self.sizes.edges,
            false => self.sizes.edges / (limit.max(bricks.len()) as u32) * bricks.len() as u32,
        };
        BatchCapacity { bricks: bricks.len() as u32, pairs: pairs.len() as u32, edges, ..self.sizes }
    }

    /// Waits for the oldest batch under way, and says how long it took, if the device has a clock. What became of it is
    /// [`DeviceLane::output`] until [`DeviceLane::release`].
    ///
    /// # Errors
    /// If the device fails; the batch is not under way any more.
    ///
    /// # Panics
    /// If none is under way, or the one before was not released.
    pub fn receive(&mut self) -> Result<Option<Seconds>, DeviceFailure> {
        assert!(self.received.is_none(), "a batch must be released first");
        let (slot, load) = self.pending.pop_front().expect("a batch is under way");
        // Where a batch failed nobody knows what it has left.
        let clean = std::mem::take(&mut self.clean[slot]);
        self.slots[slot].wait()?;
        self.clean[slot] = clean;
        let seconds = self.slots[slot].seconds()?;
        if let Some(wrong) = self.gpu.context.hardware.wrong_answer() {
            self.spoil(slot, &load, wrong);
        }
        self.received = Some((slot, load));
        Ok(seconds)
    }

    /// Overwrites what was received, for tests.
    fn spoil(&mut self, slot: usize, load: &BatchCapacity, wrong: WrongAnswer) {
        let lengths = load.lengths();
        match wrong {
            WrongAnswer::Zeros => {
                (0..READ.len()).for_each(|n| self.buffers.bytes_mut(slot, n, lengths[READ[n]]).fill(0));
            }
            WrongAnswer::OneSample { .. } => {
                let bricks: &[Brick] = bytemuck::cast_slice(self.buffers.bytes(slot, 0, lengths[READ[0]]));
                let Some(brick) = bricks.iter().position(|brick| brick.flags & VARIES != 0) else {
                    // Of uniform bricks samples are not read.
                    return self.gpu.spoil(wrong);
                };
                // The first sample of a row in its middle; the jump behind it leads on as before.
                let row = ROWS as usize / 2;
                let rows: &mut [[[u32; 2]; ROWS as usize]] =
                    bytemuck::cast_slice_mut(self.buffers.bytes_mut(slot, 2, lengths[READ[2]]));
                let [start, touched] = rows[brick][row];
                rows[brick][row] = [start.wrapping_add(1), touched | 1];
                let jumps: &mut [[u32; JUMP_WORDS as usize]] =
                    bytemuck::cast_slice_mut(self.buffers.bytes_mut(slot, 1, lengths[READ[1]]));
                let word = &mut jumps[brick][row * LINE_WORDS as usize];
                *word = word.wrapping_sub(1);
            }
        }
    }

    /// What the device made of the batch that was received; `None` if it was released.
    pub fn output(&self) -> Option<BatchOutput<'_>> {
        let (slot, load) = self.received?;
        let lengths = load.lengths();
        let part = |number: usize| self.buffers.bytes(slot, number, lengths[READ[number]]);
        Some(BatchOutput {
            bricks: bytemuck::cast_slice(part(0)),
            jumps: bytemuck::cast_slice(part(1)),
            rows: bytemuck::cast_slice(part(2)),
            hermite: bytemuck::cast_slice(part(3)),
        })
    }

    /// Gives the place of the batch that was received to the next one.
    pub fn release(&mut self) {
        self.received = None;
    }
}

/// Records the kernels of a batch, each behind the one before.
fn record_kernels(slot: &BatchSlot, kernels: &Kernels, set: vk::DescriptorSet, load: &BatchCapacity) {
    let of_pairs = load.pairs.div_ceil(WORKGROUP);
    let rooms = [load.way_spans, load.way_spans + load.other_spans];
    let [of_way, of_spans] = std::array::from_fn(|i| {
        let spans = rooms[i].min(load.pairs * SPANS_OF_PAIR[i]);
        spans.div_ceil(WORKGROUP * SPANS_OF_INVOCATION)
    });
    let groups: [u32; KERNELS] = [of_pairs, of_way, load.bricks, of_spans, load.bricks * RESOLVE_GROUPS];
    for (number, groups) in groups.into_iter().enumerate() {
        if number > 0 {
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::COMPUTE_SHADER);
        }
        slot.dispatch(kernels, number, set, [groups, 1]);
        slot.note_time(number as u32 + 2);
    }
}
