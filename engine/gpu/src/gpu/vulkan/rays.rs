//! Rays through a tree of bricks on the device: the bricks lie in pages of a pool there, and come as rays ask for them.

use super::device::Gpu;
use super::failure::DeviceFailure;
use super::hardware::MemoryUse;
use super::kernels::{DescriptorSets, Kernels};
use super::memory::Arena;
use super::ray_capacity::{
    NODES, PAGES, PIXELS, POOL, ROUND, RayCapacity, SHELLS, SIGHT, TABLES, USED, WANTED, page_words,
};
use super::ray_scene::{RayScene, RoundEnd};
use super::slot::BatchSlot;
use ash::vk;
use brickfield_shaders::{
    COUNT_WORDS, RAY_BUFFERS, RAYS, RESIDENT, Round, Sight, TABLE_ENTRIES, TILE, TreeNode, WORKGROUP,
};
use std::sync::Arc;

/// Kernels by number.
const TRACE: usize = 0;
const BLEND: usize = 1;
/// Pixels of a tile.
const TILE_PIXELS: u32 = TILE * TILE;

impl RayScene<'_> {
    /// Words of a page that has every field.
    fn page_words(&self) -> u32 {
        let fields = self.shells.len() as u32 + u32::from(self.haze);
        page_words(fields, self.counts)
    }

    /// Whatever a kernel takes for an index lies within what it indexes, and its way down ends.
    fn check(&self) {
        let count = self.nodes.len() as u64;
        let is_sound = |(number, node): (usize, &TreeNode)| {
            let first = u64::from(node.children);
            first == 0 || first > number as u64 && first + 8 <= count
        };
        assert!(count > 0 && self.nodes.iter().enumerate().all(is_sound), "a node that is not there");
        assert!(
            count < u64::from(RESIDENT) && self.shells.len() <= 4 && (self.haze || !self.shells.is_empty())
        );
        assert!(self.tables.len() == TABLE_ENTRIES as usize, "tables of another size");
    }
}

/// The kernels that follow rays, compiled. Clones are handles of the same.
#[derive(Clone)]
pub struct RayKernels(Arc<Kernels>);

impl RayKernels {
    /// Compiles them.
    ///
    /// # Errors
    /// If the device fails.
    pub fn new(gpu: &Gpu) -> Result<RayKernels, DeviceFailure> {
        let entries = [(RAYS, c"trace"), (RAYS, c"blend")];
        Ok(RayKernels(Arc::new(Kernels::new(&gpu.context, RAY_BUFFERS.len(), &entries)?)))
    }
}

/// Rays, bricks in pages, and the picture that becomes of them.
pub struct RayCaster {
    // Dropped first: it waits for the device.
    slot: BatchSlot,
    upload: Arena,
    device: Arena,
    read: Arena,
    sets: DescriptorSets,
    kernels: Arc<Kernels>,
    gpu: Gpu,
    room: RayCapacity,
    /// How many surfaces, and whether there is a haze.
    shows: (u32, bool),
    sight: Sight,
    tiles: u32,
    round: Round,
    /// By page: the node that has it.
    holders: Vec<Option<u32>>,
    /// By node: whether it has a page, or had one in the last round.
    present: Vec<bool>,
    /// Nodes that lose theirs in the next one.
    evicted: Vec<u32>,
    /// Pages to be taken next, the one that was used longest ago last.
    spare: Vec<u32>,
    /// What the next round begins with.
    copies: Vec<vk::BufferCopy>,
    /// Words of the page table that change, and pages that are staged.
    changed: u64,
    staged: u64,
}

impl RayCaster {
    /// Puts the scene there, with room for as many bricks and rays as fit in the memory that may be taken. The kernels are
    /// the device's.
    ///
    /// # Errors
    /// If the device has no room for a single brick, or fails.
    ///
    /// # Panics
    /// If the scene contradicts itself.
    pub fn new(gpu: &Gpu, kernels: &RayKernels, scene: RayScene<'_>) -> Result<RayCaster, DeviceFailure> {
        scene.check();
        gpu.check()?;
        let context = &gpu.context;
        let left = context.hardware.cap.saturating_sub(context.hardware.allocated().0);
        let room =
            RayCapacity::within(left, context.hardware.range_max, scene.nodes.len(), scene.page_words())
                .ok_or(DeviceFailure::OutOfMemory)?;
        let RayKernels(kernels) = kernels.clone();
        let device = Arena::new(context, MemoryUse::Device, room.device_bytes(), 1)?;
        let upload = Arena::new(context, MemoryUse::Upload, room.upload_bytes(), 1)?;
        let read = Arena::new(context, MemoryUse::ReadBack, room.read_bytes(), 1)?;
        let sets = kernels.sets(1)?;
        sets.point(0, 0, device.buffer(0), &room.ranges());
        let count_words = if scene.counts { COUNT_WORDS } else { 0 };
        let mut caster = RayCaster {
            slot: BatchSlot::new(context)?,
            upload,
            device,
            read,
            sets,
            kernels,
            gpu: gpu.clone(),
            room,
            shows: (scene.shells.len() as u32, scene.haze),
            sight: Sight { count_words, page_words: room.page_words, ..Sight::default() },
            tiles: 0,
            round: Round::default(),
            holders: vec![None; room.pages as usize],
            present: vec![false; room.nodes as usize],
            evicted: Vec::new(),
            spare: (0..room.pages).rev().collect(),
            copies: Vec::new(),
            changed: 0,
            staged: 0,
        };
        let [shells, nodes]: [&[u8]; 2] =
            [bytemuck::cast_slice(scene.shells), bytemuck::cast_slice(scene.nodes)];
        for (buffer, bytes) in
            [(SHELLS, shells), (TABLES, bytemuck::cast_slice(scene.tables)), (NODES, nodes)]
        {
            caster.put(buffer, bytes)?;
        }
        for buffer in [PAGES, USED] {
            caster.clear(buffer)?;
        }
        Ok(caster)
    }

