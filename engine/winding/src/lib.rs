//! The field: generalized winding numbers of triangles, open soups, point clouds and swept beads on the lattice.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod solid;
pub mod swept;
pub mod winding;

use brickfield_core::{error, large_array, lattice, progress, soup, wide};
use brickfield_octree::brick;
use brickfield_toolpath::toolpath;
