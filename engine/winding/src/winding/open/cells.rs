//! The sum over a cluster tree at many points, cell by cell: what is far as a polynomial, what is near one by one.
//!
//! Cells are the cubes of an octree over the lattice. A cell takes over its parent's polynomial, adds the clusters
//! that have become far enough ([`CellExpansion`]), and hands the rest down to its children.
//!
//! This is the fast multipole method (Greengard & Rokhlin 1987), with the sum of all error bounds on the way as the
//! criterion in place of an opening angle. What is left in a cell when points in it are asked for is seen through the
//! clusters' own expansions, and through single elements where those are not exact enough.
//!
//! Everything depends on the tree, the error and the cell, and not on who asks: cells are kept with the tree for the
//! next time, whichever thread asks then.

use super::cell::{CellId, CellPlan, ExpansionSum, FarCell};
use super::high_moments::HIGH_DEGREE;
use super::local::{CELL_DEGREE, CellExpansion, local_bound};
use super::moments::{GROUP, Reach, SurfaceElement, error_bound};
use super::tree::{Cluster, ClusterTree};
use super::wide::{Simd, SimdBase, dispatch, each_of, f64x8, level, way};
use crate::lattice::{ROOT_BITS, Units, length};
use std::sync::Arc;

/// log₂ of the edge of the cell that holds every position answered.
pub(super) const TOP_BITS: u32 = ROOT_BITS + 7;
/// Lowest coordinate of that cell; the root's own cube is one of its descendants.
pub(super) const TOP_LOW: i64 = -(1 << (TOP_BITS - 1));
/// Share of the error that polynomials handed down may take. This and the next four constants were tuned on a million
/// facets less 3 % at 128³ samples; none matters by more than a fifth over a factor of 1.5 to either side.
const DOWN_SHARE: f64 = 0.3;
/// Share of what is left of it that one level may take.
const LEVEL_SHARE: f64 = 0.3;
/// Share of what is left then that the polynomial of a block of points may take: before blocks had one of their own,
/// three times as many clusters were left to be seen from each sample.
const OWN_SHARE: f64 = 0.6;
/// By how much the limit on single bounds is lowered while their sum is too large.
const LOWERED: f64 = 0.5;
/// Clusters that reach farther than this share of a cell's radius are divided rather than handed down.
const SIZE_MAX: f64 = 1.0;
/// Clusters that reach farther than this share of their distance are divided for a bound on what they add.
const NEAR_SIZE: f64 = 0.4;
/// Share of what is left of the error that the clusters near a smooth cell may take.
const SMOOTH_SHARE: f64 = 0.95;
/// Share of what is left of that which one of them may take.
const CLUSTER_SHARE: f64 = 0.25;
/// Clusters that a smooth cell takes at most.
const SMOOTH_CLUSTERS: usize = 256;
/// Near elements times samples above which a block of samples is divided: less is better for large errors, more for
/// small ones.
const WORK_MAX: usize = 200_000;

/// Where the points in a cell lie that are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PointSpacing {
    /// On the lattice of samples 2^spacing units apart, at most 8³ of them.
    Lattice(u32),
    /// At odd positions anywhere.
    Anywhere,
}

/// Some points of a cell and the sums there.
#[derive(Default)]
pub(super) struct CellPoints {
    /// Where they are.
    pub positions: Vec<Units>,
    /// The sums.
    pub values: Vec<f64>,
}

/// Points of a lattice in one cell with the same plan.
pub(super) struct PlannedPoints {
    /// Never [`CellPlan::Divide`].
    pub plan: Arc<CellPlan>,
    /// The cell's lowest point.
    pub low: Units,
    /// Points along its edge.
    pub steps: u32,
}

/// Working memory; one per thread.
#[derive(Default)]
pub struct CellCache {
    sorted: [CellPoints; 8],
}

/// A cluster tree with a bound on the error of its sums.
#[derive(Clone, Copy)]
pub(super) struct BoundedTree<'a, E> {
    tree: &'a ClusterTree<E>,
    error: f64,
}

