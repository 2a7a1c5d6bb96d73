//! The sum over all dipoles at many samples: what is far as a polynomial, what is near point by point.
//!
//! Cells are the cubes of an octree over the lattice. A cell takes over its parent's polynomial, adds the clusters that
//! have become far enough, and hands the rest down (Greengard & Rokhlin 1987). Where few points are left it is *final*:
//! its polynomial takes what the error still allows, and the rest is seen from each sample.
//!
//! So cells become as small as points are apart, and far from all points one is as large as its polynomial holds. All of
//! this follows from the points, the error and the depth. A sample has the same value whatever brick asks.

use super::super::open::{ClusterTree, ConcurrentCache, LocalExpansion, MemorySize, local_bound};
use super::dipole::Dipole;
use super::far::{FarCluster, FarDipole, add_clusters, add_dipoles};
use super::near::{NearPoints, SampleRegion};
use crate::brick::POINTS;
use crate::lattice::{BRICK_POINTS, NodeKey, ROOT_BITS, spacing_bits};
use std::f64::consts::PI;
use std::sync::Arc;

/// log₂ of the edge of the cell that holds all samples, those of aprons too.
const TOP_BITS: u32 = ROOT_BITS + 1;
/// Points near a cell above which it is divided. This and the next shares were tuned on 100,000 points of a torus, where a
/// cell of 8³ samples has some tens of points left.
const NEAR_MAX: u32 = 1000;
/// Bytes of cells that are kept.
const KEPT_BYTES: usize = 48 << 20;
/// Share of what is left of the error that the clusters which one cell takes may add.
const DOWN_SHARE: f64 = 0.2;
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

/// log₂ of a cell's edge, and its number along each axis.
type CubeId = (u32, [u32; 3]);

/// One cell.
#[derive(Clone)]
struct CloudCell {
    /// The middle of the samples that it can hold.
    center: [f64; 3],
    /// What is far.
    local: LocalExpansion,
    /// Bound on the polynomial's error.
    spent: f64,
    /// What is not: clusters, or of a final cell points.
    near: Vec<u32>,
    is_final: bool,
}

/// The cells over a cloud.
#[derive(Debug)]
pub(super) struct CloudCells {
    kept: ConcurrentCache<CubeId, Arc<CloudCell>>,
    error: f64,
    /// log₂ of the distance of the finest samples.
    spacing: u32,
}

impl MemorySize for Arc<CloudCell> {
    fn bytes(&self) -> usize {
        size_of::<CloudCell>() + 4 * self.near.len() + 96
    }
}

impl CloudCells {
    /// For sums that are off by at most `error`, at samples of bricks down to `depth`.
    pub fn new(error: f64, depth: u8) -> CloudCells {
        let error = error * (1.0 - ROUNDING_SHARE);
        CloudCells { kept: ConcurrentCache::new(KEPT_BYTES), error, spacing: spacing_bits(depth) }
    }

    /// The sums at all samples of a brick.
    pub fn fill(
        &self,
        tree: &ClusterTree<Dipole>,
        key: NodeKey,
        near: &mut NearPoints,
        values: &mut [f64; POINTS],
    ) {
        let place = key.base().map(|b| b as u32 >> (ROOT_BITS - u32::from(key.level())));
        for octant in 0..8u32 {
            let id = (ROOT_BITS - u32::from(key.level()), [0, 1, 2].map(|a| place[a] + (octant >> a & 1)));
            self.fill_cell(tree, id, key, near, values);
        }
    }

    fn fill_cell(
        &self,
        tree: &ClusterTree<Dipole>,
        (bits, place): CubeId,
        key: NodeKey,
        near: &mut NearPoints,
        values: &mut [f64; POINTS],
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
                self.fill_cell(tree, id, key, near, values);
            }
            return;
        }
        let ways: [[f64; BRICK_POINTS]; 3] = [0, 1, 2].map(|a| {
            std::array::from_fn(|i| f64::from(base[a] + ((i as i32) << spacing) + 1) - cell.center[a])
        });
        let samples = SampleRegion { from, to };
        samples.fill(&cell.local, &ways, values);
        if !cell.near.is_empty() {
            let dipoles = cell.near.iter().map(|&e| &tree.elements()[e as usize]);
            near.gather(dipoles, cell.center, self.spacing);
            near.add(&samples, &ways, values);
        }
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
        let mut cell = match above {
            None => CloudCell {
                center,
                local: LocalExpansion::default(),
                spent: 0.0,
                near: vec![0],
                is_final: false,
            },
            Some(above) => CloudCell {
                center,
                local: above.local.shifted(std::array::from_fn(|a| center[a] - above.center[a])),
                spent: above.spent,
                near: above.near.clone(),
                is_final: false,
            },
        };
        let radius = 3f64.sqrt() * half;
        cell.absorb(tree, radius, DOWN_SHARE * (self.error - cell.spent));
        let clusters = tree.clusters();
        let points: u32 = cell.near.iter().map(|&c| clusters[c as usize].elements().len() as u32).sum();
        if points <= NEAR_MAX || bits <= self.spacing + 1 {
            cell.near = cell.near.iter().flat_map(|&c| clusters[c as usize].elements()).collect();
            cell.absorb_points(tree, radius, self.error - cell.spent);
            cell.is_final = true;
        }
        cell
    }
}

