//! Independent verdicts: is this mesh what it claims to be, how far is it from the truth, what is w here, and how much
//! material do beads and meshes hold?

mod bead;
pub mod boundary;
mod creases;
pub mod distance;
pub mod gcode;
pub mod mesh;
pub mod monte_carlo;
pub mod passes;
pub mod read;
pub(crate) mod tree;
mod weld;
pub mod winding;

pub use bead::BeadSize;
pub use weld::weld;