/// What [`choose`] found.
struct Choice {
    /// Clusters whose bounds together are within the budget.
    taken: Vec<u32>,
    /// The sum of their bounds.
    spent: f64,
    /// Clusters that are left.
    left: Vec<u32>,
}

/// Takes as many of some clusters as a budget allows: those with a bound above a limit are divided, or left if `halves`
/// says so, and the limit is lowered until the bounds of all others add up to no more than the budget.
fn choose(
    clusters: &[u32],
    budget: f64,
    bound: impl Fn(u32) -> f64,
    halves: impl Fn(u32) -> Option<[u32; 2]>,
) -> Choice {
    let mut limit = budget;
    let mut found: Vec<(f64, u32)> = Vec::with_capacity(clusters.len());
    let (mut left, mut waiting) = (Vec::new(), clusters.to_vec());
    let divide = |cluster: u32, waiting: &mut Vec<u32>, left: &mut Vec<u32>| match halves(cluster) {
        Some(halves) => waiting.extend(halves),
        None => left.push(cluster),
    };
    loop {
        while let Some(cluster) = waiting.pop() {
            let bound = bound(cluster);
            if bound <= limit {
                found.push((bound, cluster));
            } else {
                divide(cluster, &mut waiting, &mut left);
            }
        }
        let spent: f64 = found.iter().map(|(bound, _)| bound).sum();
        if spent <= budget || found.is_empty() {
            let taken = found.into_iter().map(|(_, cluster)| cluster).collect();
            return Choice { taken, spent, left };
        }
        limit *= LOWERED;
        found.retain(|&(bound, cluster)| {
            let is_kept = bound <= limit;
            if !is_kept {
                divide(cluster, &mut waiting, &mut left);
            }
            is_kept
        });
    }
}

impl<'a, E: SurfaceElement> BoundedTree<'a, E> {
    /// With sums that are off by at most `error`.
    pub fn new(tree: &'a ClusterTree<E>, error: f64) -> BoundedTree<'a, E> {
        // Rounding takes far less than the rest.
        BoundedTree { tree, error: error * (1.0 - 1e-6) }
    }

    /// The tree.
    pub fn tree(&self) -> &'a ClusterTree<E> {
        self.tree
    }

    /// A bound on the absolute value of the sum anywhere in a cell; any number above `limit` if it is not within that.
    pub fn magnitude(&self, id: CellId, limit: f64) -> f64 {
        let cell = self.cell(id);
        let (low, high, _) = extent(id, PointSpacing::Anywhere);
        let mut total = cell.spent + cell.local.magnitude(0.5 * (1u64 << id.0) as f64);
        let clusters = self.tree.clusters();
        let mut waiting = cell.near.clone();
        while total <= limit
            && let Some(c) = waiting.pop()
        {
            let cluster = &clusters[c as usize];
            let center = cluster.center;
            let distance =
                length(std::array::from_fn(|a| (low[a] - center[a]).max(center[a] - high[a]).max(0.0)));
            match cluster.halves() {
                Some(halves) if cluster.reach.farthest > NEAR_SIZE * distance => waiting.extend(halves),
                _ => total += cluster.magnitude(distance),
            }
        }
        // Sums of this kind lose far less.
        if waiting.is_empty() { total * (1.0 + 1e-9) } else { f64::INFINITY }
    }

    /// A polynomial, with its centre, that gives the sum anywhere in a cell within the error, if there is one that takes no
    /// cluster that is too near.
    pub fn as_polynomial(&self, id: CellId) -> Option<([f64; 3], CellExpansion)> {
        let cell = self.cell(id);
        let clusters = self.tree.clusters();
        let radius = 0.5 * 3f64.sqrt() * (1u64 << id.0) as f64;
        let (mut left, mut taken) = (SMOOTH_SHARE * (self.error - cell.spent), Vec::new());
        let mut waiting = cell.near.clone();
        while let Some(c) = waiting.pop() {
            let cluster = &clusters[c as usize];
            let way: [f64; 3] = std::array::from_fn(|a| cluster.center[a] - cell.center[a]);
            let bound = self.far_bound(cluster.reach, length(way), radius);
            match cluster.halves() {
                _ if bound <= left * CLUSTER_SHARE => {
                    left -= bound;
                    taken.push(c);
                }
                Some(halves) if taken.len() < SMOOTH_CLUSTERS => waiting.extend(halves),
                _ => return None,
            }
        }
        let mut local = cell.local.clone();
        self.add_far(&mut local, cell.center, &taken);
        Some((cell.center, local))
    }

