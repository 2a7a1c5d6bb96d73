//! Hermite edges: where and under which normal the boundary w = 0.5 crosses a lattice edge.

use super::{POINTS, Samples};
use crate::lattice::{Axis, BRICK_POINTS};
use crate::wide::{Simd, SimdBase, SimdMask, dispatch, i16x16, level};

/// A unit vector in octahedral coordinates (Cigolle et al. 2014): the first in the low 16 bits, the second
/// in the high ones, each a two's complement fixed-point number with 32767 for 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct OctNormal(pub u32);

impl OctNormal {
    /// What the components of [`OctNormal::to_direction`] add up to.
    pub const SUM: i32 = 32767;

    /// Encodes the direction of an integer vector, whose components stay below 2^62, by integer arithmetic
    /// alone, so that every backend gets the same code. The zero vector becomes +z.
    pub fn from_integer(n: [i64; 3]) -> OctNormal {
        let largest = n.iter().fold(0u64, |m, c| m.max(c.unsigned_abs()));
        if largest == 0 {
            return OctNormal::pack(0, 0);
        }
        // Scale so that the largest component has 31 bits: sums and products below fit an i64.
        let excess = 64 - largest.leading_zeros() as i32 - 31;
        let n = n.map(|c| if excess > 0 { c >> excess } else { c << -excess });
        let sum = n.iter().map(|c| c.abs()).sum::<i64>();
        let scaled = |c: i64| (c * 32767 * 2 + sum).div_euclid(2 * sum);
        let (mut u, mut v) = (scaled(n[0]), scaled(n[1]));
        if n[2] < 0 {
            let sign = |c: i64| if c < 0 { -1 } else { 1 };
            (u, v) = ((32767 - v.abs()) * sign(u), (32767 - u.abs()) * sign(v));
        }
        OctNormal::pack(u as i16, v as i16)
    }

    /// The opposite direction, exactly.
    #[inline]
    pub fn flipped(self) -> OctNormal {
        let (u, v) = (i32::from(self.0 as u16 as i16), i32::from((self.0 >> 16) as u16 as i16));
        let sign = |c: i32| if c < 0 { -1 } else { 1 };
        let folded = |u: i32, v: i32| ((32767 - v.abs()) * sign(u), (32767 - u.abs()) * sign(v));
        // Those below the equator are folded outward.
        let (x, y) = if u.abs() + v.abs() > 32767 { folded(u, v) } else { (u, v) };
        let (u, v) = if u.abs() + v.abs() >= 32767 { (-x, -y) } else { folded(-x, -y) };
        OctNormal::pack(u as i16, v as i16)
    }

    fn pack(u: i16, v: i16) -> OctNormal {
        OctNormal(u32::from(u as u16) | u32::from(v as u16) << 16)
    }

    /// A vector of that direction, whose components add up to [`OctNormal::SUM`] in absolute value.
    #[inline]
    pub fn to_direction(self) -> [i32; 3] {
        let (u, v) = (i32::from(self.0 as u16 as i16), i32::from((self.0 >> 16) as u16 as i16));
        let z = OctNormal::SUM - u.abs() - v.abs();
        let fold = (-z).max(0);
        [if u < 0 { u + fold } else { u - fold }, if v < 0 { v + fold } else { v - fold }, z]
    }

    /// The unit vector.
    #[inline]
    pub fn to_vector(self) -> [f64; 3] {
        let u = f64::from(self.0 as u16 as i16) / 32767.0;
        let v = f64::from((self.0 >> 16) as u16 as i16) / 32767.0;
        let z = 1.0 - u.abs() - v.abs();
        let fold = (-z).max(0.0);
        let x = if u < 0.0 { u + fold } else { u - fold };
        let y = if v < 0.0 { v + fold } else { v - fold };
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    }
}

/// Where the running count along one lattice edge passes 0.5, and the outward surface normal there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HermiteEdge {
    /// Distance from the edge's lower sample in 1/65536 of the edge.
    pub offset: u16,
    /// Outward normal of the facet there.
    pub normal: OctNormal,
}

