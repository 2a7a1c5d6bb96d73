//! Plane sections of a tree: pictures of w, and the boundary w = 0.5 as closed polylines.
//!
//! | file | owns |
//! |---|---|
//! | `plane` | where a section lies, and its two axes |
//! | `at_hand` | the bricks that a thread looks at |
//! | `picture` | w as pixels |
//! | `legend` | what stands below them |
//! | `face` | where the boundary passes a lattice edge in a plane between two layers of samples |
//! | `contour` | marching squares over the finest lattice |
//! | `drawing` | SVG and DXF files |

mod at_hand;
mod contour;
mod drawing;
mod face;
mod legend;
mod picture;
mod plane;

pub use contour::{Contour, ContourLimits, contour};
pub use drawing::{Drawing, write_drawing};
pub use picture::{SectionPicture, SectionSummary, plain, write_picture};
pub use plane::Plane;
