//! Where bricks are evaluated: on the processor's cores, or on a Vulkan device with the same bytes.

mod batch;
mod brute;
mod check;
mod device_queue;
mod leaves;
mod nodes;
mod report;
mod shares;
mod vulkan;

pub use batch::BatchLeaf;
pub use brute::brute_at;
pub use check::{CHECKED_ONE_IN, DeviceCheck};
pub use leaves::LeafQueue;
pub use nodes::{NodeBrick, NodeQueue};
pub use report::DeviceReport;
pub use shares::{DeviceShares, ShareQueue};
pub use vulkan::Vulkan;