impl HermiteEdge {
    /// The offset as a fraction of the edge, 0..1.
    #[inline]
    pub fn fraction(self) -> f64 {
        f64::from(self.offset) / 65536.0
    }
}

/// Hermite edges of a brick: for each axis one per sign-changing lattice edge among the 33³ samples, in the
/// order of the linear index of the edge's lower sample.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hermite {
    /// Indexed by [`Axis::index`].
    pub edges: [Vec<HermiteEdge>; 3],
}

impl Hermite {
    /// Number of edges along all axes.
    #[inline]
    pub fn len(&self) -> usize {
        self.edges.iter().map(Vec::len).sum()
    }

    /// True on interior nodes and on leaves without a boundary.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Heap bytes.
    #[inline]
    pub fn heap_bytes(&self) -> usize {
        self.edges.iter().map(|e| e.capacity() * size_of::<HermiteEdge>()).sum()
    }
}

/// Which samples of a brick lie inside (w ≥ 0.5) and which lattice edges change sign, as bit rows along x.
#[derive(Clone, PartialEq, Eq)]
pub struct SignChanges {
    /// Bit `i` of row `k·33 + j` is set where sample (i, j, k) is inside.
    inside: Box<[u64; BRICK_POINTS * BRICK_POINTS]>,
}

/// The inside bits, from sample `from` to the end of the row, of samples that are all `w`.
#[inline]
pub fn inside_from(w: i32, from: usize) -> u64 {
    let all = ((1u64 << BRICK_POINTS) - 1) >> from << from;
    if w >= 1 { all } else { 0 }
}

/// Bit `i` is set where the edge along x from sample `i` of a row changes sign.
#[inline(always)]
pub fn along_row(row: u64) -> u64 {
    (row ^ row >> 1) & 0xffff_ffff
}

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// As [`SignChanges::ranks`] gives them.
pub type Ranks = [u32; ROWS + 1];

impl SignChanges {
    /// Classifies samples against 0.5; of whole ones those of 1 and more are inside.
    #[inline]
    pub fn of(samples: &Samples) -> SignChanges {
        dispatch!(level(), simd => SignChanges::of_with(simd, samples))
    }

    #[inline(always)]
    fn of_with<S: Simd>(simd: S, samples: &Samples) -> SignChanges {
        let half = (1i16 << samples.1 >> 1).max(1);
        let halves = i16x16::splat(simd, half);
        let mut inside = SignChanges::outside();
        for (row, ws) in inside.inside.iter_mut().zip(samples.0.as_chunks::<BRICK_POINTS>().0) {
            let bits_from =
                |i: usize| i16x16::from_slice(simd, &ws[i..i + 16]).simd_ge(halves).to_bitmask() << i;
            let last = u64::from(ws[32] >= half) << 32;
            *row = bits_from(0) | bits_from(16) | last;
        }
        inside
    }

    /// Every sample outside.
    #[inline]
    pub fn outside() -> SignChanges {
        SignChanges { inside: vec![0; ROWS].into_boxed_slice().try_into().expect("the length is ROWS") }
    }

    /// From a predicate on the linear sample index.
    #[inline]
    pub fn from_fn(inside: impl Fn(usize) -> bool) -> SignChanges {
        let mut out = SignChanges::outside();
        for index in (0..POINTS).filter(|&index| inside(index)) {
            out.inside[index / BRICK_POINTS] |= 1 << (index % BRICK_POINTS);
        }
        out
    }

    /// The inside bits of the row at (j, k).
    #[inline]
    pub fn row(&self, j: usize, k: usize) -> u64 {
        self.inside[k * BRICK_POINTS + j]
    }

    /// Sets the inside bits, i in 0..=32, of the row at (j, k).
    #[inline]
    pub fn set_row(&mut self, j: usize, k: usize, bits: u64) {
        self.inside[k * BRICK_POINTS + j] = bits;
    }

