//! Kernels: compute pipelines over some storage buffers.

use super::context::Context;
use super::failure::DeviceFailure;
use super::memory::Range;
use ash::vk;
use brickfield_shaders::Shader;
use std::ffi::CStr;
use std::sync::Arc;

/// Pipelines that see the same buffers.
pub(super) struct Kernels {
    context: Arc<Context>,
    pub set_layout: vk::DescriptorSetLayout,
    pub layout: vk::PipelineLayout,
    pipelines: Vec<vk::Pipeline>,
    buffers: u32,
}

impl Kernels {
    /// Compiles entry points of shaders that see this many storage buffers.
    pub fn new(
        context: &Arc<Context>,
        buffers: usize,
        entries: &[(Shader, &CStr)],
    ) -> Result<Kernels, DeviceFailure> {
        let mut kernels = Kernels {
            context: Arc::clone(context),
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pipelines: Vec::new(),
            buffers: buffers as u32,
        };
        let device = &context.raw;
        let binding = |number: u32| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(number)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = (0..kernels.buffers).map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive; what is made is destroyed in `drop`.
        kernels.set_layout = unsafe { device.create_descriptor_set_layout(&info, None) }?;
        let layouts = [kernels.set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        // SAFETY: as above; the layout of the set was just made.
        kernels.layout = unsafe { device.create_pipeline_layout(&info, None) }?;
        // At once: one after the other they take some 20 ms of processor time.
        let made: Vec<_> = std::thread::scope(|scope| {
            let kernels = &kernels;
            let compile =
                |&(shader, entry): &(Shader, _)| scope.spawn(move || kernels.compile(shader, entry));
            let running: Vec<_> = entries.iter().map(compile).collect();
            running.into_iter().map(|thread| thread.join().expect("it does not panic")).collect()
        });
        kernels.pipelines.extend(made.iter().flatten());
        match made.into_iter().find_map(Result::err) {
            Some(failure) => Err(failure),
            None => Ok(kernels),
        }
    }

    fn compile(&self, shader: Shader, entry: &CStr) -> Result<vk::Pipeline, DeviceFailure> {
        let device = &self.context.raw;
        let info = vk::ShaderModuleCreateInfo::default().code(shader.words);
        // SAFETY: the words are valid SPIR-V, made at build time, that sees no buffers but those of the layout and asks
        // for no feature but 64-bit integers, which the device has. The module is not needed behind the pipeline.
        unsafe {
            let module = device.create_shader_module(&info, None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(entry);
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout);
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            device.destroy_shader_module(module, None);
            made.map(|pipelines| pipelines[0]).map_err(|(_, result)| result.into())
        }
    }

    /// By the order of their entry points.
    pub fn pipeline(&self, number: usize) -> vk::Pipeline {
        self.pipelines[number]
    }

    /// A pool for so many sets of buffers, with the sets.
    pub fn sets(&self, count: u32) -> Result<DescriptorSets, DeviceFailure> {
        let sizes = [vk::DescriptorPoolSize::default()
            .ty(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count(self.buffers * count)];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(count).pool_sizes(&sizes);
        // SAFETY: the device is alive; the pool is destroyed by `DescriptorSets`.
        let pool = unsafe { self.context.raw.create_descriptor_pool(&info, None) }?;
        let mut sets = DescriptorSets { context: Arc::clone(&self.context), pool, sets: Vec::new() };
        let layouts = vec![self.set_layout; count as usize];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for exactly these.
        sets.sets = unsafe { self.context.raw.allocate_descriptor_sets(&info) }?;
        Ok(sets)
    }
}

impl Drop for Kernels {
    fn drop(&mut self) {
        if self.context.is_abandoned() {
            return;
        }
        let device = &self.context.raw;
        // SAFETY: whoever runs kernels waits for them before letting go of these.
        unsafe {
            self.pipelines.iter().for_each(|pipeline| device.destroy_pipeline(*pipeline, None));
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// Sets of buffers.
pub(super) struct DescriptorSets {
    context: Arc<Context>,
    pool: vk::DescriptorPool,
    pub sets: Vec<vk::DescriptorSet>,
}

impl DescriptorSets {
    /// Points bindings of a set, from the number `first` on, to ranges (offset, length) of a buffer.
    pub fn point(&self, set: usize, first: u32, buffer: vk::Buffer, ranges: &[Range]) {
        let infos: Vec<[vk::DescriptorBufferInfo; 1]> = ranges
            .iter()
            .map(|&(offset, range)| [vk::DescriptorBufferInfo { buffer, offset, range }])
            .collect();
        let mut writes = Vec::with_capacity(infos.len());
        for (number, info) in (first..).zip(&infos) {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.sets[set])
                .dst_binding(number)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(info);
            writes.push(write);
        }
        // SAFETY: the set is not in use, and ranges lie within the buffer, which outlives the use of the set.
        unsafe { self.context.raw.update_descriptor_sets(&writes, &[]) };
    }
}

impl Drop for DescriptorSets {
    fn drop(&mut self) {
        if !self.context.is_abandoned() {
            // SAFETY: whoever uses the sets waits before dropping them.
            unsafe { self.context.raw.destroy_descriptor_pool(self.pool, None) };
        }
    }
}
