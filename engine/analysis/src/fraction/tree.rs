//! A level of the fractions as a tree that can be contoured.

use super::lattice::Lattice;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, point_index};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Octant, RootCube};
use crate::store::{BrickTree, NodeInfo};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Samples an axis of a brick with its apron and one more on each side.
pub(super) const AROUND: usize = BRICK_POINTS + 2;
/// By how much a normal's components are scaled before they are rounded.
const NORMAL_SCALE: f64 = 1e9;

/// The surface at which the fraction of solid passes a value, as an octree of bricks with Hermite edges. Samples are 1 where
/// the fraction is larger, 0 elsewhere: w of a smoother part. It has no interior nodes, so nothing coarser can be drawn of it.
pub struct FractionTree<'a> {
    lattice: &'a Lattice,
    /// The depth at the surface, in coarse cells.
    depth: f32,
    leaves: BTreeMap<NodeKey, NodeInfo>,
    /// Sign-changing edges that bricks own.
    edges: u64,
}

impl<'a> FractionTree<'a> {
    /// The surface `depth` coarse cells, −1 to 1, inside of the one where half is solid; outside if it is below 0.
    pub fn new(lattice: &'a Lattice, depth: f64) -> FractionTree<'a> {
        let depth = depth as f32;
        // A brick's apron belongs to its upper neighbours.
        let mut drawn: Vec<NodeKey> = lattice
            .mixed()
            .flat_map(|key| Octant::all().filter_map(move |o| key.neighbour(o.offset().map(|c| -(c as i32)))))
            .collect();
        drawn.sort_unstable();
        drawn.dedup();
        let infos: Vec<(NodeKey, NodeInfo, u64)> = drawn
            .par_iter()
            .map(|&key| {
                let mut signs = signs(&lattice.depths_around(key), depth);
                lattice.sharpen(key, &mut signs);
                let (info, edges) = info(&signs);
                (key, info, edges)
            })
            .collect();
        let edges = infos.iter().map(|(_, _, edges)| edges).sum();
        let drawn: BTreeMap<NodeKey, NodeInfo> =
            infos.into_iter().map(|(key, info, _)| (key, info)).collect();
        let mut tree = FractionTree { lattice, depth, leaves: BTreeMap::new(), edges };
        tree.divide(NodeKey::ROOT, &drawn);
        tree
    }

    /// About how many triangles its surface has: two for each lattice edge that it crosses.
    pub fn triangles(&self) -> u64 {
        2 * self.edges
    }

    /// Adds a node and all below, down to bricks that the surface may pass.
    fn divide(&mut self, key: NodeKey, drawn: &BTreeMap<NodeKey, NodeInfo>) {
        let level = self.lattice.level;
        if let Some(info) = drawn.get(&key).filter(|_| key.level() == level) {
            self.leaves.insert(key, *info);
        } else if is_above_any(key, level, drawn) {
            Octant::all().for_each(|octant| self.divide(key.child(octant), drawn));
        } else {
            let inside = i16::from(self.lattice.is_full(first_below(key, level)));
            self.leaves.insert(key, NodeInfo { leaf: true, min: inside, max: inside, fractions: false });
        }
    }
}

/// The first brick below a node, or the node itself.
fn first_below(key: NodeKey, level: u8) -> NodeKey {
    let up = level - key.level();
    NodeKey::new(level, key.position().map(|p| p << up)).unwrap_or(key)
}

/// Whether a brick that is drawn lies below a node.
fn is_above_any(key: NodeKey, level: u8, drawn: &BTreeMap<NodeKey, NodeInfo>) -> bool {
    let first = first_below(key, level);
    let next = drawn.range(first..).next();
    next.is_some_and(|(found, _)| found.ancestor(key.level()) == Some(key))
}

fn at(depths: &[f32], [i, j, k]: [usize; 3]) -> f32 {
    depths[((k + 1) * AROUND + j + 1) * AROUND + i + 1]
}

/// Which samples of a brick lie inside.
fn signs(depths: &[f32], depth: f32) -> SignChanges {
    let mut signs = SignChanges::outside();
    for k in 0..BRICK_POINTS {
        for j in 0..BRICK_POINTS {
            let row = &depths[((k + 1) * AROUND + j + 1) * AROUND + 1..][..BRICK_POINTS];
            let bits = row.iter().enumerate().fold(0, |bits, (i, &d)| bits | u64::from(d > depth) << i);
            signs.set_row(j, k, bits);
        }
    }
    signs
}

/// What is known of a brick, and how many edges change sign that no brick before it has.
fn info(signs: &SignChanges) -> (NodeInfo, u64) {
    let all = (1u64 << BRICK_POINTS) - 1;
    let (mut any, mut every) = (false, true);
    let mut edges = 0;
    for k in 0..BRICK_POINTS {
        for j in 0..BRICK_POINTS {
            let row = signs.row(j, k);
            (any, every) = (any || row != 0, every && row == all);
            if j < BRICK_CELLS && k < BRICK_CELLS {
                let own = (1u64 << BRICK_CELLS) - 1;
                edges += Axis::ALL
                    .map(|axis| u64::from((signs.edges(axis, j, k) & own).count_ones()))
                    .iter()
                    .sum::<u64>();
            }
        }
    }
    let info = NodeInfo { leaf: true, min: i16::from(every), max: i16::from(any), fractions: false };
    (info, edges)
}

/// The crossings on all edges that change sign, those of the part where `exact` has them: positions between two samples by their depths, normals against the gradient.
fn hermite(
    signs: &SignChanges,
    (depths, depth): (&[f32], f32),
    exact: impl Fn(Axis, [usize; 3]) -> Option<HermiteEdge>,
) -> Hermite {
    let gradient = |[i, j, k]: [usize; 3]| -> [f64; 3] {
        let strides = [1, AROUND, AROUND * AROUND];
        let place = ((k + 1) * AROUND + j + 1) * AROUND + i + 1;
        strides.map(|stride| f64::from(depths[place + stride]) - f64::from(depths[place - stride]))
    };
    let edges = Axis::ALL.map(|axis| {
        let mut edges = Vec::new();
        signs.for_edges(axis, |low| {
            if let Some(edge) = exact(axis, low) {
                edges.push(edge);
                return;
            }
            let mut high = low;
            high[axis.index()] += 1;
            let [a, b] = [low, high].map(|ijk| f64::from(at(depths, ijk)) - f64::from(depth));
            // Where a side is the part's, depths may say otherwise.
            let t = if a == b { 0.5 } else { (a / (a - b)).clamp(0.0, 1.0) };
            let [ga, gb] = [low, high].map(gradient);
            let mut normal: [i64; 3] =
                std::array::from_fn(|n| (-NORMAL_SCALE * (ga[n] + (gb[n] - ga[n]) * t)) as i64);
            if normal == [0; 3] {
                normal[axis.index()] = if a > b { 1 } else { -1 };
            }
            let offset = (t * 65536.0).min(65535.0) as u16;
            edges.push(HermiteEdge { offset, normal: OctNormal::from_integer(normal) });
        });
        edges
    });
    Hermite { edges }
}

impl BrickTree for FractionTree<'_> {
    fn root(&self) -> RootCube {
        self.lattice.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        self.leaves.get(&key).copied()
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.leaves.keys().copied().collect()
    }

    fn deepest_level(&self) -> u8 {
        self.leaves.last_key_value().map_or(0, |(key, _)| key.level())
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        let info = self.leaves.get(&key).copied();
        if let Some(NodeInfo { min, max, .. }) = info
            && min == max
        {
            return Ok(Arc::new(Brick::Uniform(min)));
        }
        let depths = self.lattice.depths_around(key);
        let mut signs = signs(&depths, self.depth);
        self.lattice.sharpen(key, &mut signs);
        let mut samples = Samples::filled(0);
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                let row = signs.row(j, k);
                let start = point_index([0, j, k]);
                (0..BRICK_POINTS).for_each(|i| samples.0[start + i] = (row >> i & 1) as i16);
            }
        }
        let hermite =
            hermite(&signs, (&depths, self.depth), |axis, low| self.lattice.crossing(key, axis, low));
        Ok(Arc::new(Brick::Counts { samples, hermite }))
    }
}
