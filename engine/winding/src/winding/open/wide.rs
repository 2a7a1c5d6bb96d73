//! Groups of samples in vectors.

pub(super) use crate::wide::{
    Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, each_of, f64x8, level, mask64x8,
};

/// From some points to another.
#[inline(always)]
pub(super) fn way<S: Simd>(simd: S, to: &[f64; 3], at: &[f64x8<S>; 3]) -> [f64x8<S>; 3] {
    // Spelled out: see [`each_of`].
    [f64x8::splat(simd, to[0]) - at[0], f64x8::splat(simd, to[1]) - at[1], f64x8::splat(simd, to[2]) - at[2]]
}
