//! The widest vectors of this processor.
//!
//! `dispatch!(level(), simd => f(simd))` calls `f` as compiled for them. Everything in `f` must be inlined. Results have the
//! same bits for any width: lanes do the same operations in the same order, and none is fused.

pub use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdFrom, SimdMask, SimdSplit, dispatch, f32x4, f32x8, f32x16,
    f64x4, f64x8, i16x16, i32x4, mask64x4, mask64x8, u32x8, u32x16, u64x4,
};

use fearless_simd::Level;

/// What the processor has; found out once.
#[inline]
pub fn level() -> Level {
    Level::new()
}

/// Eight points, by axis.
#[inline(always)]
pub fn each_of<S: Simd>(simd: S, at: &[[f64; 8]; 3]) -> [f64x8<S>; 3] {
    // Spelled out: a closure may stay a call, compiled for the narrowest vectors.
    [f64x8::from_slice(simd, &at[0]), f64x8::from_slice(simd, &at[1]), f64x8::from_slice(simd, &at[2])]
}

/// Eight rows of eight numbers as columns. Shuffles, because what is written number by number and read at once has to
/// wait for the cache.
#[inline(always)]
pub fn transposed<S: Simd, V: SimdFloat<S> + SimdFrom<V, S>>(rows: [V; 8]) -> [V; 8] {
    let [a, b, c, d, e, f, g, h] = rows;
    let ((ae, ae_high), (bf, bf_high)) = (a.interleave(e), b.interleave(f));
    let ((cg, cg_high), (dh, dh_high)) = (c.interleave(g), d.interleave(h));
    let ((p, q), (r, s)) = (ae.interleave(cg), bf.interleave(dh));
    let ((t, u), (v, w)) = (ae_high.interleave(cg_high), bf_high.interleave(dh_high));
    let ((k, l), (m, n)) = (p.interleave(r), q.interleave(s));
    let ((x, y), (z, o)) = (t.interleave(v), u.interleave(w));
    [k, l, m, n, x, y, z, o]
}

/// Four rows of eight numbers as columns, in shuffles, too.
#[inline(always)]
pub fn in_fours<S: Simd>([a, b, c, d]: [f32x8<S>; 4]) -> [[f32; 4]; 8] {
    let ((ac, ac_high), (bd, bd_high)) = (a.interleave(c), b.interleave(d));
    let ((p, q), (r, s)) = (ac.interleave(bd), ac_high.interleave(bd_high));
    let mut columns = [[0.0; 4]; 8];
    p.store_slice(columns[..2].as_flattened_mut());
    q.store_slice(columns[2..4].as_flattened_mut());
    r.store_slice(columns[4..6].as_flattened_mut());
    s.store_slice(columns[6..].as_flattened_mut());
    columns
}

/// Eight numbers with half the bits, rounded to nearest.
#[inline(always)]
pub fn narrowed<S: Simd>(simd: S, numbers: f64x8<S>) -> f32x8<S> {
    let (low, high) = numbers.split();
    simd.narrow_f64x4(low, high)
}

/// Eight numbers with twice the bits.
#[inline(always)]
pub fn widened<S: Simd>(simd: S, numbers: f32x8<S>) -> f64x8<S> {
    let numbers = numbers.as_array();
    let mut wide = [0.0; 8];
    for lane in 0..8 {
        wide[lane] = f64::from(numbers[lane]);
    }
    f64x8::from_slice(simd, &wide)
}
