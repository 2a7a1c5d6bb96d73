//! The sum over all dipoles at many samples: what is far as a polynomial, what is near point by point.
//!
//! Cells are the cubes of an octree over the lattice. A cell takes over its parent's polynomial, adds the clusters that
//! have become far enough, and hands the rest down (Greengard & Rokhlin 1987): clusters, and where they hold few points these.
//! A cell is *final* if its polynomial can take all points but a few, which are then seen from each sample.
//!
//! So cells become as small as points are apart, and far from all points one is as large as its polynomial holds. All of
//! this follows from the points, the error and the depth. A sample has the same value whatever brick asks.

use super::super::open::{Cluster, ClusterTree, ConcurrentCache, LocalExpansion, MemorySize, local_bound};
use super::dipole::Dipole;
use super::far::{C, ClusterMoments, FarCluster, FarDipole, add_clusters, add_dipoles, moments_of};
use super::near::{NearPoints, SampleRegion, SampleWays};
use crate::brick::POINTS;
use crate::error::Result;
use crate::large_array::LargeArray;
use crate::lattice::{BRICK_POINTS, NodeKey, ROOT_BITS, spacing_bits};
use std::f64::consts::PI;
use std::sync::Arc;

/// log₂ of the edge of the cell that holds all samples, those of aprons too.
const TOP_BITS: u32 = ROOT_BITS + 1;
/// Points near a cell up to which they are looked at one by one. This and the next numbers were tuned on 100,000 points of a
/// torus, where a cell of 8³ samples has some five hundred points left.
const NEAR_MAX: u32 = 2000;
/// Pairs of a point and one of a cell's samples up to which the cell leaves points to its samples.
const SEEN_MAX: u64 = 300_000;
/// Bytes of cells that are kept.
const KEPT_BYTES: usize = 48 << 20;
/// Share of what is left of the error that the clusters which one cell takes may add.
const DOWN_SHARE: f64 = 0.2;
/// The same of points.
const POINTS_SHARE: f64 = 0.3;
/// Clusters whose points are farther from their centre than this share of a cell's radius are divided where they are not
/// taken.
const DIVIDED: f64 = 0.15;
/// Largest ratio of a cell's and a cluster's size to their distance.
const RATIO_MAX: f64 = 0.8;
/// The largest error of a far cluster, as a share of what its area covers of the view, in times of the error that a cell
/// may take: what lies around a plane takes about as much.
const FIRST_SHARE: f64 = 16.0;
/// By how much that is lowered while the sum of bounds is too large.
const LOWERED: f64 = 0.6;
/// Share of the error that is left to rounding. Terms near a sample, and sums of 32 of them, are off by about 1e-6 of what
/// the areas cover: see [`NearPoints`]. A ball covers at most 0.14, so that hundreds may be near where the error is 0.01.
const ROUNDING_SHARE: f64 = 0.02;
/// Classes of points by how near they are to a cell.
const BINS: usize = 128;
/// In place of a class: of points that no polynomial takes.
const TOO_NEAR: u8 = u8::MAX;

/// log₂ of a cell's edge, and its number along each axis.
type CubeId = (u32, [u32; 3]);

/// What gets a final cell, the samples of a brick that it holds, and how far samples are from its middle.
type CellVisit<'a> = dyn FnMut(&CloudCell, &SampleRegion, &SampleWays) + 'a;

/// One cell.
#[derive(Clone)]
pub(super) struct CloudCell {
    /// The middle of the samples that it can hold.
    center: [f64; 3],
    /// What is far.
    pub local: LocalExpansion<C>,
    /// Bound on the polynomial's error.
    spent: f64,
    /// What is not: clusters, or of a final cell points.
    near: Vec<u32>,
    /// Whether these are points.
    has_points: bool,
    is_final: bool,
}

/// Points about as far from a cell.
#[derive(Clone, Copy, Default)]
struct PointClass {
    points: usize,
    /// What their areas cover of the view from the cell's middle.
    view: f64,
}

/// A cluster that may be far enough from a cell.
struct FarCandidate {
    cluster: u32,
    /// The way to its centre.
    way: [f64; 3],
    /// Bound on its error.
    bound: f64,
    /// The same as a share of what its area covers of the view.
    share: f64,
}

