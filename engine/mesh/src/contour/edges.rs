//! The twelve edges of the cells of a row: which change sign, where their crossings stand, and what is around them.

use super::planes::EdgePlane;
use super::surface::HermiteSurface;
use super::topology::derive_edge;
use crate::brick::along_row;
use crate::lattice::Axis;
use crate::wide::{Simd, SimdBase, f32x4};

/// The runs of parallel edges at a row of cells along x: four along x, then two rows of edges along y and two
/// along z, of which a cell has the ones at its own index and at the next.
pub(super) struct EdgeStreams {
    /// Sign-changing edges by index of the lower sample.
    bits: [u64; 8],
    /// Place in the decoded planes of the first edge of the row.
    first: [u32; 8],
    /// The inside bits of the rows of samples at the cells' lower corners.
    corners: [u64; 4],
}

/// For each of a cell's 12 edges the stream it belongs to, whether it starts at the next index, and its
/// lower end as the cell's centre sees it and direction, with a zero that makes them vectors.
pub(super) struct EdgePlace {
    stream: usize,
    step: u32,
    lower: [f32; 4],
    direction: [f32; 4],
    /// Which of the four cells around the edge the cell is, in the order of [`SQUARE`].
    pub quadrant: usize,
}

impl EdgeStreams {
    /// Those at the row (j, k) of cells; none in a leaf whose samples are all alike.
    #[inline(always)]
    pub(super) fn of(changes: Option<&HermiteSurface>, j: usize, k: usize) -> EdgeStreams {
        let none = EdgeStreams { bits: [0; 8], first: [0; 8], corners: [0; 4] };
        let Some(changes) = changes else { return none };
        // Spelled out: with an axis that is not known beforehand every stream would be branches.
        let at = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)];
        let [a, b, c, d] = at.map(|(j, k)| changes.signs.row(j, k));
        let [xa, xb, xc, xd] = at.map(|(j, k)| changes.before(Axis::X, j, k));
        let [ya, yc] = [at[0], at[2]].map(|(j, k)| changes.before(Axis::Y, j, k));
        let [za, zb] = [at[0], at[1]].map(|(j, k)| changes.before(Axis::Z, j, k));
        EdgeStreams {
            bits: [along_row(a), along_row(b), along_row(c), along_row(d), a ^ b, c ^ d, a ^ c, b ^ d],
            first: [xa, xb, xc, xd, ya, yc, za, zb],
            corners: [a, b, c, d],
        }
    }

    /// Corner mask of cell `i`, as [`HermiteSurface::mask`].
    #[inline(always)]
    pub(super) fn mask(&self, i: usize) -> u8 {
        let [a, b, c, d] = self.corners.map(|row| (row >> i) as u8 & 3);
        a | b << 2 | c << 4 | d << 6
    }

    /// Whether an edge of cell `i` changes sign.
    #[inline(always)]
    pub(super) fn is_crossed(&self, i: usize, place: &EdgePlace) -> bool {
        self.bits[place.stream] >> (i as u32 + place.step) & 1 == 1
    }

    /// Place among the decoded planes of an edge of cell `i`.
    #[inline(always)]
    pub(super) fn slot(&self, i: usize, place: &EdgePlace) -> usize {
        let before = self.bits[place.stream] & ((1 << (i as u32 + place.step)) - 1);
        (self.first[place.stream] + before.count_ones()) as usize
    }
}

impl EdgePlace {
    /// As [`EdgePlace::seen_from_centre`]; the last number means nothing.
    #[inline(always)]
    pub(super) fn seen_wide<S: Simd>(&self, simd: S, plane: &EdgePlane) -> f32x4<S> {
        let (lower, direction) =
            (f32x4::from_slice(simd, &self.lower), f32x4::from_slice(simd, &self.direction));
        lower + f32x4::splat(simd, plane.fraction) * direction
    }

    /// The crossing on the edge, seen from the cell's centre: exact, as fractions have 16 bits.
    #[inline(always)]
    pub(super) fn seen_from_centre(&self, plane: &EdgePlane) -> [f32; 4] {
        std::array::from_fn(|n| self.lower[n] + plane.fraction * self.direction[n])
    }
}

/// What is around an edge.
#[derive(Clone, Copy)]
pub(super) struct Quad {
    /// The vertices of the four cells.
    pub vertices: [u16; 4],
    /// Where the surface crosses the edge, in 65,536ths of it from its lower end.
    pub fraction: u16,
}

/// Stands in a [`Quad`] where a cell needs a closer look.
pub(super) const NO_VERTEX: u16 = u16::MAX;

impl Quad {
    /// Of an edge of which nothing is known.
    pub(super) const UNKNOWN: Quad = Quad { vertices: [NO_VERTEX; 4], fraction: 1 << 15 };
}

pub(super) static EDGE_PLACES: [EdgePlace; 12] = {
    const NONE: EdgePlace =
        EdgePlace { stream: 0, step: 0, lower: [0.0; 4], direction: [0.0; 4], quadrant: 0 };
    let mut places = [NONE; 12];
    let mut edge = 0;
    while edge < 12 {
        let (axis, [i, j, k]) = derive_edge(edge);
        places[edge].stream = [j + 2 * k, 4 + k, 6 + j][axis.index()];
        places[edge].step = i as u32;
        places[edge].lower = [i as f32 - 0.5, j as f32 - 0.5, k as f32 - 0.5, 0.0];
        places[edge].direction[axis.index()] = 1.0;
        // By the offsets of the edge along the other two axes.
        places[edge].quadrant = [2, 3, 1, 0][edge % 4];
        edge += 1;
    }
    places
};