    /// True if sample (i, j, k) is inside.
    #[inline]
    pub fn is_inside(&self, ijk: [usize; 3]) -> bool {
        self.row(ijk[1], ijk[2]) >> ijk[0] & 1 != 0
    }

    /// Bit `i` is set where the edge along `axis` that starts at sample (i, j, k) changes sign; zero where
    /// no such edge lies within the 33³ samples.
    #[inline]
    pub fn edges(&self, axis: Axis, j: usize, k: usize) -> u64 {
        let row = self.row(j, k);
        match axis {
            Axis::X => along_row(row),
            Axis::Y if j + 1 < BRICK_POINTS => row ^ self.row(j + 1, k),
            Axis::Z if k + 1 < BRICK_POINTS => row ^ self.row(j, k + 1),
            _ => 0,
        }
    }

    /// Whether two samples across the diagonal of a lattice face are inside, and the other two are not: two sheets pass
    /// the face, and a wall or a gap between them is thinner than its diagonal.
    #[inline]
    pub fn has_ambiguous_face(&self) -> bool {
        let layer = |k: usize| &self.inside[k * BRICK_POINTS..][..BRICK_POINTS];
        // Two rows of samples beside each other: faces along x, whose other direction is from one row to the other.
        let between = |a: u64, b: u64| along_row(a) & along_row(b) & (a ^ b) != 0;
        let rows = |a: &[u64], b: &[u64]| a.iter().zip(b).any(|(a, b)| between(*a, *b));
        // Four rows around a line along x: faces across it.
        let across = |near: &[u64], far: &[u64]| {
            let mut pairs = near.windows(2).zip(far.windows(2));
            pairs.any(|(a, b)| (a[0] ^ a[1]) & (b[0] ^ b[1]) & (a[0] ^ b[0]) != 0)
        };
        (0..BRICK_POINTS).any(|k| rows(layer(k), &layer(k)[1..]))
            || (1..BRICK_POINTS).any(|k| rows(layer(k - 1), layer(k)) || across(layer(k - 1), layer(k)))
    }

    /// Calls `each` with the lower samples (i, j, k) of the sign-changing edges along `axis`, in the order of the linear
    /// index.
    #[inline(always)]
    pub fn for_edges(&self, axis: Axis, mut each: impl FnMut([usize; 3])) {
        let layer = |k: usize| &self.inside[k * BRICK_POINTS..][..BRICK_POINTS];
        for k in 0..BRICK_POINTS {
            let next = match axis {
                Axis::X => layer(k),
                Axis::Y => &layer(k)[1..],
                Axis::Z if k + 1 < BRICK_POINTS => layer(k + 1),
                Axis::Z => &[],
            };
            for (j, (row, next)) in layer(k).iter().zip(next).enumerate() {
                let mut bits = if axis == Axis::X { along_row(*row) } else { row ^ next };
                while bits != 0 {
                    each([bits.trailing_zeros() as usize, j, k]);
                    bits &= bits - 1;
                }
            }
        }
    }

    /// The same with the crossing of each edge, as far as there are crossings.
    #[inline(always)]
    pub fn for_crossings(
        &self,
        axis: Axis,
        hermite: &Hermite,
        mut each: impl FnMut([usize; 3], HermiteEdge),
    ) {
        let mut edges = hermite.edges[axis.index()].iter();
        self.for_edges(axis, |low| {
            if let Some(edge) = edges.next() {
                each(low, *edge);
            }
        });
    }

    /// For each row k·33 + j, how many sign-changing edges along `axis` the rows before it hold; the last
    /// entry is the number of all.
    #[inline]
    pub fn ranks(&self, axis: Axis) -> Box<Ranks> {
        let mut ranks = vec![0u32; ROWS + 1];
        for row in 0..ROWS {
            let count = self.edges(axis, row % BRICK_POINTS, row / BRICK_POINTS).count_ones();
            ranks[row + 1] = ranks[row] + count;
        }
        ranks.into_boxed_slice().try_into().expect("the length is ROWS + 1")
    }

