//! Toolpaths: the model of beads with sections and passes, the reader of G-code, beads as closed solids, and the sweeps of
//! X3D.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod bead;
pub mod milling;
pub mod toolpath;
pub mod x3d;

#[cfg(test)]
use brickfield_core::Silent;
use brickfield_core::{error, lattice, part, progress};
