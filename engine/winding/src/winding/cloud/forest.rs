//! A spanning forest of the graph of neighbours, by which normals are turned the same way. The cost of an edge is how much the
//! planes at its ends differ.
//!
//! Costs are put in order with the numbers of the points, so that there is one forest of least cost only, in whatever parts it is
//! found. Which way a point's normal has to be turned is kept beside the point that it hangs on, so that nobody walks along trees,
//! which lead through all of a file.

use crate::error::Result;
use crate::large_array::LargeArray;
use crate::lattice::dot;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use std::ops::Range;

/// Neighbours, the point itself among them, that give its plane, and that it hands its orientation to.
pub(super) const NEIGHBOURS: usize = 16;
/// Most points of a bucket: their edges take some 6 MB, and one edge in twenty leads out of it.
const BUCKET_POINTS: usize = 1 << 16;
/// Edges that are sorted rather than divided.
const SORTED_EDGES: usize = 1 << 12;
/// Costs of 1: 2^-30 resolves costs better than normals are known.
const COST_ONE: f64 = (1 << 30) as f64;
/// Set beside a cost where the normals at the ends are more than a right angle apart.
const OPPOSED: u32 = 1 << 31;

/// Numbers of a point's neighbours in the tree; where there are fewer, its own.
pub(super) type AroundPoint = [u32; NEIGHBOURS];

/// An edge of the graph of neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GraphEdge {
    /// With [`OPPOSED`].
    cost: u32,
    /// The lower number first.
    ends: [u32; 2],
}

/// What is found of some points while they are in memory.
pub(super) struct Bucket {
    pub normals: Vec<[f64; 3]>,
    /// The spanning forest of the edges among them.
    pub kept: Vec<GraphEdge>,
    /// Edges to points of other buckets, whose normals may be unknown.
    pub crossing: Vec<[u32; 2]>,
}

/// A spanning forest: sets of points, each known by its first one.
pub(super) struct Forest {
    /// Of each point one that hangs together with it and has no higher number.
    parents: Vec<u32>,
    /// Whether its normal has to be turned if that one's is not; of a first one, whether it has to be.
    turned: Vec<bool>,
}

impl GraphEdge {
    /// Between two points with these normals.
    pub fn new([a, b]: [u32; 2], normal: impl Fn(u32) -> [f64; 3]) -> GraphEdge {
        let ends = [a.min(b), a.max(b)];
        let along = dot(normal(ends[0]), normal(ends[1]));
        let cost = ((1.0 - along.abs()).max(0.0) * COST_ONE) as u32;
        GraphEdge { cost: if along < 0.0 { cost | OPPOSED } else { cost }, ends }
    }

    /// Edges in order; no two that differ are alike.
    fn key(&self) -> (u32, [u32; 2]) {
        (self.cost & !OPPOSED, self.ends)
    }

    fn is_opposed(&self) -> bool {
        self.cost & OPPOSED != 0
    }
}

/// Points in the order of a tree, cut as the tree is.
pub(super) fn buckets_of(count: usize) -> Vec<Range<usize>> {
    fn cut(range: Range<usize>, all: &mut Vec<Range<usize>>) {
        if range.len() <= BUCKET_POINTS {
            return all.push(range);
        }
        let middle = range.start + range.len() / 2;
        cut(range.start..middle, all);
        cut(middle..range.end, all);
    }
    let mut all = Vec::new();
    cut(0..count, &mut all);
    all
}

/// The forest of points from the number `first` on, with their neighbours and planes.
pub(super) fn bucket_forest(first: u32, around: Vec<AroundPoint>, normals: Vec<[f64; 3]>) -> Bucket {
    let numbers = first..first + around.len() as u32;
    let normal = |v: u32| normals[(v - first) as usize];
    let (mut edges, mut crossing) = (Vec::new(), Vec::new());
    for (own, others) in numbers.clone().zip(&around) {
        for &other in others.iter().filter(|&&other| other != own) {
            if !numbers.contains(&other) {
                crossing.push([own, other]);
            } else if own < other || !around[(other - first) as usize].contains(&own) {
                // The others are those of both ends.
                edges.push(GraphEdge::new([own, other], normal));
            }
        }
    }
    let (mut forest, mut kept) = (Forest::apart(around.len()), Vec::with_capacity(around.len()));
    forest.take_least(&mut edges, first, &mut kept);
    Bucket { normals, kept, crossing }
}

impl Forest {
    /// Every point is its own tree.
    fn apart(points: usize) -> Forest {
        Forest { parents: (0..points as u32).collect(), turned: vec![false; points] }
    }

    /// Of least cost, of these edges (Kruskal 1956).
    ///
    /// # Errors
    /// If the temporary file for what memory has no room for cannot be written.
    pub fn of(points: usize, mut edges: LargeArray<GraphEdge>) -> Result<Forest> {
        edges.sort_by(|a, b| a.key().cmp(&b.key()))?;
        let mut forest = Forest::apart(points);
        edges.iter().for_each(|edge| {
            forest.unite(edge, 0);
        });
        Ok(forest)
    }

