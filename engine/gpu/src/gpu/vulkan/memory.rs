//! Memory on the device: an arena is one allocation with some buffers in it, all of which live as long as it does.

use super::context::Context;
use super::failure::{DeviceFailure, Stage};
use super::hardware::MemoryUse;
use ash::vk;
use std::sync::Arc;

/// Alignment of ranges that kernels see: Vulkan lets no device ask for more.
pub(super) const RANGE_ALIGNMENT: u64 = 256;

/// Offset and length of a part of a buffer, in bytes.
pub(super) type Range = (u64, u64);

/// Parts of these lengths, one behind the other.
pub(super) fn in_a_row<const N: usize>(lengths: [u64; N]) -> [Range; N] {
    let mut end = 0;
    lengths.map(|length| {
        let from = end;
        end = (from + length).next_multiple_of(RANGE_ALIGNMENT);
        (from, length)
    })
}

/// Where the last of some parts ends.
pub(super) fn end_of(ranges: &[Range]) -> u64 {
    ranges.last().map_or(0, |(from, length)| from + length)
}

/// Buffers of equal size in one allocation.
pub(super) struct Arena {
    context: Arc<Context>,
    memory: vk::DeviceMemory,
    /// Bytes that count for the allocation.
    reserved: u64,
    buffers: Vec<vk::Buffer>,
    size: u64,
    stride: u64,
    /// Where the memory is mapped; null if it is the device's alone.
    mapped: *mut u8,
}

// SAFETY: the pointer is to memory that the arena alone owns; reads go through `&self`, writes through `&mut self`.
unsafe impl Send for Arena {}
// SAFETY: as above: whoever shares an arena only reads what is mapped, and its handles.
unsafe impl Sync for Arena {}

impl Arena {
    /// `count` buffers of `size` bytes.
    pub fn new(
        context: &Arc<Context>,
        purpose: MemoryUse,
        size: u64,
        count: usize,
    ) -> Result<Arena, DeviceFailure> {
        context.strike(Stage::Allocate)?;
        // Filled as soon as something is made, so that `drop` cleans up after a failure.
        let mut arena = Arena {
            context: Arc::clone(context),
            memory: vk::DeviceMemory::null(),
            reserved: 0,
            buffers: Vec::new(),
            size: size.next_multiple_of(4),
            stride: 0,
            mapped: std::ptr::null_mut(),
        };
        arena.fill(purpose, count)?;
        Ok(arena)
    }

    fn fill(&mut self, purpose: MemoryUse, count: usize) -> Result<(), DeviceFailure> {
        let device = &self.context.raw;
        let usage = match purpose {
            MemoryUse::Device => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST
            }
            MemoryUse::Upload => vk::BufferUsageFlags::TRANSFER_SRC,
            MemoryUse::ReadBack => vk::BufferUsageFlags::TRANSFER_DST,
        };
        let info = vk::BufferCreateInfo::default().size(self.size).usage(usage);
        for _ in 0..count {
            // SAFETY: the device is alive; the buffer is destroyed in `drop`.
            self.buffers.push(unsafe { device.create_buffer(&info, None) }?);
        }
        // SAFETY: the buffer is the device's.
        let needs = unsafe { device.get_buffer_memory_requirements(self.buffers[0]) };
        self.stride = needs.size.next_multiple_of(needs.alignment.max(RANGE_ALIGNMENT));
        let kind = self
            .context
            .hardware
            .memory_type(needs.memory_type_bits, purpose)
            .ok_or(DeviceFailure::OutOfMemory)?;
        let bytes = self.stride * count as u64;
        self.context.hardware.reserve(bytes)?;
        self.reserved = bytes;
        let info = vk::MemoryAllocateInfo::default().allocation_size(bytes).memory_type_index(kind);
        // SAFETY: the type is one that the buffers may have; buffers of equal size and use have equal needs, and each
        // lies in its own stride of the allocation. The memory is mapped once and freed in `drop`.
        unsafe {
            self.memory = device.allocate_memory(&info, None)?;
            for (number, buffer) in self.buffers.iter().enumerate() {
                device.bind_buffer_memory(*buffer, self.memory, self.stride * number as u64)?;
            }
            if purpose != MemoryUse::Device || self.context.hardware.shares_memory() {
                let all = vk::MemoryMapFlags::empty();
                self.mapped = device.map_memory(self.memory, 0, vk::WHOLE_SIZE, all)?.cast();
            }
        }
        Ok(())
    }

    pub fn buffer(&self, number: usize) -> vk::Buffer {
        self.buffers[number]
    }

    /// Bytes of each buffer.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Whether it is written and read here.
    pub fn is_mapped(&self) -> bool {
        !self.mapped.is_null()
    }

    /// The bytes of a mapped buffer from `from` on, which the device must not be using.
    pub fn bytes(&self, number: usize, from: u64, length: u64) -> &[u8] {
        let at = self.place(number, from, length);
        // SAFETY: `place` has checked that the bytes lie in the mapped buffer; writes of the device to coherent memory
        // are made visible by the barrier to the host in each batch and the wait for it. Any bytes are bytes, and memory
        // of the driver's counts as written.
        unsafe { std::slice::from_raw_parts(at, length as usize) }
    }

    /// As [`Arena::bytes`], for writing.
    pub fn bytes_mut(&mut self, number: usize, from: u64, length: u64) -> &mut [u8] {
        let at = self.place(number, from, length);
        // SAFETY: as in `bytes`; the arena is borrowed as a whole, so that nobody else has a part of it.
        unsafe { std::slice::from_raw_parts_mut(at, length as usize) }
    }

    fn place(&self, number: usize, from: u64, length: u64) -> *mut u8 {
        assert!(self.is_mapped(), "only memory of the host's is mapped");
        assert!(number < self.buffers.len() && from + length <= self.size, "beyond the buffer");
        // SAFETY: by the assertions the place lies within the mapped allocation.
        unsafe { self.mapped.add((self.stride * number as u64 + from) as usize) }
    }
}

impl Drop for Arena {
    fn drop(&mut self) {
        if self.context.is_abandoned() || self.context.strike(Stage::FreeMemory).is_err() {
            return;
        }
        let device = &self.context.raw;
        // SAFETY: whoever owns an arena waits for the device before dropping it. Destroying nothing is allowed.
        unsafe {
            self.buffers.iter().for_each(|buffer| device.destroy_buffer(*buffer, None));
            device.free_memory(self.memory, None);
        }
        self.context.hardware.release(self.reserved);
    }
}
