//! The sum over all triangles at each point, on the device: the paper's method (Jacobson et al. 2013), one point an
//! invocation.

use super::device::Gpu;
use super::failure::Failure;
use super::kernels::{Kernels, Sets};
use super::memory::{Arena, RANGE_ALIGNMENT, Use};
use super::slot::Slot;
use ash::vk;
use brickfield_shaders::{ANGLE_BITS, BRUTE, BRUTE_BUFFERS, STEPS_MAX, Sum, WORKGROUP};

/// Points of a run: 64 workgroups.
const POINTS: usize = 64 * WORKGROUP as usize;
/// Parts of the facets of a run, each of which has its own sums: the run takes 4 s on two processor cores.
const PARTS: usize = 64;
/// Facets of a run.
const FACETS: usize = PARTS * STEPS_MAX as usize;

/// Bytes of each buffer, by binding.
const LENGTHS: [u64; BRUTE_BUFFERS.len()] =
    [size_of::<Sum>() as u64, FACETS as u64 * 36, POINTS as u64 * 12, (PARTS * POINTS) as u64 * 8];
/// Buffers that are uploaded.
const UPLOADED: usize = 3;

/// Sums solid angles in single precision.
pub struct AngleSums {
    // Dropped first: it waits for the device.
    slot: Slot,
    upload: Arena,
    device: Arena,
    read: Arena,
    sets: Sets,
    kernels: Kernels,
    gpu: Gpu,
}

/// Offset and length of each buffer.
fn ranges() -> [(u64, u64); LENGTHS.len()] {
    let mut end = 0;
    LENGTHS.map(|length| {
        let from = end;
        end = (from + length).next_multiple_of(RANGE_ALIGNMENT);
        (from, length)
    })
}

impl AngleSums {
    /// Buffers and kernel.
    ///
    /// # Errors
    /// If the device has no room for them, or fails.
    pub fn new(gpu: &Gpu) -> Result<AngleSums, Failure> {
        gpu.check()?;
        let context = &gpu.context;
        let ranges = ranges();
        let end = |buffer: usize| ranges[buffer].0 + ranges[buffer].1;
        let kernels = Kernels::new(context, BRUTE_BUFFERS.len(), &[(BRUTE, c"add_up")])?;
        let device = Arena::new(context, Use::Device, end(LENGTHS.len() - 1), 1)?;
        let upload = Arena::new(context, Use::Upload, end(UPLOADED - 1), 1)?;
        let read = Arena::new(context, Use::ReadBack, LENGTHS[UPLOADED], 1)?;
        let sets = kernels.sets(1)?;
        sets.point(0, 0, device.buffer(0), &ranges);
        Ok(AngleSums { slot: Slot::new(context)?, upload, device, read, sets, kernels, gpu: gpu.clone() })
    }

    /// Facets that one call of [`AngleSums::add`] takes at most.
    pub const FACETS_MAX: usize = FACETS;

    /// Adds the solid angles of facets, seen from points, to the angles, in steradians times 2^[`ANGLE_BITS`].
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// If there are too many facets, or not as many angles as points.
    pub fn add(
        &mut self,
        facets: &[[[f32; 3]; 3]],
        points: &[[f32; 3]],
        angles: &mut [i64],
    ) -> Result<(), Failure> {
        assert!(facets.len() <= FACETS && points.len() == angles.len());
        if facets.is_empty() {
            return Ok(());
        }
        for (points, angles) in points.chunks(POINTS).zip(angles.chunks_mut(POINTS)) {
            self.gpu.check()?;
            self.run(facets, points)?;
            let parts = facets.len().div_ceil(STEPS_MAX as usize);
            let sums: &[i64] = bytemuck::cast_slice(self.read.bytes(0, 0, (parts * points.len() * 8) as u64));
            for part in sums.chunks_exact(points.len()) {
                angles.iter_mut().zip(part).for_each(|(angle, sum)| *angle += sum);
            }
        }
        Ok(())
    }

    fn run(&mut self, facets: &[[[f32; 3]; 3]], points: &[[f32; 3]]) -> Result<(), Failure> {
        let sum = Sum { points: points.len() as u32, facets: facets.len() as u32 };
        let inputs: [&[u8]; UPLOADED] =
            [bytemuck::bytes_of(&sum), bytemuck::cast_slice(facets), bytemuck::cast_slice(points)];
        let ranges = ranges();
        let mut copies = [vk::BufferCopy::default(); UPLOADED];
        for ((copy, (from, _)), input) in copies.iter_mut().zip(ranges).zip(inputs) {
            let size = input.len() as u64;
            self.upload.bytes_mut(0, from, size).copy_from_slice(input);
            *copy = vk::BufferCopy { src_offset: from, dst_offset: from, size };
        }
        let parts = sum.facets.div_ceil(STEPS_MAX);
        let size = u64::from(parts) * u64::from(sum.points) * 8;
        let back = [vk::BufferCopy { src_offset: ranges[UPLOADED].0, dst_offset: 0, size }];
        let (kernels, gpu) = (&self.kernels, &self.gpu);
        let (upload, buffer, read) = (self.upload.buffer(0), self.device.buffer(0), self.read.buffer(0));
        let sets = [self.sets.sets[0]];
        self.slot.run(|slot| {
            let (raw, commands) = (&gpu.context.raw, slot.commands());
            let point = vk::PipelineBindPoint::COMPUTE;
            // SAFETY: the buffers have the lengths of `LENGTHS`, within which the assertions of `add` keep everything;
            // pipeline and set have the same layout.
            unsafe { raw.cmd_copy_buffer(commands, upload, buffer, &copies) };
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::COMPUTE_SHADER);
            // SAFETY: as above.
            unsafe {
                raw.cmd_bind_pipeline(commands, point, kernels.pipeline(0));
                raw.cmd_bind_descriptor_sets(commands, point, kernels.layout, 0, &sets, &[]);
                raw.cmd_dispatch(commands, sum.points.div_ceil(WORKGROUP), parts, 1);
            }
            slot.barrier(vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
            // SAFETY: as above.
            unsafe { raw.cmd_copy_buffer(commands, buffer, read, &back) };
            slot.barrier(vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        })?;
        self.slot.wait()
    }

    /// Angles as [`AngleSums::add`] leaves them, as shares of the full sphere: winding numbers.
    pub fn windings(angles: &[i64]) -> Vec<f64> {
        let sphere = 4.0 * std::f64::consts::PI * (1u64 << ANGLE_BITS) as f64;
        angles.iter().map(|angle| *angle as f64 / sphere).collect()
    }
}
