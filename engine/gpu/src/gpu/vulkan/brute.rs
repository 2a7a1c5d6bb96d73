//! The sum over all triangles at each point, on the device: the paper's method (Jacobson et al. 2013), one point an
//! invocation.

use super::device::Gpu;
use super::exchange::{BufferLayout, BufferSet};
use super::failure::DeviceFailure;
use super::kernels::{DescriptorSets, Kernels};
use super::memory::in_a_row;
use super::slot::BatchSlot;
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
    slot: BatchSlot,
    buffers: BufferSet,
    sets: DescriptorSets,
    kernels: Kernels,
    gpu: Gpu,
}

impl AngleSums {
    /// Buffers and kernel.
    ///
    /// # Errors
    /// If the device has no room for them, or fails.
    pub fn new(gpu: &Gpu) -> Result<AngleSums, DeviceFailure> {
        gpu.check()?;
        let context = &gpu.context;
        let kernels = Kernels::new(context, BRUTE_BUFFERS.len(), &[(BRUTE, c"add_up")])?;
        let layout = BufferLayout { ranges: in_a_row(LENGTHS), written: UPLOADED, read: &[UPLOADED] };
        let buffers = BufferSet::new(context, &layout, 1)?;
        let sets = kernels.sets(1)?;
        sets.point(0, 0, buffers.buffer(0), buffers.ranges());
        Ok(AngleSums { slot: BatchSlot::new(context)?, buffers, sets, kernels, gpu: gpu.clone() })
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
    ) -> Result<(), DeviceFailure> {
        assert!(facets.len() <= FACETS && points.len() == angles.len());
        if facets.is_empty() {
            return Ok(());
        }
        for (points, angles) in points.chunks(POINTS).zip(angles.chunks_mut(POINTS)) {
            self.gpu.check()?;
            self.run(facets, points)?;
            let parts = facets.len().div_ceil(STEPS_MAX as usize);
            let sums = self.buffers.bytes(0, 0, (parts * points.len() * 8) as u64);
            let sums: &[i64] = bytemuck::cast_slice(sums);
            for part in sums.chunks_exact(points.len()) {
                angles.iter_mut().zip(part).for_each(|(angle, sum)| *angle += sum);
            }
        }
        Ok(())
    }

    fn run(&mut self, facets: &[[[f32; 3]; 3]], points: &[[f32; 3]]) -> Result<(), DeviceFailure> {
        let sum = Sum { points: points.len() as u32, facets: facets.len() as u32 };
        let inputs: [&[u8]; UPLOADED] =
            [bytemuck::bytes_of(&sum), bytemuck::cast_slice(facets), bytemuck::cast_slice(points)];
        let parts = sum.facets.div_ceil(STEPS_MAX);
        let upload = self.buffers.write(0, &inputs, Vec::new());
        let read_back = self.buffers.read_back(0, &[u64::from(parts) * u64::from(sum.points) * 8]);
        let (kernels, set) = (&self.kernels, self.sets.sets[0]);
        self.slot.run(|slot| {
            upload.record(slot);
            slot.dispatch(kernels, 0, set, [sum.points.div_ceil(WORKGROUP), parts]);
            read_back.record(slot);
        })?;
        self.slot.wait()
    }

    /// Angles as [`AngleSums::add`] leaves them, as shares of the full sphere: winding numbers.
    pub fn windings(angles: &[i64]) -> Vec<f64> {
        let sphere = 4.0 * std::f64::consts::PI * (1u64 << ANGLE_BITS) as f64;
        angles.iter().map(|angle| *angle as f64 / sphere).collect()
    }
}
