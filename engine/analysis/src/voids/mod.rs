//! Voids of a part: the regions that it encloses, their sizes and what lies around them.
//!
//! | file | owns |
//! |---|---|
//! | `components` | connected components of one brick |
//! | `measure` | what is summed of a component |
//! | `labelling` | components of the tree, joined across leaves |
//! | `border` | leaves beyond which others are to come, and disjoint sets |
//! | `surface`, `bulge` | area and volume from the polygons of the contour; what lies beyond these |
//! | `wanted` | a tree without the surfaces of all other voids |
//! | `meshes`, `mesh_piece` | closed meshes of voids; what leaves have of them |
//! | `crossing`, `boundary` | crossings in a leaf; those around voids |
//! | `outline` | crossings around each void, for other rooms |
//! | `points` | distances between them |
//! | `pores` | voids that open through a throat |
//! | `sealed` | which voids are sealed for certain, and which open |
//! | `cells` | cells of a node by what is known of them, in groups |
//! | `matter` | what the source has within a node |
//! | `covered` | cells that beads cover for certain |
//! | `slabs` | volumes by layer |
//! | `totals` | volumes of all together, and the errors of these |
//! | `around` | the beads around a void |
//! | `gaps` | where a line may be missing |
//! | `trace` | what is told of both |
//! | `cad` | what of a void lies within another tree |
//! | `role` | what features are |
//! | `class`, `classify` | whether a void is meant to be |
//! | `void` | what is known of one |
//! | `find` | all of it |
//! | `place` | the void at a place |
//! | `labels` | numbers of voids at the samples |

mod around;
mod border;
mod boundary;
mod bulge;
mod cad;
mod cells;
mod class;
mod classify;
mod components;
mod covered;
mod crossing;
mod enclosing_ball;
mod find;
mod gaps;
mod infill;
mod labelling;
mod labels;
mod matter;
mod measure;
mod mesh_piece;
mod meshes;
mod outline;
mod place;
mod points;
mod pores;
mod role;
mod sealed;
mod slabs;
mod surface;
mod totals;
mod trace;
mod void;
mod wanted;

pub use class::Class;
pub use components::Connectivity;
pub use find::{Detail, VoidOptions, Voids, find};
pub use labelling::{Component, Labelling, label};
pub use labels::{VoidNumbers, write_labels};
pub use measure::Sums;
pub use meshes::{VoidMeshOptions, VoidMeshSink, write_meshes};
pub use outline::{BoundaryPoint, boundary_points};
pub use place::VoidPlaces;
pub use slabs::{Slab, slabs};
pub use totals::Total;
pub use trace::{Trace, TracedLine};
pub use void::{Seal, Void};

#[cfg(test)]
mod tests;