/// The cells over a cloud.
#[derive(Debug)]
pub(super) struct CloudCells {
    kept: ConcurrentCache<CubeId, Arc<CloudCell>>,
    /// By cluster.
    moments: LargeArray<ClusterMoments>,
    error: f64,
    /// log₂ of the distance of the finest samples.
    pub spacing: u32,
}

impl MemorySize for Arc<CloudCell> {
    fn bytes(&self) -> usize {
        size_of::<CloudCell>() + 4 * self.near.len() + 96
    }
}

impl CloudCells {
    /// For sums over a tree's dipoles that are off by at most `error`, at samples of bricks down to `depth`.
    ///
    /// # Errors
    /// If the temporary file for what memory has no room for cannot be written.
    pub fn new(tree: &ClusterTree<Dipole>, error: f64, depth: u8) -> Result<CloudCells> {
        let clusters = tree.clusters();
        let moments = |number: usize| Some(moments_of(&clusters[number].expansion));
        Ok(CloudCells {
            kept: ConcurrentCache::new(KEPT_BYTES),
            moments: LargeArray::of_each(clusters.len(), tree.room(), moments)?,
            error: error * (1.0 - ROUNDING_SHARE),
            spacing: spacing_bits(depth),
        })
    }

    /// The sums at all samples of a brick.
    pub fn fill(
        &self,
        tree: &ClusterTree<Dipole>,
        key: NodeKey,
        near: &mut NearPoints,
        values: &mut [f64; POINTS],
    ) {
        self.for_cells(tree, key, &mut |cell, samples, ways| {
            samples.fill(&cell.local, ways, values);
            if cell.gather(tree, self.spacing, near) {
                near.add(samples, ways, values);
            }
        });
    }

    /// Calls `each` with every final cell that holds samples of a brick.
    pub fn for_cells(&self, tree: &ClusterTree<Dipole>, key: NodeKey, each: &mut CellVisit<'_>) {
        let place = key.base().map(|b| b as u32 >> (ROOT_BITS - u32::from(key.level())));
        for octant in 0..8u32 {
            let id = (ROOT_BITS - u32::from(key.level()), [0, 1, 2].map(|a| place[a] + (octant >> a & 1)));
            self.visit_cell(tree, id, key, each);
        }
    }

    fn visit_cell(
        &self,
        tree: &ClusterTree<Dipole>,
        (bits, place): CubeId,
        key: NodeKey,
        each: &mut CellVisit<'_>,
    ) {
        let (base, spacing) = (key.base(), key.spacing_bits());
        // Samples lie one unit above multiples of their spacing, so within a cell and never on its border.
        let first = |a: usize, place: u32| {
            let low = (i64::from(place) << bits) - i64::from(base[a]);
            ((low + (1 << spacing) - 1) >> spacing).clamp(0, BRICK_POINTS as i64)
        };
        let from = [0, 1, 2].map(|a| first(a, place[a]) as usize);
        let to = [0, 1, 2].map(|a| first(a, place[a] + 1) as usize);
        if (0..3).any(|a| from[a] == to[a]) {
            return;
        }
        let cell = self.cell(tree, (bits, place));
        if !cell.is_final {
            for octant in 0..8u32 {
                let id = (bits - 1, [0, 1, 2].map(|a| 2 * place[a] + (octant >> a & 1)));
                self.visit_cell(tree, id, key, each);
            }
            return;
        }
        let ways: SampleWays = [0, 1, 2].map(|a| {
            std::array::from_fn(|i| f64::from(base[a] + ((i as i32) << spacing) + 1) - cell.center[a])
        });
        each(&cell, &SampleRegion { from, to }, &ways);
    }

    /// A cell, or the final one that holds it.
    fn cell(&self, tree: &ClusterTree<Dipole>, (bits, place): CubeId) -> Arc<CloudCell> {
        let make = || {
            if bits == TOP_BITS {
                return Arc::new(self.make(tree, None, (bits, place)));
            }
            let above = self.cell(tree, (bits + 1, place.map(|c| c >> 1)));
            if above.is_final { above } else { Arc::new(self.make(tree, Some(&above), (bits, place))) }
        };
        Arc::clone(&self.kept.get_or_make((bits, place), make))
    }

