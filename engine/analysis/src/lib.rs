//! What is inside a part: samples at points, dense arrays, volumes, layers and voids of a store; a part at a coarse detail.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod analysis;
pub mod csg;
pub mod distance;
pub mod fraction;
pub mod machining;
pub mod voids;

use brickfield_core::{error, large_array, lattice, part, progress, schedule, sets, soup, wide};
use brickfield_mesh::contour;
use brickfield_octree::{brick, store};
use brickfield_toolpath::milling;
use brickfield_winding::{solid, swept, winding};
