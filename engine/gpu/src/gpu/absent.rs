//! Devices of a library that was built without Vulkan: there are none. The types are there, so that their users need no
//! second text, but no value of them.

use super::batch::{BatchInput, BatchOutput, DeviceSettings, Seconds};
use super::failure::{DeviceFailure, DeviceUnavailable, InjectedFailure, WrongAnswer};
use super::info::DeviceInfo;
use super::ray_scene::{RayScene, RoundEnd};
use super::splat_batch::{SplatBatch, SplatCapacity};
use super::sum_batch::{SumCapacity, SumInput};
use brickfield_shaders::Sight;
use std::sync::{Arc, Mutex};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Never {}

fn unavailable() -> DeviceUnavailable {
    DeviceUnavailable::new(
        "this program was built without the feature `vulkan`",
        "build it with that feature",
    )
}

/// All devices of the machine.
///
/// # Errors
/// Always: the library was built without Vulkan.
pub fn devices() -> Result<Vec<DeviceInfo>, DeviceUnavailable> {
    Err(unavailable())
}

/// A device with the kernels that evaluate bricks: there is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gpu(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl Gpu {
    /// Opens none.
    ///
    /// # Errors
    /// Always: the library was built without Vulkan.
    pub fn open(_: &DeviceSettings) -> Result<Gpu, DeviceUnavailable> {
        Err(unavailable())
    }

    pub fn second(&self) -> Option<&Gpu> {
        match self.0 {}
    }

    pub fn info(&self) -> &DeviceInfo {
        match self.0 {}
    }

    pub fn memory(&self) -> u64 {
        match self.0 {}
    }

    pub fn allocated(&self) -> (u64, u64) {
        match self.0 {}
    }

    pub fn is_lost(&self) -> bool {
        match self.0 {}
    }

    pub fn messages(&self) -> Arc<Mutex<Vec<String>>> {
        match self.0 {}
    }

    pub fn inject(&self, _: InjectedFailure) {
        match self.0 {}
    }

    pub fn spoil(&self, _: WrongAnswer) {
        match self.0 {}
    }
}

/// Buffers and commands of one thread: there are none.
pub struct DeviceLane(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl DeviceLane {
    pub fn new(gpu: &Gpu, _: u64) -> Result<DeviceLane, DeviceFailure> {
        match gpu.0 {}
    }

    pub fn is_on(&self, _: &Gpu) -> bool {
        match self.0 {}
    }

    pub fn room(&self) -> (usize, usize) {
        match self.0 {}
    }

    pub fn is_full(&self) -> bool {
        match self.0 {}
    }

    pub fn is_idle(&self) -> bool {
        match self.0 {}
    }

    pub fn submit(&mut self, _: &BatchInput, _: usize) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn receive(&mut self) -> Result<Option<Seconds>, DeviceFailure> {
        match self.0 {}
    }

    pub fn output(&self) -> Option<BatchOutput<'_>> {
        match self.0 {}
    }

    pub fn release(&mut self) {
        match self.0 {}
    }
}

/// A cluster tree on a device: there is none.
pub struct SumTree(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl SumTree {
    pub fn new(gpu: &Gpu, _: &[u32], _: &[u32]) -> Result<SumTree, DeviceFailure> {
        match gpu.0 {}
    }
}

/// Sums of one thread on a device: there are none.
pub struct SumLane(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl SumLane {
    pub fn new(tree: &Arc<SumTree>, _: u64) -> Result<SumLane, DeviceFailure> {
        match tree.0 {}
    }

    pub fn room(&self) -> SumCapacity {
        match self.0 {}
    }

    pub fn is_full(&self) -> bool {
        match self.0 {}
    }

    pub fn submit(&mut self, _: &SumInput, _: u8) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn receive(&mut self) -> Result<(&[[i32; 4]], Option<f64>), DeviceFailure> {
        match self.0 {}
    }
}

/// Sums of solid angles on a device: there are none.
pub struct AngleSums(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl AngleSums {
    pub const FACETS_MAX: usize = 1;

    pub fn new(gpu: &Gpu) -> Result<AngleSums, DeviceFailure> {
        match gpu.0 {}
    }

    pub fn add(&mut self, _: &[[[f32; 3]; 3]], _: &[[f32; 3]], _: &mut [i64]) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn windings(_: &[i64]) -> Vec<f64> {
        Vec::new()
    }
}

/// Kernels that follow rays: there are none.
#[derive(Clone)]
pub struct RayKernels(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl RayKernels {
    pub fn new(gpu: &Gpu) -> Result<RayKernels, DeviceFailure> {
        match gpu.0 {}
    }
}

/// Rays, bricks in pages, and their picture on a device: there are none.
pub struct RayCaster(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl RayCaster {
    pub fn new(gpu: &Gpu, _: &RayKernels, _: RayScene<'_>) -> Result<RayCaster, DeviceFailure> {
        match gpu.0 {}
    }

    pub fn pages(&self) -> u32 {
        match self.0 {}
    }

    pub fn staged_max(&self) -> u32 {
        match self.0 {}
    }

    pub fn tiles_max(&self, _: u32) -> u32 {
        match self.0 {}
    }

    pub fn begin(&mut self, _: Sight, _: u32) {
        match self.0 {}
    }

    pub fn round(&mut self, _: bool) -> Result<RoundEnd, DeviceFailure> {
        match self.0 {}
    }

    pub fn wanted(&self) -> &[u32] {
        match self.0 {}
    }

    pub fn has(&self, _: u32) -> bool {
        match self.0 {}
    }

    pub fn bring(&mut self, _: u32, _: impl FnOnce(&mut [u32]) -> usize) -> bool {
        match self.0 {}
    }

    pub fn pixels(&mut self) -> Result<&[[u32; 2]], DeviceFailure> {
        match self.0 {}
    }
}

/// Splats in tiles on a device: there are none.
pub struct SplatDrawer(Never);

#[allow(missing_docs, clippy::missing_errors_doc)]
impl SplatDrawer {
    pub fn new(gpu: &Gpu) -> Result<SplatDrawer, DeviceFailure> {
        match gpu.0 {}
    }

    pub fn room(&self) -> SplatCapacity {
        match self.0 {}
    }

    pub fn draw(&mut self, _: &SplatBatch) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn find_nearest(&mut self, _: &SplatBatch, _: bool) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn blend(&mut self, _: &SplatBatch) -> Result<(), DeviceFailure> {
        match self.0 {}
    }

    pub fn pixels(&self, _: usize) -> &[[f32; 4]] {
        match self.0 {}
    }
}
