//! Winding numbers of point clouds: a dipole a point, with the area that its neighbours leave it.

mod area;
mod brick;
mod cells;
#[cfg(test)]
mod cells_tests;
mod dipole;
mod far;
mod forest;
mod near;
mod nearest;
mod normals;
mod roots;
mod surfels;
#[cfg(test)]
mod tests;

use super::open::{ClusterTree, shares_at};
use crate::error::Result;
use crate::large_array::LargeArray;
use crate::lattice::RootCube;
use crate::progress::Progress;
use dipole::Dipole;
use rayon::prelude::*;

pub use brick::{CloudBrick, CloudBricks, CloudEvaluator, CloudPiece};
pub use nearest::{KdTree, Located, Neighbour, by_place, median_distance};
pub use normals::{estimate_normals, plane_normal, with_estimated_normals};
pub use surfels::{Surfel, Surfels};

fn dipoles_of(surfels: &Surfels, root: RootCube) -> Result<LargeArray<Dipole>> {
    let all = &surfels.all;
    LargeArray::of_each(all.len(), all.room(), |number| Some(Dipole::new(&all[number], root)))
}

/// The field of an oriented point cloud (Barill et al. 2018): w = Σ a·(x − p)/(4π|x − p|³) over its points x. Each is
/// spread over a ball that reaches about as far as its neighbours, within which there is no pole (the formula stands
/// in `dipole.rs`).
#[derive(Debug)]
pub struct CloudField {
    tree: ClusterTree<Dipole>,
}

impl CloudField {
    /// Of surfels, snapped to the lattice of `root`.
    ///
    /// # Errors
    /// If the temporary file for what memory has no room for cannot be written.
    pub fn new(surfels: &Surfels, root: RootCube) -> Result<CloudField> {
        Ok(CloudField { tree: ClusterTree::of(dipoles_of(surfels, root)?)? })
    }

    /// As [`CloudField::new`], of surfels that nobody else needs.
    pub(super) fn of_all(surfels: Surfels, root: RootCube) -> Result<CloudField> {
        let dipoles = dipoles_of(&surfels, root)?;
        drop(surfels);
        Ok(CloudField { tree: ClusterTree::of(dipoles)? })
    }

    /// The winding number at each point, off from the sum over all dipoles by at most `error`. Points are
    /// snapped as [`super::winding_at`] does.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn winding_at(
        &self,
        root: RootCube,
        points: &[[f64; 3]],
        error: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>> {
        shares_at(root, &self.tree, points, error, progress)
    }

    /// The sum over all dipoles at each point: what [`CloudField::winding_at`] approaches.
    pub fn brute_at(&self, root: RootCube, points: &[[f64; 3]]) -> Vec<f64> {
        let at = |p: &[f64; 3]| {
            let units = root.to_units(*p);
            let near = units.iter().all(|c| c.abs() < f64::from(1 << 30));
            let snapped = units.map(|c| if near { f64::from(c.floor() as i32 | 1) } else { c });
            self.tree.elements().iter().map(|d| d.seen_from(snapped)).sum()
        };
        points.par_iter().map(at).collect()
    }
}
