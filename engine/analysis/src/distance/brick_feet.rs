//! How far the surface is from the samples of a brick, all at once: patch by patch instead of sample by sample.
//!
//! First each crossing bounds the distances of the samples around it from above. Then each patch is asked from the samples whose
//! bound it may improve. So a patch is found once, and not once for each sample.

use super::boxes::{Block, block_of};
use super::patch::Touch;
use super::piece::Piece;
use super::questions::TIE;
use super::surface::Surface;
use crate::brick::{POINTS, point_position};
use crate::error::Result;
use crate::lattice::{BRICK_POINTS, dot, minus};

/// More than what rounding to 32 bits makes of distances within a brick, in cells.
const ROUNDED: f32 = 2e-3;
/// Samples of a row, and of a layer.
const ROW: usize = BRICK_POINTS;
const LAYER: usize = ROW * ROW;

/// Samples of a brick, and how far the surface is from them. Lengths are in cells of the deepest level.
pub(super) struct BrickFeet {
    /// The first sample.
    first: [f64; 3],
    /// Cells between two samples.
    step: f64,
    /// No distance is larger.
    reach: f64,
    /// Bounds of distances from above.
    within: Vec<f32>,
    /// Squares of distances, infinite where no patch was asked or near enough.
    squares: Vec<f64>,
    /// Whether samples are inside, as all their nearest points say; `None` where these differ.
    sides: Vec<Option<bool>>,
}

/// The samples of a row around a crossing, and where the row stands.
struct NearRow {
    samples: std::ops::Range<usize>,
    /// The first one's way from the crossing along the row, and the square of the way to the row.
    along: f32,
    beside: f32,
}

/// Shows rows of samples that are so many cells apart, within so many cells of a place, which is counted from the first sample.
fn rows((step, reach): (f64, f64), at: [f64; 3], mut each: impl FnMut(NearRow)) {
    let last = (ROW - 1) as f64;
    let range = |c: f64, reach: f64| {
        let [low, high] = [((c - reach) / step).max(0.0), (c + reach) / step];
        let below = low as usize;
        let first = below + usize::from((below as f64) < low);
        (first, if high < 0.0 { 0 } else { high.min(last) as usize + 1 })
    };
    let (ranges, square) = (at.map(|c| range(c, reach)), reach * reach);
    for k in ranges[2].0..ranges[2].1 {
        let z = k as f64 * step - at[2];
        for j in ranges[1].0..ranges[1].1 {
            let y = j as f64 * step - at[1];
            let beside = y * y + z * z;
            if beside > square {
                continue;
            }
            let (low, high) = range(at[0], (square - beside).sqrt());
            if low < high {
                let along = (low as f64 * step - at[0]) as f32;
                let row = k * LAYER + j * ROW;
                let samples = row + low..row + high;
                each(NearRow { samples, along, beside: beside as f32 });
            }
        }
    }
}

impl BrickFeet {
    /// Asks all patches within `reach` of the samples of the brick whose first sample stands there.
    ///
    /// # Errors
    /// What reading the surface gives.
    pub fn new(surface: &Surface, first: [f64; 3], step: f64, reach: f64) -> Result<BrickFeet> {
        let (within, squares) = (vec![reach as f32; POINTS], vec![f64::INFINITY; POINTS]);
        let mut feet = BrickFeet { first, step, reach, within, squares, sides: vec![None; POINTS] };
        let pieces = surface.pieces_in(feet.block());
        for &leaf in &pieces {
            feet.bound(&surface.piece(leaf));
        }
        for &leaf in &pieces {
            feet.visit(&surface.piece(leaf));
        }
        feet.ask_again(surface)?;
        Ok(feet)
    }

    /// Asks from samples by themselves whose bound no patch confirmed: of patches that are bent much the nearest point may be
    /// missed.
    fn ask_again(&mut self, surface: &Surface) -> Result<()> {
        for sample in 0..self.squares.len() {
            if self.squares[sample] == f64::INFINITY
                && f64::from(self.within[sample]) < self.reach - 0.01
                && let Some(foot) = surface.closest(self.place(sample), self.reach)
            {
                self.squares[sample] = foot.distance * foot.distance;
                self.sides[sample] = Some(foot.inside);
            }
        }
        Ok(())
    }

    /// Where a sample stands, in cells.
    pub fn place(&self, sample: usize) -> [f64; 3] {
        let ijk = point_position(sample);
        std::array::from_fn(|a| self.first[a] + self.step * ijk[a] as f64)
    }

    /// Whether a sample is inside, as [`Surface::closest`] says too, where the distance is known; `None` where nearest points of
    /// several patches differ in that.
    pub fn side(&self, sample: usize) -> Option<bool> {
        self.sides[sample]
    }

