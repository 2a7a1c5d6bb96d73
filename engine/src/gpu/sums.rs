//! The sum over a cluster tree at samples, on the device: the tree lies there for as long as a build takes, blocks of
//! samples come and go.

use super::context::Context;
use super::device::Gpu;
use super::failure::Failure;
use super::kernels::{Kernels, Sets};
use super::memory::{Arena, RANGE_ALIGNMENT, Use};
use super::slot::Slot;
use ash::vk;
use brickfield_shaders::{
    Block, CLUSTER_WORDS, COEFFICIENTS, ELEMENT_WORDS, OPEN, POINTS, SUM_BUFFERS, Sums, TERMS_MAX, WORKGROUP,
};
use std::sync::Arc;

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

type Ranges<const N: usize> = [(u64, u64); N];

/// Offset and length of buffers of these lengths in one.
fn in_a_row<const N: usize>(lengths: [u64; N]) -> Ranges<N> {
    let mut end = 0;
    lengths.map(|length| {
        let from = end;
        end = (from + length).next_multiple_of(RANGE_ALIGNMENT);
        (from, length)
    })
}

/// The clusters and elements of a tree on a device.
pub struct SumTree {
    buffer: Arena,
    ranges: Ranges<OF_TREE>,
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
    pub fn new(gpu: &Gpu, clusters: &[u32], elements: &[u32]) -> Result<SumTree, Failure> {
        assert!(!clusters.is_empty() && !elements.is_empty(), "a tree that is not empty");
        gpu.check()?;
        let context = &gpu.context;
        let parts: [&[u8]; OF_TREE] = [bytemuck::cast_slice(clusters), bytemuck::cast_slice(elements)];
        let ranges = in_a_row(parts.map(|part| part.len() as u64));
        if ranges.iter().any(|(_, length)| *length > context.range_max) {
            return Err(Failure::OutOfMemory);
        }
        let [_, (from, length)] = ranges;
        let tree = SumTree {
            buffer: Arena::new(context, Use::Device, from + length, 1)?,
            ranges,
            kernels: Kernels::new(context, SUM_BUFFERS.len(), &[(OPEN, c"sum_up")])?,
            counts: [clusters.len() as u32 / CLUSTER_WORDS, elements.len() as u32 / ELEMENT_WORDS],
            gpu: gpu.clone(),
        };
        // Dropped first: it waits for the device.
        let mut slot = (Slot::new(context)?, Arena::new(context, Use::Upload, UPLOAD_BYTES, 1)?);
        for (part, (from, _)) in parts.iter().zip(ranges) {
            for (number, bytes) in (0..).zip(part.chunks(UPLOAD_BYTES as usize)) {
                tree.upload(&mut slot, bytes, from + number * UPLOAD_BYTES)?;
            }
        }
        Ok(tree)
    }

    fn upload(&self, (slot, upload): &mut (Slot, Arena), bytes: &[u8], to: u64) -> Result<(), Failure> {
        let size = bytes.len() as u64;
        upload.bytes_mut(0, 0, size).copy_from_slice(bytes);
        let copies = [vk::BufferCopy { src_offset: 0, dst_offset: to, size }];
        slot.run(|slot| {
            let raw = &self.gpu.context.raw;
            // SAFETY: the bytes lie within both buffers, of which nothing else is made use of.
            unsafe { raw.cmd_copy_buffer(slot.commands(), upload.buffer(0), self.buffer.buffer(0), &copies) };
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
        })?;
        slot.wait()
    }
}

/// Samples of some bricks.
#[derive(Debug, Default)]
pub struct SumInput {
    /// Blocks of samples.
    pub blocks: Vec<Block>,
    /// By block: the coefficients of its polynomial, without the constant.
    pub coefficients: Vec<[f32; COEFFICIENTS as usize]>,
    /// Numbers of clusters and elements.
    pub terms: Vec<u32>,
    /// By row of four samples: the number of its block; in the ninth bit whether they are every second one; below, three
    /// bits an axis, the place of the first in the block.
    pub rows: Vec<u32>,
}

impl SumInput {
    /// Empties it.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.coefficients.clear();
        self.terms.clear();
        self.rows.clear();
    }
}

/// How much of each thing there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SumRoom {
    /// Bricks.
    pub bricks: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Blocks.
    pub blocks: usize,
    /// Terms.
    pub terms: usize,
}

impl SumRoom {
    fn of(bricks: u64) -> SumRoom {
        let of = |each: u64| (bricks * each) as usize;
        SumRoom {
            bricks: of(1),
            rows: of(ROWS_OF_BRICK),
            blocks: of(BLOCKS_OF_BRICK),
            terms: of(TERMS_OF_BRICK),
        }
    }

    fn ranges(&self) -> Ranges<OF_LANE> {
        let rows = self.rows as u64;
        let blocks = self.blocks as u64;
        let coefficients = u64::from(COEFFICIENTS) * 4;
        in_a_row([
            size_of::<Sums>() as u64,
            blocks * size_of::<Block>() as u64,
            blocks * coefficients,
            self.terms as u64 * 4,
            rows * 4,
            rows * 16,
        ])
    }

    /// Bytes of what is uploaded, on the device, and read back.
    fn bytes(&self) -> [u64; 3] {
        let ranges = self.ranges();
        let end = |buffer: usize| ranges[buffer].0 + ranges[buffer].1;
        [end(OF_LANE - 2), end(OF_LANE - 1), ranges[OF_LANE - 1].1]
    }
}

