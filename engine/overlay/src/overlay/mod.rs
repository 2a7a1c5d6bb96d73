//! Colours for what analyses find, where pictures show the boundary of a part: each kind is a [`Tint`] of the renderer.
//!
//! Whatever a tint says comes from the same functions as the tables: components of the streaming labelling, thickness and
//! signed distances at points of the surface.
//!
//! | file | owns |
//! |---|---|
//! | `voids` | voids, each in a colour of its own |
//! | `measures` | thickness and deviation at the point that is seen |
//! | `scale` | which colour stands for a number |

mod measures;
mod scale;
mod voids;

pub use measures::{DeviationTint, ThicknessTint, usual_deviation, usual_thickness};
pub use scale::{DeviationScale, ThicknessScale, class_colour, rounded_up, size_along, size_colour};
pub use voids::VoidTint;

use crate::render::{Met, Tint};
