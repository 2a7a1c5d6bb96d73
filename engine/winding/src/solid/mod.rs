//! Beads as analytic solids: the union is sampled straight from the toolpath, without triangles (Peelar et al.
//! 2019, §7.6).
//!
//! A segment of a bead is a convex solid with an exact formula (`body`), so every lattice line meets it in one
//! interval. *One* rule decides whether a sample is inside: the interval of its x row, a pure function of integers and
//! of the section.
//!
//! Everything else, the brick, its neighbours, all levels and threads, follows from that and agrees by construction.

mod body;
mod brick_lattice;
mod eight_lines;
mod evaluate;
mod hermite;
mod hidden;
mod lines;
mod points;
mod profile;
mod segment;
mod segments;
#[cfg(test)]
mod tests;

pub use body::Body;
pub use brick_lattice::SegmentList;
pub use evaluate::{SolidEvaluation, SolidEvaluator, for_samples};
pub use hermite::normal_code;
pub use lines::for_lines;
pub use points::{beads_at, brute_beads_at};
pub use profile::{Outline, SolidProfile};
pub use segment::Segment;
pub use segments::{Solids, bounds_of_beads, passes_of};
