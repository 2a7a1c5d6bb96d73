//! The Vulkan device: what is there, memory on it, and kernels run on batches of bricks.
//!
//! The only room beside `mmap` with `unsafe`: Vulkan's functions have rules that no type holds. What the rules ask for
//! is kept here, so that nothing outside can break them.
//!
//! Buffers belong to a [`DeviceLane`], a lane to one thread at a time, and every number that a kernel uses as an index is
//! bounded by the batch that [`DeviceLane::submit`] has checked.
//!
//! It knows nothing of trees and soups; `backend` decides what becomes a batch.

mod brute;
mod context;
mod device;
mod exchange;
mod failure;
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
mod sums;
mod swapchain;

pub use brute::AngleSums;
pub use device::{DeviceSettings, Gpu};
pub use failure::{DeviceFailure, DeviceUnavailable, InjectedFailure, Stage, WrongAnswer};
pub use instance::{DeviceInfo, DeviceKind, devices, may_be_there};
pub use lane::{BatchInput, BatchOutput, DeviceLane};
pub use present::{PresentOutcome, Presenter};
pub use rays::{RayCaster, RayKernels, RayScene, RoundEnd};
pub use slot::Seconds;
pub use sums::{SumCapacity, SumInput, SumLane, SumTree};
