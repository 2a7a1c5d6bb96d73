//! The sum over a cluster tree at samples, on the device: the tree lies there for as long as a build takes, blocks of
//! samples come and go.

use super::context::Context;
use super::device::Gpu;
use super::exchange::{BufferLayout, BufferSet};
use super::failure::{DeviceFailure, WrongAnswer};
use super::hardware::MemoryUse;
use super::kernels::{DescriptorSets, Kernels};
use super::memory::{Arena, Range, end_of, in_a_row};
use super::slot::BatchSlot;
use super::sum_batch::{SumCapacity, SumInput};
use brickfield_shaders::{
    Block, CLUSTER_WORDS, COEFFICIENTS, ELEMENT_WORDS, OPEN, POINTS, SUM_BUFFERS, Sums, TERMS_MAX, WORKGROUP,
};
use std::collections::VecDeque;
use std::sync::Arc;

/// Batches under way: one is laid open or settled here while another is summed up there.
const RING: usize = 2;
/// Buffers of the tree: clusters and elements. Those of a lane follow.
const OF_TREE: usize = 2;
/// Buffers of a lane, of which all but the last are uploaded, and that one is read back.
const OF_LANE: usize = SUM_BUFFERS.len() - OF_TREE;
/// Bytes in which a tree is uploaded.
const UPLOAD_BYTES: u64 = 1 << 20;

/// Rows of up to four samples for which a brick makes room: its lattices have some 10,000.
const ROWS_OF_BRICK: u64 = (POINTS * POINTS) as u64 * 12;
/// Blocks for which a brick makes room: it has 125 of its own lattice and some of each coarser one.
const BLOCKS_OF_BRICK: u64 = 256;
/// Terms for which it does.
const TERMS_OF_BRICK: u64 = 1 << 16;
/// Bricks of a batch at most: siblings.
const BRICKS_MAX: u64 = 8;

/// The clusters and elements of a tree on a device.
pub struct SumTree {
    buffer: Arena,
    ranges: [Range; OF_TREE],
    kernels: Kernels,
    /// How many clusters and elements.
    counts: [u32; OF_TREE],
    gpu: Gpu,
}

impl SumTree {
    /// Uploads a tree: the words of its clusters and those of its elements.
    ///
    /// # Errors
    /// If the device has no room for it, or fails.
    ///
    /// # Panics
    /// If there is no cluster or no element.
    pub fn new(gpu: &Gpu, clusters: &[u32], elements: &[u32]) -> Result<SumTree, DeviceFailure> {
        assert!(!clusters.is_empty() && !elements.is_empty(), "a tree that is not empty");
        gpu.check()?;
        let context = &gpu.context;
        let parts: [&[u8]; OF_TREE] = [bytemuck::cast_slice(clusters), bytemuck::cast_slice(elements)];
        let ranges = in_a_row(parts.map(|part| part.len() as u64));
        if ranges.iter().any(|(_, length)| *length > context.hardware.range_max) {
            return Err(DeviceFailure::OutOfMemory);
        }
        let kernels = Kernels::new(context, SUM_BUFFERS.len(), &[(OPEN, c"sum_up")])?;
        let mut buffer = Arena::new(context, MemoryUse::Device, end_of(&ranges), 1)?;
        let mut upload = match buffer.is_mapped() {
            true => None,
            false => Some(Arena::new(context, MemoryUse::Upload, UPLOAD_BYTES, 1)?),
        };
        // Behind what it uses, so that it is dropped first: it waits for the device.
        let mut slot = BatchSlot::new(context)?;
        for (part, (from, _)) in parts.iter().zip(ranges) {
            slot.put(upload.as_mut(), &mut buffer, from, part)?;
        }
        drop(slot);
        let counts = [clusters.len() as u32 / CLUSTER_WORDS, elements.len() as u32 / ELEMENT_WORDS];
        Ok(SumTree { buffer, ranges, kernels, counts, gpu: gpu.clone() })
    }
}

impl SumCapacity {
    fn of(bricks: u64) -> SumCapacity {
        let of = |each: u64| (bricks * each) as usize;
        SumCapacity {
            bricks: of(1),
            rows: of(ROWS_OF_BRICK),
            blocks: of(BLOCKS_OF_BRICK),
            terms: of(TERMS_OF_BRICK),
        }
    }

    /// Where the parts of a buffer lie.
    fn layout(&self) -> BufferLayout<OF_LANE> {
        let rows = self.rows as u64;
        let blocks = self.blocks as u64;
        let coefficients = u64::from(COEFFICIENTS) * 4;
        let ranges = in_a_row([
            size_of::<Sums>() as u64,
            blocks * size_of::<Block>() as u64,
            blocks * coefficients,
            self.terms as u64 * 4,
            rows * 4,
            rows * 16,
        ]);
        BufferLayout { ranges, written: OF_LANE - 1, read: &[OF_LANE - 1] }
    }
}

/// Buffers and commands of one thread.
pub struct SumLane {
    // Dropped first: they wait for the device.
    slots: Vec<BatchSlot>,
    buffers: BufferSet,
    sets: DescriptorSets,
    room: SumCapacity,
    tree: Arc<SumTree>,
    /// Batches under way, oldest first: the slot, and how many rows.
    pending: VecDeque<(usize, usize)>,
    next: usize,
}

