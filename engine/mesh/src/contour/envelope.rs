//! Polygons that cannot meet each other but at shared edges.
//!
//! *Intersection-free Contouring on an Octree Grid*, Ju & Udeshi 2006: the envelope of the polygon around a minimal
//! edge e is the union of the tetrahedra of e with each two vertices that follow each other.
//!
//! Where the mesh edges between vertices pass through the faces that their cells share, envelopes of different edges
//! have no inner point in common, so triangles that stay within theirs do not meet.
//!
//! That is so by itself between cells of one size, each with one vertex strictly inside it: the segment between two of
//! them lies within their common slab along both other axes. Elsewhere mesh edges get vertices on faces
//! ([`super::faces`]).
//!
//! Of a quadrilateral a, b, c, d around e, seen along e, the diagonal ac passes e on one side, say that of b, and
//! meets there the ray from e to b at a point q. The two triangles along this diagonal stay within the envelope
//! exactly if q lies in the triangle of e and b.
//!
//! Then ac is split into two parts in one tetrahedron each, and where the other triangle, a, c, d, meets e is a mean
//! of the heights of its corners. If neither diagonal does, the polygon becomes a fan about a vertex on e.
//!
//! Cells are boxes between the planes of the lattice rounded to 32 bits, as vertices are. Rounding keeps order.
//! Vertices keep a distance of more than a step from their cell's faces, those on faces a step from the face's border
//! ([`super::face_vertices`]), and those on edges a step from the edge's ends.
//!
//! Everything is decided from these numbers; what rounding of 64-bit numbers could decide otherwise counts as not
//! within, which costs triangles at worst.

use super::lanes::Vec3;
use crate::lattice::{Axis, BRICK_POINTS, RootCube, Units, spacing_bits};
use crate::wide::{Select, Simd, SimdBase, f64x8, mask64x8};

/// What rounding may change of a sum of products, as a share of their bound: some twenty operations of 2⁻⁵³ each.
const SLACK: f64 = 1e-14;

/// The minimal edge that a polygon is around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MinimalEdge {
    pub axis: Axis,
    /// Its world coordinates along the other two axes, in the order of [`Axis::others`].
    pub at: [f32; 2],
    /// World coordinates of its ends.
    pub ends: [f32; 2],
    /// Where the surface crosses it, as a fraction from its lower end.
    pub fraction: f32,
}

/// A diagonal of each of eight quadrilaterals.
#[derive(Clone, Copy)]
pub(super) struct Diagonal<S: Simd> {
    /// Whether the two triangles along it keep within the envelope.
    pub within: mask64x8<S>,
    /// Where they meet the edge, above its lower end; of a diagonal that is not within, anything.
    pub height: f64x8<S>,
}

/// The diagonals 0–2 and 1–3 of eight quadrilaterals around eight edges along `axis`. Corners are counter-clockwise seen
/// from the upper end of the edge, `at` and `ends` as in [`MinimalEdge`].
#[inline(always)]
pub(super) fn diagonals<S: Simd>(
    simd: S,
    axis: Axis,
    corners: &[Vec3<S>; 4],
    at: [f64x8<S>; 2],
    ends: [f64x8<S>; 2],
) -> [Diagonal<S>; 2] {
    let zero = f64x8::splat(simd, 0.0);
    let (u, v) = axis.others();
    // Seen along the edge, which is the origin; and the height above its lower end.
    let (mut flat, mut height) = ([[zero; 2]; 4], [zero; 4]);
    for n in 0..4 {
        flat[n] = [corners[n][u.index()] - at[0], corners[n][v.index()] - at[1]];
        height[n] = corners[n][axis.index()] - ends[0];
    }
    let length = ends[1] - ends[0];
    let mut area = [zero; 4];
    for n in 0..4 {
        area[n] = crossed(flat[n], flat[(n + 1) % 4]);
    }
    // Seen along the edge, corners follow each other round it.
    let is_round =
        area[0].simd_gt(zero) & area[1].simd_gt(zero) & area[2].simd_gt(zero) & area[3].simd_gt(zero);
    let mut found = [Diagonal { within: is_round, height: zero }; 2];
    for (n, Diagonal { within, height: met }) in found.iter_mut().enumerate() {
        let [b, c, d] = [n + 1, n + 2, (n + 3) % 4];
        // Twice the area of the edge and the diagonal; above 0 where b's ray meets it, below where d's does.
        let signed = crossed(flat[n], flat[c]);
        let is_b = signed.simd_ge(zero);
        let beside = is_b.select(signed, zero - signed);
        let whole = is_b.select(area[n] + area[b], area[c] + area[d]);
        // The height of q, and that of the corner at the end of the ray, times `whole`.
        let q =
            is_b.select(height[n] * area[b] + height[c] * area[n], height[c] * area[d] + height[n] * area[c]);
        let end = is_b.select(height[b], height[d]) * beside;
        let rest = whole - beside;
        let slack = whole * length * SLACK;
        *within &=
            rest.simd_gt(whole * SLACK) & (q - end).simd_gt(slack) & (rest * length + end - q).simd_gt(slack);
        // Where the triangle on the other side meets the edge, times what is in front.
        let [far, second] = [is_b.select(height[d], height[b]), is_b.select(area[d], area[n])];
        let pierced =
            is_b.select(height[n] * area[c], height[n] * area[b]) + height[c] * second + far * beside;
        let whole = is_b.select(area[c], area[b]) + second + beside;
        let slack = whole * length * SLACK;
        *within &= pierced.simd_gt(slack) & (whole * length - pierced).simd_gt(slack);
        *met = pierced / whole;
    }
    found
}

