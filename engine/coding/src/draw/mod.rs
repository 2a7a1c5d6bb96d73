//! Pictures of splats for pages: one thread, one ray a pixel, no dependencies.
//!
//! A page draws its first pictures with this, and all of them where a browser has no graphics processor. The passes are those of
//! the program's renderer (Botsch et al. 2004): the nearest splat of each pixel, the mean normal of all splats that lie with it, light.
//!
//! | file | owns |
//! |---|---|
//! | `packed` | splats in five words each, as a page keeps them |
//! | `view` | where the eye is, and what that means for cells of a level |
//! | `place` | one splat in the picture: its box of pixels, its plane there |
//! | `edges` | where a large one ends in each row |
//! | `survey` | which nodes a picture shows |
//! | `canvas` | pixels while they are drawn |
//! | `holes` | pixels that splats leave empty among them |
//! | `light` | colours |

mod canvas;
mod edges;
mod holes;
mod light;
mod packed;
mod place;
mod survey;
mod view;

pub use canvas::PageCanvas;
pub use holes::each_hole;
pub use light::{COLOUR, FILL, INNER};
pub use packed::{packed_splats, PackedSplat};
pub use survey::{seen_nodes, units_to_refine};
pub use view::{DrawStyle, DrawView, CELL_REACH, HALF_DIAGONAL, TOGETHER};

#[cfg(test)]
mod tests;
