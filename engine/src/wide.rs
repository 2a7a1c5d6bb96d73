//! The widest vectors of this processor.
//!
//! `dispatch!(level(), simd => f(simd))` calls `f` as compiled for them. Everything in `f` must be inlined. Results have the
//! same bits for any width: lanes do the same operations in the same order, and none is fused.

pub(crate) use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdFrom, SimdMask, dispatch, f64x4, f64x8, i16x16, mask64x4,
    mask64x8, u64x4,
};

use fearless_simd::Level;
use std::sync::LazyLock;

/// What the processor has.
pub(crate) fn level() -> Level {
    static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);
    *LEVEL
}