    /// Takes a point of a patch, if it is nearer to a sample than those before or as near.
    fn take(&mut self, sample: usize, touch: &Touch, from: [f64; 3]) {
        let before = self.squares[sample];
        if touch.squared > before * (1.0 + TIE) {
            return;
        }
        let side = Some(dot(minus(from, touch.at), touch.normal) < 0.0);
        if touch.squared * (1.0 + TIE) < before {
            self.sides[sample] = side;
        } else if self.sides[sample] != side {
            self.sides[sample] = None;
        }
        if touch.squared < before {
            self.squares[sample] = touch.squared;
            let distance = touch.squared.max(0.0).sqrt() as f32 + ROUNDED;
            self.within[sample] = self.within[sample].min(distance);
        }
    }

    /// The distance of a sample, if it is at most the reach.
    pub fn distance(&self, sample: usize) -> Option<f64> {
        let distance = self.squares[sample].max(0.0).sqrt();
        (distance <= self.reach).then_some(distance)
    }

    /// What may hold patches that count.
    fn block(&self) -> Block {
        let size = self.step * (ROW - 1) as f64;
        block_of([0.0, 1.0].map(|end| self.first.map(|c| c + end * size)).into_iter(), self.reach)
    }

    /// Bounds distances by the crossings of a piece.
    fn bound(&mut self, piece: &Piece) {
        let base: [f64; 3] = std::array::from_fn(|a| piece.base[a] - self.first[a]);
        let step = self.step as f32;
        for patch in piece.patches {
            let at = std::array::from_fn(|a| f64::from(patch.at[a]) + base[a]);
            // Polygons that no cell resolves may leave their crossing outside.
            let touch = patch.nearest(piece.rings, patch.at.map(f64::from), f64::INFINITY);
            let off = touch.map_or(f32::INFINITY, |touch| touch.squared.sqrt() as f32) + ROUNDED;
            rows((self.step, self.reach), at, |row| {
                let mut along = row.along;
                for within in &mut self.within[row.samples] {
                    let distance = (along * along + row.beside).sqrt() + off;
                    *within = if distance < *within { distance } else { *within };
                    along += step;
                }
            });
        }
    }

    /// Asks the patches of a piece from the samples that they may be nearest to.
    fn visit(&mut self, piece: &Piece) {
        let base: [f64; 3] = std::array::from_fn(|a| piece.base[a] - self.first[a]);
        let step = self.step;
        for patch in piece.patches {
            let at = std::array::from_fn(|a| f64::from(patch.at[a]) + base[a]);
            let radius = patch.radius + ROUNDED;
            let frame = (self.step, self.reach + f64::from(radius));
            rows(frame, at, |row| {
                let mut along = row.along;
                for sample in row.samples {
                    let within = self.within[sample];
                    let reach = within + radius;
                    let square = along * along + row.beside;
                    along += step as f32;
                    if square > reach * reach {
                        continue;
                    }
                    let ijk = point_position(sample);
                    let from = std::array::from_fn(|a| ijk[a] as f64 * step - base[a]);
                    let most = f64::from(within);
                    if let Some(touch) = patch.nearest(piece.rings, from, most * most) {
                        self.take(sample, &touch, from);
                    }
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::tests::{boxed, surface, tree};
    use crate::lattice::minus;

    #[test]
    fn distances_are_those_of_a_search_of_all_patches() {
        // A turned box with waves of a few cells, which leave patches rough.
        let within = boxed([14.0, 11.0, 9.0]);
        let wave = |p: [f64; 3]| p.map(|c| (1.9 * c).sin()).iter().product::<f64>();
        let shape = move |p: [f64; 3]| within(p) + 0.9 * wave(p);
        let surface = surface(&tree(&shape));
        for (first, step, reach) in
            [([0.0; 3], 1.0, 3.1), ([32.0, 0.0, 32.0], 1.0, 5.0), ([0.0; 3], 2.0, 6.1)]
        {
            let feet = BrickFeet::new(&surface, first, step, reach).unwrap();
            let mut near = 0;
            for sample in (0..POINTS).step_by(61) {
                let ijk = point_position(sample);
                let at: [f64; 3] = std::array::from_fn(|a| first[a] + step * ijk[a] as f64);
                let mut least = f64::INFINITY;
                for leaf in 0..surface.leaves().len() {
                    let piece = surface.piece(leaf);
                    let from = minus(at, piece.base);
                    for patch in piece.patches {
                        let touch = patch.nearest(piece.rings, from, f64::INFINITY);
                        least = least.min(touch.map_or(f64::INFINITY, |touch| touch.squared));
                    }
                }
                let (least, found) = (least.max(0.0).sqrt(), feet.distance(sample));
                let closest = surface.closest(at, f64::INFINITY).unwrap().distance;
                assert!(
                    (closest - least).abs() < 1e-5 * least.max(1.0),
                    "{ijk:?}: {closest} instead of {least}"
                );
                if least <= reach {
                    assert!((found.unwrap() - least).abs() < 1e-9, "{ijk:?}: {found:?} instead of {least}");
                    near += 1;
                } else {
                    assert_eq!(found, None);
                }
            }
            assert!(near > 50, "{near}");
        }
    }
}