    /// Fills a buffer.
    fn put(&mut self, buffer: usize, bytes: &[u8]) -> Result<(), DeviceFailure> {
        let (to, _) = self.room.ranges()[buffer];
        self.slot.put(Some(&mut self.upload), &mut self.device, to, bytes)
    }

    /// Fills a buffer with zeros.
    fn clear(&mut self, buffer: usize) -> Result<(), DeviceFailure> {
        let (range, device) = (self.room.ranges()[buffer], self.device.buffer(0));
        self.slot.run(|slot| {
            slot.zero(device, range);
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
        })?;
        self.slot.wait()
    }

    /// For how many bricks there are pages.
    pub fn pages(&self) -> u32 {
        self.room.pages
    }

    /// How many bricks can be brought for a round.
    pub fn staged_max(&self) -> u32 {
        self.room.staged
    }

    /// Tiles of a picture with so many rays along the side of a pixel that are drawn at once, at most.
    pub fn tiles_max(&self, rays: u32) -> u32 {
        self.room.rays / (TILE_PIXELS * rays * rays)
    }

    /// Sets out on the rays of some tiles, by rows of tiles from `sight.first_tile` on. What the scene decides is taken from
    /// there.
    ///
    /// # Panics
    /// If there are too many of them, or numbers of the sight contradict the scene.
    pub fn begin(&mut self, sight: Sight, tiles: u32) {
        assert!(
            sight.rays >= 1 && (1..=self.tiles_max(sight.rays)).contains(&tiles),
            "too many rays at once"
        );
        let stops = [sight.opacities, sight.colours];
        assert!(
            !self.shows.1 || stops.iter().all(|count| (1..=brickfield_shaders::STOPS_MAX).contains(count))
        );
        let Sight { count_words, page_words, .. } = self.sight;
        let haze = if self.shows.1 { sight.haze.max(1) } else { 0 };
        self.sight = Sight { shells: self.shows.0, haze, count_words, page_words, ..sight };
        self.tiles = tiles;
        let rays = tiles * sight.rays * sight.rays * TILE_PIXELS;
        self.round = Round { number: self.round.number, rays, first: 1, ..Round::default() };
    }

    /// Lets all rays go on, until they end or come to a brick that is not there. In a draft a coarser brick that is there
    /// stands for it, or nothing.
    ///
    /// # Errors
    /// If the device fails.
    pub fn round(&mut self, draft: bool) -> Result<RoundEnd, DeviceFailure> {
        self.gpu.check()?;
        let half = self.room.rays;
        // Rays that wait change sides.
        let start = if self.round.behind == 0 { 0 } else { half };
        self.round = Round {
            number: self.round.number + 1,
            draft: draft.into(),
            start,
            behind: half - start,
            wanted_max: self.room.staged,
            waiting: 0,
            wanted: 0,
            ..self.round
        };
        let (sight, round) = (self.sight, self.round);
        self.stage(SIGHT, bytemuck::bytes_of(&sight));
        self.stage(ROUND, bytemuck::bytes_of(&round));
        self.send_round()?;
        self.slot.wait()?;
        self.copies.clear();
        (self.changed, self.staged) = (0, 0);
        self.evicted.drain(..).for_each(|node| self.present[node as usize] = false);
        let [(round, length), ..] = self.room.read_ranges();
        let end: Round = *bytemuck::from_bytes(self.read.bytes(0, round, length));
        (self.round.rays, self.round.first) = (end.waiting, 0);
        self.round.wanted = end.wanted.min(self.room.staged);
        self.order_pages();
        Ok(RoundEnd { waiting: end.waiting, wanted: self.round.wanted })
    }

    /// The nodes whose bricks the rays of the last round asked for, each once.
    pub fn wanted(&self) -> &[u32] {
        let [_, (from, _), ..] = self.room.read_ranges();
        bytemuck::cast_slice(self.read.bytes(0, from, u64::from(self.round.wanted) * 4))
    }

    /// Whether the brick of a node has a page, had one in the last round, or will have one in the next.
    pub fn has(&self, node: u32) -> bool {
        self.present[node as usize]
    }

