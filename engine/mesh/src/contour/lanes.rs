//! Eight loops side by side in vectors: their numbers, matrices, and minimisers on the faces of boxes.

use super::qef::TRUNCATION_SQUARED;
use super::symmetric::Symmetric;
use crate::wide::{Select, Simd, SimdBase, SimdMask, f64x8};

/// Loops in a group.
pub(super) const GROUP: usize = 8;

/// One number for each loop.
pub(super) type LoopLanes = [f64; GROUP];

/// Moves minimisers that are beyond one face of the box to those over the face, where these lie within the face and
/// no direction of the face is truncated: no edge or corner of the face has a smaller error then. Returns a bit for
/// each lane whose point is the minimiser over the box.
#[inline(always)]
pub(super) fn on_faces<S: Simd>(
    matrix: &Matrix<S>,
    rhs: Vec3<S>,
    mass: Vec3<S>,
    largest: f64x8<S>,
    [low, high]: [Vec3<S>; 2],
    at: &mut Vec3<S>,
) -> u64 {
    let is_within = [
        at[0].simd_ge(low[0]) & at[0].simd_le(high[0]),
        at[1].simd_ge(low[1]) & at[1].simd_le(high[1]),
        at[2].simd_ge(low[2]) & at[2].simd_le(high[2]),
    ];
    let mut done = (is_within[0] & is_within[1] & is_within[2]).to_bitmask();
    let [xx, yy, zz, xy, yz, zx] = matrix.0;
    let (diagonal, opposite) = ([xx, yy, zz], [yz, zx, xy]);
    for a in 0..3 {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let is_below = at[a].simd_lt(low[a]);
        let is_beyond = (is_below | at[a].simd_gt(high[a])) & is_within[b] & is_within[c];
        if !is_beyond.any_true() {
            continue;
        }
        let face = is_below.select(low[a], high[a]);
        let [bb, cc, bc] = [diagonal[b], diagonal[c], opposite[a]];
        let from_mass = face - mass[a];
        let rhs = [rhs[b] - opposite[c] * from_mass, rhs[c] - opposite[b] * from_mass];
        let determinant = bb * cc - bc * bc;
        // The product of the two eigenvalues over their sum is at most the smaller one.
        let is_whole = determinant.simd_gt(largest * TRUNCATION_SQUARED * (bb + cc));
        let scale = inverse(determinant);
        let p = mass[b] + (cc * rhs[0] - bc * rhs[1]) * scale;
        let q = mass[c] + (bb * rhs[1] - bc * rhs[0]) * scale;
        let is_on_face = p.simd_ge(low[b]) & p.simd_le(high[b]) & q.simd_ge(low[c]) & q.simd_le(high[c]);
        let is_found = is_beyond & is_whole & is_on_face;
        at[a] = is_found.select(face, at[a]);
        at[b] = is_found.select(p, at[b]);
        at[c] = is_found.select(q, at[c]);
        done |= is_found.to_bitmask();
    }
    done
}

/// Points or vectors: by axis, then by lane.
pub(super) type Vec3<S> = [f64x8<S>; 3];

#[inline(always)]
pub(super) fn minus<S: Simd>(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn times<S: Simd>(a: Vec3<S>, s: f64x8<S>) -> Vec3<S> {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(super) fn divided<S: Simd>(a: Vec3<S>, s: f64x8<S>) -> Vec3<S> {
    times(a, inverse(s))
}

/// One division takes as long as a dozen products.
#[inline(always)]
pub(super) fn inverse<S: Simd>(s: f64x8<S>) -> f64x8<S> {
    f64x8::splat(s.simd, 1.0) / s
}

/// The matrices of eight loops.
pub(super) type Matrix<S> = Symmetric<f64x8<S>>;

#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, terms: &[LoopLanes; 6]) -> Matrix<S> {
    let mut all = [f64x8::splat(simd, 0.0); 6];
    for (to, term) in all.iter_mut().zip(terms) {
        *to = f64x8::from_slice(simd, term);
    }
    Symmetric(all)
}
