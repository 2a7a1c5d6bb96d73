//! Questions answered from a finished octree: w at points, the beads that make it up, a level as one dense
//! grid, volumes.

mod added;
mod beads;
mod export;
mod face_beads;
mod faces;
mod overlap;
mod overlap_leaf;
mod overlap_lines;
mod overlap_pairs;
mod sample;
#[cfg(test)]
mod tests;
mod volume;

pub use added::volume_added;
pub use beads::solids_of;
pub use beads::{CoveringPass, beads_at_points};
pub use export::{BrickBlock, Dense, Element, TakeRows, covering};
pub use face_beads::{BeadAttribute, FaceBeads};
pub(crate) use faces::share_beside;
pub use overlap::{OverlapSum, Overlaps, PairOverlap, overlaps};
pub(crate) use sample::leaf_at;
pub use sample::{sample_at, winding_range};
pub(crate) use volume::spread;
pub use volume::{Volumes, negative_volume, volume};