    /// Takes the edges of least cost that join what is apart; the first point is `first`. The cheaper half is taken before
    /// the dearer one is looked at, most of which joins nothing by then (Osipov, Sanders & Singler 2009).
    fn take_least(&mut self, edges: &mut [GraphEdge], first: u32, kept: &mut Vec<GraphEdge>) {
        if edges.len() <= SORTED_EDGES {
            edges.sort_unstable_by_key(GraphEdge::key);
            kept.extend(edges.iter().filter(|edge| self.unite(edge, first)));
            return;
        }
        let middle = edges.len() / 2;
        edges.select_nth_unstable_by_key(middle, GraphEdge::key);
        let (cheaper, dearer) = edges.split_at_mut(middle);
        self.take_least(cheaper, first, kept);
        let mut left = 0;
        for at in 0..dearer.len() {
            let [a, b] = dearer[at].ends;
            if self.root_of(a - first).0 != self.root_of(b - first).0 {
                dearer[left] = dearer[at];
                left += 1;
            }
        }
        self.take_least(&mut dearer[..left], first, kept);
    }

    /// Joins what an edge joins; whether that was apart.
    fn unite(&mut self, edge: &GraphEdge, first: u32) -> bool {
        let [(a, turned_a), (b, turned_b)] = edge.ends.map(|v| self.root_of(v - first));
        if a != b {
            self.parents[a.max(b) as usize] = a.min(b);
            self.turned[a.max(b) as usize] = turned_a ^ turned_b ^ edge.is_opposed();
        }
        a != b
    }

    /// The first point of a point's tree, and whether their normals are opposed.
    fn root_of(&mut self, mut v: u32) -> (u32, bool) {
        let mut is_turned = false;
        loop {
            let above = self.parents[v as usize];
            if above == v {
                return (v, is_turned);
            }
            let next = self.parents[above as usize];
            if next != above {
                self.parents[v as usize] = next;
                self.turned[v as usize] ^= self.turned[above as usize];
            }
            is_turned ^= self.turned[v as usize];
            v = next;
        }
    }

    /// Turns normals the same way in each tree: that of the topmost point, of several the first, up.
    ///
    /// # Errors
    /// If the temporary file for what memory has no room for cannot be written.
    pub fn orient(
        mut self,
        normals: &mut LargeArray<[f64; 3]>,
        height: impl Fn(u32) -> f64 + Sync,
    ) -> Result<()> {
        let count = normals.len() as u32;
        let mut tops = LargeArray::of_each(normals.len(), normals.room(), |v| Some(v as u32))?;
        for v in 0..count {
            let (root, is_turned) = self.root_of(v);
            // All hang on the first one from now on.
            if root != v {
                (self.parents[v as usize], self.turned[v as usize]) = (root, is_turned);
            }
            let top = &mut tops[root as usize];
            if height(v) > height(*top) {
                *top = v;
            }
        }
        let Forest { parents, mut turned } = self;
        for v in (0..count).filter(|&v| parents[v as usize] == v) {
            let top = tops[v as usize];
            let is_opposed = top != v && turned[top as usize];
            turned[v as usize] = is_opposed ^ (normals[top as usize][2] < 0.0);
        }
        normals.par_iter_mut().enumerate().for_each(|(v, normal)| {
            let root = parents[v] as usize;
            if turned[root] ^ (root != v && turned[v]) {
                *normal = normal.map(|c| -c);
            }
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_bench_data::Rng;

    /// Planes with normals at random or along an axis, around each of which are the numbers next to it.
    fn graph(count: usize, rng: &mut Rng) -> (Vec<AroundPoint>, Vec<[f64; 3]>) {
        let near = |n: usize, i: usize| (n + i).saturating_sub(NEIGHBOURS / 2).min(count - 1) as u32;
        let mut normal = || match rng.below(3) {
            0 => [0.0, 0.0, 1.0],
            _ => {
                let v: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
                let length = dot(v, v).sqrt();
                v.map(|c| c / length)
            }
        };
        let normals = (0..count).map(|_| normal()).collect();
        ((0..count).map(|n| std::array::from_fn(|i| near(n, i))).collect(), normals)
    }

    /// In however many buckets edges are found, there is one forest, and normals are turned along its edges.
    #[test]
    fn forests_do_not_depend_on_buckets() {
        let mut rng = Rng::new(7);
        let count = 20_000;
        let (around, normals) = graph(count, &mut rng);
        let mut all: Vec<Vec<[f64; 3]>> = Vec::new();
        for size in [count, 7_000, 900, 30, 1] {
            let mut edges = Vec::new();
            for first in (0..count).step_by(size) {
                let range = first..count.min(first + size);
                let bucket =
                    bucket_forest(first as u32, around[range.clone()].to_vec(), normals[range].to_vec());
                edges.extend(bucket.kept);
                let crossing = bucket.crossing.iter();
                edges.extend(crossing.map(|ends| GraphEdge::new(*ends, |v| normals[v as usize])));
            }
            let mut forest = Forest::apart(count);
            let mut kept = Vec::new();
            forest.take_least(&mut edges.clone(), 0, &mut kept);
            assert_eq!(kept.len(), count - 1);
            let mut turned = LargeArray::from(normals.clone());
            Forest::of(count, edges.into()).unwrap().orient(&mut turned, f64::from).unwrap();
            for edge in &kept {
                let [a, b] = edge.ends.map(|v| turned[v as usize]);
                assert!(dot(a, b) >= 0.0);
            }
            assert!(turned[count - 1][2] >= 0.0);
            all.push(turned.to_vec());
        }
        assert!(all.iter().all(|turned| *turned == all[0]));
    }

    #[test]
    fn buckets_hold_each_point_once() {
        for count in [0, 1, BUCKET_POINTS, BUCKET_POINTS + 1, 300_000] {
            let all = buckets_of(count);
            assert!(all.iter().all(|range| range.len() <= BUCKET_POINTS));
            assert!(all.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!((all[0].start, all[all.len() - 1].end), (0, count));
        }
    }
}