    /// The sums at points that all lie in the cell with the edge 2^bits that holds the first of them.
    pub fn answer(&self, cache: &mut CellCache, bits: u32, grain: PointSpacing, points: &mut CellPoints) {
        points.values.clear();
        points.values.resize(points.positions.len(), 0.0);
        let Some(first) = points.positions.first() else { return };
        if self.tree.clusters().is_empty() {
            return;
        }
        let place = first.map(|c| ((i64::from(c) - TOP_LOW) >> bits) as u32);
        self.answer_in(cache, (bits, place), grain, points);
    }

    fn answer_in(&self, cache: &mut CellCache, id: CellId, grain: PointSpacing, points: &mut CellPoints) {
        match &*self.plan_of(id, grain) {
            CellPlan::Here(sum) => self.sum(sum, points),
            CellPlan::Divide => self.answer_in_parts(cache, id, grain, points),
        }
    }

    fn plan_of(&self, id: CellId, grain: PointSpacing) -> Arc<CellPlan> {
        let spacing = match grain {
            PointSpacing::Lattice(spacing) => spacing,
            PointSpacing::Anywhere => u32::MAX,
        };
        self.tree.made().plans.get_or_make((self.error.to_bits(), id, spacing), || {
            let (bits, place) = id;
            let above = self.cell((bits + 1, place.map(|c| c >> 1)));
            self.plan(&above, id, grain)
        })
    }

    /// How [`BoundedTree::answer`] answers points of a lattice 2^spacing apart that all lie in one cell: `found` gets them
    /// with what adds up to their sums, the points of one plan at a time.
    pub fn find<P: Copy>(
        &self,
        bits: u32,
        spacing: u32,
        points: &[(Units, P)],
        found: &mut impl FnMut(PlannedPoints, &[(Units, P)]),
    ) {
        if let Some((first, _)) = points.first() {
            let place = first.map(|c| ((i64::from(c) - TOP_LOW) >> bits) as u32);
            self.find_in((bits, place), spacing, points, found);
        }
    }

    fn find_in<P: Copy>(
        &self,
        id: CellId,
        spacing: u32,
        points: &[(Units, P)],
        found: &mut impl FnMut(PlannedPoints, &[(Units, P)]),
    ) {
        let plan = self.plan_of(id, PointSpacing::Lattice(spacing));
        let (bits, place) = id;
        let low = |bits: u32, place: u32| ((i64::from(place) << bits) + TOP_LOW) as i32;
        if let CellPlan::Here(_) = *plan {
            let low = place.map(|c| low(bits, c) + 1);
            return found(PlannedPoints { plan, low, steps: 1 << bits.saturating_sub(spacing) }, points);
        }
        let middle = place.map(|c| low(bits - 1, 2 * c + 1));
        let octant_of = |p: &Units| (0..3).fold(0, |o, a| o | usize::from(p[a] >= middle[a]) << a);
        let mut parts: [Vec<(Units, P)>; 8] = Default::default();
        points.iter().for_each(|point| parts[octant_of(&point.0)].push(*point));
        for (octant, part) in (0u32..).zip(&parts).filter(|(_, part)| !part.is_empty()) {
            let place = std::array::from_fn(|a| 2 * place[a] + (octant >> a & 1));
            self.find_in((bits - 1, place), spacing, part, found);
        }
    }

