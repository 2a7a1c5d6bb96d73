//! Parts of the surface that may go on in the bricks around: what a node tells its parent ([`super::cross_leaf`]).

use super::super::qef::{Qef, Vector};
use super::super::symmetric::dot;
use super::super::topology::{SQUARE, edge_index};
use super::crossings::{FROZEN, LeafEdges, SignChangeEdge};
use super::patches::{LevelPatches, crosses_as_a_plane};
use super::vertex_merge::{LEVELS, NONE};
use crate::lattice::{Axis, NodeKey};

/// A part with more different normals than this stays what it is: it is curved, and each of them takes 40 bytes and a
/// test at every level. All crossings of one facet have one normal.
const MOST_NORMALS: usize = 32;

/// A crossing at a cell of a part, on the border of its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct BorderCrossing {
    /// The leaf's level.
    pub level: u8,
    pub axis: u8,
    /// Its lower sample, on the lattice of the level.
    pub low: [u32; 3],
    /// In which quadrant around the edge the cell lies.
    pub quadrant: u8,
}

impl BorderCrossing {
    /// Of the planes across the other two axes that the edge lies in, the cells between them and the root's first, as
    /// a power of 2 that divides them: a node of `n` cells has the planes of `log₂ n` and above on its border.
    pub(super) fn planes(&self) -> [u32; 2] {
        let (u, v) = Axis::ALL[usize::from(self.axis)].others();
        [u, v].map(|axis| self.low[axis.index()].trailing_zeros())
    }

    /// True for crossings of the same edge.
    pub(super) fn is_at_the_edge_of(&self, other: &BorderCrossing) -> bool {
        (self.level, self.axis, self.low) == (other.level, other.axis, other.low)
    }
}

/// Normals of tangent planes, each with the least and the greatest distance of its planes from the root's first
/// sample, in cells of the leaf. It stands for all of these planes: what is near the first and the last of parallel
/// planes is near all between them.
#[derive(Clone, Debug, Default)]
pub(super) struct Planes(Vec<(Vector, [f64; 2])>);

impl Planes {
    /// False if there are too many.
    fn add(&mut self, normal: Vector, [least, most]: [f64; 2]) -> bool {
        match self.0.iter_mut().find(|(other, _)| *other == normal) {
            Some((_, range)) => *range = [range[0].min(least), range[1].max(most)],
            None => self.0.push((normal, [least, most])),
        }
        self.0.len() <= MOST_NORMALS
    }

    /// The normals.
    pub(super) fn normals(&self) -> impl Iterator<Item = Vector> + '_ {
        self.0.iter().map(|(normal, _)| *normal)
    }

    /// By how much a point, counted from the root's first sample, misses the planes of each normal at most.
    pub(super) fn missed(&self, point: Vector) -> impl Iterator<Item = (Vector, f64)> + '_ {
        self.0.iter().map(move |(normal, range)| {
            let at = dot(point, *normal);
            (*normal, (at - range[0]).abs().max((at - range[1]).abs()))
        })
    }
}

/// What a part is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PartSource {
    /// The part of a leaf with this number.
    OfLeaf(u32, u32),
    /// What is merged already: its number.
    Merged(u32),
}

/// A disk within a node that meets the node's border as a plane may.
#[derive(Clone, Default)]
pub(super) struct SurfaceDisk {
    /// Of the leaves that it is in.
    pub level: u8,
    /// Of its planes, the node being the unit cube.
    pub sums: Qef,
    pub planes: Planes,
    pub crossings: Vec<BorderCrossing>,
    pub pieces: Vec<PartSource>,
}

impl SurfaceDisk {
    /// Adds another of the same node. False if that has too many normals.
    pub(super) fn take(&mut self, other: SurfaceDisk) -> bool {
        self.sums.add_all(&other.sums);
        self.crossings.extend(other.crossings);
        self.pieces.extend(other.pieces);
        other.planes.0.into_iter().all(|(normal, range)| self.planes.add(normal, range))
    }

    /// Whether the part meets the border of its node, 2 to the power of `bits` cells wide, as a plane may, having
    /// dropped the crossings that are not on it.
    pub(super) fn meets_border(&mut self, bits: u32) -> bool {
        self.crossings.retain(|crossing| crossing.planes().iter().any(|&plane| plane >= bits));
        let (mut edges, mut is_twice) = (0u16, false);
        for crossing in self.crossings.iter().filter(|c| c.planes().iter().all(|&plane| plane >= bits)) {
            let [qu, qv] = SQUARE[usize::from(crossing.quadrant)];
            let edge = 1 << edge_index(Axis::ALL[usize::from(crossing.axis)], 1 - qu, 1 - qv);
            is_twice |= edges & edge != 0;
            edges |= edge;
        }
        !is_twice && crosses_as_a_plane(edges)
    }

    /// Heap bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        self.planes.0.capacity() * size_of::<(Vector, [f64; 2])>()
            + self.crossings.capacity() * size_of::<BorderCrossing>()
            + self.pieces.capacity() * size_of::<PartSource>()
    }
}

/// The parts of a leaf whose vertices have been joined as far as the leaf goes, and for each vertex the number of its
/// part or [`NONE`].
pub(super) fn of_leaf(
    patches: &mut LevelPatches,
    crossings: &LeafEdges,
    key: NodeKey,
) -> (Vec<SurfaceDisk>, Vec<u32>) {
    let mut part_of = Vec::new();
    let mut parts: Vec<SurfaceDisk> = Vec::new();
    let first = key.first_sample();
    for root in patches.reaching_out(crossings) {
        let Some(planes) = planes(patches, crossings, root, first) else { continue };
        part_of.resize(patches.sums.len(), NONE);
        for vertex in patches.members(root) {
            part_of[vertex as usize] = parts.len() as u32;
        }
        let sums = patches.sums[root].clone();
        parts.push(SurfaceDisk { level: key.level(), sums, planes, ..SurfaceDisk::default() });
    }
    if parts.is_empty() {
        return (parts, part_of);
    }
    for crossing in crossings.within(LEVELS + 1) {
        for (quadrant, &vertex) in crossing.vertices.iter().enumerate() {
            let part = if vertex < FROZEN { part_of[vertex as usize] } else { NONE };
            if part != NONE {
                parts[part as usize].crossings.push(BorderCrossing {
                    level: key.level(),
                    axis: crossing.axis.index() as u8,
                    low: std::array::from_fn(|a| first[a] + u32::from(crossing.low[a])),
                    quadrant: quadrant as u8,
                });
            }
        }
    }
    (parts, part_of)
}

fn planes(patches: &LevelPatches, crossings: &LeafEdges, root: usize, first: [u32; 3]) -> Option<Planes> {
    let mut planes = Planes::default();
    let mut add = |crossing: &SignChangeEdge| {
        let point = std::array::from_fn(|a| f64::from(first[a]) + crossing.point[a]);
        planes.add(crossing.normal, [dot(point, crossing.normal); 2])
    };
    let is_all = patches.members(root).flat_map(|vertex| crossings.at(vertex)).all(&mut add);
    is_all.then_some(planes)
}
