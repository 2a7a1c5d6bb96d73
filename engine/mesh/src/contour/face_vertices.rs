//! Vertices on faces: where they may stand, and the names by which they are found.
//!
//! Both polygons at a cut of a face are fans about vertices on edges of the face, so one that stood on the face's
//! border could stand where the middle of a fan does. And two cuts of a face need places on either side of the
//! diagonal between the corners that they do not cut off.
//!
//! That has to be so of places as they are written, with 32 bits: the surface may cross edges at samples, or nearer to
//! them than a step of such numbers.

use super::envelope::{MinimalEdge, step_at};
use super::frame::{CellFrame, SampleCoordinates};
use super::loops::SLACK;
use super::topology::edge_lower;
use crate::brick::{POINTS, point_index, point_position};
use crate::lattice::{Axis, NodeKey, RootCube, Units, spacing_bits};

/// Name, relative to a corner `from` that it shares its cell or face with, of a minimal edge: `relative` is
/// its lower end minus the corner in units.
#[inline]
pub(super) fn edge_key(relative: [i32; 3], axis: Axis, level: u8) -> u64 {
    // Spacings are multiples of 8 units, and no cell is larger than 2^19.
    let [x, y, z] = relative.map(|r| (r >> 3) as u64);
    x | y << 17 | z << 34 | (axis.index() as u64) << 51 | u64::from(level) << 53
}

/// Name, relative to the lower corner of a face across `axis`, of edge number `edge` of a plain cell of `leaf`, which
/// bounds the face.
pub(super) fn plain_edge_key(edge: usize, axis: Axis, leaf: NodeKey) -> u64 {
    let (along, mut offset) = edge_lower(edge);
    offset[axis.index()] = 0;
    edge_key(offset.map(|o| (o as i32) << leaf.spacing_bits()), along, leaf.level())
}

/// There are fewer names of faces than this.
pub(super) const FACES: usize = 3 * POINTS;

/// Name within a leaf of the face across `axis` with this lower corner.
#[inline]
pub(super) fn face_key(axis: Axis, corner: [usize; 3]) -> u32 {
    (axis.index() * POINTS + point_index(corner)) as u32
}

/// What [`face_key`] names.
#[inline]
pub(super) fn face_of(face: u32) -> (Axis, [usize; 3]) {
    let (axis, at) = (face as usize / POINTS, face as usize % POINTS);
    (Axis::ALL[axis], point_position(at))
}

/// A face, between planes of the lattice.
pub(super) struct SplitFace {
    axis: Axis,
    /// From where to where it reaches in the world; across it both are one number.
    span: [[f32; 2]; 3],
}

impl SplitFace {
    /// That of a cell across `axis` with this lower corner.
    pub(super) fn new(lattice: &SampleCoordinates, axis: Axis, corner: [usize; 3]) -> SplitFace {
        let span = |a: usize| {
            let end = corner[a] + usize::from(a != axis.index());
            [lattice[a][corner[a]], lattice[a][end]]
        };
        SplitFace { axis, span: std::array::from_fn(span) }
    }

    /// That of cells of `level` across `axis` with this lower corner.
    pub(super) fn of_level(root: RootCube, axis: Axis, corner: Units, level: u8) -> SplitFace {
        let end =
            std::array::from_fn(|a| corner[a] + if a == axis.index() { 0 } else { 1 << spacing_bits(level) });
        let [low, high] = [corner, end].map(|at| root.sample(at));
        SplitFace { axis, span: std::array::from_fn(|a| [low[a], high[a]]) }
    }

    /// A position moved onto the face and off its border, where it is not.
    pub(super) fn inside(&self, position: [f32; 3]) -> [f32; 3] {
        let across = self.axis.index();
        std::array::from_fn(|a| {
            let [low, high] = self.span[a];
            if a == across { low } else { position[a].clamp(low.next_up(), high.next_down()) }
        })
    }

    /// World position of a point, 0..1 along each axis of the face, off its border.
    pub(super) fn place(&self, at: [f64; 3]) -> [f32; 3] {
        self.inside(self.rounded(at))
    }

    /// The same without moving it.
    pub(super) fn rounded(&self, at: [f64; 3]) -> [f32; 3] {
        let across = self.axis.index();
        std::array::from_fn(|a| {
            let [low, high] = self.span[a].map(f64::from);
            if a == across { self.span[a][0] } else { (low + at[a] * (high - low)) as f32 }
        })
    }

    /// Where a position on the face lies: 0..1 along its axes, 0 across it.
    pub(super) fn seen(&self, position: [f32; 3]) -> [f64; 3] {
        let across = self.axis.index();
        std::array::from_fn(|a| {
            let [low, high] = self.span[a].map(f64::from);
            if a == across { 0.0 } else { (f64::from(position[a]) - low) / (high - low) }
        })
    }

