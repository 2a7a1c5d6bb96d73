//! What a build tells in the end.

use super::thin::ThinSummary;
use crate::backend::DeviceReport;
use crate::pieces::{InsideOut, PiecesReport};
use crate::store::ShardId;
use crate::winding::Surfels;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// What a build did. Serialized as one map, in which numbers of other kinds of input are 0.
#[derive(Clone, Debug)]
pub struct BuildSummary {
    /// What was read.
    pub input: InputSummary,
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
    pub phases: Vec<(&'static str, f64)>,
}

/// What was read, by its kind.
#[derive(Clone, Debug)]
pub enum InputSummary {
    /// Triangles.
    Facets(FacetsSummary),
    /// Beads as solids, of which no facets are made.
    Beads(BeadsSummary),
    /// Point clouds.
    Points(PointsSummary),
    /// Triangles and point clouds.
    Mixed(FacetsSummary, PointsSummary),
}

/// Triangles that were read.
#[derive(Clone, Debug, Default)]
pub struct FacetsSummary {
    /// Facets read.
    pub facets: u64,
    /// Facets without area on the lattice.
    pub degenerate_facets: u64,
    /// Faces with fewer than three corners, which were left out.
    pub skipped_faces: u64,
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
}

/// Beads that were read.
#[derive(Clone, Debug, Default)]
pub struct BeadsSummary {
    /// Segments of beads.
    pub segments: u64,
}

/// Points that were read.
#[derive(Clone, Debug, Default)]
pub struct PointsSummary {
    /// Points read.
    pub points: u64,
    /// Points without area: repeated ones, and those with a normal of length 0.
    pub void_points: u64,
    /// Distance of neighbouring points: the root of the median area of a point, in the input's unit.
    pub spacing: f64,
}

impl PointsSummary {
    pub(super) fn of(surfels: &Surfels) -> PointsSummary {
        let Surfels { all, void, spacing, .. } = surfels;
        PointsSummary { points: all.len() as u64 + void, void_points: *void, spacing: *spacing }
    }
}

impl InputSummary {
    /// Pieces read: facets, segments of beads, or points.
    pub fn count(&self) -> u64 {
        match self {
            InputSummary::Facets(read) => read.facets,
            InputSummary::Beads(read) => read.segments,
            InputSummary::Points(read) => read.points,
            InputSummary::Mixed(facets, points) => facets.facets + points.points,
        }
    }

    /// Whether points were read.
    pub fn has_points(&self) -> bool {
        matches!(self, InputSummary::Points(_) | InputSummary::Mixed(..))
    }

    /// What was read of triangles, if any were.
    pub fn facets(&self) -> Option<&FacetsSummary> {
        match self {
            InputSummary::Facets(read) | InputSummary::Mixed(read, _) => Some(read),
            InputSummary::Beads(_) | InputSummary::Points(_) => None,
        }
    }
}

impl Serialize for BuildSummary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (no_facets, no_points) = (FacetsSummary::default(), PointsSummary::default());
        let (facets, segments, points) = match &self.input {
            InputSummary::Facets(read) => (read, 0, &no_points),
            InputSummary::Beads(read) => (&no_facets, read.segments, &no_points),
            InputSummary::Points(read) => (&no_facets, 0, read),
            InputSummary::Mixed(facets, points) => (facets, 0, points),
        };
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("facets", &facets.facets)?;
        map.serialize_entry("segments", &segments)?;
        map.serialize_entry("degenerate_facets", &facets.degenerate_facets)?;
        map.serialize_entry("skipped_faces", &facets.skipped_faces)?;
        map.serialize_entry("points", &points.points)?;
        map.serialize_entry("void_points", &points.void_points)?;
        map.serialize_entry("spacing", &points.spacing)?;
        map.serialize_entry("depth", &self.depth)?;
        map.serialize_entry("cell", &self.cell)?;
        map.serialize_entry("nodes", &self.nodes)?;
        map.serialize_entry("leaves", &self.leaves)?;
        map.serialize_entry("file_bytes", &self.file_bytes)?;
        map.serialize_entry("open_edges", &facets.open_edges)?;
        map.serialize_entry("loops", &facets.loops)?;
        map.serialize_entry("flipped_patches", &facets.flipped_patches)?;
        map.serialize_entry("pieces", &facets.pieces)?;
        map.serialize_entry("inside_out", &facets.inside_out)?;
        map.serialize_entry("turned_sweeps", &facets.turned_sweeps)?;
        map.serialize_entry("base_depth", &self.base_depth)?;
        map.serialize_entry("thin", &self.thin)?;
        map.serialize_entry("temporary_bytes", &self.temporary_bytes)?;
        map.serialize_entry("resumed", &self.resumed)?;
        map.serialize_entry("shard", &self.shard)?;
        map.serialize_entry("device", &self.device)?;
        map.serialize_entry("phases", &Phases(&self.phases))?;
        map.end()
    }
}

/// Phases as a map in their order.
struct Phases<'a>(&'a [(&'static str, f64)]);

impl Serialize for Phases<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
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