/// Buffers and commands of one thread.
pub struct SumLane {
    // Dropped first: it waits for the device.
    slot: Slot,
    upload: Arena,
    device: Arena,
    read: Arena,
    sets: Sets,
    room: SumRoom,
    tree: Arc<SumTree>,
}

impl SumLane {
    /// A lane with as much as fits in `bytes`; at least one brick.
    ///
    /// # Errors
    /// If the device has less memory, or fails.
    pub fn new(tree: &Arc<SumTree>, bytes: u64) -> Result<SumLane, Failure> {
        tree.gpu.check()?;
        let context: &Arc<Context> = &tree.gpu.context;
        let fits = |bricks: &u64| {
            let room = SumRoom::of(*bricks);
            let is_seen = room.ranges().iter().all(|(_, length)| *length <= context.range_max);
            is_seen && room.bytes().iter().sum::<u64>() <= bytes
        };
        let room = SumRoom::of((1..=BRICKS_MAX).rev().find(fits).ok_or(Failure::OutOfMemory)?);
        let [upload, device, read] = room.bytes();
        let device = Arena::new(context, Use::Device, device, 1)?;
        let upload = Arena::new(context, Use::Upload, upload, 1)?;
        let read = Arena::new(context, Use::ReadBack, read, 1)?;
        let sets = tree.kernels.sets(1)?;
        sets.point(0, 0, tree.buffer.buffer(0), &tree.ranges);
        sets.point(0, OF_TREE as u32, device.buffer(0), &room.ranges());
        Ok(SumLane { slot: Slot::new(context)?, upload, device, read, sets, room, tree: Arc::clone(tree) })
    }

    /// What a batch may hold at most.
    pub fn room(&self) -> SumRoom {
        self.room
    }

    /// By row: the samples, less the sum, rounded to `bits` binary places, or [`brickfield_shaders::UNSURE`]; and the
    /// seconds that the device took, if it has a clock.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// If the input is larger than the room, or not sound.
    pub fn run(&mut self, input: &SumInput, bits: u8) -> Result<(&[[i32; 4]], Option<f64>), Failure> {
        self.check(input, bits);
        self.tree.gpu.check()?;
        if input.rows.is_empty() {
            return Ok((&[], None));
        }
        let sums = Sums { rows: input.rows.len() as u32, bits: bits.into() };
        let inputs: [&[u8]; OF_LANE - 1] = [
            bytemuck::bytes_of(&sums),
            bytemuck::cast_slice(&input.blocks),
            bytemuck::cast_slice(&input.coefficients),
            bytemuck::cast_slice(&input.terms),
            bytemuck::cast_slice(&input.rows),
        ];
        let ranges = self.room.ranges();
        let mut copies = Vec::with_capacity(inputs.len());
        for ((from, _), bytes) in ranges.into_iter().zip(inputs).filter(|(_, bytes)| !bytes.is_empty()) {
            let size = bytes.len() as u64;
            self.upload.bytes_mut(0, from, size).copy_from_slice(bytes);
            copies.push(vk::BufferCopy { src_offset: from, dst_offset: from, size });
        }
        let size = u64::from(sums.rows) * 16;
        let back = vk::BufferCopy { src_offset: ranges[OF_LANE - 1].0, dst_offset: 0, size };
        self.send(&copies, sums.rows.div_ceil(WORKGROUP), back)?;
        self.slot.wait()?;
        let seconds = self.slot.seconds()?.map(|seconds| seconds.kernels[0]);
        Ok((bytemuck::cast_slice(self.read.bytes(0, 0, size)), seconds))
    }

    /// Every number that the kernel takes for an index lies within what it indexes.
    fn check(&self, input: &SumInput, bits: u8) {
        let SumInput { blocks, coefficients, terms, rows } = input;
        assert!(
            rows.len() <= self.room.rows
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

    fn send(&mut self, copies: &[vk::BufferCopy], groups: u32, back: vk::BufferCopy) -> Result<(), Failure> {
        let tree = &self.tree;
        let (upload, buffer, read) = (self.upload.buffer(0), self.device.buffer(0), self.read.buffer(0));
        let sets = [self.sets.sets[0]];
        self.slot.run(|slot| {
            let (raw, commands) = (&tree.gpu.context.raw, slot.commands());
            let point = vk::PipelineBindPoint::COMPUTE;
            slot.reset_times();
            slot.note_time(0);
            // SAFETY: the parts lie in buffers of the same room, of which nothing is in use; `check` keeps the kernel
            // within them; pipeline and set have the same layout; there are fewer groups than any device allows.
            unsafe { raw.cmd_copy_buffer(commands, upload, buffer, copies) };
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
            slot.note_time(1);
            // SAFETY: as above.
            unsafe {
                raw.cmd_bind_pipeline(commands, point, tree.kernels.pipeline(0));
                raw.cmd_bind_descriptor_sets(commands, point, tree.kernels.layout, 0, &sets, &[]);
                raw.cmd_dispatch(commands, groups, 1, 1);
            }
            slot.note_times_from(2);
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
            // SAFETY: as above.
            unsafe { raw.cmd_copy_buffer(commands, buffer, read, &[back]) };
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        })
    }
}
