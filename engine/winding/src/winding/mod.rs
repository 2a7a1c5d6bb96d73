//! The field: exact winding numbers of closed soups from crossings with lattice lines, those of open soups and
//! point clouds within a bound.

mod balance;
mod bridges;
mod brute;
mod cloud;
mod corners;
mod crossings;
mod edges;
mod evaluate;
mod hermite;
mod lines;
mod mixed;
mod open;
mod passages;
mod points;
mod scan;
mod thin;

pub use balance::EdgeBalance;
pub use brute::solid_angle;
pub use cloud::{
    CloudBrick, CloudBricks, CloudEvaluator, CloudField, CloudPiece, KdTree, Located, Neighbour, Surfel,
    Surfels, by_place, estimate_normals, median_distance, plane_normal, with_estimated_normals,
};
pub use corners::CornerGrid;
pub use evaluate::{Evaluation, Evaluator, TriangleList};
pub use mixed::{MixedEvaluator, MixedField};
pub use open::{
    BlockSample, Boundary, ClusterParts, ClusterTree, FAR_FIELD_BYTES, OpenBrick, OpenEdge, OpenEvaluator,
    OpenField, OpenPart, OpenSummary, RoundedShares, SumBlock, SumBlocks, SurfaceElement, bytes_of_caps,
    open_winding_at,
};
pub use points::{brute_at, winding_at};
