//! Pictures of a tree of bricks: plane sections, drawings, and rays through space, with the canvas that they share.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod picture;
pub mod render;
pub mod section;

use brickfield_core::{error, lattice, part, progress};
use brickfield_gpu::gpu;
use brickfield_octree::{brick, store};
