//! Symmetric 3×3 matrices, of numbers or of vectors that hold one number of each of several matrices: what follows from
//! sums, differences and products alone is written once and has the same bits for both.

use std::ops::{Add, Mul, Sub};

/// A number, or several in a vector.
pub(super) trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>> Number for T {}

#[inline(always)]
pub(super) fn dot<T: Number>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A symmetric matrix: xx, yy, zz, xy, yz, zx.
#[derive(Clone, Copy, Default)]
pub(super) struct Symmetric<T = f64>(pub [T; 6]);

impl<T: Number> Symmetric<T> {
    /// With n·nᵀ added.
    #[inline(always)]
    pub(super) fn plus(&self, n: [T; 3]) -> Symmetric<T> {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        Symmetric([
            xx + n[0] * n[0],
            yy + n[1] * n[1],
            zz + n[2] * n[2],
            xy + n[0] * n[1],
            yz + n[1] * n[2],
            zx + n[2] * n[0],
        ])
    }

    #[inline(always)]
    pub(super) fn times(&self, x: [T; 3]) -> [T; 3] {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        [
            xx * x[0] + xy * x[1] + zx * x[2],
            xy * x[0] + yy * x[1] + yz * x[2],
            zx * x[0] + yz * x[1] + zz * x[2],
        ]
    }

    #[inline(always)]
    pub(super) fn trace(&self) -> T {
        self.0[0] + self.0[1] + self.0[2]
    }

    /// The matrix of the principal minors and their complements: the inverse times the determinant.
    #[inline(always)]
    pub(super) fn adjugate(&self) -> Symmetric<T> {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        Symmetric([
            yy * zz - yz * yz,
            xx * zz - zx * zx,
            xx * yy - xy * xy,
            yz * zx - xy * zz,
            xy * zx - xx * yz,
            xy * yz - yy * zx,
        ])
    }

    #[inline(always)]
    pub(super) fn determinant(&self, adjugate: &Symmetric<T>) -> T {
        self.0[0] * adjugate.0[0] + self.0[3] * adjugate.0[3] + self.0[5] * adjugate.0[5]
    }

    #[inline(always)]
    pub(super) fn squared(&self) -> Symmetric<T> {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        Symmetric([
            xx * xx + xy * xy + zx * zx,
            xy * xy + yy * yy + yz * yz,
            zx * zx + yz * yz + zz * zz,
            xx * xy + xy * yy + zx * yz,
            xy * zx + yy * yz + yz * zz,
            zx * xx + yz * xy + zz * zx,
        ])
    }
}
