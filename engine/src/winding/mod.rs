//! The field: exact winding numbers of closed soups from crossings with lattice lines.

mod balance;
mod brute;
mod corners;
mod evaluate;
mod hermite;
mod open;
mod points;
mod scan;

pub use balance::EdgeBalance;
pub use brute::solid_angle;
pub use corners::CornerGrid;
pub use evaluate::{Evaluation, Evaluator, Triangles};
pub use open::{Boundary, ClusterTree, OpenEdge, OpenPart, OpenSummary, Selection, open_winding_at};
pub use points::{brute_at, winding_at};
