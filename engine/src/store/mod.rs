//! The brick store: one file that holds the octree.

mod tree;

pub use tree::{BrickTree, MemoryTree, NodeInfo};
