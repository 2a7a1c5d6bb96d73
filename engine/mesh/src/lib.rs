//! The isosurface of a tree of bricks: manifold, without self-intersections, out of core; and mesh files.
//!
//! It is the largest crate, of 21,000 lines, a sixth of them tests: the stages share one cache of leaves, so none can be
//! carved out.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod contour;

use brickfield_core::{error, lattice, part, predicates, progress, schedule, sets, wide};
use brickfield_octree::{brick, store};
