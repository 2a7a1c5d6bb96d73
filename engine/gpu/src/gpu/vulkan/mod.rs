//! Vulkan: devices, memory on them, and kernels run on batches of bricks.
//!
//! The only folder beside `mmap` with `unsafe`: Vulkan's functions have rules that no type holds. What the rules ask for
//! is kept here, so that nothing outside can break them.
//!
//! Buffers belong to a [`DeviceLane`], a lane to one thread at a time, and every number that a kernel uses as an index is
//! bounded by the batch that [`DeviceLane::submit`] has checked.

mod brute;
mod context;
mod device;
mod exchange;
mod hardware;
mod instance;
mod kernels;
mod lane;
mod memory;
mod present;
mod ray_capacity;
mod rays;
mod screen;
mod sizes;
mod slot;
mod splats;
mod sums;
mod swapchain;

pub use brute::AngleSums;
pub use device::Gpu;
pub use instance::devices;
pub use lane::DeviceLane;
pub use present::{PresentOutcome, Presenter};
pub use rays::{RayCaster, RayKernels};
pub use splats::SplatDrawer;
pub use sums::{SumLane, SumTree};

use super::{batch, failure, info, ray_scene, splat_batch, sum_batch};
