//! Distances from the surface of a store: wall thickness, offset, deviation.
//!
//! One kernel answers all of them: the surface as *patches*, one for each crossing. A patch is the crossing's polygon of the dual
//! contour, bent by the quadratic form that passes its corners, so that it is exact on planes and right to the third order on
//! curved surfaces. Patches are found by boxes in Morton order, leaf by leaf.
//!
//! | file | owns |
//! |---|---|
//! | `patch` | one patch: its nearest point, where a ray meets it |
//! | `quadratic` | the form that bends it |
//! | `polygons` | the polygons that patches are made of, and which share corners |
//! | `piece` | the patches of a leaf |
//! | `pieces` | those of all, in memory or in files |
//! | `boxes` | trees of boxes |
//! | `slabs` | thinner bounds of what is in a box |
//! | `sift` | which of eight patches a ball may reach |
//! | `sides` | inside or outside, by samples |
//! | `brick_feet` | distances from all samples of a brick |
//! | `surface` | all patches |
//! | `questions` | nearest points, normals, rays, balls |
//! | `around` | normals of surfaces with facets |
//! | `thickness` | thickness of walls, width of gaps |
//! | `inscribed` | balls inside, and how they grow |
//! | `balls` | balls of all crossings, by place |
//! | `local` | local thickness as a tree |
//! | `tally` | how it is spread |
//! | `offset` | offsets and shells as stores |
//! | `mitre` | convex creases, whose planes are extended |
//! | `closing` | parts closed by balls, as stores |
//! | `band` | distances near the surface as a tree |
//! | `brick_sides` | on which side samples of a brick are, within coarser leaves |
//! | `sample_box` | boxes of samples, which both halve |
//! | `deviation` | signed distances from a reference, both ways |
//! | `by_bead` | deviation by layer and feature |
//! | `align` | a part laid over a reference |
//! | `motion` | rigid motions |
//! | `cloud` | the surface that points of a cloud were measured on |
//! | `triangle` | the nearest point of one triangle |
//! | `triangles` | the triangles of a mesh |
//! | `triangle_sort` | triangles sorted by place, in a file where they are too many |
//! | `numbers` | a number for each of many points |
//! | `regions` | patches that hang together |
//! | `scalar_mesh` | meshes whose vertices have a number |

mod align;
mod answers;
mod around;
mod balls;
mod band;
mod boxes;
mod brick_feet;
mod brick_sides;
mod by_bead;
pub mod closing;
mod cloud;
pub mod deviation;
mod inscribed;
mod level_nodes;
mod local;
#[cfg(test)]
mod local_tests;
mod mitre;
mod motion;
mod numbers;
pub mod offset;
mod patch;
mod piece;
mod pieces;
mod polygons;
mod quadratic;
mod questions;
mod regions;
mod sample_box;
mod scalar_mesh;
mod scalar_points;
mod sides;
mod sift;
mod slabs;
mod surface;
mod tally;
#[cfg(test)]
mod tests;
pub mod thickness;
mod triangle;
mod triangle_sort;
mod triangles;

pub use align::{ALIGNED_POINTS, Align, align};
pub use answers::{BallAt, Foot, Place};
pub use band::{BAND, DistanceTree};
pub use by_bead::{DeviationByBead, SurfaceDeviation, deviation_by_bead};
pub use cloud::{CloudSurface, MeasuredPart};
pub use local::{LocalOf, LocalThickness};
pub use numbers::PointNumbers;
pub use regions::Region;
pub use scalar_mesh::{SCALAR_ENDINGS, ScalarMesh};
pub use scalar_points::ScalarPoints;
pub use sides::Sides;
pub use surface::{PatchInfo, Surface};
pub use tally::LocalSpread;
pub use triangles::{Nearest, PreviousPlace, Triangles};
