//! Plane sections of a tree: pictures of w, and the boundary w = 0.5 as closed polylines.
//!
//! | file | owns |
//! |---|---|
//! | `plane` | where a section lies, and its two axes |
//! | `brick_finder` | the bricks that a thread looks at |
//! | `picture` | w as pixels |
//! | `legend` | what stands below them |
//! | `arc` | how the boundary passes a square between two points of it |
//! | `face` | where the boundary passes a lattice edge in a plane between two layers of samples |
//! | `cell` | which points between samples lie inside |
//! | `contour` | marching squares over the finest lattice |
//! | `join` | stretches of the boundary joined to closed polylines |
//! | `straighten` | straight runs of polylines merged |
//! | `drawing` | SVG and DXF files |

mod arc;
mod brick_finder;
mod cell;
mod contour;
mod drawing;
mod face;
mod join;
mod legend;
mod picture;
mod plane;
mod straighten;

pub use crate::picture::Label as SectionLabel;
pub use contour::{ContourLimits, contour};
pub use drawing::{Drawing, write_drawing};
pub use join::Contour;
pub use legend::plain;
pub use picture::{
    SectionPicture, SectionSummary, SectionTint, SectionValues, Tinted, section_values, write_picture,
    write_tinted_picture,
};
pub use plane::Plane;
pub use straighten::straighten;
