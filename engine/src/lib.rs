//! Exact generalized winding numbers of huge triangle soups, in an adaptive octree of 32³-sample bricks
//! kept in one file.
//!
//! Rooms, from the bottom up; no module uses one that stands above it:
//! [`lattice`], [`mmap`], [`gpu`] → [`toolpath`] → [`bead`] → [`x3d`] → [`ingest`], [`brick`] → [`winding`], [`solid`],
//! [`check`], [`pieces`], [`store`] → [`backend`], [`volumes`] → [`build`] → [`cache`], [`contour`], [`analysis`],
//! [`fraction`],
//! [`section`], [`render`], which draw with [`picture`].
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;

pub use brickfield_analysis::{analysis, fraction, voids};
pub use brickfield_builder::{backend, build, volumes};
pub use brickfield_core::{Error, Progress, Result, Silent, lattice, mmap, part};
pub use brickfield_gpu::gpu;
pub use brickfield_io::{check, ingest, pieces};
pub use brickfield_mesh::contour;
pub use brickfield_octree::{brick, cache, store};
pub use brickfield_picture::{picture, render, section};
pub use brickfield_toolpath::{bead, toolpath, x3d};
pub use brickfield_winding::{solid, winding};
