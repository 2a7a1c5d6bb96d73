//! What a build tells in the end.

use super::thin::ThinSummary;
use crate::backend::DeviceReport;
use crate::pieces::{InsideOut, PiecesReport};
use crate::store::ShardId;
use serde::{Serialize, Serializer};

/// What a build did.
#[derive(Clone, Debug, Serialize)]
pub struct BuildSummary {
    /// Facets read.
    pub facets: u64,
    /// Segments of beads read, where beads are solids and no facets are made of them.
    pub segments: u64,
    /// Facets without area on the lattice.
    pub degenerate_facets: u64,
    /// Faces with fewer than three corners, which were left out.
    pub skipped_faces: u64,
    /// Points read, where the input is a point cloud.
    pub points: u64,
    /// Points without area: repeated ones, and those with a normal of length 0.
    pub void_points: u64,
    /// Distance of neighbouring points: the root of the median area of a point, in the input's unit; 0 if there are none.
    pub spacing: f64,
    /// Deepest level.
    pub depth: u8,
    /// Cell edge at the deepest level, in the input's unit.
    pub cell: f64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Size of the store.
    pub file_bytes: u64,
    /// Directed edges that no reverse cancels; 0 for closed input.
    pub open_edges: u64,
    /// Loops into which they fall.
    pub loops: u64,
    /// Borders of patches that face the wrong way.
    pub flipped_patches: u64,
    /// The pieces of the input, if they were to be turned outward.
    pub pieces: Option<PiecesReport>,
    /// Closed pieces that are inside out, if the field is negative somewhere.
    pub inside_out: Option<InsideOut>,
    /// Extrusions whose sweeps were inside out, and were turned when they were read.
    pub turned_sweeps: u64,
    /// The level to which all that pieces touch is divided; less than `depth` if thin walls alone are divided further.
    pub base_depth: u8,
    /// Walls and gaps thinner than a cell that no sample shows, in the leaves that this run built. `None` if there are none,
    /// or nobody looked: in open input, point clouds, and beads that are all thicker than a cell.
    pub thin: Option<ThinSummary>,
    /// Bytes written to the temporary file; 0 if the pieces fitted in memory.
    pub temporary_bytes: u64,
    /// What of an earlier run was gone on with, if there was something.
    pub resumed: Option<ResumedBuild>,
    /// What of the tree was built, if it was a shard.
    pub shard: Option<ShardSummary>,
    /// What a device did, if one was given and the input is what devices are for.
    pub device: Option<DeviceReport>,
    /// Seconds by phase, in order; serialized as a map.
    #[serde(serialize_with = "as_map")]
    pub phases: Vec<(&'static str, f64)>,
}

fn as_map<S: Serializer>(
    phases: &[(&'static str, f64)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(phases.iter().copied())
}

/// What an earlier run has left.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResumedBuild {
    /// Nodes.
    pub nodes: u64,
    /// How far it had come along the curve through the root cube in whose order stores are written, from 0 to 1.
    pub part: f64,
}

/// A shard of a tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShardSummary {
    /// Which one.
    #[serde(flatten)]
    pub id: ShardId,
    /// Level of the cubes that are shared out.
    pub level: u8,
    /// How many the shard has, empty ones included.
    pub cubes: u64,
    /// The part of all work that was foreseen for it.
    pub work: f64,
}