    /// Where a mesh edge through the cut between two minimal edges has a vertex, if it has one wherever its ends are:
    /// half way between the crossings, off the ends of the edges by as much as rounding could move it; off the border,
    /// too, if both edges are on one side of the face.
    ///
    /// All leaves have the same, and any lines from there to points of the two edges meet none of another cut of the
    /// face, if no run that is cut off has more than two corners.
    pub(super) fn half_way(&self, cut: [&MinimalEdge; 2]) -> [f32; 3] {
        let ends = cut.map(MinimalEdge::crossing_off_ends);
        let mut at: [f64; 3] = std::array::from_fn(|a| (ends[0][a] + ends[1][a]) / 2.0);
        if cut[0].axis == cut[1].axis && cut[0].at == cut[1].at {
            // Lines of other cuts leave that side more steeply.
            let step = step_at(self.span.as_flattened());
            let (along, across) = (cut[0].axis.index(), self.axis.index());
            for a in (0..3).filter(|&a| a != along && a != across) {
                at[a] += if at[a] > f64::from(self.span[a][0]) { -step } else { step };
            }
        }
        self.inside(at.map(|c| c as f32))
    }

    /// The same on a face with several cuts, of which this one cuts off a run with so many corners of the face. With three
    /// or four all others are between its ends, on one side of the face or about one of its corners: lines from the middle of
    /// the face pass over whatever is there.
    pub(super) fn half_way_of_several(&self, cut: [&MinimalEdge; 2], corners: usize) -> [f32; 3] {
        if corners < 3 { self.half_way(cut) } else { self.place([0.5; 3]) }
    }
}

/// The mean of the middles of the two edges that a cut of a face joins, numbered as a cell's own, in the cell's
/// coordinates.
///
/// In cells of at least seven steps of 32 bits it is where the cut may have its vertex however it is rounded: the hull
/// of the edges is a triangle, of which it is a mean with no weight below a quarter, or the whole face, whose middle
/// it is.
pub(super) fn middle(cut: [usize; 2]) -> [f64; 3] {
    let middles = cut.map(|edge| {
        let (along, low) = edge_lower(edge);
        let mut at = low.map(|c| c as f64);
        at[along.index()] += 0.5;
        at
    });
    std::array::from_fn(|a| (middles[0][a] + middles[1][a]) / 2.0)
}

/// Whether a point of a face that is cut twice is within the triangle of the two edges that a cut with this [`middle`]
/// joins, 0..1 along each axis of the face.
fn is_cut_off(axis: Axis, middle: [f64; 3], at: [f64; 3]) -> bool {
    let (u, v) = axis.others();
    let from_corner = |a: usize| if middle[a] < 0.5 { at[a] } else { 1.0 - at[a] };
    from_corner(u.index()) + from_corner(v.index()) < 1.0 - SLACK
}

/// The vertex on a cut of a split face.
pub(super) struct SplitVertex {
    /// Names of the face and of the edges that the cut joins.
    pub face: u32,
    pub edges: [u64; 2],
    pub place: SplitPlace,
}

/// Where it goes.
pub(super) enum SplitPlace {
    /// There: [`SplitFace::half_way`].
    At([f32; 3]),
    /// Between plain cells of one size, where it should be in coordinates of the cell, and the [`middle`] of the cut.
    Near([f64; 3], [f64; 3]),
}

impl SplitVertex {
    /// Its position in 32 bits, apart from vertices on edges, and from that on the other cut of a face of four edges.
    pub(super) fn position(&self, frame: &CellFrame, lattice: &SampleCoordinates) -> [f32; 3] {
        let (at, middle) = match self.place {
            SplitPlace::At(position) => return position,
            SplitPlace::Near(at, middle) => (at, middle),
        };
        let (axis, corner) = face_of(self.face);
        let face = SplitFace::new(lattice, axis, corner);
        let place = |mut at: [f64; 3]| {
            at[axis.index()] = 0.0;
            face.inside(frame.world(corner, at))
        };
        let between = std::array::from_fn(|a| (at[a] + middle[a]) / 2.0);
        let mut places = [at, between].map(place).into_iter();
        let is_apart = |position: &[f32; 3]| is_cut_off(axis, middle, face.seen(*position));
        places.find(is_apart).unwrap_or_else(|| place(middle))
    }
}

/// The vertex on one cut of a split face, found from either edge that the cut joins.
pub(super) struct FaceVertex {
    pub face: u32,
    pub edge: u64,
    pub vertex: u32,
}

/// The vertex on the cut of a face that ends at a minimal edge, in a list sorted by both.
pub(super) fn found_extra(extras: &[FaceVertex], face: u32, edge: u64) -> Option<u32> {
    if extras.is_empty() {
        return None;
    }
    let found = extras.binary_search_by_key(&(face, edge), |e| (e.face, e.edge));
    found.ok().map(|n| extras[n].vertex)
}
