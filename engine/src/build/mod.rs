//! From triangles to the octree: snap, check that the soup is closed, sort by subtree, build the subtrees on
//! all threads, record them in order.

mod bins;
mod closed;
mod field;
mod jobs;
mod memory;
mod open;
mod ordered;
mod pipeline;
mod records;
mod rules;
mod snap;
mod sorted;
mod subtree;
#[cfg(test)]
mod tests;

pub use closed::is_closed;
pub use memory::{build_in_memory, build_open_in_memory};
pub use pipeline::{BuildOptions, Resolution, Summary, build, build_opened};
pub use rules::TreeOptions;
