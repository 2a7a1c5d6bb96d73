//! Cells that suit beads: small enough for the least of them, and never in step with the layers.
//!
//! If layers are a whole number of cells apart, all of them are sampled at the same heights, and sums over samples err
//! in every layer alike: at one sample a layer of 0.2 mm, unions by 5 %.
//!
//! Two numbers are in step if their ratio is near a fraction p/q with a small p: then each layer is met at one of p
//! heights only. A ratio of n + 0.618, the golden section, is as far from all fractions as can be, so heights spread
//! evenly (Weyl 1916; Niederreiter 1992, §3.1).

use crate::lattice::{MAX_LEVEL, RootCube};
use crate::toolpath::Toolpath;
use std::f64::consts::FRAC_PI_4;

/// Largest default cell against the least height and width of beads.
const CELL_OF_LEAST: f64 = 0.4;
/// A larger cell against the least height or width loses overlaps and gaps.
pub(super) const COARSE_OF_LEAST: f64 = 0.5;
/// Part of the deposited volume that may be lower or narrower than what counts as the least: outliers, and ironing, whose
/// long lines hold next to nothing.
const OUTLIERS: f64 = 0.01;
/// The part of the ratio that stays: (√5 − 1)/2.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Fractions with a larger p meet each bead at so many heights that it makes no difference.
const HEIGHTS_MAX: u32 = 6;
/// With fewer layers than this nothing spreads.
const LAYERS_MIN: f64 = 8.0;
/// Steps by which a root cube is grown until it is no more in step, against its edge.
const GROWTH: f64 = 1.0 / 1024.0;

/// Sizes of beads, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BeadSizes {
    /// Least height: that of which 1 % of the deposited volume is lower.
    pub height: f64,
    /// Least width, likewise.
    pub width: f64,
    /// The height of most of the volume: how far layers are apart.
    pub layer: f64,
}

impl BeadSizes {
    /// Of all beads; `None` if nothing is deposited.
    pub fn of(paths: &[&Toolpath]) -> Option<BeadSizes> {
        let (mut heights, mut widths) = (Vec::new(), Vec::new());
        for path in paths {
            for bead in 0..path.len() {
                for (number, ends) in path.points(bead).windows(2).enumerate() {
                    let length = (0..3).map(|a| (ends[1][a] - ends[0][a]).powi(2)).sum::<f64>().sqrt();
                    let section = path.section(bead, number);
                    // About: what matters is which sizes hold little.
                    let volume = length * section.height * section.width;
                    add(&mut heights, section.height, volume);
                    add(&mut widths, section.width, volume);
                }
            }
        }
        // In an order that the files' does not change where volumes are equal.
        heights.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        widths.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        Some(BeadSizes { height: least(&heights)?, width: least(&widths)?, layer: usual(&heights)? })
    }

    /// The lesser of height and width, with its name.
    pub fn least(&self) -> (f64, &'static str) {
        if self.width < self.height { (self.width, "width") } else { (self.height, "height") }
    }

    /// The default cell: at most 0.4 of the least height and width, and the layers n + 0.618 of it apart.
    pub fn cell(&self) -> f64 {
        let most = CELL_OF_LEAST * self.least().0;
        let whole = (self.layer / most - GOLDEN).ceil().max(0.0);
        self.layer / (whole + GOLDEN)
    }
}

/// Adds a volume with a size; runs of the same size are one.
fn add(sizes: &mut Vec<(f64, f64)>, size: f64, volume: f64) {
    match sizes.last_mut() {
        Some((last, sum)) if *last == size => *sum += volume,
        _ if size > 0.0 && volume > 0.0 => sizes.push((size, volume)),
        _ => {}
    }
}

/// The size of which [`OUTLIERS`] of the volume are smaller, sizes being sorted.
fn least(sizes: &[(f64, f64)]) -> Option<f64> {
    let outliers = OUTLIERS * sizes.iter().map(|(_, volume)| volume).sum::<f64>();
    let mut sum = 0.0;
    let found = sizes.iter().find(|(_, volume)| {
        sum += volume;
        sum >= outliers
    });
    found.map(|(size, _)| *size)
}

