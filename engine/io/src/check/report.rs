//! What there is to say of a mesh.

use crate::predicates::Meeting;
use serde::Serialize;

/// Something that a sound mesh has none of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Defect {
    /// How many.
    pub count: u64,
    /// Where one of them is, in the file's unit.
    pub at: Option<[f64; 3]>,
}

/// Two triangles that meet elsewhere than they must.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeetingPair {
    /// Their numbers in the file, from 0, polygons having been split; the lower one first.
    pub faces: [u32; 2],
    /// The middle of what the boxes around them have in common.
    pub near: [f64; 3],
    /// How they meet.
    pub meeting: Meeting,
}

/// Pairs of triangles that meet elsewhere than they must, by the way in which they do.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Intersections {
    /// All of them.
    pub pairs: u64,
    /// [`Meeting::Crossing`].
    pub crossing: u64,
    /// [`Meeting::Overlapping`].
    pub overlapping: u64,
    /// [`Meeting::Touching`].
    pub touching: u64,
    /// The ten with the lowest numbers.
    pub first: Vec<MeetingPair>,
}

/// Triangles that hang together by their edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShellReport {
    /// How many.
    pub triangles: u64,
    /// V − E + F, where a vertex counts once for each fan that it has in this shell.
    pub euler_characteristic: i64,
    /// Area.
    pub area: f64,
    /// Volume within, negative if the shell faces inward, as around a cavity. Means little if the shell is open.
    pub volume: f64,
    /// A corner of its first triangle.
    pub at: [f64; 3],
}

/// What [`super::check`] found. Lengths, areas and volumes are in the file's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// Triangles in the file, polygons having been split.
    pub triangles: u64,
    /// Vertices of triangles with three different ones; only these triangles count in what follows.
    pub vertices: u64,
    /// Other vertices.
    pub unused_vertices: u64,
    /// Edges.
    pub edges: u64,
    /// V − E + F.
    pub euler_characteristic: i64,
    /// Sum of the genera of all components, if the mesh is closed, oriented and manifold.
    pub genus: Option<i64>,
    /// Edges with an odd number of triangles: borders of holes.
    pub open_edges: Defect,
    /// Edges along which triangles do not run both ways alike: some face the wrong way.
    pub misoriented_edges: Defect,
    /// Edges with more than two triangles.
    pub crowded_edges: Defect,
    /// Vertices whose triangles do not hang together around them: they form more than one fan.
    pub split_vertices: Defect,
    /// Triangles with a corner that is NaN or infinite.
    pub non_finite_triangles: Defect,
    /// Triangles with less than three different vertices.
    pub collapsed_triangles: Defect,
    /// Triangles with three different vertices on a line.
    pub flat_triangles: Defect,
    /// Triangles whose vertices are those of an earlier one.
    pub duplicate_triangles: Defect,
    /// Where the surface meets itself.
    pub intersections: Intersections,
    /// Area of the triangles.
    pub area: f64,
    /// Volume within, w counting: what lies within two shells counts twice, what lies within an inward one is taken off.
    pub volume: f64,
    /// Lower and upper corner of the box around the triangles.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Shells: triangles that hang together by edges.
    pub components: u64,
    /// Of these, those with a negative volume.
    pub inward_components: u64,
    /// All of them, in the order of their first triangles.
    #[serde(skip)]
    pub shells: Vec<ShellReport>,
}

impl CheckReport {
    /// There are triangles, and none of their edges is at a hole.
    pub fn is_closed(&self) -> bool {
        self.triangles > 0
            && self.open_edges.count + self.non_finite_triangles.count + self.collapsed_triangles.count == 0
    }

    /// Neighbours agree on which side is outside.
    pub fn is_oriented(&self) -> bool {
        self.misoriented_edges.count == 0
    }

    /// No edge has more than two triangles.
    pub fn is_edge_manifold(&self) -> bool {
        self.crowded_edges.count == 0
    }

    /// The triangles at every vertex form one fan.
    pub fn is_vertex_manifold(&self) -> bool {
        self.split_vertices.count == 0
    }

    /// Edges and vertices are those of a manifold, perhaps with borders.
    pub fn is_manifold(&self) -> bool {
        self.is_edge_manifold() && self.is_vertex_manifold()
    }

    /// Triangles meet in common edges and vertices only, and every one has an area.
    pub fn is_free_of_intersections(&self) -> bool {
        self.intersections.pairs + self.flat_triangles.count == 0
    }

    /// Closed, oriented, manifold and free of self-intersections.
    pub fn is_sound(&self) -> bool {
        self.is_closed() && self.is_oriented() && self.is_manifold() && self.is_free_of_intersections()
    }

    /// What is wrong with its name, in the order in which to mend it; empty if the mesh [`Self::is_sound`].
    pub fn defects(&self) -> Vec<(&'static str, Defect)> {
        let Intersections { crossing, overlapping, touching, first, .. } = &self.intersections;
        let pairs = |count: u64, meeting: Meeting| Defect {
            count,
            at: first.iter().find(|pair| pair.meeting == meeting).map(|pair| pair.near),
        };
        let mut all = vec![
            ("triangles with a corner that is not finite", self.non_finite_triangles),
            ("triangles with less than three different vertices", self.collapsed_triangles),
            ("triangles without area", self.flat_triangles),
            ("triangles that are there already", self.duplicate_triangles),
            ("open edges", self.open_edges),
            ("edges where triangles face opposite ways", self.misoriented_edges),
            ("edges of more than two triangles", self.crowded_edges),
            ("vertices of more than one fan", self.split_vertices),
            ("pairs of triangles that cross", pairs(*crossing, Meeting::Crossing)),
            ("pairs of triangles that overlap", pairs(*overlapping, Meeting::Overlapping)),
            ("pairs of triangles that touch", pairs(*touching, Meeting::Touching)),
        ];
        all.retain(|(_, defect)| defect.count > 0);
        all
    }
}