    /// How many sign-changing edges along `axis` come before the edge that starts at sample (i, j, k), given their
    /// [`SignChanges::ranks`].
    #[inline(always)]
    pub fn rank(&self, axis: Axis, [i, j, k]: [usize; 3], ranks: &Ranks) -> usize {
        let before = self.edges(axis, j, k) & ((1 << i) - 1);
        (ranks[k * BRICK_POINTS + j] + before.count_ones()) as usize
    }

    /// Number of sign-changing edges along each axis.
    #[inline]
    pub fn counts(&self) -> [usize; 3] {
        // Plain loops over slices are vectorized, which counts bits in a third of the instructions.
        let count = |rows: &[u64], next: &[u64]| -> u64 {
            rows.iter().zip(next).map(|(row, next)| u64::from((row ^ next).count_ones())).sum()
        };
        let rows = &self.inside[..];
        let along_x = rows.iter().map(|row| u64::from(along_row(*row).count_ones())).sum();
        let along_y = rows.chunks_exact(BRICK_POINTS).map(|layer| count(layer, &layer[1..])).sum();
        let along_z = count(rows, &rows[BRICK_POINTS..]);
        [along_x, along_y, along_z].map(|count: u64| count as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::point_index;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn normals_survive_the_octahedron(n in prop::array::uniform3(-(1i64 << 49)..1 << 49), shift in 0u32..48) {
            let n = n.map(|c| c >> shift);
            prop_assume!(n != [0; 3]);
            let length = n.iter().map(|&c| (c as f64).powi(2)).sum::<f64>().sqrt();
            let back = OctNormal::from_integer(n).to_vector();
            let dot: f64 = (0..3).map(|a| back[a] * n[a] as f64 / length).sum();
            prop_assert!(dot > 1.0 - 1e-8, "{dot}");
        }

        #[test]
        fn flipped_normals_are_opposite(n in prop::array::uniform3(-(1i64 << 40)..1 << 40), zero in 0usize..6) {
            let mut n = n;
            if zero < 3 { n[zero] = 0 }
            prop_assume!(n != [0; 3]);
            let code = OctNormal::from_integer(n);
            let (there, back) = (code.to_vector(), code.flipped().to_vector());
            let apart = (0..3).map(|a| (there[a] + back[a]).abs()).fold(0.0, f64::max);
            prop_assert!(apart < 1e-12, "{there:?} {back:?}");
            prop_assert_eq!(code.flipped().flipped().to_vector(), there);
        }
    }

    #[test]
    fn axis_normals_are_exact() {
        for axis in 0..3 {
            for sign in [-1i64, 1] {
                let mut n = [0; 3];
                n[axis] = sign * 12345;
                assert_eq!(OctNormal::from_integer(n).to_vector(), n.map(|c| c.signum() as f64));
            }
        }
    }

    #[test]
    fn edges_and_ranks_agree_with_the_samples() {
        let mut samples = Samples::filled(0);
        for ijk in [[0, 0, 0], [32, 32, 32], [5, 6, 7], [31, 32, 0]] {
            samples.0[point_index(ijk)] = 1;
        }
        let signs = SignChanges::of(&samples);
        for axis in Axis::ALL {
            let mut rank = 0;
            let ranks = signs.ranks(axis);
            for (row, &before) in ranks[..ROWS].iter().enumerate() {
                assert_eq!(before, rank);
                let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
                for i in 0..BRICK_POINTS {
                    let mut to = [i, j, k];
                    to[axis.index()] += 1;
                    let changes = to[axis.index()] < BRICK_POINTS
                        && (samples.at([i, j, k]) >= 1) != (samples.at(to) >= 1);
                    assert_eq!(signs.edges(axis, j, k) >> i & 1 == 1, changes);
                    rank += u32::from(changes);
                }
            }
            assert_eq!(ranks[ROWS], rank);
        }
        assert!(signs.is_inside([31, 32, 0]) && !signs.is_inside([30, 32, 0]));
    }
}
