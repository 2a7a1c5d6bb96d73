//! Stores from meshes, toolpaths and point clouds: sorting, subtree jobs, refinement, devices, volumes of the source.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod backend;
pub mod build;
pub mod volumes;

#[cfg(test)]
use brickfield_core::disk;
use brickfield_core::{error, large_array, lattice, mmap, part, progress, schedule, soup};
use brickfield_gpu::gpu;
use brickfield_io::{ingest, pieces};
use brickfield_mesh::contour;
use brickfield_octree::{brick, store};
use brickfield_toolpath::toolpath;
use brickfield_winding::{solid, winding};
