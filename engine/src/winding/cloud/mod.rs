//! Winding numbers of point clouds: a dipole a point, with the area that its neighbours leave it.

mod area;
mod nearest;
mod normals;
#[cfg(test)]
mod tests;

use super::open::{ClusterTree, Element, GROUP, Moments, Reach, shares_at};
use crate::error::{Error, Result};
use crate::ingest::PointCloud;
use crate::lattice::{RootCube, Units};
use crate::progress::Progress;
use area::cell_area;
use nearest::KdTree;
use rayon::prelude::*;
use std::f64::consts::PI;

pub use normals::estimate_normals;

/// Neighbours that bound the area of a point: of scattered points a cell has six on average, and seldom more
/// than ten.
const NEIGHBOURS: usize = 12;

/// One oriented point, in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dipole {
    position: [f64; 3],
    /// Outward normal with the length of the area.
    area: [f64; 3],
}

/// The field of an oriented point cloud (Barill et al. 2018): w = Σ a·(x − p)/(4π|x − p|³).
#[derive(Debug)]
pub struct CloudField {
    tree: ClusterTree<Dipole>,
}

impl CloudField {
    /// Of a cloud with normals, snapped to the lattice of `root`. A point's area is that of its cell among
    /// its 12 nearest neighbours, seen along its normal; those that face the other way, as across a thin wall,
    /// do not bound it. Points that coincide count once; those with a normal of length 0 not at all.
    ///
    /// # Errors
    /// [`Error::Setting`] if a point lacks a normal; if the user interrupts.
    pub fn new(cloud: &PointCloud, root: RootCube, progress: &dyn Progress) -> Result<CloudField> {
        if cloud.normals.len() != cloud.points.len() {
            return Err(Error::setting("the points have no normals", "estimate them"));
        }
        let snapper = root.snapper();
        let mut snapped: Vec<(Units, usize)> =
            cloud.points.iter().enumerate().map(|(number, p)| (snapper(*p), number)).collect();
        snapped.par_sort_unstable();
        snapped.dedup_by_key(|(p, _)| *p);
        let positions: Vec<[f64; 3]> = snapped.iter().map(|(p, _)| p.map(f64::from)).collect();
        progress.phase("measuring", Some(positions.len() as u64), "points");
        let nearest = KdTree::new(&positions);
        let dipole = |(position, &(_, number)): (&[f64; 3], &(Units, usize))| {
            let normal = cloud.normals[number];
            let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
            if length == 0.0 {
                return None;
            }
            let normal = normal.map(|c| c / length);
            // The point itself is the first of them.
            let around = &nearest.around(*position, NEIGHBOURS + 1)[1..];
            let ways = around.iter().filter_map(|n| {
                let (q, other) = (positions[n.number as usize], cloud.normals[snapped[n.number as usize].1]);
                let alike = (0..3).map(|a| normal[a] * other[a]).sum::<f64>() > 0.0;
                alike.then(|| std::array::from_fn(|a| q[a] - position[a]))
            });
            let area = cell_area(normal, ways, around.last().map_or(0.0, |n| n.squared).sqrt());
            progress.advance(1);
            (area > 0.0).then(|| Dipole { position: *position, area: normal.map(|c| c * area) })
        };
        let dipoles: Vec<Dipole> = positions.par_iter().zip(&snapped).filter_map(dipole).collect();
        progress.check()?;
        Ok(CloudField { tree: ClusterTree::new(dipoles) })
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

impl Dipole {
    fn seen_from(&self, p: [f64; 3]) -> f64 {
        let r: [f64; 3] = std::array::from_fn(|a| self.position[a] - p[a]);
        let squared = r.iter().map(|c| c * c).sum::<f64>();
        let along: f64 = (0..3).map(|a| self.area[a] * r[a]).sum();
        along / (4.0 * PI * squared * squared.sqrt())
    }
}

impl Element for Dipole {
    fn position(&self) -> [f64; 3] {
        self.position
    }

    fn area(&self) -> f64 {
        self.area.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    fn reach(&self, center: [f64; 3]) -> Reach {
        let squared = (0..3).map(|a| (self.position[a] - center[a]).powi(2)).sum::<f64>();
        let farthest = squared.sqrt();
        let area = self.area();
        let third = area * squared * farthest;
        Reach { farthest, area, spread: farthest, powers: [third, third * farthest, third * squared] }
    }

    fn add_to(&self, center: [f64; 3], moments: &mut Moments) {
        let d: [f64; 3] = std::array::from_fn(|a| self.position[a] - center[a]);
        moments.add(self.area, d, |i, j| d[i] * d[j]);
    }

    fn share_at(&self, p: Units) -> f64 {
        self.seen_from(p.map(f64::from))
    }

    #[inline(always)]
    fn add_shares<'a>(
        elements: impl Iterator<Item = &'a Dipole>,
        at: &[[f64; GROUP]; 3],
        _: impl Fn(usize) -> Units,
        sums: &mut [f64; GROUP],
    ) {
        for dipole in elements {
            for (l, sum) in sums.iter_mut().enumerate() {
                *sum += dipole.seen_from([at[0][l], at[1][l], at[2][l]]);
            }
        }
    }
}