impl SumLane {
    /// A lane with as much as fits in `bytes`; at least one brick.
    ///
    /// # Errors
    /// If the device has less memory, or fails.
    pub fn new(tree: &Arc<SumTree>, bytes: u64) -> Result<SumLane, DeviceFailure> {
        tree.gpu.check()?;
        let context: &Arc<Context> = &tree.gpu.context;
        let fits = |bricks: &u64| {
            let layout = SumCapacity::of(*bricks).layout();
            layout.is_seen(context.hardware.range_max)
                && layout.total_bytes(!context.hardware.shares_memory()) <= bytes / RING as u64
        };
        let room = SumCapacity::of((1..=BRICKS_MAX).rev().find(fits).ok_or(DeviceFailure::OutOfMemory)?);
        let buffers = BufferSet::new(context, &room.layout(), RING)?;
        let sets = tree.kernels.sets(RING as u32)?;
        for slot in 0..RING {
            sets.point(slot, 0, tree.buffer.buffer(0), &tree.ranges);
            sets.point(slot, OF_TREE as u32, buffers.buffer(slot), buffers.ranges());
        }
        let slots = (0..RING).map(|_| BatchSlot::new(context)).collect::<Result<_, _>>()?;
        let (tree, pending) = (Arc::clone(tree), VecDeque::new());
        Ok(SumLane { slots, buffers, sets, room, tree, pending, next: 0 })
    }

    /// What a batch may hold at most.
    pub fn room(&self) -> SumCapacity {
        self.room
    }

    /// Whether a batch must be received before the next is sent.
    pub fn is_full(&self) -> bool {
        self.pending.len() == RING
    }

    /// Sends a batch, whose samples are to be rounded to `bits` binary places.
    ///
    /// # Errors
    /// If the device fails; the batch is not under way then.
    ///
    /// # Panics
    /// If the lane is full, or the input is larger than the room, empty, or not sound.
    pub fn submit(&mut self, input: &SumInput, bits: u8) -> Result<(), DeviceFailure> {
        assert!(!self.is_full(), "a batch must be received first");
        self.check(input, bits);
        self.tree.gpu.check()?;
        let sums = Sums { rows: input.rows.len() as u32, bits: bits.into() };
        let inputs: [&[u8]; OF_LANE - 1] = [
            bytemuck::bytes_of(&sums),
            bytemuck::cast_slice(&input.blocks),
            bytemuck::cast_slice(&input.coefficients),
            bytemuck::cast_slice(&input.terms),
            bytemuck::cast_slice(&input.rows),
        ];
        let number = self.next;
        let upload = self.buffers.write(number, &inputs, Vec::new());
        let read_back = self.buffers.read_back(number, &[u64::from(sums.rows) * 16]);
        let (kernels, set) = (&self.tree.kernels, self.sets.sets[number]);
        self.slots[number].run(|slot| {
            slot.reset_times();
            slot.note_time(0);
            upload.record(slot);
            slot.note_time(1);
            slot.dispatch(kernels, 0, set, [sums.rows.div_ceil(WORKGROUP), 1]);
            slot.note_times_from(2);
            read_back.record(slot);
        })?;
        self.pending.push_back((number, input.rows.len()));
        self.next = (number + 1) % RING;
        Ok(())
    }

    /// Waits for the oldest batch under way. By row: the samples, less the sum, rounded, or
    /// [`brickfield_shaders::UNSURE`]; and the seconds that the device took, if it has a clock.
    ///
    /// # Errors
    /// If the device fails; the batch is not under way any more.
    ///
    /// # Panics
    /// If none is under way.
    pub fn receive(&mut self) -> Result<(&[[i32; 4]], Option<f64>), DeviceFailure> {
        let (number, rows) = self.pending.pop_front().expect("a batch is under way");
        self.slots[number].wait()?;
        let seconds = self.slots[number].seconds()?.map(|seconds| seconds.kernels[0]);
        match self.tree.gpu.context.hardware.wrong_answer() {
            Some(WrongAnswer::Zeros) => self.buffers.bytes_mut(number, 0, rows as u64 * 16).fill(0),
            Some(WrongAnswer::OneSample { .. }) => self.buffers.bytes_mut(number, 0, 1)[0] ^= 1,
            None => {}
        }
        Ok((bytemuck::cast_slice(self.buffers.bytes(number, 0, rows as u64 * 16)), seconds))
    }

    /// Every number that the kernel takes for an index lies within what it indexes.
    fn check(&self, input: &SumInput, bits: u8) {
        let SumInput { blocks, coefficients, terms, rows } = input;
        assert!(
            (1..=self.room.rows).contains(&rows.len())
                && blocks.len() <= self.room.blocks
                && terms.len() <= self.room.terms
                && coefficients.len() == blocks.len(),
            "the batch does not fit"
        );
        let [clusters_there, elements_there] = self.tree.counts;
        let is_sound = |block: &Block| {
            let (from, clusters) = (block.terms_from as usize, block.clusters as usize);
            let end = from + clusters + block.elements as usize;
            end <= terms.len()
                && block.clusters + block.elements <= TERMS_MAX
                && block.spacing < 32
                && terms[from..from + clusters].iter().all(|c| *c < clusters_there)
                && terms[from + clusters..end].iter().all(|e| *e < elements_there)
        };
        assert!(blocks.iter().all(is_sound), "a term that is not there");
        assert!(rows.iter().all(|row| ((row >> 10) as usize) < blocks.len()), "a row of no block");
        assert!((1..=15).contains(&bits), "samples have 16 bits");
    }
}