/// The size, to a micrometre, that most of the volume has.
fn usual(sizes: &[(f64, f64)]) -> Option<f64> {
    let step = |size: f64| (size * 1000.0).round();
    let runs = sizes.chunk_by(|a, b| step(a.0) == step(b.0));
    let sums = runs.map(|run| (run[0].0, run.iter().map(|(_, volume)| volume).sum::<f64>()));
    sums.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(size, _)| size)
}

/// Numerator of the fraction p/q, 1 to [`HEIGHTS_MAX`] over as much, with which layers and cells keep step throughout
/// the part: of each p + 1 planes through q layers the last meets what the first met, and over all layers they drift
/// by less than the distance of two such heights.
///
/// `None` if they do not, or there are too few layers to tell.
fn in_step(layer: f64, cell: f64, extent: f64) -> Option<u32> {
    let (layers, ratio) = (extent / layer, layer / cell);
    if layers < LAYERS_MIN {
        return None;
    }
    let keeps_step = |p: u32, q: u32| {
        let (p, q) = (f64::from(p), f64::from(q));
        q * layers * (ratio - p / q).abs() < 1.0
    };
    (1..=HEIGHTS_MAX).find(|&p| (1..=HEIGHTS_MAX).any(|q| keeps_step(p, q)))
}

/// The cube and level for cells of exactly `cell`. If these keep step with the layers, the cube is moved along z so that
/// planes of samples meet the beads at heights at which those with round sides have their mean width.
pub(super) fn with_cell(
    (min, max): ([f64; 3], [f64; 3]),
    cell: f64,
    sizes: &BeadSizes,
) -> Option<(RootCube, u8)> {
    let (root, level) = RootCube::with_cell(min, max, cell)?;
    let Some(planes) = in_step(sizes.layer, cell, max[2] - min[2]) else { return Some((root, level)) };
    let margin = (root.edge - (max[2] - min[2])) / 2.0;
    if margin < 2.0 * cell {
        return Some((root, level));
    }
    // The first plane of samples within the part, against the bottom of the layers.
    let wanted = best_height(planes) * sizes.layer;
    let first = root.to_world([1.0; 3])[2];
    let shift = (min[2] + wanted - first).rem_euclid(cell);
    let mut moved = root;
    moved.origin[2] += if shift > cell / 2.0 { shift - cell } else { shift };
    Some((moved, level))
}

/// The height of the lowest of `planes` planes through a layer of height 1, evenly apart, on which beads with round sides
/// are in the mean as wide as over all heights.
fn best_height(planes: u32) -> f64 {
    let spacing = 1.0 / f64::from(planes);
    let mean = |lowest: f64| {
        let half = |n: u32| 2.0 * (lowest + f64::from(n) * spacing) - 1.0;
        (0..planes).map(|n| (1.0 - half(n).powi(2)).max(0.0).sqrt()).sum::<f64>() * spacing
    };
    // From the bottom, where one plane meets next to nothing, to the most that there is: half a spacing up.
    let (mut low, mut high) = (0.0, spacing / 2.0);
    for _ in 0..50 {
        let middle = (low + high) / 2.0;
        if mean(middle) < FRAC_PI_4 { low = middle } else { high = middle }
    }
    low
}

