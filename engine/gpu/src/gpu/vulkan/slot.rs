//! The commands of one batch at a time, and how they are recorded.

use super::batch::{KERNELS, Seconds};
use super::context::Context;
use super::failure::{DeviceFailure, Stage};
use super::kernels::Kernels;
use super::memory::{Arena, Range};
use ash::vk;
use std::sync::Arc;

/// Points of time that a batch notes: before, uploaded, after each kernel, read back.
const TIMES: u32 = KERNELS as u32 + 3;

/// Command buffer, semaphore and clock of one batch at a time.
pub(super) struct BatchSlot {
    context: Arc<Context>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    semaphore: vk::Semaphore,
    /// The semaphore's value when the last batch is done.
    value: u64,
    times: vk::QueryPool,
    /// Whether a batch may be on the device.
    pending: bool,
}

impl BatchSlot {
    pub fn new(context: &Arc<Context>) -> Result<BatchSlot, DeviceFailure> {
        let mut slot = BatchSlot {
            context: Arc::clone(context),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            semaphore: vk::Semaphore::null(),
            value: 0,
            times: vk::QueryPool::null(),
            pending: false,
        };
        let device = &context.raw;
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(context.hardware.family);
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let times =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(TIMES);
        // SAFETY: the device is alive and has timeline semaphores, and a clock where `tick_ns` says so; all of it is
        // destroyed in `drop`.
        unsafe {
            slot.pool = device.create_command_pool(&pool, None)?;
            slot.semaphore = device.create_semaphore(&semaphore, None)?;
            if context.hardware.tick_ns.is_some() {
                slot.times = device.create_query_pool(&times, None)?;
            }
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(slot.pool).command_buffer_count(1);
            slot.commands = device.allocate_command_buffers(&info)?[0];
        }
        Ok(slot)
    }

