//! Closed triangle meshes with outward orientation.
//!
//! Integer arguments give integer vertices wherever no sine is involved, so the pieces can stand on a
//! lattice with their faces exactly in its planes or at 45° to them.

mod extrude;
mod solids;
mod sweep;

pub use extrude::{Polygon, extrude};
pub use solids::{cuboid, icosphere, octahedron, slant, spiked_cube, tetrahedron, torus};
pub use sweep::{BeadEnd, ConvexSection, helix, spiral_tube, sweep};
