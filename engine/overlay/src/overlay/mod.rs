//! Colours for what analyses find, where pictures show the boundary of a part: each kind is a [`Tint`] of the renderer.
//!
//! Whatever a tint says comes from the same functions as the tables: components of the streaming labelling, thickness and
//! signed distances at points of the surface.
//!
//! | file | owns |
//! |---|---|
//! | `voids` | voids, each in a colour of its own |
//! | `changes` | what is new since an earlier store, and voids that have opened |
//! | `measures` | thickness and deviation at the point that is seen |
//! | `sections` | the same in plane sections |
//! | `numbers` | where the number of each void stands |
//! | `scale` | which colour stands for a number |

mod changes;
mod measures;
mod numbers;
mod scale;
mod sections;
mod voids;

pub use changes::{Change, ChangesTint};
pub use measures::{DeviationTint, ThicknessTint, usual_deviation, usual_thickness};
pub use numbers::{numbers_in, numbers_seen};
pub use scale::{DeviationScale, ThicknessScale, class_colour, rounded_up, size_along, size_colour};
pub use sections::BandTint;
pub use voids::VoidTint;

use crate::render::{Met, Tint};
