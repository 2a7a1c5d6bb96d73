//! Where bricks are evaluated: on the processor's cores, or on a Vulkan device with the same bytes.

mod batch;
mod brute;
mod check;
mod device_queue;
mod leaves;
mod node_brick;
mod nodes;
mod report;
mod shares;
mod trust;
mod vulkan;

pub use batch::BatchLeaf;
pub use brute::brute_at;
pub use leaves::LeafQueue;
pub use node_brick::NodeBrick;
pub use nodes::NodeQueue;
pub use report::DeviceReport;
pub use shares::{DeviceShares, ShareQueue};
pub use trust::{CHECKED_ONE_IN, DeviceCheck};
pub use vulkan::Vulkan;