    fn answer_in_parts(
        &self,
        cache: &mut CellCache,
        id: CellId,
        grain: PointSpacing,
        points: &mut CellPoints,
    ) {
        let (bits, place) = (id.0 - 1, id.1.map(|c| c << 1));
        let middle: Units = std::array::from_fn(|a| ((i64::from(place[a] + 1) << bits) + TOP_LOW) as i32);
        let octant_of = |p: &Units| (0..3).fold(0, |o, a| o | usize::from(p[a] >= middle[a]) << a);
        let mut parts: [CellPoints; 8] = Default::default();
        std::mem::swap(&mut parts, &mut cache.sorted);
        parts.iter_mut().for_each(|part| part.positions.clear());
        points.positions.iter().for_each(|p| parts[octant_of(p)].positions.push(*p));
        for (octant, part) in parts.iter_mut().enumerate() {
            if !part.positions.is_empty() {
                part.values.clear();
                part.values.resize(part.positions.len(), 0.0);
                let id = (bits, std::array::from_fn(|a| place[a] + (octant as u32 >> a & 1)));
                self.answer_in(cache, id, grain, part);
            }
        }
        let mut next = [0; 8];
        for (p, value) in points.positions.iter().zip(&mut points.values) {
            let octant = octant_of(p);
            *value = parts[octant].values[next[octant]];
            next[octant] += 1;
        }
        cache.sorted = parts;
    }

    fn cell(&self, id: CellId) -> Arc<FarCell> {
        self.tree.made().cells.get_or_make((self.error.to_bits(), id), || self.make_cell(id))
    }

    fn make_cell(&self, (bits, place): CellId) -> FarCell {
        debug_assert!(bits <= TOP_BITS);
        let (mut cell, way) = if bits == TOP_BITS {
            let all =
                FarCell { center: [0.0; 3], local: CellExpansion::default(), spent: 0.0, near: vec![0] };
            (all, [0.0; 3])
        } else {
            let above = self.cell((bits + 1, place.map(|c| c >> 1)));
            let quarter = 0.5 * (1u64 << bits) as f64;
            let way = std::array::from_fn(|a| if place[a] & 1 == 1 { quarter } else { -quarter });
            ((*above).clone(), way)
        };
        let budget = LEVEL_SHARE * (DOWN_SHARE * self.error - cell.spent);
        self.take_over(&mut cell, way, 0.5 * 3f64.sqrt() * (1u64 << bits) as f64, budget);
        cell
    }

    /// Moves the polynomial's centre by `way` and adds to it what is far enough from all points within `radius`.
    fn take_over(&self, cell: &mut FarCell, way: [f64; 3], radius: f64, budget: f64) {
        if cell.spent > 0.0 {
            cell.local.shift(way);
        }
        (0..3).for_each(|a| cell.center[a] += way[a]);
        if cell.near.is_empty() {
            return;
        }
        let clusters = self.tree.clusters();
        let center = cell.center;
        let way =
            |c: u32| -> [f64; 3] { std::array::from_fn(|a| clusters[c as usize].center[a] - center[a]) };
        let bound = |c: u32| self.far_bound(clusters[c as usize].reach, length(way(c)), radius);
        let halves = |c: u32| {
            let cluster = &clusters[c as usize];
            cluster.halves().filter(|_| cluster.reach.farthest > SIZE_MAX * radius)
        };
        let choice = choose(&cell.near, budget, bound, halves);
        if !choice.taken.is_empty() {
            self.add_far(&mut cell.local, center, &choice.taken);
        }
        cell.spent += choice.spent;
        cell.near = choice.left;
    }

    /// [`local_bound`] with the moments that clusters have.
    fn far_bound(&self, reach: Reach, distance: f64, radius: f64) -> f64 {
        if self.tree.high_moments().is_empty() {
            local_bound::<CELL_DEGREE, 3>(reach, distance, radius)
        } else {
            local_bound::<CELL_DEGREE, HIGH_DEGREE>(reach, distance, radius)
        }
    }

    /// Adds clusters to a polynomial about a centre.
    fn add_far(&self, local: &mut CellExpansion, center: [f64; 3], clusters: &[u32]) {
        let all = self.tree.clusters();
        let way = |c: u32| -> [f64; 3] { std::array::from_fn(|a| all[c as usize].center[a] - center[a]) };
        const D: usize = CELL_DEGREE + 1;
        let high = self.tree.high_moments();
        if !high.is_empty() {
            let far: Vec<_> = clusters.iter().map(|&c| (way(c), &high[c as usize].0)).collect();
            local.add::<D, _>(&far);
        } else {
            let moments: Vec<_> = clusters.iter().map(|&c| all[c as usize].expansion.moments()).collect();
            let far: Vec<_> = clusters.iter().zip(&moments).map(|(&c, moments)| (way(c), moments)).collect();
            local.add::<D, _>(&far);
        }
    }