impl CloudCell {
    /// Adds clusters to the polynomial that are far enough from all samples within `radius`, with an error of at most
    /// `budget` together. Larger ones are divided.
    fn absorb(&mut self, tree: &ClusterTree<Dipole>, radius: f64, budget: f64) {
        let clusters = tree.clusters();
        let mut share = FIRST_SHARE * budget;
        let (mut far, mut left, mut waiting) = (Vec::new(), Vec::new(), Vec::new());
        let spent = loop {
            far.clear();
            left.clear();
            waiting.extend(self.near.iter().rev());
            let mut spent = 0.0;
            while let Some(c) = waiting.pop() {
                let cluster = &clusters[c as usize];
                let way: [f64; 3] = std::array::from_fn(|a| cluster.center[a] - self.center[a]);
                let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
                let (reach, distance) = (cluster.reach, squared.sqrt());
                // The first part of the bound tells of most that are too near.
                let q = (reach.spread + radius) / distance;
                let beyond = 1.0 - q;
                if q < RATIO_MAX && q * q * q * (q * q * q) * (7.0 - 6.0 * q) <= share * beyond * beyond {
                    let bound = local_bound(reach, distance, radius);
                    if bound * squared * (4.0 * PI) <= share * reach.area {
                        spent += bound;
                        far.push(FarCluster { way, expansion: &cluster.expansion });
                        continue;
                    }
                }
                match cluster.halves(c) {
                    Some([first, second]) if reach.spread > DIVIDED * radius => {
                        waiting.extend([second, first]);
                    }
                    _ => left.push(c),
                }
            }
            if spent <= budget {
                break spent;
            }
            share *= LOWERED;
        };
        if !far.is_empty() {
            add_clusters(&mut self.local, &far, radius);
        }
        self.spent += spent;
        self.near = left;
    }

    /// Adds points, which are all that is near, to the polynomial as far as a budget of the error allows, the farthest
    /// first.
    ///
    /// A dipole of area A at the distance r adds an error of at most A/(4π r²) e(t/r) within t of the centre, with
    /// e(q) = q⁶ (7 − 6q)/(1 − q)²: see [`local_bound`]. They are counted by classes of q², each with the bound of
    /// its largest.
    fn absorb_points(&mut self, tree: &ClusterTree<Dipole>, radius: f64, budget: f64) {
        let points: Vec<(u32, [f64; 3], usize)> = (self.near.iter())
            .map(|&e| {
                let dipole = &tree.elements()[e as usize];
                let way: [f64; 3] = dipole.way_from(self.center);
                let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
                // The ball has to end before the samples begin.
                let apart = radius + dipole.radius();
                let bin = if apart * apart < squared {
                    (radius * radius / squared * BINS as f64) as usize
                } else {
                    usize::MAX
                };
                (e, way, bin)
            })
            .collect();
        let mut views = [0.0; BINS];
        for (e, way, bin) in &points {
            if let Some(view) = views.get_mut(*bin) {
                let squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
                *view += tree.elements()[*e as usize].view() / squared;
            }
        }
        let (mut last, mut spent) = (0, 0.0);
        for (bin, view) in views.iter().enumerate() {
            let q = ((bin + 1) as f64 / BINS as f64).sqrt();
            let bound = view * q.powi(6) * (7.0 - 6.0 * q) / ((1.0 - q) * (1.0 - q));
            // The bound of the last one is infinite.
            if bin + 1 == BINS || spent + bound > budget {
                break;
            }
            spent += bound;
            last = bin + 1;
        }
        let far: Vec<_> = (points.iter().filter(|(.., bin)| *bin < last))
            .map(|(e, way, _)| FarDipole { way: *way, dipole: tree.elements()[*e as usize].over_four_pi() })
            .collect();
        if !far.is_empty() {
            add_dipoles(&mut self.local, &far, radius);
        }
        self.spent += spent;
        self.near = points.iter().filter(|(.., bin)| *bin >= last).map(|(e, ..)| *e).collect();
    }
}
