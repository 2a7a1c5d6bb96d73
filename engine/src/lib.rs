//! Exact generalized winding numbers of huge triangle soups, in an adaptive octree of 32³-sample bricks
//! kept in one file.
//!
//! Rooms, from the bottom up; no module uses one that stands above it:
//! [`lattice`], [`mmap`], [`gpu`] → [`toolpath`] → [`bead`] → [`x3d`] → [`ingest`], [`brick`] → [`winding`], [`solid`],
//! [`check`], [`pieces`], [`store`] → [`backend`], [`volumes`] → [`build`] → [`cache`], [`contour`], [`analysis`],
//! [`section`], [`render`], which draw with [`picture`].
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub mod analysis;
pub mod backend;
pub mod bead;
pub mod brick;
pub mod build;
pub mod cache;
pub mod check;
pub mod contour;
mod disk;
mod error;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;
#[allow(unsafe_code)] // Vulkan
pub mod gpu;
pub mod ingest;
pub mod lattice;
#[allow(unsafe_code)] // maps
pub mod mmap;
pub mod part;
pub mod picture;
pub mod pieces;
mod progress;
pub mod render;
mod schedule;
pub mod section;
pub mod solid;
pub mod store;
pub mod toolpath;
pub mod voids;
pub mod volumes;
mod wide;
pub mod winding;
pub mod x3d;

pub use error::{Error, Result};
pub use progress::{Progress, Silent};
