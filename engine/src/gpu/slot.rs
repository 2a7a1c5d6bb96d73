//! One place of a lane's ring: the commands of a batch, from upload to read-back.

use super::context::Context;
use super::failure::{Failure, Stage};
use super::kernels::Kernels;
use super::sizes::{READ, Ranges, Sizes, UPLOADED};
use ash::vk;
use brickfield_shaders::{POINTS, WORKGROUP};
use std::sync::Arc;

/// Spans that one invocation follows at most, of 33 lines each: see [`brickfield_shaders::STEPS_MAX`] for what bounds the
/// steps of its loops.
const SPANS_OF_INVOCATION: u32 = 16;
/// Spans that a triangle has in a brick at most, on the way to samples and in all.
const SPANS_OF_PAIR: [u32; 2] = [POINTS + 2, 3 * POINTS];
/// Workgroups for each brick that share the edges with several crossings.
const RESOLVE_GROUPS: u32 = 4;
/// Kernels of a batch.
pub(super) const KERNELS: usize = 5;
/// Points of time that a batch notes: before, uploaded, after each kernel, read back.
const TIMES: u32 = KERNELS as u32 + 3;

/// Seconds that a batch took on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// To upload its input.
    pub upload: f64,
    /// To compute, by kernel.
    pub kernels: [f64; KERNELS],
    /// To read its results back.
    pub read: f64,
}

/// Command buffer, semaphore and clock of one batch at a time.
pub(super) struct Slot {
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

/// The buffers of a slot.
#[derive(Clone, Copy)]
pub(super) struct Buffers {
    pub device: vk::Buffer,
    /// None if the device's buffer is written and read by the host.
    pub staged: Option<Staged>,
    pub set: vk::DescriptorSet,
}

/// From where and to where a batch is copied.
#[derive(Clone, Copy)]
pub(super) struct Staged {
    pub upload: vk::Buffer,
    pub read: vk::Buffer,
}

impl Slot {
    pub fn new(context: &Arc<Context>) -> Result<Slot, Failure> {
        let mut slot = Slot {
            context: Arc::clone(context),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            semaphore: vk::Semaphore::null(),
            value: 0,
            times: vk::QueryPool::null(),
            pending: false,
        };
        let device = &context.raw;
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(context.family);
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let times =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(TIMES);
        // SAFETY: the device is alive and has timeline semaphores, and a clock where `tick_ns` says so; all of it is
        // destroyed in `drop`.
        unsafe {
            slot.pool = device.create_command_pool(&pool, None)?;
            slot.semaphore = device.create_semaphore(&semaphore, None)?;
            if context.tick_ns.is_some() {
                slot.times = device.create_query_pool(&times, None)?;
            }
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(slot.pool).command_buffer_count(1);
            slot.commands = device.allocate_command_buffers(&info)?[0];
        }
        Ok(slot)
    }

    /// Sends a batch that lies in the upload buffer, or in the device's if nothing is staged. `zeros` are the offsets and
    /// lengths of what is still to be zeroed, if it is staged. `load` is what it takes of the sizes of the buffers.
    pub fn submit(
        &mut self,
        kernels: &Kernels,
        buffers: Buffers,
        zeros: &[(u64, u64)],
        sizes: &Sizes,
        load: &Sizes,
    ) -> Result<(), Failure> {
        let ranges = sizes.ranges();
        self.run(|slot| {
            slot.reset_times();
            slot.note_time(0);
            if let Some(staged) = buffers.staged {
                slot.record_upload(staged, buffers, &ranges, zeros, load);
                slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
            }
            slot.note_time(1);
            slot.record_kernels(kernels, buffers, load);
            let mut last = vk::PipelineStageFlags::COMPUTE_SHADER;
            if let Some(staged) = buffers.staged {
                slot.barrier(last, vk::PipelineStageFlags::TRANSFER);
                slot.record_read_back(staged, buffers, &ranges, sizes, load);
                last = vk::PipelineStageFlags::TRANSFER;
            }
            slot.barrier(last, vk::PipelineStageFlags::HOST);
            slot.note_time(TIMES - 1);
        })
    }

