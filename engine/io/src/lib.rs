//! Readers of meshes and point clouds, the exact checker of meshes, and connected pieces that are inside out.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod check;
pub mod ingest;
pub mod pieces;

#[cfg(test)]
use brickfield_core::Silent;
use brickfield_core::{error, large_array, lattice, mmap, predicates, progress, soup};
use brickfield_toolpath::{bead, toolpath, x3d};
