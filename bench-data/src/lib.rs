//! What Brickfield is fed with in tests and benchmarks, and what its answers are held against.
//!
//! - [`shapes`]: closed pieces with outward orientation,
//! - [`pile`]: many of them together, from a dozen for property tests to 45 million facets of beads,
//! - [`passes`]: toolpaths that come back onto themselves, with their volumes in closed form,
//! - [`mod@write`]: the file formats the program reads,
//! - [`judge`]: an independent check of meshes, and winding numbers by brute force.
//!
//! The crate does not depend on the engine, so that a mistake there cannot hide here. Every generator is a
//! function of its arguments alone: own random numbers, own sine, only correctly rounded operations, hence
//! the same bytes on every machine.

#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod inputs;
pub mod judge;
mod mesh;
pub mod passes;
pub mod pile;
mod rng;
pub mod shapes;
pub mod trig;
mod vector;
pub mod write;

pub use mesh::Mesh;
pub use rng::Rng;

/// The program in Python that asks one peer one question; `peers/peers.py`.
pub const ASK_PEER: &str = include_str!("../peers/peers.py");

/// One facet as STL stores it: three corners, counter-clockwise seen from outside.
pub type StlFacet = [[f32; 3]; 3];
/// One facet in double precision.
pub type Facet64 = [[f64; 3]; 3];
/// One facet on an integer lattice.
pub type LatticeFacet = [[i32; 3]; 3];
