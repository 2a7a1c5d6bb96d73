//! Dipoles near some samples, seen from each of them: in vectors of sixteen samples, in 32 bits.
//!
//! A sample's sum has the same bits whatever fifteen it shares a vector with.

use super::super::open::LocalExpansion;
use super::dipole::Dipole;
use super::far::C;
use crate::brick::POINTS;
use crate::lattice::BRICK_POINTS;
use crate::wide::{Bytes, Select, Simd, SimdBase, dispatch, f32x16, level, u32x16};

/// Samples along a row of a brick.
const P: usize = BRICK_POINTS;
/// Samples at a time.
pub(super) const LANES: usize = 16;
/// Points whose sum has 32 bits: longer sums would lose more than their terms.
const SUMMED: usize = 32;

/// By axis, how far the samples of a row are from the middle of a cell.
pub(super) type SampleWays = [[f64; P]; 3];

/// Sums at sixteen places, and by axis how fast they grow there.
pub(super) type SumsWithSlopes = ([f64; LANES], [[f64; LANES]; 3]);

/// A box of a brick's samples: the first along each axis, and the first beyond.
pub(super) struct SampleRegion {
    pub from: [usize; 3],
    pub to: [usize; 3],
}

/// A dipole about the middle of a cell, in units of the finest samples' distance.
#[derive(Clone, Copy, Debug, Default)]
struct NearPoint {
    position: [f32; 3],
    /// Area over 4π.
    area: [f32; 3],
    /// Radius of the ball, squared.
    ball: f32,
    /// Within the ball, less the squared distance times the second.
    within: [f32; 2],
}

/// Points near a cell.
#[derive(Debug, Default)]
pub(super) struct NearPoints {
    points: Vec<NearPoint>,
    scale: f64,
}

impl SampleRegion {
    /// Whether it holds a sample.
    pub fn holds(&self, sample: [usize; 3]) -> bool {
        (0..3).all(|a| (self.from[a]..self.to[a]).contains(&sample[a]))
    }

    /// Sets all samples to the values of a polynomial; `ways` tell how far samples are from its centre.
    pub fn fill(&self, local: &LocalExpansion<C>, ways: &SampleWays, values: &mut [f64; POINTS]) {
        dispatch!(level(), _simd => self.fill_with(local, ways, values));
    }

    #[inline(always)]
    fn fill_with(&self, local: &LocalExpansion<C>, ways: &SampleWays, values: &mut [f64; POINTS]) {
        let SampleRegion { from, to } = *self;
        let of_box: [&[f64]; 3] = std::array::from_fn(|axis| &ways[axis][from[axis]..to[axis]]);
        local.at_grid(
            of_box,
            |j, k| (((from[2] + k) * P + from[1] + j) * P + from[0], to[0] - from[0]),
            values,
        );
    }
}

