//! Winding numbers of open soups at arbitrary points.

use super::super::points::crossings_at;
use super::cells::{BoundedTree, CellCache, CellPoints, PointSpacing, TOP_BITS};
use super::{ClusterTree, OpenPart, SurfaceElement};
use crate::error::Result;
use crate::lattice::{ROOT_BITS, RootCube, Units};
use crate::progress::Progress;
use crate::soup::Facets;
use rayon::prelude::*;

/// Points of a cell, on average: what is far from a cell is summed once for all of them.
const POINTS_A_CELL: usize = 64;
/// Levels of cells below the root, at least: few points have cells of their own.
const LEVELS_MIN: u32 = 4;
/// Farther out than this, in units, points have no lattice position.
const FAR: f64 = (1u64 << (TOP_BITS - 1)) as f64;
/// A million of the root's edges away the soup covers less than 1e-12 of the view; farther out f64 overflows.
const NOWHERE: f64 = FAR / 64.0 * 1e6;

/// The winding number of an open soup at each point, with an error of at most `error`. Input and points are
/// snapped as [`super::super::winding_at`] does; points outside the root too. The input is streamed once;
/// memory goes with the number of points and that of the caps.
///
/// # Errors
/// If the user interrupts.
pub fn open_winding_at(
    sources: &[&dyn Facets],
    root: RootCube,
    open: &OpenPart,
    points: &[[f64; 3]],
    error: f64,
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    let counts = crossings_at(sources, &open.caps, root, points, progress)?;
    let shares = shares_at(root, &open.tree, points, error, progress)?;
    Ok(counts.iter().zip(shares).map(|(&count, share)| count as f64 - share).collect())
}

/// The sum over a tree's elements at each point, off by at most `error`. Points are snapped.
pub(in crate::winding) fn shares_at<E: SurfaceElement>(
    root: RootCube,
    tree: &ClusterTree<E>,
    points: &[[f64; 3]],
    error: f64,
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    let mut shares = vec![0.0; points.len()];
    let mut near: Vec<(Units, Units, usize)> = Vec::new();
    let shift = cell_bits(points.len());
    for (number, p) in points.iter().enumerate() {
        let units = root.to_units(*p);
        if units.iter().all(|c| c.abs() < FAR) {
            // As in `Columns`: truncation is the floor there, and here the cell is found from the result.
            let p = units.map(|c| c.floor() as i32 | 1);
            near.push((p.map(|c| c >> shift), p, number));
        } else if units.iter().all(|c| c.abs() < NOWHERE) {
            shares[number] = tree.far_at(units);
        }
    }
    near.par_sort_unstable();
    let cells: Vec<&[(Units, Units, usize)]> = near.chunk_by(|a, b| a.0 == b.0).collect();
    let answered = |(cache, points): &mut (CellCache, CellPoints), cell: &&[(Units, Units, usize)]| {
        if progress.cancelled() {
            return Vec::new();
        }
        points.positions.clear();
        points.positions.extend(cell.iter().map(|(_, p, _)| *p));
        BoundedTree::new(tree, error).answer(cache, shift, PointSpacing::Anywhere, points);
        cell.iter().map(|(.., number)| *number).zip(points.values.iter().copied()).collect()
    };
    let found: Vec<Vec<(usize, f64)>> = cells.par_iter().map_init(Default::default, answered).collect();
    progress.check()?;
    found.into_iter().flatten().for_each(|(number, share)| shares[number] = share);
    Ok(shares)
}

/// log₂ of the edge of the cells in which so many points share a choice.
fn cell_bits(points: usize) -> u32 {
    let cells = (points / POINTS_A_CELL).max(1);
    ROOT_BITS - (cells.ilog2() / 3).clamp(LEVELS_MIN, 8)
}
