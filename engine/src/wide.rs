//! The widest vectors of this processor.
//!
//! `dispatch!(level(), simd => f(simd))` calls `f` as compiled for them. Everything in `f` must be inlined. Results have the
//! same bits for any width: lanes do the same operations in the same order, and none is fused.

pub(crate) use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdFrom, SimdMask, dispatch, f64x4, f64x8, i16x16, mask64x4,
    mask64x8, u64x4,
};

use fearless_simd::Level;

/// What the processor has; found out once.
#[inline]
pub(crate) fn level() -> Level {
    Level::new()
}

/// Eight points, by axis.
#[inline(always)]
pub(crate) fn each_of<S: Simd>(simd: S, at: &[[f64; 8]; 3]) -> [f64x8<S>; 3] {
    // Spelled out: a closure may stay a call, compiled for the narrowest vectors.
    [f64x8::from_slice(simd, &at[0]), f64x8::from_slice(simd, &at[1]), f64x8::from_slice(simd, &at[2])]
}
