//! The field: exact winding numbers of closed soups from crossings with lattice lines.

mod balance;
mod brute;
mod corners;
mod crossings;
mod edges;
mod evaluate;
mod hermite;
mod points;
mod scan;

pub use balance::{EdgeBalance, OpenEdges, open_edges_of};
pub use brute::solid_angle;
pub use corners::CornerGrid;
pub use evaluate::{Evaluation, Evaluator, Triangles};
pub use points::{brute_at, winding_at};
