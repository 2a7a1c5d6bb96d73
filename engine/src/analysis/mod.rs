//! Questions answered from a finished octree: w at points, a level as one dense grid, volumes.

mod export;
mod sample;
#[cfg(test)]
mod tests;
mod volume;

pub use export::{Dense, Element};
pub use sample::{sample_at, winding_range};
pub use volume::{Volumes, volume};
