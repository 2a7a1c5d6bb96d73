//! Where bricks are evaluated: on the processor's cores, or on a Vulkan device with the same bytes.

mod brute;
mod leaves;
mod nodes;
mod report;
mod shares;
mod vulkan;

pub use brute::brute_at;
pub use leaves::{Leaf, LeafQueue};
pub use nodes::{NodeBrick, NodeQueue};
pub use report::DeviceReport;
pub use shares::{DeviceShares, ShareQueue};
pub use vulkan::Vulkan;
