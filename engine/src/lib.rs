//! Exact generalized winding numbers of huge triangle soups, toolpaths and point clouds, in an adaptive octree of
//! 32³-sample bricks: in one file larger than memory, or in memory.
//!
//! [`Builder`] takes files, triangles or points; [`Octree`] answers. [`Field`] answers without an octree.
//!
//! ```
//! # fn main() -> brickfield_engine::Result<()> {
//! use brickfield_engine::Builder;
//! // Two cubes that share a third of their volume: eight vertices and twelve triangles each.
//! let cube = |x: f64| {
//!     let corner = |n: usize| [x + (n & 1) as f64 * 3.0, (n >> 1 & 1) as f64 * 3.0, (n >> 2) as f64 * 3.0];
//!     let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
//!     let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect::<Vec<[u32; 3]>>();
//!     ((0..8).map(corner).collect::<Vec<_>>(), triangles)
//! };
//! let [(left, triangles), (right, _)] = [cube(0.0), cube(2.0)];
//! let octree = Builder::new().triangles(left, triangles.clone()).triangles(right, triangles).depth(2).in_memory()?;
//!
//! // How many pieces cover a point.
//! assert_eq!(octree.sample(&[[1.0, 1.5, 1.5], [2.5, 1.5, 1.5], [9.0, 0.0, 0.0]])?, [1.0, 2.0, 0.0]);
//! // Volumes of union and overlap, each with a bound on its error.
//! let volumes = octree.volumes()?;
//! assert!((volumes.union - 45.0).abs() <= volumes.union_error);
//! assert!((volumes.overlap - 9.0).abs() <= volumes.overlap_error);
//! // The boundary of the union, closed and manifold.
//! let mesh = octree.mesh()?;
//! assert!(mesh.triangles.len() > 100);
//! # Ok(())
//! # }
//! ```
//!
//! `write` in place of `in_memory` builds a store, which [`Octree::open`] opens again:
//!
//! ```no_run
//! # fn main() -> brickfield_engine::Result<()> {
//! use brickfield_engine::{Axis, Builder, Octree};
//! Builder::new().file("part.gcode").cell(0.2).identity().write("part.brf")?;
//! let part = Octree::open("part.brf")?;
//! part.write_mesh("part.stl")?;
//! part.write_slice("section.png", Axis::Z, 12.5)?;
//! part.write_picture("part.png", "iso")?;
//! # Ok(())
//! # }
//! ```
//!
//! # Where to go on
//!
//! | module | for |
//! |---|---|
//! | [`ingest`], [`toolpath`], [`x3d`] | reading files |
//! | [`build`] | all settings of a build; shards and their joining |
//! | [`store`], [`cache`] | stores: reading, verifying, rewriting, cutting down |
//! | [`analysis`], [`voids`] | samples, volumes, overlaps, components of void and solid |
//! | [`distance`] | wall thickness, offsets, deviations |
//! | [`csg`], [`machining`], [`milling`] | Booleans of stores and solids; what milling programs take off |
//! | [`contour`] | meshes, with a tolerance, with normals, streamed into files |
//! | [`export`], [`import`] | volumes in the files of other tools |
//! | [`splats`], [`bsp`] | parts as small clipped planes, level by level, and files of them |
//! | [`picks`] | tables of the beads of a part, for picks in pages |
//! | [`ellipses`] | parts as few flat ellipses that are larger than cells |
//! | [`fraction`] | meshes of a detail or of a number of triangles |
//! | [`section`], [`render`] | sections, drawings, pictures in all styles |
//! | [`overlay`] | voids, thickness and deviations as colours in pictures |
//! | [`winding`] | winding numbers of one brick, and the sum that judges all others |
//! | [`gpu`] | a Vulkan device, for [`build::Resources`] and [`render::Caster`] |
//!
//! # Features
//!
//! All but the last two are on by default; what a program does not need, it need not compile.
//!
//! | feature | for |
//! |---|---|
//! | `gcode` | reading G-code in [`toolpath`]; programs in [`milling`] need it not |
//! | `x3d` | reading sweeps in [`x3d`] |
//! | `vulkan` | devices in [`gpu`]; without it there are none |
//! | `export` | [`export`], [`import`] |
//! | `pictures` | [`picture`], [`section`], [`render`], [`overlay`]; `Octree::write_slice` and `write_picture` |
//! | `splats` | [`splats`], [`bsp`], [`picks`], [`draw`], [`ellipses`]; brings `pictures` |
//! | `las` | packed point clouds of LAS: LAZ, COPC |
//! | `e57` | point clouds in E57 |
//!
//! An [`Error`] is one line for the user: what went wrong, where, what to do. [`Error::kind`] is for programs. A
//! [`Progress`] hears of phases and steps, and stops the work by saying that it is cancelled.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod builder;
mod field;
mod octree;
#[cfg(feature = "pictures")]
mod pictures;

#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;

pub use builder::Builder;
pub use field::Field;
pub use octree::Octree;

pub use brickfield_analysis::{analysis, csg, distance, fraction, machining, voids};
pub use brickfield_builder::{backend, build, volumes};
#[cfg(feature = "splats")]
pub use brickfield_coding::{bsp, picks};
pub use brickfield_core::lattice::Axis;
pub use brickfield_core::{Error, ErrorKind, Progress, Result, Silent, large_array, lattice, mmap, part};
#[cfg(feature = "export")]
pub use brickfield_export::{export, import};
pub use brickfield_gpu::gpu;
pub use brickfield_io::{check, ingest, pieces};
pub use brickfield_mesh::contour;
pub use brickfield_octree::{brick, cache, store};
#[cfg(feature = "pictures")]
pub use brickfield_overlay::overlay;
#[cfg(feature = "pictures")]
pub use brickfield_picture::{picture, render, section};
#[cfg(feature = "splats")]
pub use brickfield_splats::{draw, ellipses, splats};
pub use brickfield_toolpath::{bead, milling, toolpath, x3d};
pub use brickfield_winding::{solid, swept, winding};