    /// Brings the brick of a node for the next round. `fill` writes the words of its page and says how many these are. False
    /// if no more can be brought before that.
    ///
    /// # Panics
    /// If there is no such node, or it has a page: a round's copies must not overlap.
    pub fn bring(&mut self, node: u32, fill: impl FnOnce(&mut [u32]) -> usize) -> bool {
        assert!(!self.has(node), "a brick that is there");
        if self.staged == u64::from(self.room.staged) {
            return false;
        }
        let Some(page) = self.spare.pop() else { return false };
        let ranges = self.room.ranges();
        let page_bytes = u64::from(self.room.page_words) * 4;
        let from = self.room.upload_offset(POOL) + self.staged * page_bytes;
        let words = bytemuck::cast_slice_mut(self.upload.bytes_mut(0, from, page_bytes));
        let size = fill(words) as u64 * 4;
        assert!((1..=page_bytes).contains(&size), "a page has its words");
        let to = ranges[POOL].0 + u64::from(page) * page_bytes;
        self.copies.push(vk::BufferCopy { src_offset: from, dst_offset: to, size });
        self.staged += 1;
        if let Some(evicted) = self.holders[page as usize].replace(node) {
            self.evicted.push(evicted);
            self.enter(evicted, 0);
        }
        self.present[node as usize] = true;
        self.enter(node, RESIDENT | page);
        true
    }

    /// Changes a node's word of the page table.
    fn enter(&mut self, node: u32, word: u32) {
        assert!(node < self.room.nodes, "a node that is not there");
        let from = self.room.upload_offset(PAGES) + self.changed * 4;
        self.upload.bytes_mut(0, from, 4).copy_from_slice(&word.to_ne_bytes());
        let to = self.room.ranges()[PAGES].0 + u64::from(node) * 4;
        self.copies.push(vk::BufferCopy { src_offset: from, dst_offset: to, size: 4 });
        self.changed += 1;
    }

    /// Stages a small structure.
    fn stage(&mut self, buffer: usize, bytes: &[u8]) {
        let from = self.room.upload_offset(buffer);
        let size = bytes.len() as u64;
        self.upload.bytes_mut(0, from, size).copy_from_slice(bytes);
        self.copies.push(vk::BufferCopy { src_offset: from, dst_offset: self.room.ranges()[buffer].0, size });
    }

    /// Finds the pages that were used longest ago. Rays wait for none of those that are there, so any may go; but what
    /// was used just now will be used again.
    fn order_pages(&mut self) {
        let [_, _, (from, length), _] = self.room.read_ranges();
        let used: &[u32] = bytemuck::cast_slice(self.read.bytes(0, from, length));
        self.spare.clear();
        self.spare.extend(0..self.room.pages);
        let last = |page: &u32| match self.holders[*page as usize] {
            Some(_) => used[*page as usize] + 1,
            None => 0,
        };
        self.spare.sort_unstable_by_key(|page| std::cmp::Reverse((last(page), *page)));
    }

    fn send_round(&mut self) -> Result<(), DeviceFailure> {
        let ranges = self.room.ranges();
        let read = self.room.read_ranges();
        let back: [vk::BufferCopy; 3] = std::array::from_fn(|n| vk::BufferCopy {
            src_offset: ranges[[ROUND, WANTED, USED][n]].0,
            dst_offset: read[n].0,
            size: read[n].1,
        });
        let (from, device, to) = (self.upload.buffer(0), self.device.buffer(0), self.read.buffer(0));
        let (copies, groups) = (&self.copies, self.round.rays.div_ceil(WORKGROUP).max(1));
        let (kernels, set) = (&self.kernels, self.sets.sets[0]);
        self.slot.run(|slot| {
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
            // No two of them overlap: `bring` takes a page once a round, and changes a node's word only if it has not
            // changed yet.
            slot.copy(from, device, copies);
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
            slot.dispatch(kernels, TRACE, set, [groups, 1]);
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
            slot.copy(device, to, &back);
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        })
    }

    /// What became of the tiles: row by row each pixel's colour, as bytes from the low one on, and the bits of the distance
    /// of the nearest opaque thing, in edges of the root cube; beyond 1e29 there is none.
    ///
    /// # Errors
    /// If the device fails.
    pub fn pixels(&mut self) -> Result<&[[u32; 2]], DeviceFailure> {
        self.gpu.check()?;
        let size = u64::from(self.tiles * TILE_PIXELS) * 8;
        let [.., (at, _)] = self.room.read_ranges();
        let back = [vk::BufferCopy { src_offset: self.room.ranges()[PIXELS].0, dst_offset: at, size }];
        let (device, to) = (self.device.buffer(0), self.read.buffer(0));
        let (kernels, set, tiles) = (&self.kernels, self.sets.sets[0], self.tiles);
        self.slot.run(|slot| {
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::COMPUTE_SHADER);
            slot.dispatch(kernels, BLEND, set, [tiles, 1]);
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
            slot.copy(device, to, &back);
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        })?;
        self.slot.wait()?;
        Ok(bytemuck::cast_slice(self.read.bytes(0, at, size)))
    }
}
