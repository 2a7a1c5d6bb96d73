//! Beads as closed solids: a cross-section swept along each path of a toolpath.
//!
//! A bead becomes one or more *tubes*. Within a tube neighbouring segments meet in a *mitre*: one ring of vertices in
//! the plane that bisects them. At a bend sharper than [`SweepOptions::bend`], where the cross-section changes, and
//! where a mitre would fold over, the bead is split into two tubes that both reach the point.
//!
//! The round caps at their ends overlap there, so the joint is round. Caps are fused: the ring, pushed out by (w/2)
//! sin θ and scaled by cos θ, down to a single point.
//!
//! Every ring is a pure function of a point and its two neighbours, made of +, −, ×, ÷ and √ alone. So any range of
//! triangles can be made on its own, and neighbours agree on every bit.
//!
//! Directed edges cancel exactly, and the winding number of each tube is 1 inside and 0 outside. Triangles are never
//! kept; a range of a [`SweptToolpath`] costs time by its length.

mod joint;
mod outline;
mod path;
mod profile;
mod stl;
mod sweep;
mod swept;
#[cfg(test)]
mod tests;
mod tube;

pub use outline::read_outline;
pub use path::BeadPath;
pub use profile::{Profile, ProfileShape};
pub use stl::{StlBeads, StlSummary};
pub use sweep::{Sweep, SweepOptions};
pub use swept::SweptToolpath;
pub use tube::Joints;