/// The cube around a part for a depth, grown by as little as is needed for its cells not to keep step with the layers.
pub(super) fn with_depth(
    (min, max): ([f64; 3], [f64; 3]),
    depth: u8,
    sizes: &BeadSizes,
) -> Option<(RootCube, u8)> {
    let root = RootCube::around(min, max)?;
    if depth > MAX_LEVEL {
        return Some((root, depth));
    }
    let cells = root.edge / root.spacing(depth);
    let grown = |step: u32| root.spacing(depth) * (1.0 + f64::from(step) * GROWTH);
    let step = (0..64).find(|&step| in_step(sizes.layer, grown(step), max[2] - min[2]).is_none());
    match step {
        None | Some(0) => Some((root, depth)),
        Some(step) => {
            let edge = grown(step) * cells;
            let origin = std::array::from_fn(|a| (min[a] + max[a] - edge) / 2.0);
            Some((RootCube { origin, edge }, depth))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::{Attributes, BeadView, Section};

    fn wall(beads: &[(f64, f64, f64)]) -> Toolpath {
        let mut path = Toolpath::default();
        for &(width, height, length) in beads {
            let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 1), fed: None };
            let points = [[0.0; 3], [length, 0.0, 0.0]];
            path.push(BeadView {
                points: &points,
                axes: &[],
                sections: &[Section { width, height }],
                lines: &[],
                attributes,
            });
        }
        path
    }

    #[test]
    fn rare_outliers_do_not_decide_the_cell() {
        let path = wall(&[(0.45, 0.2, 100.0), (0.02, 0.01, 0.5), (0.5, 0.3, 20.0)]);
        let sizes = BeadSizes::of(&[&path]).unwrap();
        assert_eq!((sizes.height, sizes.width, sizes.layer), (0.2, 0.45, 0.2));
        assert_eq!(BeadSizes::of(&[&path, &wall(&[(0.1, 0.2, 10.0)])]).unwrap().width, 0.1);
        // Ironing: a fifth of the length, and a hundredth of a layer high.
        let sizes = BeadSizes::of(&[&path, &wall(&[(0.45, 0.002, 30.0)])]).unwrap();
        assert_eq!((sizes.height, sizes.layer), (0.2, 0.2));
        assert_eq!(BeadSizes::of(&[]), None);
    }

    #[test]
    fn default_cells_are_small_enough_and_out_of_step() {
        for (height, width) in [(0.2, 0.45), (0.1, 0.1), (0.3, 0.2), (2.5, 6.0), (1.0, 0.05)] {
            let sizes = BeadSizes { height, width, layer: height };
            let cell = sizes.cell();
            assert!(
                cell <= 0.4 * height.min(width) * (1.0 + 1e-12) && cell > 0.2 * height.min(width),
                "{cell}"
            );
            assert_eq!(in_step(height, cell, 1000.0 * height), None);
        }
    }

    #[test]
    fn steps_are_found_as_they_are() {
        for (cell, planes) in [
            (0.2, Some(1)),
            (0.1, Some(2)),
            (0.4, Some(1)),
            (0.3, Some(2)),
            (0.19, None),
            (0.21, None),
            (0.0764, None),
        ] {
            assert_eq!(in_step(0.2, cell, 100.0), planes, "{cell}");
        }
        // Of a few layers none keeps step with anything.
        assert_eq!(in_step(0.2, 0.2, 1.0), None);
    }

    #[test]
    fn a_cell_in_step_moves_the_cube_and_keeps_the_cell() {
        let bounds = ([0.0; 3], [20.0, 20.0, 10.0]);
        let sizes = BeadSizes { height: 0.2, width: 0.45, layer: 0.2 };
        for (cell, planes) in [(0.2, 1), (0.1, 2), (0.05, 4)] {
            let (root, level) = with_cell(bounds, cell, &sizes).unwrap();
            assert_eq!(root.spacing(level), cell);
            let first = root.to_world([1.0; 3])[2] / cell;
            let heights: Vec<f64> =
                (0..planes).map(|n| ((first + f64::from(n)) * cell / 0.2).rem_euclid(1.0)).collect();
            let mean: f64 = heights.iter().map(|h| (1.0 - (2.0 * h - 1.0).powi(2)).sqrt()).sum::<f64>();
            assert!((mean / f64::from(planes) - FRAC_PI_4).abs() < 1e-3, "{cell}: {heights:?}");
        }
        let free = with_cell(bounds, 0.19, &sizes).unwrap();
        assert_eq!(free, RootCube::with_cell(bounds.0, bounds.1, 0.19).unwrap());
    }

    #[test]
    fn a_depth_in_step_grows_the_cube() {
        // 0.2 mm is 2^-7 of the edge of 25.6 mm.
        let side = 25.6 * 31.0 / 32.0;
        let bounds = ([0.0; 3], [side, 10.0, 20.0]);
        let sizes = BeadSizes { height: 0.2, width: 0.45, layer: 0.2 };
        let around = RootCube::around(bounds.0, bounds.1).unwrap();
        let (grown, depth) = with_depth(bounds, 2, &sizes).unwrap();
        assert!(grown.edge > around.edge && grown.edge < 1.07 * around.edge && depth == 2);
        assert_eq!(in_step(0.2, grown.spacing(2), 20.0), None);
        let other = BeadSizes { layer: 0.2 * 1.3, ..sizes };
        assert_eq!(with_depth(bounds, 2, &other).unwrap().0, around);
    }
}