    /// Decides how points of a cell are answered, from what is known of the cell above.
    fn plan(&self, above: &FarCell, (bits, place): CellId, grain: PointSpacing) -> CellPlan {
        let clusters = self.tree.clusters();
        let (low, high, samples) = extent((bits, place), grain);
        let mut cell = above.clone();
        let way = std::array::from_fn(|a| 0.5 * (low[a] + high[a]) - cell.center[a]);
        let half = 0.5 * (high[0] - low[0]);
        let budget = OWN_SHARE * (self.error - cell.spent);
        self.take_over(&mut cell, way, 3f64.sqrt() * half, budget);
        let bound = |c: u32| {
            let Cluster { center, reach, .. } = clusters[c as usize];
            error_bound(
                reach,
                length(std::array::from_fn(|a| (low[a] - center[a]).max(center[a] - high[a]).max(0.0))),
            )
        };
        let budget = self.error - cell.spent;
        let choice = choose(&cell.near, budget, bound, |c| clusters[c as usize].halves());
        let elements: Vec<u32> = choice.left.iter().flat_map(|&c| clusters[c as usize].elements()).collect();
        if samples > 1 && elements.len() * samples > WORK_MAX && bits > 1 {
            return CellPlan::Divide;
        }
        let sum = ExpansionSum { center: cell.center, local: cell.local, clusters: choice.taken, elements };
        CellPlan::Here(Box::new(sum))
    }

    /// The sums at points of a cell.
    pub fn sum(&self, sum: &ExpansionSum, points: &mut CellPoints) {
        dispatch!(level(), simd => self.sum_with(simd, sum, points));
    }

    #[inline(always)]
    fn sum_with<S: Simd>(&self, simd: S, sum: &ExpansionSum, points: &mut CellPoints) {
        let ExpansionSum { center, local, clusters, elements } = sum;
        let CellPoints { positions, values } = points;
        local.at_points(*center, positions, values);
        for (some, values) in positions.chunks(GROUP).zip(values.chunks_mut(GROUP)) {
            // Idle places repeat the last point.
            let at: [[f64; GROUP]; 3] =
                [0, 1, 2].map(|a| std::array::from_fn(|l| f64::from(some[l.min(some.len() - 1)][a])));
            let own: [f64; GROUP] = std::array::from_fn(|l| values.get(l).copied().unwrap_or(0.0));
            let mut sums = f64x8::from_slice(simd, &own);
            let places = each_of(simd, &at);
            for &c in clusters {
                let Cluster { center, expansion, .. } = &self.tree.clusters()[c as usize];
                sums += expansion.at_each(simd, way(simd, center, &places));
            }
            let mut sums: [f64; GROUP] = sums.into();
            let elements = elements.iter().map(|&e| &self.tree.elements()[e as usize]);
            let position = |l: usize| some[l.min(some.len() - 1)];
            E::add_shares(elements, &at, position, &mut sums);
            values.copy_from_slice(&sums[..some.len()]);
        }
    }
}

/// The box of a cell's points of a grain, and how many they are, of scattered ones on average.
fn extent((bits, place): CellId, grain: PointSpacing) -> ([f64; 3], [f64; 3], usize) {
    let low = place.map(|c| ((i64::from(c) << bits) + TOP_LOW + 1) as f64);
    let (size, samples) = match grain {
        PointSpacing::Lattice(spacing) => {
            let steps = 1u64 << bits.saturating_sub(spacing);
            ((steps - 1) << spacing, steps.pow(3) as usize)
        }
        PointSpacing::Anywhere => ((1u64 << bits) - 2, 64),
    };
    (low, low.map(|c| c + size as f64), samples)
}
