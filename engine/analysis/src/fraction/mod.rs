//! A part at a coarse detail: the fraction of solid around the samples of a coarse lattice, and surfaces of it.
//!
//! What is thinner than a cell cannot be sampled: hair channels between beads come and go between samples, and with them
//! the volume. The mean of solid over about a cell can. Its surface is smooth, and the fraction at which it lies is chosen so
//! that the volume is kept.
//!
//! | file | owns |
//! |---|---|
//! | `kernel` | the tent by which solid is averaged |
//! | `leaf` | what one leaf adds, by chords between exact crossings |
//! | `plan` | which coarse samples the lines of a leaf add to |
//! | `chords` | the chords along one axis, slice by slice |
//! | `sharp` | where planes of the fine level agree, so that edges stay sharp |
//! | `lattice` | all sums, brick by brick, completed as leaves pass in Morton order |
//! | `tree` | a surface of the fractions as a tree that can be contoured |
//! | `widen` | wide tents from narrow ones, for cells with several samples |
//! | `level` | the surface that keeps the volume |
//! | `fitted` | a mesh of one lattice with so many triangles, by a tolerance |
//! | `size` | the detail at which a mesh has so many triangles |
//! | `nearest` | the nearest mesh with so many triangles of a part of faces |
//! | `distance` | how far a mesh and the surface of a store are from each other |

mod chords;
mod distance;
mod fitted;
mod kernel;
mod lattice;
mod leaf;
mod level;
mod nearest;
mod plan;
mod sharp;
mod size;
#[cfg(test)]
mod tests;
mod tree;
mod widen;

pub use distance::{Distances, distances};
pub use fitted::{DetailRequest, SizedMesh, SizedTree};
pub use lattice::{Lattice, fine_fractions, fractions};
pub use level::{LevelSurface, keep_volume, surface};
pub use size::of_triangles;
pub use tree::FractionTree;

use crate::store::BrickTree;

/// How many of the finest cells an axis are a coarse cell of at most `detail`; `None` if it is smaller than these.
pub fn factor_of(tree: &dyn BrickTree, detail: f64) -> Option<u32> {
    let fine = tree.root().spacing(tree.deepest_level());
    // A length that was meant to be so many cells is, whatever rounding says.
    let cells = (detail / fine * (1.0 + 1e-9)).floor();
    (cells >= 1.0).then_some(cells.min(1e6) as u32)
}

/// Edge of the finest cells of a tree.
pub fn finest_cell(tree: &dyn BrickTree) -> f64 {
    tree.root().spacing(tree.deepest_level())
}
