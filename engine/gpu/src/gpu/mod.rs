//! The device: what is there, and kernels run on batches of bricks.
//!
//! It knows nothing of trees and soups; `backend` decides what becomes a batch. Without the feature `vulkan` there are no
//! devices, and no program can hold one.

mod batch;
mod failure;
mod info;
mod ray_scene;
mod splat_batch;
mod sum_batch;

#[cfg(not(feature = "vulkan"))]
mod absent;
#[cfg(not(feature = "vulkan"))]
pub use absent::*;
#[cfg(feature = "vulkan")]
mod vulkan;
#[cfg(feature = "vulkan")]
pub use vulkan::*;

pub use batch::{BatchInput, BatchOutput, DeviceSettings, Seconds};
pub use failure::{DeviceFailure, DeviceUnavailable, InjectedFailure, Stage, WrongAnswer};
pub use info::{DeviceInfo, DeviceKind, may_be_there};
pub use ray_scene::{RayScene, RoundEnd};
pub use splat_batch::{SplatBatch, SplatCapacity};
pub use sum_batch::{SumCapacity, SumInput};