    /// Sends the commands that `record` records.
    pub fn run(&mut self, record: impl FnOnce(&BatchSlot)) -> Result<(), DeviceFailure> {
        let device = &self.context.raw;
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last batch was waited for, so nothing of the pool is in use.
        unsafe {
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())?;
            device.begin_command_buffer(self.commands, &begin)?;
        }
        record(self);
        // SAFETY: recording began above.
        unsafe { device.end_command_buffer(self.commands) }?;
        self.context.submit(self.commands, self.semaphore, self.value + 1)?;
        self.value += 1;
        self.pending = true;
        Ok(())
    }

    /// Begins to note times.
    pub fn reset_times(&self) {
        if self.context.hardware.tick_ns.is_some() {
            // SAFETY: the buffer is being recorded; the queries of the last batch were read.
            unsafe { self.context.raw.cmd_reset_query_pool(self.commands, self.times, 0, TIMES) };
        }
    }

    /// Notes when all before is done.
    pub fn note_time(&self, number: u32) {
        if self.context.hardware.tick_ns.is_some() {
            // SAFETY: the buffer is being recorded; the query was reset.
            unsafe {
                self.context.raw.cmd_write_timestamp(
                    self.commands,
                    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                    self.times,
                    number,
                );
            }
        }
    }

    /// Notes the time for all numbers from this one on: what has fewer steps than a batch of bricks.
    pub fn note_times_from(&self, number: u32) {
        (number..TIMES).for_each(|number| self.note_time(number));
    }

    /// What the stages before have written, those behind may read and write.
    pub fn barrier(&self, before: vk::PipelineStageFlags, behind: vk::PipelineStageFlags) {
        let writes = match before {
            vk::PipelineStageFlags::TRANSFER => vk::AccessFlags::TRANSFER_WRITE,
            _ => vk::AccessFlags::SHADER_WRITE,
        };
        let uses = match behind {
            vk::PipelineStageFlags::HOST => vk::AccessFlags::HOST_READ,
            vk::PipelineStageFlags::TRANSFER => {
                vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE
            }
            _ => vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE,
        };
        let all = [vk::MemoryBarrier::default().src_access_mask(writes).dst_access_mask(uses)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the buffer is being recorded.
        unsafe { self.context.raw.cmd_pipeline_barrier(self.commands, before, behind, none, &all, &[], &[]) };
    }

    /// Copies parts of one buffer to another, within both.
    pub fn copy(&self, from: vk::Buffer, to: vk::Buffer, copies: &[vk::BufferCopy]) {
        // SAFETY: the buffer is being recorded. Whoever asks for copies has made both buffers from the lengths by which
        // they are placed, and none is empty or overlaps another; barriers keep them apart from what uses the buffers.
        unsafe { self.context.raw.cmd_copy_buffer(self.commands, from, to, copies) };
    }

    /// Fills a part of a buffer with zeros.
    pub fn zero(&self, buffer: vk::Buffer, (from, length): Range) {
        // SAFETY: as in `copy`; parts begin and end at multiples of four.
        unsafe { self.context.raw.cmd_fill_buffer(self.commands, buffer, from, length, 0) };
    }

    /// Runs a kernel on a set of buffers.
    pub fn dispatch(&self, kernels: &Kernels, number: usize, set: vk::DescriptorSet, groups: [u32; 2]) {
        let (raw, point) = (&self.context.raw, vk::PipelineBindPoint::COMPUTE);
        // SAFETY: the buffer is being recorded; the set was made for the layout of these kernels. What a kernel takes for
        // an index was checked before it was written, and rooms are so small that there are fewer groups than any device
        // allows.
        unsafe {
            raw.cmd_bind_pipeline(self.commands, point, kernels.pipeline(number));
            raw.cmd_bind_descriptor_sets(self.commands, point, kernels.layout, 0, &[set], &[]);
            raw.cmd_dispatch(self.commands, groups[0], groups[1], 1);
        }
    }

    /// Fills a part of a buffer that nothing uses, through one for uploads unless it is mapped itself.
    pub fn put(
        &mut self,
        upload: Option<&mut Arena>,
        to: &mut Arena,
        from: u64,
        bytes: &[u8],
    ) -> Result<(), DeviceFailure> {
        let Some(upload) = upload else {
            to.bytes_mut(0, from, bytes.len() as u64).copy_from_slice(bytes);
            return Ok(());
        };
        let part = upload.size();
        for (number, bytes) in (0..).zip(bytes.chunks(part as usize)) {
            let size = bytes.len() as u64;
            upload.bytes_mut(0, 0, size).copy_from_slice(bytes);
            let copies = [vk::BufferCopy { src_offset: 0, dst_offset: from + number * part, size }];
            self.run(|slot| {
                slot.copy(upload.buffer(0), to.buffer(0), &copies);
                slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
            })?;
            self.wait()?;
        }
        Ok(())
    }

    /// Waits for what was sent.
    pub fn wait(&mut self) -> Result<(), DeviceFailure> {
        let waited = self.context.wait(self.semaphore, self.value);
        self.pending = false;
        waited
    }

    /// How long the last batch took, if the device has a clock.
    pub fn seconds(&self) -> Result<Option<Seconds>, DeviceFailure> {
        let Some(tick_ns) = self.context.hardware.tick_ns else { return Ok(None) };
        let mut ticks = [0u64; TIMES as usize];
        // SAFETY: the batch is done, so that all queries are there; the array has a word for each.
        unsafe {
            self.context.raw.get_query_pool_results(
                self.times,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64,
            )?;
        }
        let between = |i: usize| ticks[i + 1].saturating_sub(ticks[i]) as f64 * f64::from(tick_ns) * 1e-9;
        Ok(Some(Seconds {
            upload: between(0),
            kernels: std::array::from_fn(|number| between(number + 1)),
            read: between(KERNELS + 1),
        }))
    }
}

impl Drop for BatchSlot {
    fn drop(&mut self) {
        if self.pending && !self.context.is_abandoned() {
            // Whatever comes of it: a device that is lost uses nothing any more, and one that does not answer is
            // abandoned.
            let _ = self.context.wait(self.semaphore, self.value);
        }
        if self.context.is_abandoned() || self.context.strike(Stage::FreeCommands).is_err() {
            return;
        }
        let device = &self.context.raw;
        // SAFETY: nothing of it is in use. Destroying nothing is allowed.
        unsafe {
            device.destroy_query_pool(self.times, None);
            device.destroy_semaphore(self.semaphore, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}
