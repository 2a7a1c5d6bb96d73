//! The isosurface of a tree of bricks: manifold, without self-intersections, out of core; and mesh files.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod contour;

use brickfield_core::{error, lattice, part, predicates, progress, schedule, sets, wide};
use brickfield_octree::{brick, store};
