//! A thread's way to the device: a ring of batches, so that one is packed here while another is computed there and a third
//! is read. Where the device's memory is the host's nothing is copied.

use super::context::Context;
use super::device::Gpu;
use super::failure::Failure;
use super::kernels::Sets;
use super::memory::{Arena, Use};
use super::sizes::{CHAINS, READ, Sizes, UPLOADED, ZEROED};
use super::slot::{Buffers, Seconds, Slot, Staged};
use brickfield_shaders::{Batch, Brick, JUMP_WORDS, Pair, ROWS};
use std::collections::VecDeque;
use std::sync::Arc;

/// Batches under way.
const RING: usize = 2;

/// Bricks to evaluate.
#[derive(Clone, Debug, Default)]
pub struct BatchInput {
    /// The bricks' corners.
    pub bricks: Vec<Brick>,
    /// Of each brick every triangle that touches it.
    pub pairs: Vec<Pair>,
}

impl BatchInput {
    /// Empties it.
    pub fn clear(&mut self) {
        self.bricks.clear();
        self.pairs.clear();
    }
}

/// What the device made of a batch.
#[derive(Debug)]
pub struct BatchOutput<'a> {
    /// What became of the bricks.
    pub bricks: &'a [Brick],
    /// By brick: by row, four a word, the jumps of the samples at edges along x, as
    /// [`brickfield_shaders::JUMP_BIAS`] tells; then those of the other lines, and which edges hold crossings.
    pub jumps: &'a [[u32; JUMP_WORDS as usize]],
    /// By brick and row: the first sample, and which edges along x hold crossings.
    pub rows: &'a [[[u32; 2]; ROWS as usize]],
    /// The Hermite edges of all bricks: offset and normal.
    pub hermite: &'a [[u32; 2]],
    /// How long it took, if the device has a clock.
    pub seconds: Option<Seconds>,
}

/// Memory through which data go to the device and come back.
struct Staging {
    upload: Arena,
    read: Arena,
}

impl Staging {
    fn new(context: &Arc<Context>, sizes: &Sizes) -> Result<Staging, Failure> {
        let upload = Arena::new(context, Use::Upload, sizes.upload_bytes(), RING)?;
        let read = Arena::new(context, Use::ReadBack, sizes.read_bytes(), RING)?;
        Ok(Staging { upload, read })
    }

    /// The buffers of a slot.
    fn of(&self, slot: usize) -> Staged {
        Staged { upload: self.upload.buffer(slot), read: self.read.buffer(slot) }
    }
}

/// Buffers and commands of one thread.
pub struct Lane {
    // Dropped first: they wait for the device.
    slots: Vec<Slot>,
    device: Arena,
    /// None where the device's memory is written and read here.
    staging: Option<Staging>,
    sets: Sets,
    gpu: Gpu,
    sizes: Sizes,
    /// By slot: bytes of the chains that are 0, because a batch that was done has left them so.
    clean: [u64; RING],
    /// Batches under way by slot, oldest first.
    pending: VecDeque<(usize, Sizes)>,
    next: usize,
}

impl Lane {
    /// A lane with as much as fits in `bytes`.
    ///
    /// # Errors
    /// If the device has less memory, or fails.
    pub fn new(gpu: &Gpu, bytes: u64) -> Result<Lane, Failure> {
        gpu.check()?;
        let context = &gpu.context;
        let stages = !context.shares_memory();
        let sizes = Sizes::within(bytes / RING as u64, context.range_max, stages);
        let purpose = if stages { Use::Device } else { Use::Shared };
        let device = Arena::new(context, purpose, sizes.device_bytes(), RING)?;
        let staging = stages.then(|| Staging::new(context, &sizes)).transpose()?;
        let sets = gpu.kernels.sets(RING as u32)?;
        let ranges = sizes.ranges();
        (0..RING).for_each(|slot| sets.point(slot, 0, device.buffer(slot), &ranges));
        let slots = (0..RING).map(|_| Slot::new(context)).collect::<Result<_, _>>()?;
        let (clean, pending) = ([0; RING], VecDeque::new());
        Ok(Lane { slots, device, staging, sets, gpu: gpu.clone(), sizes, clean, pending, next: 0 })
    }

    /// The most bricks, and pairs, that a batch may have.
    pub fn room(&self) -> (usize, usize) {
        (self.sizes.bricks as usize, self.sizes.pairs as usize)
    }

    /// Whether a batch must be received before the next is sent.
    pub fn is_full(&self) -> bool {
        self.pending.len() == RING
    }