    /// Sends the commands that `record` records.
    pub fn run(&mut self, record: impl FnOnce(&Slot)) -> Result<(), Failure> {
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

    /// The command buffer, while it is recorded.
    pub fn commands(&self) -> vk::CommandBuffer {
        self.commands
    }

    /// Begins to note times.
    pub fn reset_times(&self) {
        if self.context.tick_ns.is_some() {
            // SAFETY: the buffer is being recorded; the queries of the last batch were read.
            unsafe { self.context.raw.cmd_reset_query_pool(self.commands, self.times, 0, TIMES) };
        }
    }

    /// Notes when all before is done.
    pub fn note_time(&self, number: u32) {
        if self.context.tick_ns.is_some() {
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

    fn record_upload(
        &self,
        staged: Staged,
        buffers: Buffers,
        ranges: &Ranges,
        zeros: &[(u64, u64)],
        load: &Sizes,
    ) {
        let lengths = load.lengths();
        let copies: [vk::BufferCopy; UPLOADED] = std::array::from_fn(|i| vk::BufferCopy {
            src_offset: ranges[i].0,
            dst_offset: ranges[i].0,
            size: lengths[i],
        });
        // SAFETY: the load fits the sizes from which the buffers were made, and no part of it is empty.
        unsafe {
            let device = &self.context.raw;
            device.cmd_copy_buffer(self.commands, staged.upload, buffers.device, &copies);
            for &(from, length) in zeros {
                device.cmd_fill_buffer(self.commands, buffers.device, from, length, 0);
            }
        }
    }

    fn record_kernels(&self, kernels: &Kernels, buffers: Buffers, load: &Sizes) {
        let of_pairs = load.pairs.div_ceil(WORKGROUP);
        let rooms = [load.way_spans, load.way_spans + load.other_spans];
        let [of_way, of_spans] = std::array::from_fn(|i| {
            let spans = rooms[i].min(load.pairs * SPANS_OF_PAIR[i]);
            spans.div_ceil(WORKGROUP * SPANS_OF_INVOCATION)
        });
        let groups = [of_pairs, of_way, load.bricks, of_spans, load.bricks * RESOLVE_GROUPS];
        let device = &self.context.raw;
        for (number, groups) in groups.into_iter().enumerate() {
            if number > 0 {
                self.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::COMPUTE_SHADER);
            }
            // SAFETY: pipelines and set have the same layout; there are fewer groups than any device allows; indices in
            // the batch were checked before it was written.
            unsafe {
                let point = vk::PipelineBindPoint::COMPUTE;
                device.cmd_bind_pipeline(self.commands, point, kernels.pipeline(number));
                if number == 0 {
                    let sets = [buffers.set];
                    device.cmd_bind_descriptor_sets(self.commands, point, kernels.layout, 0, &sets, &[]);
                }
                device.cmd_dispatch(self.commands, groups, 1, 1);
            }
            self.note_time(number as u32 + 2);
        }
    }

    fn record_read_back(
        &self,
        staged: Staged,
        buffers: Buffers,
        ranges: &Ranges,
        sizes: &Sizes,
        load: &Sizes,
    ) {
        let (read, lengths) = (sizes.read_ranges(), load.lengths());
        let copies: [vk::BufferCopy; READ.len()] = std::array::from_fn(|i| vk::BufferCopy {
            src_offset: ranges[READ[i]].0,
            dst_offset: read[i].0,
            size: lengths[READ[i]],
        });
        // SAFETY: as in `record_upload`.
        unsafe { self.context.raw.cmd_copy_buffer(self.commands, buffers.device, staged.read, &copies) };
    }

    /// Waits for what was sent.
    pub fn wait(&mut self) -> Result<(), Failure> {
        let waited = self.context.wait(self.semaphore, self.value);
        self.pending = false;
        waited
    }

    /// How long the last batch took, if the device has a clock.
    pub fn seconds(&self) -> Result<Option<Seconds>, Failure> {
        let Some(tick_ns) = self.context.tick_ns else { return Ok(None) };
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

impl Drop for Slot {
    fn drop(&mut self) {
        if self.pending {
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
