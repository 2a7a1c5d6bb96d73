//! Bricks of samples with their codec, and the store: one file that holds the octree of bricks, with what keeps, reads,
//! rewrites and verifies it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod brick;
pub mod cache;
pub mod store;

use brickfield_core::{disk, error, lattice, mmap, part, progress, schedule, wide};