#[inline(always)]
fn crossed<S: Simd>(a: [f64x8<S>; 2], b: [f64x8<S>; 2]) -> f64x8<S> {
    a[0] * b[1] - a[1] * b[0]
}

/// The largest step of 32 bits among coordinates.
pub(super) fn step_at(coordinates: &[f32]) -> f64 {
    let farthest = coordinates.iter().fold(0.0f32, |far, c| far.max(c.abs()));
    f64::from(farthest.next_up()) - f64::from(farthest)
}

impl MinimalEdge {
    /// The edge along `axis` from a sample of a brick on, crossed at `fraction`; `lattice` has the world coordinates of
    /// the brick's samples by axis.
    #[inline(always)]
    pub(super) fn placed(
        lattice: &[[f32; BRICK_POINTS]; 3],
        axis: Axis,
        low: [usize; 3],
        fraction: f32,
    ) -> MinimalEdge {
        let (u, v) = axis.others();
        let along = |axis: Axis| &lattice[axis.index()][low[axis.index()]..];
        let ends = along(axis);
        MinimalEdge { axis, at: [along(u)[0], along(v)[0]], ends: [ends[0], ends[1]], fraction }
    }

    /// Corners seen along the edge, which is the origin, and their heights.
    fn seen(&self, corner: [f32; 3]) -> ([f64; 2], f64) {
        let (u, v) = self.axis.others();
        let flat = [(u, 0), (v, 1)].map(|(axis, n)| f64::from(corner[axis.index()]) - f64::from(self.at[n]));
        (flat, f64::from(corner[self.axis.index()]))
    }

    /// As [`diagonals`] says of one quadrilateral.
    #[cfg(test)]
    pub(super) fn diagonals(&self, corners: [[f32; 3]; 4]) -> [bool; 2] {
        crate::wide::dispatch!(crate::wide::level(), simd => {
            let splat = |c: f32| f64x8::splat(simd, f64::from(c));
            let found = diagonals(simd, self.axis, &corners.map(|p| p.map(splat)), self.at.map(splat), self.ends.map(splat));
            found.map(|diagonal| crate::wide::SimdMask::to_bitmask(diagonal.within) & 1 == 1)
        })
    }

    /// Whether the edge passes through the inside of a triangle, which is then within the envelope.
    pub(super) fn pierces(&self, corners: [[f32; 3]; 3]) -> bool {
        let seen = corners.map(|corner| self.seen(corner));
        let area = [0, 1, 2].map(|n| cross(seen[(n + 1) % 3].0, seen[(n + 2) % 3].0));
        let whole: f64 = area.iter().sum();
        let [low, high] = self.ends.map(f64::from);
        let height: f64 = (0..3).map(|n| area[n] * (seen[n].1 - low)).sum();
        let slack = whole * (high - low) * SLACK;
        area.iter().all(|&area| area > whole * SLACK)
            && height > slack
            && whole * (high - low) - height > slack
    }

    /// The edge of `level` with this lower end, crossed at `fraction`.
    pub(super) fn of_level(
        root: RootCube,
        axis: Axis,
        lower: Units,
        level: u8,
        fraction: f32,
    ) -> MinimalEdge {
        let (u, v) = axis.others();
        let mut upper = lower;
        upper[axis.index()] += 1 << spacing_bits(level);
        let [low, high] = [lower, upper].map(|at| root.sample(at));
        let ends = [low[axis.index()], high[axis.index()]];
        MinimalEdge { axis, at: [low[u.index()], low[v.index()]], ends, fraction }
    }

    /// Where the surface crosses the edge, kept a 64th of it off the ends, or eight steps of 32 bits if that is more.
    pub(super) fn crossing_off_ends(&self) -> [f64; 3] {
        let [low, high] = self.ends.map(f64::from);
        let step = step_at([self.ends, self.at].as_flattened());
        let least = (8.0 * step / (high - low)).clamp(1.0 / 64.0, 0.5);
        let (u, v) = self.axis.others();
        let mut at = [low + f64::from(self.fraction).clamp(least, 1.0 - least) * (high - low); 3];
        (at[u.index()], at[v.index()]) = (f64::from(self.at[0]), f64::from(self.at[1]));
        at
    }

    /// Half way between its ends.
    pub(super) fn middle(&self) -> [f32; 3] {
        MinimalEdge { fraction: 0.5, ..*self }.crossing()
    }

    /// Where the surface crosses the edge, kept off the ends.
    pub(super) fn crossing(&self) -> [f32; 3] {
        let [low, high] = self.ends;
        let height = f64::from(low) + f64::from(self.fraction) * (f64::from(high) - f64::from(low));
        let (u, v) = self.axis.others();
        let mut crossing = [(height as f32).clamp(low.next_up(), high.next_down()); 3];
        (crossing[u.index()], crossing[v.index()]) = (self.at[0], self.at[1]);
        crossing
    }
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
