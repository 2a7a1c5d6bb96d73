//! What tools sweep: convex solids of revolution on straight moves, and boxes, balls and cylinders, sampled straight from
//! their formulas.
//!
//! A lattice line meets a convex solid in one interval. One rule decides every sample: the interval of its row along x,
//! closed where it begins and open where it ends. It is a pure function of the row, so bricks, neighbours, levels and
//! threads agree. Lines along y and z place crossings alone.

mod brick;
#[cfg(test)]
mod brick_tests;
mod cone;
mod distance;
mod line;
mod lines;
mod solid;
#[cfg(test)]
mod tests;

pub use brick::{SweptEvaluator, WantedSamples};
pub use line::{Feature, Interval, IntervalEnd};
pub use lines::ParallelLines;
pub use solid::{ConvexSolid, SweptSolid, cube_of};