    /// Whether nothing is under way.
    pub fn is_idle(&self) -> bool {
        self.pending.is_empty()
    }

    /// Sends a batch. Each brick has the room for edges that it would have in a batch of `limit` bricks.
    ///
    /// # Errors
    /// If the device fails; the batch is not under way then.
    ///
    /// # Panics
    /// If the lane is full, or the batch is larger than its room, or empty, or has a triangle of no brick.
    pub fn submit(&mut self, input: &BatchInput, limit: usize) -> Result<(), Failure> {
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
        let ranges = self.sizes.ranges();
        let to = self.staging.as_mut().map_or(&mut self.device, |staging| &mut staging.upload);
        for ((from, _), part) in ranges.iter().zip(parts) {
            to.bytes_mut(slot, *from, part.len() as u64).copy_from_slice(part);
        }
        let mut zeros = self.zeros(slot, &load);
        if self.staging.is_none() {
            // Here, so that the device need not wait for it between two batches.
            zeros.drain(..).for_each(|(from, length)| self.device.bytes_mut(slot, from, length).fill(0));
        }
        let staged = self.staging.as_ref().map(|staging| staging.of(slot));
        let buffers = Buffers { device: self.device.buffer(slot), staged, set: self.sets.sets[slot] };
        self.slots[slot].submit(&self.gpu.kernels, buffers, &zeros, &self.sizes, &load)?;
        self.clean[slot] = self.clean[slot].max(load.lengths()[CHAINS]);
        self.pending.push_back((slot, load));
        self.next = (slot + 1) % RING;
        Ok(())
    }

    /// Offset and length of what must be 0 before a batch begins.
    fn zeros(&self, slot: usize, load: &Sizes) -> Vec<(u64, u64)> {
        let (ranges, lengths) = (self.sizes.ranges(), load.lengths());
        let clean = self.clean[slot];
        let chains = (ranges[CHAINS].0 + clean, lengths[CHAINS].saturating_sub(clean));
        let zeros = ZEROED.iter().map(|&number| (ranges[number].0, lengths[number])).chain([chains]);
        zeros.filter(|(_, length)| *length > 0).collect()
    }

    /// How much room a batch takes; checks that it is sound.
    fn load(&self, input: &BatchInput, limit: usize) -> Sizes {
        let BatchInput { bricks, pairs } = input;
        let fits = |count: usize, room: u32| (1..=room as usize).contains(&count);
        assert!(
            fits(bricks.len(), self.sizes.bricks) && fits(pairs.len(), self.sizes.pairs),
            "the batch does not fit"
        );
        let is_sound = |pair: &Pair| {
            ((pair.owner & 0xffff) as usize) < bricks.len() && (1..=24).contains(&(pair.owner >> 16))
        };
        assert!(pairs.iter().all(is_sound), "a triangle of no brick");
        // A share of the room, so that no more is read back than there may be.
        let share = |room: u32| room / (limit.max(bricks.len()) as u32) * bricks.len() as u32;
        Sizes {
            bricks: bricks.len() as u32,
            pairs: pairs.len() as u32,
            edges: share(self.sizes.edges),
            ..self.sizes
        }
    }

    /// Waits for the oldest batch under way; `None` if there is none.
    ///
    /// # Errors
    /// If the device fails; the batch is not under way any more.
    pub fn receive(&mut self) -> Result<Option<BatchOutput<'_>>, Failure> {
        let Some((slot, load)) = self.pending.pop_front() else { return Ok(None) };
        // Where a batch failed nobody knows what it has left.
        let clean = std::mem::take(&mut self.clean[slot]);
        self.slots[slot].wait()?;
        self.clean[slot] = clean;
        let seconds = self.slots[slot].seconds()?;
        let (ranges, read_ranges, lengths) = (self.sizes.ranges(), self.sizes.read_ranges(), load.lengths());
        let part = |number: usize| {
            let length = lengths[READ[number]];
            match &self.staging {
                Some(staging) => staging.read.bytes(slot, read_ranges[number].0, length),
                None => self.device.bytes(slot, ranges[READ[number]].0, length),
            }
        };
        Ok(Some(BatchOutput {
            bricks: bytemuck::cast_slice(part(0)),
            jumps: bytemuck::cast_slice(part(1)),
            rows: bytemuck::cast_slice(part(2)),
            hermite: bytemuck::cast_slice(part(3)),
            seconds,
        }))
    }
}