impl NearPoints {
    /// Takes some dipoles in place of others, about the middle of a cell.
    pub fn gather<'a>(&mut self, dipoles: impl Iterator<Item = &'a Dipole>, center: [f64; 3], spacing: u32) {
        self.scale = 1.0 / (1u64 << spacing) as f64;
        let scale = self.scale;
        self.points.clear();
        self.points.extend(dipoles.map(|dipole| {
            let (position, area, radius) = dipole.about(center, scale);
            let ball = radius * radius;
            NearPoint {
                position: position.map(|c| c as f32),
                area: area.map(|c| c as f32),
                ball: ball as f32,
                within: [2.5 / (ball * radius), 1.5 / (ball * ball * radius)].map(|c| c as f32),
            }
        }));
    }

    /// Adds what the points give at some samples.
    pub fn add(&self, samples: &SampleRegion, ways: &SampleWays, values: &mut [f64; POINTS]) {
        dispatch!(level(), simd => self.add_with(simd, samples, ways, values));
    }

    #[inline(always)]
    fn add_with<S: Simd>(
        &self,
        simd: S,
        samples: &SampleRegion,
        ways: &SampleWays,
        values: &mut [f64; POINTS],
    ) {
        let SampleRegion { from, to } = *samples;
        let mut at = [[0.0f32; LANES]; 3];
        let mut places = [0usize; LANES];
        let mut count = 0;
        for k in from[2]..to[2] {
            for j in from[1]..to[1] {
                for i in from[0]..to[0] {
                    places[count] = (k * P + j) * P + i;
                    for (axis, number) in [i, j, k].into_iter().enumerate() {
                        at[axis][count] = (ways[axis][number] * self.scale) as f32;
                    }
                    count += 1;
                    if count == LANES {
                        let sums = self.seen_from(simd, &at);
                        places.iter().zip(sums).for_each(|(&place, sum)| values[place] += sum);
                        count = 0;
                    }
                }
            }
        }
        if count > 0 {
            let sums = self.seen_from(simd, &at);
            places[..count].iter().zip(sums).for_each(|(&place, sum)| values[place] += sum);
        }
    }

    /// What the points give at sixteen places, by axis how far they are from the cell's middle.
    pub fn with_slopes(&self, at: &[[f64; LANES]; 3]) -> SumsWithSlopes {
        let at = at.map(|row| row.map(|c| (c * self.scale) as f32));
        let (sums, slopes) = dispatch!(level(), simd => self.slopes_from(simd, &at));
        (sums, slopes.map(|row| row.map(|slope| slope * self.scale)))
    }

    #[inline(always)]
    fn slopes_from<S: Simd>(&self, simd: S, at: &[[f32; LANES]; 3]) -> SumsWithSlopes {
        let [x, y, z] = [
            f32x16::from_slice(simd, &at[0]),
            f32x16::from_slice(simd, &at[1]),
            f32x16::from_slice(simd, &at[2]),
        ];
        let mut sums = [[0.0; LANES]; 4];
        for points in self.points.chunks(SUMMED) {
            let mut sum = [f32x16::splat(simd, 0.0); 4];
            for point in points {
                let dx = f32x16::splat(simd, point.position[0]) - x;
                let dy = f32x16::splat(simd, point.position[1]) - y;
                let dz = f32x16::splat(simd, point.position[2]) - z;
                let squared = dx * dx + (dy * dy + dz * dz);
                let along = dx * point.area[0] + (dy * point.area[1] + dz * point.area[2]);
                let inverse = inverse_root(simd, squared);
                let is_within = squared.simd_lt(f32x16::splat(simd, point.ball));
                let beyond = inverse * inverse * inverse;
                let within = f32x16::splat(simd, point.within[0]) - squared * point.within[1];
                let factor = is_within.select(within, beyond);
                // Twice the derivative of the factor by the squared distance.
                let within = f32x16::splat(simd, -2.0 * point.within[1]);
                let change = is_within.select(within, beyond * inverse * inverse * -3.0) * along;
                sum[0] += along * factor;
                sum[1] -= factor * point.area[0] + change * dx;
                sum[2] -= factor * point.area[1] + change * dy;
                sum[3] -= factor * point.area[2] + change * dz;
            }
            sums.iter_mut().zip(sum).for_each(|(sums, sum)| add_wide(sums, sum));
        }
        let [sum, x, y, z] = sums;
        (sum, [x, y, z])
    }

    #[inline(always)]
    fn seen_from<S: Simd>(&self, simd: S, at: &[[f32; LANES]; 3]) -> [f64; LANES] {
        let [x, y, z] = [
            f32x16::from_slice(simd, &at[0]),
            f32x16::from_slice(simd, &at[1]),
            f32x16::from_slice(simd, &at[2]),
        ];
        let mut sums = [0.0; LANES];
        for points in self.points.chunks(SUMMED) {
            let mut sum = f32x16::splat(simd, 0.0);
            for point in points {
                let dx = f32x16::splat(simd, point.position[0]) - x;
                let dy = f32x16::splat(simd, point.position[1]) - y;
                let dz = f32x16::splat(simd, point.position[2]) - z;
                let squared = dx * dx + (dy * dy + dz * dz);
                let along = dx * point.area[0] + (dy * point.area[1] + dz * point.area[2]);
                let inverse = inverse_root(simd, squared);
                let beyond = inverse * inverse * inverse;
                let within = f32x16::splat(simd, point.within[0]) - squared * point.within[1];
                let is_within = squared.simd_lt(f32x16::splat(simd, point.ball));
                sum += along * is_within.select(within, beyond);
            }
            add_wide(&mut sums, sum);
        }
        sums
    }
}

/// Adds sums of 32 bits to sums of 64.
#[inline(always)]
fn add_wide<S: Simd>(sums: &mut [f64; LANES], some: f32x16<S>) {
    let some = some.as_array();
    for lane in 0..LANES {
        sums[lane] += f64::from(some[lane]);
    }
}

/// 1/√x, off by at most 8e-7 of itself: a root and a division would take longer than all the rest of a point.
///
/// Shifting the bits halves the exponent, and gives a first guess that is off by 3.5 %. Each step of Newton's then squares
/// the error; its factors move the error's range to both sides of 0 (Moroz et al. 2018).
#[inline(always)]
fn inverse_root<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    let guess = u32x16::splat(simd, 0x5f37_5a86) - (x.bitcast::<u32x16<S>>() >> 1);
    let y: f32x16<S> = guess.bitcast();
    let y = y * (f32x16::splat(simd, 1.501_314) - x * 0.500_438 * y * y);
    y * (f32x16::splat(simd, 1.500_001) - x * 0.500_000_3 * y * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_roots() {
        // Two octaves, which all others repeat, and both ends of what distances are.
        let octaves = (0..40_000u16).map(|step| 1.0 + 3.0 * f32::from(step) / 40_000.0);
        let worst = octaves.chain([1e-11, 3e13, 2f32.powi(46)]).fold(0.0f64, |worst, x| {
            let inverse = dispatch!(level(), simd => inverse_root(simd, f32x16::splat(simd, x))[0]);
            worst.max((f64::from(inverse) * f64::from(x).sqrt() - 1.0).abs())
        });
        assert!(worst <= 8e-7, "{worst}");
    }
}
