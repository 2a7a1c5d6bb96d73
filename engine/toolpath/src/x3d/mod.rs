//! X3D in its XML encoding (ISO/IEC 19776-1): swept `Extrusion` nodes as closed triangle tubes, and toolpaths
//! written as such nodes.
//!
//! [`read`] walks a file of any size and hands over one [`Extrusion`] after the other; [`Sweeps`] keeps them
//! compactly and yields their triangles by number; [`Writer`] writes beads.
//!
//! A sweep follows ISO/IEC 19775-1, 13.3.5. Where the text leaves a choice, it is made in [`scp`] and
//! [`Sweeps`], and said there. Coordinates are handed on as they stand in the file: metres by the
//! specification, millimetres in most files that slicers' users meet.

// What only the reader needs is dead without it.
#![cfg_attr(not(feature = "x3d"), allow(dead_code))]

mod affine;
mod cap;
mod extrusion;
#[cfg(feature = "x3d")]
mod fields;
#[cfg(feature = "x3d")]
mod node;
#[cfg(feature = "x3d")]
mod reader;
#[cfg(not(feature = "x3d"))]
#[path = "absent.rs"]
mod reader;
mod report;
pub mod scp;
mod sweeps;
#[cfg(test)]
mod tests;
mod writer;

pub use extrusion::{Extrusion, Sink, X3dItem};
pub use reader::read;
pub use report::{SkippedNode, X3dReport};
pub use sweeps::{PlacedExtrusion, Sweeps};
pub use writer::{ExtrusionStyle, Writer};
