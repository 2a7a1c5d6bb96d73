//! What becomes of the voids of a part: whether the cut reaches them, what of the wall is left, and which move opens them.
//!
//! A void is judged by the crossings of its boundary against the formulas of the solids. A crossing is not the very point of
//! a round void that is nearest to the cut; the curvature between neighbouring crossings says how far that is.

use super::cut::Cut;
use crate::error::Result;
use crate::lattice::{RootCube, dot, minus};
use crate::progress::Progress;
use crate::store::{BrickTree, Store};
use crate::swept::SweptSolid;
use crate::voids::{BoundaryPoint, Void, VoidOptions, boundary_points, find};
use rayon::prelude::*;

/// What becomes of a void.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VoidState {
    /// The cut does not reach it.
    Untouched,
    /// The cut reaches it, and some of its wall remains.
    Opened,
    /// All of it lies within the cut.
    Consumed,
}

impl VoidState {
    /// As in tables.
    pub fn name(self) -> &'static str {
        match self {
            VoidState::Untouched => "untouched",
            VoidState::Opened => "opened",
            VoidState::Consumed => "consumed",
        }
    }
}

/// A void, and what becomes of it. Lengths in the store's unit.
#[derive(Clone, Debug)]
pub struct OpenedVoid {
    /// The void.
    pub void: Void,
    /// What becomes of it.
    pub state: VoidState,
    /// What is left between it and the cut, of voids that are not touched; `None` where there is no cut.
    pub ligament: Option<f64>,
    /// The first move that reaches it, in [`crate::milling::Program::moves`].
    pub first: Option<u32>,
}

/// Neighbours of a crossing, by which the curvature is told: within this many cells.
const NEIGHBOURS: f64 = 2.5;
/// Most that curvature may add, in cells.
const MOST_ADDED: f64 = 1.0;
/// Farthest that the extreme point may be from the nearest crossing, in cells.
const MOST_MOVED: f64 = 2.0;

/// The voids of a store, largest first, and what a cut does to each.
///
/// # Errors
/// What reading the store gives; [`crate::error::Error::Interrupted`].
pub fn opened(
    store: &Store,
    cut: &Cut,
    options: &VoidOptions<'_>,
    progress: &dyn Progress,
) -> Result<Vec<OpenedVoid>> {
    let found = find(store, options, progress)?;
    let points = boundary_points(store, &found, progress)?;
    let (root, cell) = (store.root(), f64::from(1u32 << crate::lattice::spacing_bits(store.meta().depth)));
    let of_void = |(void, points): (&Void, &Vec<BoundaryPoint>)| {
        progress.check()?;
        Ok(Boundary::new(points, cell).judge(void, cut, root))
    };
    found.voids.par_iter().zip(&points).map(of_void).collect()
}

/// The boundary of a void.
struct Boundary<'a> {
    points: &'a [BoundaryPoint],
    cell: f64,
    bounds: [[f64; 3]; 2],
}