    fn make(
        &self,
        tree: &ClusterTree<Dipole>,
        above: Option<&CloudCell>,
        (bits, place): CubeId,
    ) -> CloudCell {
        // Half of the extent of the samples.
        let half = 0.5 * ((1u64 << bits) as f64 - (1u64 << self.spacing) as f64).max(0.0);
        let center = place.map(|c| (u64::from(c) << bits) as f64 + 1.0 + half);
        let mut cell = CloudCell::below(above, center);
        let mut near: &[u32] = above.map_or(&[0], |above| &above.near);
        let radius = 3f64.sqrt() * half;
        let is_least = bits <= self.spacing + 1;
        let of_clusters: Vec<u32>;
        if !cell.has_points {
            let clusters = tree.clusters();
            let budget = DOWN_SHARE * (self.error - cell.spent);
            let left = cell.absorb((tree, &self.moments), near, radius, budget);
            let points: u32 = left.iter().map(|&c| clusters[c as usize].elements().len() as u32).sum();
            if points > NEAR_MAX && !is_least {
                cell.near = left;
                return cell;
            }
            cell.has_points = true;
            of_clusters = left.iter().flat_map(|&c| clusters[c as usize].elements()).collect();
            near = &of_clusters;
        }
        let samples = 1u64.checked_shl(3 * (bits - self.spacing)).unwrap_or(u64::MAX);
        let few = if is_least { usize::MAX } else { (SEEN_MAX / samples) as usize };
        cell.absorb_points(tree, near, radius, self.error, few);
        cell
    }
}

impl FarCandidate {
    /// A cluster if its bound is at most `share` of what its area covers of the view from the middle of a cell.
    fn of(number: u32, cluster: &Cluster, center: [f64; 3], radius: f64, share: f64) -> Option<FarCandidate> {
        let way: [f64; 3] = std::array::from_fn(|a| cluster.center[a] - center[a]);
        let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
        let (reach, distance) = (cluster.reach, squared.sqrt());
        // The first part of the bound tells of most that are too near.
        let q = (reach.spread + radius) / distance;
        let beyond = 1.0 - q;
        if q >= RATIO_MAX || q * q * q * (q * q * q) * (7.0 - 6.0 * q) > share * beyond * beyond {
            return None;
        }
        let bound = local_bound::<C, 3>(reach, distance, radius);
        let own = bound * squared * (4.0 * PI) / reach.area;
        (own <= share).then_some(FarCandidate { cluster: number, way, bound, share: own })
    }
}

impl CloudCell {
    /// A cell as it is handed down, before what is near it is looked at.
    fn below(above: Option<&CloudCell>, center: [f64; 3]) -> CloudCell {
        CloudCell {
            center,
            local: above.map_or_else(LocalExpansion::default, |above| {
                above.local.shifted(std::array::from_fn(|a| center[a] - above.center[a]))
            }),
            spent: above.map_or(0.0, |above| above.spent),
            near: Vec::new(),
            has_points: above.is_some_and(|above| above.has_points),
            is_final: false,
        }
    }

    /// Takes what is near a final cell in place of other points, in units of a distance of 2^spacing; whether there is any.
    pub fn gather(&self, tree: &ClusterTree<Dipole>, spacing: u32, near: &mut NearPoints) -> bool {
        near.gather(self.near.iter().map(|&e| &tree.elements()[e as usize]), self.center, spacing);
        !self.near.is_empty()
    }

    /// Adds those of some clusters to the polynomial that are far enough from all samples within `radius`, with an error of at
    /// most `budget` together. Larger ones are divided. Returns what is left.
    fn absorb(
        &mut self,
        (tree, moments): (&ClusterTree<Dipole>, &[ClusterMoments]),
        near: &[u32],
        radius: f64,
        budget: f64,
    ) -> Vec<u32> {
        let clusters = tree.clusters();
        let mut share = FIRST_SHARE * budget;
        let (mut far, mut left) = (Vec::<FarCandidate>::new(), Vec::new());
        let mut waiting: Vec<u32> = near.iter().rev().copied().collect();
        let put = |c: u32, waiting: &mut Vec<u32>, left: &mut Vec<u32>| {
            let cluster = &clusters[c as usize];
            match cluster.halves() {
                Some([first, second]) if cluster.reach.spread > DIVIDED * radius => {
                    waiting.extend([second, first]);
                }
                _ => left.push(c),
            }
        };
        let spent = loop {
            while let Some(c) = waiting.pop() {
                match FarCandidate::of(c, &clusters[c as usize], self.center, radius, share) {
                    Some(candidate) => far.push(candidate),
                    None => put(c, &mut waiting, &mut left),
                }
            }
            let spent: f64 = far.iter().map(|candidate| candidate.bound).sum();
            if spent <= budget {
                break spent;
            }
            // Those that are no longer far enough, and what they are divided into, are all that changes.
            share *= LOWERED;
            far.retain(|candidate| {
                let is_kept = candidate.share <= share;
                if !is_kept {
                    put(candidate.cluster, &mut waiting, &mut left);
                }
                is_kept
            });
        };
        if !far.is_empty() {
            let scale = 1.0 / radius;
            let far = far.iter().map(|candidate| FarCluster {
                way: candidate.way.map(|c| (c * scale) as f32),
                moments: &moments[candidate.cluster as usize],
            });
            add_clusters(&mut self.local, &far.collect::<Vec<_>>(), radius);
        }
        self.spent += spent;
        left
    }

