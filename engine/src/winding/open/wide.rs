//! Groups of samples in vectors.

pub(super) use crate::wide::{Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, f64x8, level, mask64x8};

use super::local::GROUP;

/// Coordinates of some points, by axis.
#[inline(always)]
pub(super) fn each_of<S: Simd>(simd: S, at: &[[f64; GROUP]; 3]) -> [f64x8<S>; 3] {
    // Spelled out, here and below: a closure may stay a call, compiled for the narrowest vectors.
    [f64x8::from_slice(simd, &at[0]), f64x8::from_slice(simd, &at[1]), f64x8::from_slice(simd, &at[2])]
}

/// From some points to another.
#[inline(always)]
pub(super) fn way<S: Simd>(simd: S, to: &[f64; 3], at: &[f64x8<S>; 3]) -> [f64x8<S>; 3] {
    [f64x8::splat(simd, to[0]) - at[0], f64x8::splat(simd, to[1]) - at[1], f64x8::splat(simd, to[2]) - at[2]]
}