impl<'a> Boundary<'a> {
    fn new(points: &'a [BoundaryPoint], cell: f64) -> Boundary<'a> {
        let mut bounds: [[f64; 3]; 2] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for point in points {
            let [low, high] = bounds;
            bounds =
                [[0, 1, 2].map(|a| low[a].min(point.at[a])), [0, 1, 2].map(|a| high[a].max(point.at[a]))];
        }
        Boundary { points, cell, bounds }
    }

    fn judge(&self, void: &Void, cut: &Cut, root: RootCube) -> OpenedVoid {
        let mut order: Vec<(f64, usize)> =
            cut.solids.iter().enumerate().map(|(n, solid)| (self.apart(solid), n)).collect();
        // In the order of the program those that may reach it, to find the first.
        let near: Vec<usize> =
            order.iter().filter(|(apart, _)| *apart <= MOST_ADDED * self.cell).map(|(_, n)| *n).collect();
        let first = near.iter().find(|&&n| self.nearest(&cut.solids[n]) < 0.0).copied();
        let mut least = f64::INFINITY;
        if first.is_none() {
            order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (apart, n) in order {
                // A curved void may reach beyond its crossings.
                if apart - MOST_ADDED * self.cell > least {
                    break;
                }
                least = least.min(self.nearest(&cut.solids[n]));
            }
        }
        let solids: Vec<&SweptSolid> = near.iter().map(|&n| &cut.solids[n]).collect();
        let state = match first {
            None => VoidState::Untouched,
            Some(_) if self.farthest(&solids) < 0.0 => VoidState::Consumed,
            Some(_) => VoidState::Opened,
        };
        OpenedVoid {
            void: void.clone(),
            state,
            ligament: (first.is_none() && least.is_finite()).then(|| least * root.unit()),
            first: first.map(|n| cut.moves[n]),
        }
    }

    /// At most how far the boxes of the void and of a solid are apart.
    fn apart(&self, solid: &SweptSolid) -> f64 {
        let [low, high] = solid.bounds();
        let off = [0, 1, 2].map(|a| (low[a] - self.bounds[1][a]).max(self.bounds[0][a] - high[a]).max(0.0));
        dot(off, off).sqrt()
    }

    /// The distance of the void to a solid; below 0 if they have something in common.
    fn nearest(&self, solid: &SweptSolid) -> f64 {
        let distance = |at: [f64; 3]| solid.distance(at);
        let Some((point, least)) = least_of(self.points, |point| distance(point.at)) else {
            return f64::INFINITY;
        };
        self.extreme(point, distance, -1.0).map_or(least, |at| distance(at).min(least))
    }

    /// How far the farthest point of the void is from all solids; below 0 if all of it lies within them.
    fn farthest(&self, solids: &[&SweptSolid]) -> f64 {
        let distance =
            |at: [f64; 3]| solids.iter().map(|solid| solid.distance(at)).fold(f64::INFINITY, f64::min);
        let Some((point, most)) = least_of(self.points, |point| -distance(point.at)) else {
            return f64::INFINITY;
        };
        self.extreme(point, distance, 1.0).map_or(-most, |at| distance(at).max(-most))
    }

    /// The point of the void near a crossing that is farthest away from a solid (1), or nearest to it (-1): on the ball that
    /// has the curvature of the boundary there. `None` of a flat boundary.
    fn extreme(
        &self,
        point: &BoundaryPoint,
        distance: impl Fn([f64; 3]) -> f64,
        away: f64,
    ) -> Option<[f64; 3]> {
        let step = 1e-3 * self.cell;
        let slope = [0, 1, 2].map(|a| {
            let (mut low, mut high) = (point.at, point.at);
            low[a] -= step;
            high[a] += step;
            (distance(high) - distance(low)) * away
        });
        let size = dot(slope, slope).sqrt();
        let (mut bent, mut turned) = (0.0, 0.0);
        for other in self.points {
            let apart = minus(point.at, other.at);
            if dot(apart, apart) > (NEIGHBOURS * self.cell) * (NEIGHBOURS * self.cell) {
                continue;
            }
            // Normals point into the void, towards the middle of the ball.
            let turn = minus(other.normal, point.normal);
            bent += dot(apart, turn);
            turned += dot(turn, turn);
        }
        if size == 0.0 || turned < 1e-6 || bent <= 0.0 {
            return None;
        }
        let radius = bent / turned;
        // From the crossing to the middle, and from there in the direction of the slope.
        let moved = [0, 1, 2].map(|a| radius * (point.normal[a] + slope[a] / size));
        let far = dot(moved, moved).sqrt();
        let most = if far > MOST_MOVED * self.cell { MOST_MOVED * self.cell / far } else { 1.0 };
        Some([0, 1, 2].map(|a| point.at[a] + moved[a] * most))
    }
}

/// The point with the least value, the first of several.
fn least_of(
    points: &[BoundaryPoint],
    value: impl Fn(&BoundaryPoint) -> f64,
) -> Option<(&BoundaryPoint, f64)> {
    let mut best: Option<(&BoundaryPoint, f64)> = None;
    for point in points {
        let value = value(point);
        if best.is_none_or(|(_, least)| value < least) {
            best = Some((point, value));
        }
    }
    best
}