    /// Adds points, which are all that was near, to the polynomial as far as a share of what is left of the error allows,
    /// the farthest first. If all that is left of it would leave a `few` points or less, that is spent, and the cell is final.
    ///
    /// A dipole of area A at the distance r adds an error of at most A/(4π r²) e(t/r) within t of the centre, with
    /// e(q) = q⁶ (7 − 6q)/(1 − q)²: see [`local_bound`]. They are counted by classes of q², each with the bound of
    /// its largest.
    fn absorb_points(
        &mut self,
        tree: &ClusterTree<Dipole>,
        near: &[u32],
        radius: f64,
        error: f64,
        few: usize,
    ) {
        let mut classes = [PointClass::default(); BINS];
        let center = self.center;
        let way_to = |number: &u32| tree.elements()[*number as usize].way_from(center);
        let class_of = |number: &u32| {
            let dipole = &tree.elements()[*number as usize];
            let way = way_to(number);
            let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
            // The ball has to end before the samples begin.
            let apart = radius + dipole.radius();
            if apart * apart >= squared {
                return TOO_NEAR;
            }
            let class = (radius * radius / squared * BINS as f64) as usize;
            classes[class].view += dipole.view() / squared;
            classes[class].points += 1;
            class as u8
        };
        let of_each: Vec<u8> = near.iter().map(class_of).collect();
        let (last, spent, is_final) = settle_classes(&classes, of_each.len(), error - self.spent, few);
        let is_far = |class: u8| usize::from(class) < last;
        let scale = 1.0 / radius;
        let far_dipole = |number: &u32| FarDipole {
            way: way_to(number).map(|c| (c * scale) as f32),
            dipole: tree.elements()[*number as usize].over_four_pi().map(|c| (c * scale * scale) as f32),
        };
        let far = near.iter().zip(&of_each).filter(|(_, class)| is_far(**class));
        let far: Vec<FarDipole> = far.map(|(number, _)| far_dipole(number)).collect();
        if !far.is_empty() {
            add_dipoles(&mut self.local, &far, radius);
        }
        self.spent += spent;
        let left = near.iter().zip(&of_each).filter(|(_, class)| !is_far(**class));
        self.near = left.map(|(number, _)| *number).collect();
        self.is_final = is_final;
    }
}

/// The first class that a cell does not take, the bounds of those before it, and whether the cell is final: it may take them
/// all, because a `few` points or less are left then. Of all others it takes what a share of the `budget` allows.
fn settle_classes(
    classes: &[PointClass; BINS],
    points: usize,
    budget: f64,
    few: usize,
) -> (usize, f64, bool) {
    let (mut down, mut all) = ((0, 0.0), (0, 0.0));
    let mut left = points;
    for (number, class) in classes.iter().enumerate() {
        let q = ((number + 1) as f64 / BINS as f64).sqrt();
        let (power, beyond) = (q * q * q * (q * q * q), 1.0 - q);
        let spent = all.1 + class.view * power * (7.0 - 6.0 * q) / (beyond * beyond);
        // The bound of the last one is infinite.
        if number + 1 == BINS || spent > budget {
            break;
        }
        left -= class.points;
        all = (number + 1, spent);
        if spent <= POINTS_SHARE * budget {
            down = all;
        }
    }
    let is_final = left <= few;
    let (last, spent) = if is_final { all } else { down };
    (last, spent, is_final)
}
