//! A part as splats: small planes, one to three in each cell that its boundary passes, at every level of the octree.
//!
//! | file | owns |
//! |---|---|
//! | `cluster` | crossings of one face in a cell as sums, and how such sums become one |
//! | `brick` | the cells of a leaf |
//! | `levels` | all levels, from the leaves upward |
//! | `disc` | a splat in the world |
//! | `write` | files of splats, `.bsp` |
//! | `read` | the same, read |
//! | `page` | pages with their data, and folders for servers |
//! | `picks` | the beads of a toolpath, for picks in pages |
//! | `gaussian` | a splat as a flat Gaussian |
//! | `ply`, `glb` | splats as other programs want them |
//!
//! A cell of a level is a cube between eight samples. The splat of a face in it is the plane through the mean of the face's
//! crossings under their mean normal, moved to the middle between the two farthest. What it stands for lies in the cell and
//! within a stated distance of the plane.

mod brick;
mod cluster;
mod disc;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;
mod gaussian;
mod glb;
mod levels;
mod page;
mod picks;
mod ply;
mod read;
mod spilled;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use disc::{CellPlanes, planes_of_levels, planes_of_tree};
pub use disc::{Disc, discs_of_levels, discs_of_tree};
pub use gaussian::GaussianSource;
pub use glb::write_glb;
pub use levels::{LevelsOptions, SplatLevels};
pub use page::{PageBytes, viewer_bytes, write_page, write_page_folder};
pub use picks::PickBeads;
pub use ply::write_ply;
pub use read::{read_bsp, read_tree};
pub use write::{BspSummary, bsp_bytes, write_bsp};
