//! X3D in its XML encoding (ISO/IEC 19776-1): swept `Extrusion` nodes as closed triangle tubes, and toolpaths
//! written as such nodes.
//!
//! [`read`] walks a file of any size and hands over one [`Extrusion`] after the other; [`Sweeps`] keeps them
//! compactly and yields their triangles by number; [`Writer`] writes beads.
//!
//! A sweep follows ISO/IEC 19775-1, 13.3.5. Where the text leaves a choice, it is made in [`scp`] and
//! [`Sweeps`], and said there. Coordinates are handed on as they stand in the file: metres by the
//! specification, millimetres in most files that slicers' users meet.

mod affine;
mod cap;
mod fields;
mod node;
mod reader;
mod report;
pub mod scp;
mod sweeps;
#[cfg(test)]
mod tests;
mod writer;

pub use fields::Extrusion;
pub use reader::{Sink, X3dItem, read};
pub use report::{SkippedNode, X3dReport};
pub use sweeps::{PlacedExtrusion, Sweeps};
pub use writer::{ExtrusionStyle, Writer};
