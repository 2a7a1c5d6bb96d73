//! The root cube: where the lattice lies in the world.

use super::{ROOT_BITS, Units};
use serde::{Deserialize, Serialize};

/// Edge of the root cube in units.
const ROOT_UNITS: f64 = (1u32 << ROOT_BITS) as f64;

/// The cube that the octree divides, in the input's length unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RootCube {
    /// World position of unit (0, 0, 0).
    pub origin: [f64; 3],
    /// World length of 2^24 units.
    pub edge: f64,
}

impl RootCube {
    /// The cube centred on the box `min..max` that leaves 1/64 of its edge free on each side of the longest
    /// extent, so that every sample on the cube's own faces lies outside the input.
    ///
    /// `None` if the box is empty, not finite, or so small against its distance from the origin that the
    /// lattice could not tell its positions apart in f64.
    #[inline]
    pub fn around(min: [f64; 3], max: [f64; 3]) -> Option<RootCube> {
        let extent = longest(min, max)?;
        RootCube::centred(min, max, extent * (32.0 / 31.0))
    }

    /// The cube around `min..max` with cells of exactly `cell` at the returned level: the smallest level
    /// whose cube has room for the box and its margin. `None` as for [`RootCube::around`], or if that would
    /// be deeper than [`super::MAX_LEVEL`].
    #[inline]
    pub fn with_cell(min: [f64; 3], max: [f64; 3], cell: f64) -> Option<(RootCube, u8)> {
        let needed = longest(min, max)? * (32.0 / 31.0);
        if !(cell.is_finite() && cell > 0.0) {
            return None;
        }
        let (level, edge) = (0..=super::MAX_LEVEL)
            .map(|level| (level, cell * 32.0 * f64::from(1u32 << level)))
            .find(|&(_, edge)| edge >= needed)?;
        Some((RootCube::centred(min, max, edge)?, level))
    }

    fn centred(min: [f64; 3], max: [f64; 3], edge: f64) -> Option<RootCube> {
        let origin = std::array::from_fn(|a| (min[a] + max[a]) * 0.5 - edge * 0.5);
        let cube = RootCube { origin, edge };
        let farthest = min.iter().chain(&max).chain(&origin).fold(0.0f64, |m, v| m.max(v.abs()));
        // Half a unit must survive next to the largest coordinate.
        (edge.is_finite() && edge * 2f64.powi(-25) > farthest * f64::EPSILON && cube.scale().is_finite())
            .then_some(cube)
    }

    /// Half units per world length.
    #[inline]
    fn scale(&self) -> f64 {
        ROOT_UNITS * 0.5 / self.edge
    }

    /// The function that snaps a world position to the nearest even lattice position.
    ///
    /// Positions inside the box the cube was made for stay inside the root.
    #[inline]
    pub fn snapper(&self) -> impl Fn([f64; 3]) -> Units + Copy + use<> {
        let (origin, scale) = (self.origin, self.scale());
        move |p| std::array::from_fn(|a| 2 * round_half_up((p[a] - origin[a]) * scale))
    }

    /// World length of a lattice unit.
    #[inline]
    pub fn unit(&self) -> f64 {
        self.edge / ROOT_UNITS
    }

    /// World position of a lattice position, which may lie between units.
    #[inline]
    pub fn to_world(&self, units: [f64; 3]) -> [f64; 3] {
        let unit = self.unit();
        std::array::from_fn(|a| self.origin[a] + units[a] * unit)
    }

    /// World position in 32 bits of the sample that is one unit above a corner of a cell, to the last bit the same for all
    /// that have it.
    #[inline]
    pub fn sample(&self, corner: Units) -> [f32; 3] {
        self.to_world(corner.map(|c| f64::from(c) + 1.0)).map(|c| c as f32)
    }

    /// Lattice position of a world position, not rounded.
    #[inline]
    pub fn to_units(&self, world: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (world[a] - self.origin[a]) * (ROOT_UNITS / self.edge))
    }

    /// Lattice position of a world position, counted from the root's first sample, which stands at (1, 1, 1), and
    /// resolved to 2^-10 of a unit. So the position of a sample, after it went through decimal or binary fractions of
    /// the world's unit, is that sample again. Weights of interpolation between samples are exact.
    #[inline]
    pub fn from_first_sample(&self, world: [f64; 3]) -> [f64; 3] {
        const STEPS_PER_UNIT: f64 = 1024.0;
        self.to_units(world).map(|u| ((u - 1.0) * STEPS_PER_UNIT).round() / STEPS_PER_UNIT)
    }

    /// The largest coordinate of the cube without its sign.
    pub fn farthest(&self) -> f64 {
        self.origin.iter().map(|c| c.abs().max((c + self.edge).abs())).fold(0.0, f64::max)
    }

    /// World distance of two samples of `level`, the cell size there.
    #[inline]
    pub fn spacing(&self, level: u8) -> f64 {
        self.edge / f64::from(super::BRICK_CELLS as u32) / f64::from(1u32 << level)
    }
}

/// floor(v + ½) for |v| < 2^30, in operations that every processor has for several numbers at a time: neither a call
/// into libm, which baseline x86-64 needs for `floor`, nor a conversion that saturates.
#[inline]
fn round_half_up(v: f64) -> i32 {
    /// Adding this rounds to an integer, which then stands in the low bits of the mantissa.
    const ROUND: f64 = (1u64 << 52) as f64 * 1.5;
    let shifted = v + 0.5;
    let rounded = shifted + ROUND;
    let above = rounded - ROUND > shifted;
    (rounded.to_bits() as i32).wrapping_sub(i32::from(above))
}

fn longest(min: [f64; 3], max: [f64; 3]) -> Option<f64> {
    let extent = (0..3).map(|a| max[a] - min[a]).fold(0.0, f64::max);
    (extent.is_finite() && extent > 0.0).then_some(extent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapping_is_even_nearest_and_inside() {
        let cube = RootCube::around([-3.0, 10.0, 0.0], [5.0, 12.5, 1.0]).unwrap();
        let snap = cube.snapper();
        for p in [[-3.0, 10.0, 0.0], [5.0, 12.5, 1.0], [0.1, 11.3, 0.7]] {
            let q = snap(p);
            let back = cube.to_world(q.map(f64::from));
            for a in 0..3 {
                assert_eq!(q[a] % 2, 0);
                assert!(q[a] > 1 && q[a] < (1 << ROOT_BITS) - 1);
                assert!((back[a] - p[a]).abs() <= cube.edge * 2f64.powi(-24) * 1.001);
            }
        }
    }

    #[test]
    fn cells_have_the_size_asked_for() {
        let (cube, level) = RootCube::with_cell([0.0; 3], [100.0, 20.0, 5.0], 0.05).unwrap();
        assert_eq!(cube.spacing(level), 0.05);
        assert_eq!(level, 7);
        assert!(RootCube::with_cell([0.0; 3], [1.0; 3], 1e-9).is_none());
        assert!(RootCube::around([0.0; 3], [0.0; 3]).is_none());
        assert!(RootCube::around([1e18; 3], [1e18 + 1e3; 3]).is_none());
        assert!(RootCube::around([f64::NEG_INFINITY; 3], [0.0; 3]).is_none());
    }

    #[test]
    fn rounding_matches_floor() {
        for v in [-2.5, -2.0, -1.50001, -0.5, -0.49999, 0.0, 0.49999, 0.5, 1.5, 8388607.5] {
            assert_eq!(f64::from(round_half_up(v)), (v + 0.5f64).floor(), "{v}");
        }
    }
}
