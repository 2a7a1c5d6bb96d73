//! Where the sum over all dipoles passes 0.5 on the edges of a brick's lattice.
//!
//! Between samples that are about as far apart as points, w rises within a cell, and no curve through the samples tells
//! where it passes 0.5. So the sum itself is asked: some steps of Newton's from the straight line between the samples. An
//! edge belongs to the cell of the sample that this line's root is nearer to, so that all bricks find the same.

use super::super::open::ClusterTree;
use super::cells::{CloudCell, CloudCells};
use super::dipole::Dipole;
use super::near::{LANES, NearPoints, SampleRegion, SampleWays};
use crate::brick::{Hermite, HermiteEdge, OctNormal, Ranks, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};

/// Samples along a row.
const P: usize = BRICK_POINTS;

/// Steps at most. Where samples are at most as far apart as points, two are nearly always enough.
const STEPS_MAX: usize = 8;
/// From what the sum is here off 0.5 the next step is the last one.
const NEAR_ROOT: f64 = 1e-3;

/// A lattice edge on which the sum passes 0.5, and the part of it where it does.
#[derive(Clone, Copy)]
struct RootEdge {
    axis: Axis,
    /// Its lower sample.
    lower: [usize; 3],
    /// Shares of the way from there between which the root lies.
    range: [f64; 2],
    /// What the sum is there above 0.5. One is negative, and the other is not.
    values: [f64; 2],
    /// The next place to ask, or where the root is.
    at: f64,
    is_found: bool,
    /// How fast the sum grows at the last place asked.
    slope: [f64; 3],
}

/// The Hermite edges of a brick with these samples.
pub(super) fn hermite_of(
    (cells, tree): (&CloudCells, &ClusterTree<Dipole>),
    key: NodeKey,
    samples: &Samples,
    near: &mut NearPoints,
) -> Hermite {
    let signs = SignChanges::of(samples);
    let counts = signs.counts();
    if counts == [0; 3] {
        return Hermite::default();
    }
    let none = HermiteEdge { offset: 0, normal: OctNormal::from_integer([0; 3]) };
    let mut hermite = Hermite { edges: counts.map(|count| vec![none; count]) };
    let ranks: [Box<Ranks>; 3] = Axis::ALL.map(|axis| signs.ranks(axis));
    let mut edges = Vec::new();
    cells.for_cells(tree, key, &mut |cell, region, ways| {
        edges.clear();
        Axis::ALL.into_iter().for_each(|axis| collect(axis, region, &signs, samples, &mut edges));
        if edges.is_empty() {
            return;
        }
        cell.gather(tree, cells.spacing, near);
        for some in edges.chunks_mut(LANES) {
            let spacing = f64::from(1u32 << key.spacing_bits());
            for _ in 0..STEPS_MAX {
                if some.iter().all(|edge| edge.is_found) {
                    break;
                }
                approach(some, (cell, near), ways, spacing);
            }
            for edge in some {
                let rank = signs.rank(edge.axis, edge.lower, &ranks[edge.axis.index()]);
                hermite.edges[edge.axis.index()][rank] = edge.crossing();
            }
        }
    });
    hermite
}

/// The edges along an axis whose straight roots are nearest to samples of a region.
fn collect(
    axis: Axis,
    region: &SampleRegion,
    signs: &SignChanges,
    samples: &Samples,
    edges: &mut Vec<RootEdge>,
) {
    // Of those that end at the region's first samples, too.
    let first = |a: usize| region.from[a].saturating_sub(usize::from(a == axis.index()));
    let columns = (1u64 << region.to[0]) - (1u64 << first(0));
    for k in first(2)..region.to[2] {
        for j in first(1)..region.to[1] {
            let mut bits = signs.edges(axis, j, k) & columns;
            while bits != 0 {
                let lower = [bits.trailing_zeros() as usize, j, k];
                bits &= bits - 1;
                let edge = RootEdge::new(axis, lower, samples);
                if region.holds(edge.nearest()) {
                    edges.push(edge);
                }
            }
        }
    }
}

/// Asks the sum where the roots of some edges are thought to be.
fn approach(
    edges: &mut [RootEdge],
    (cell, near): (&CloudCell, &NearPoints),
    ways: &SampleWays,
    spacing: f64,
) {
    let mut at = [[0.0; LANES]; 3];
    for (lane, edge) in edges.iter().enumerate() {
        for axis in 0..3 {
            let along = if axis == edge.axis.index() { edge.at * spacing } else { 0.0 };
            at[axis][lane] = ways[axis][edge.lower[axis]] + along;
        }
    }
    let (sums, slopes) = near.with_slopes(&at);
    for (lane, edge) in edges.iter_mut().enumerate().filter(|(_, edge)| !edge.is_found) {
        let (far, slope) = cell.local.with_slope([0, 1, 2].map(|a| at[a][lane]));
        edge.slope = [0, 1, 2].map(|a| slope[a] + slopes[a][lane]);
        edge.narrow(far + sums[lane] - 0.5, edge.slope[edge.axis.index()] * spacing);
    }
}

impl RootEdge {
    fn new(axis: Axis, lower: [usize; 3], samples: &Samples) -> RootEdge {
        let index = (lower[2] * P + lower[1]) * P + lower[0];
        let upper = index + [1, P, P * P][axis.index()];
        let quantum = 1.0 / f64::from(1u32 << samples.1);
        let values = [index, upper].map(|i| f64::from(samples.0[i]) * quantum - 0.5);
        let mut edge =
            RootEdge { axis, lower, range: [0.0, 1.0], values, at: 0.0, is_found: false, slope: [0.0; 3] };
        edge.at = edge.straight_root();
        edge
    }

    /// The sample that the place to ask is nearest to.
    fn nearest(&self) -> [usize; 3] {
        let mut sample = self.lower;
        sample[self.axis.index()] += usize::from(self.at >= 0.5);
        sample
    }

    fn straight_root(&self) -> f64 {
        let ([low, high], [from, to]) = (self.range, self.values);
        low + (high - low) * (from / (from - to))
    }

    /// Takes in the sum above 0.5 at the place asked, and how fast it grows along the edge.
    fn narrow(&mut self, value: f64, growth: f64) {
        let end = usize::from((value < 0.0) != (self.values[0] < 0.0));
        (self.range[end], self.values[end]) = (self.at, value);
        let newton = self.at - value / growth;
        let is_sound = self.range[0] <= newton && newton <= self.range[1];
        self.at = if is_sound { newton } else { self.straight_root() };
        self.is_found = is_sound && value.abs() <= NEAR_ROOT;
    }

    fn crossing(&self) -> HermiteEdge {
        let largest = self.slope.iter().fold(0.0f64, |most, c| most.max(c.abs()));
        let normal = if largest > 0.0 {
            self.slope.map(|c| (-c / largest * f64::from(1u32 << 30)) as i64)
        } else {
            let mut normal = [0; 3];
            normal[self.axis.index()] = if self.values[0] < 0.0 { -1 } else { 1 };
            normal
        };
        let offset = (self.at.clamp(0.0, 1.0) * 65536.0).min(65535.0) as u16;
        HermiteEdge { offset, normal: OctNormal::from_integer(normal) }
    }
}
