//! Buffers of kernels that are written and read here: in place where the device's memory is the host's, else through
//! memory for copies.

use super::context::Context;
use super::failure::DeviceFailure;
use super::hardware::MemoryUse;
use super::memory::{Arena, Range, end_of, in_a_row};
use super::slot::BatchSlot;
use ash::vk;
use std::sync::Arc;

/// Parts of a buffer, by binding.
pub(super) struct BufferLayout<const N: usize> {
    /// Where they lie.
    pub ranges: [Range; N],
    /// How many are written here: the first ones.
    pub written: usize,
    /// Those that are read here.
    pub read: &'static [usize],
}

impl<const N: usize> BufferLayout<N> {
    /// Bytes of a buffer, with those for copies if it `stages`.
    pub fn total_bytes(&self, stages: bool) -> u64 {
        let copies = if stages { self.upload_bytes() + end_of(&self.read_ranges()) } else { 0 };
        end_of(&self.ranges) + copies
    }

    /// Whether kernels see all of it, if they see so many bytes of a part.
    pub fn is_seen(&self, range_max: u64) -> bool {
        self.ranges.iter().all(|(_, length)| *length <= range_max)
    }

    fn upload_bytes(&self) -> u64 {
        end_of(&self.ranges[..self.written])
    }

    /// Where what is read lies in the buffer for that.
    fn read_ranges(&self) -> [Range; N] {
        in_a_row(std::array::from_fn(|n| self.read.get(n).map_or(0, |part| self.ranges[*part].1)))
    }
}

/// Some buffers of one layout.
pub(super) struct BufferSet {
    device: Arena,
    /// None where the device's memory is written and read here.
    staging: Option<Staging>,
    ranges: Vec<Range>,
    written: usize,
    read: &'static [usize],
}

/// Memory through which data go to the device and come back.
struct Staging {
    upload: Arena,
    read: Arena,
    /// By part that is read: where it begins there.
    places: Vec<Range>,
}

/// What is recorded before kernels run: nothing where they run on what was written here.
pub(super) struct Upload {
    to: vk::Buffer,
    /// From where, if not in place.
    from: Option<vk::Buffer>,
    copies: Vec<vk::BufferCopy>,
    zeros: Vec<Range>,
}

/// What is recorded behind kernels.
pub(super) struct Readback {
    from: vk::Buffer,
    /// To where, if not in place.
    to: Option<vk::Buffer>,
    copies: Vec<vk::BufferCopy>,
}

impl BufferSet {
    /// `count` buffers.
    pub fn new<const N: usize>(
        context: &Arc<Context>,
        layout: &BufferLayout<N>,
        count: usize,
    ) -> Result<BufferSet, DeviceFailure> {
        let device = Arena::new(context, MemoryUse::Device, end_of(&layout.ranges), count)?;
        let mut staging = None;
        if !device.is_mapped() {
            let places = layout.read_ranges();
            staging = Some(Staging {
                upload: Arena::new(context, MemoryUse::Upload, layout.upload_bytes(), count)?,
                read: Arena::new(context, MemoryUse::ReadBack, end_of(&places), count)?,
                places: places.to_vec(),
            });
        }
        let BufferLayout { ranges, written, read } = *layout;
        Ok(BufferSet { device, staging, ranges: ranges.to_vec(), written, read })
    }

    /// What kernels see.
    pub fn buffer(&self, number: usize) -> vk::Buffer {
        self.device.buffer(number)
    }

    /// Where the parts of a buffer lie.
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Writes the first parts of a buffer that is not in use, as far as there are bytes, and zeros elsewhere.
    ///
    /// # Panics
    /// If a part is too long.
    pub fn write(&mut self, number: usize, parts: &[&[u8]], mut zeros: Vec<Range>) -> Upload {
        assert!(parts.len() <= self.written, "a part that is not written");
        let (to, from) = (self.buffer(number), self.staging.as_ref().map(|s| s.upload.buffer(number)));
        let mut copies = Vec::new();
        for ((from, length), part) in self.ranges.iter().zip(parts).filter(|(_, part)| !part.is_empty()) {
            let size = part.len() as u64;
            assert!(size <= *length, "a part is too long");
            let arena = self.staging.as_mut().map_or(&mut self.device, |staging| &mut staging.upload);
            arena.bytes_mut(number, *from, size).copy_from_slice(part);
            copies.push(vk::BufferCopy { src_offset: *from, dst_offset: *from, size });
        }
        if self.staging.is_none() {
            // Here, so that the device need not wait for it between two batches.
            zeros.drain(..).for_each(|(from, length)| self.device.bytes_mut(number, from, length).fill(0));
        }
        Upload { to, from, copies, zeros }
    }

    /// Reads back so many bytes of each part that is read.
    pub fn read_back(&self, number: usize, lengths: &[u64]) -> Readback {
        let from = self.buffer(number);
        let Some(Staging { read, places, .. }) = &self.staging else {
            return Readback { from, to: None, copies: Vec::new() };
        };
        let copy = |((part, place), size): ((&usize, &Range), &u64)| vk::BufferCopy {
            src_offset: self.ranges[*part].0,
            dst_offset: place.0,
            size: *size,
        };
        let copies = self.read.iter().zip(places).zip(lengths).map(copy).collect();
        Readback { from, to: Some(read.buffer(number)), copies }
    }

    /// The first bytes of what was read back, by its number among those parts.
    pub fn bytes(&self, number: usize, part: usize, length: u64) -> &[u8] {
        match &self.staging {
            Some(Staging { read, places, .. }) => read.bytes(number, places[part].0, length),
            None => self.device.bytes(number, self.ranges[self.read[part]].0, length),
        }
    }
}

/// For tests, which spoil what was read back.
impl BufferSet {
    /// As [`BufferSet::bytes`], to be overwritten.
    pub fn bytes_mut(&mut self, number: usize, part: usize, length: u64) -> &mut [u8] {
        match &mut self.staging {
            Some(Staging { read, places, .. }) => read.bytes_mut(number, places[part].0, length),
            None => self.device.bytes_mut(number, self.ranges[self.read[part]].0, length),
        }
    }
}

impl Upload {
    /// Records copies and zeros, and that kernels wait for them.
    pub fn record(&self, slot: &BatchSlot) {
        let Some(from) = self.from else { return };
        slot.copy(from, self.to, &self.copies);
        self.zeros.iter().for_each(|range| slot.zero(self.to, *range));
        slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
    }
}

impl Readback {
    /// Records that what kernels have written is copied, and seen here.
    pub fn record(&self, slot: &BatchSlot) {
        let mut last = vk::PipelineStageFlags::COMPUTE_SHADER;
        if let Some(to) = self.to {
            slot.barrier(last, vk::PipelineStageFlags::TRANSFER);
            slot.copy(self.from, to, &self.copies);
            last = vk::PipelineStageFlags::TRANSFER;
        }
        slot.barrier(last, vk::PipelineStageFlags::HOST);
    }
}
