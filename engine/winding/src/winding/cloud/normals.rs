//! Normals of unoriented points: the plane through each point's neighbours, turned outward along a minimum
//! spanning tree (Hoppe et al. 1992, sections 3.1 to 3.3).
//!
//! Points are taken in the order of a k-d tree, so that neighbours are near each other in memory too, and only a part of the
//! edges of the graph of neighbours is in memory at once (Osipov, Sanders & Singler 2009).

use super::nearest::{KdTree, Located};
use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::lattice::dot;
use crate::progress::Progress;
use crate::soup::PointCloud;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

/// Neighbours, the point itself among them, that give its plane, and that it hands its orientation to.
const NEIGHBOURS: usize = 16;
/// Sweeps of the eigenvalue iteration, which converges quadratically: five or six suffice for 3 × 3.
const SWEEPS: usize = 12;
/// Edges that are sorted together: 50 MB of them. It is no setting, since it decides between edges where more of them have
/// one cost.
const EDGES_AT_ONCE: usize = 1 << 22;
/// Points whose edges are looked at by all threads before they are gathered.
const POINTS_AT_ONCE: usize = 1 << 14;
/// Costs of 1: 2^-30 resolves costs better than normals are known.
const COST_ONE: f64 = (1 << 30) as f64;

/// A point in the order of the tree.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct NumberedPoint {
    position: [f64; 3],
    /// Its number in the cloud.
    number: u64,
}

impl Located for NumberedPoint {
    fn place(&self) -> [f64; 3] {
        self.position
    }
}

/// Numbers of a point's neighbours in the tree; where there are fewer, its own.
type AroundPoint = [u32; NEIGHBOURS];

/// The graph of neighbours, each with the normal of the plane through those around it.
///
/// Ends of edges are anywhere: their normals are apart from all the rest, so that many of them are in a page.
struct NeighbourGraph {
    normals: LargeArray<[f64; 3]>,
    around: LargeArray<AroundPoint>,
}

/// An edge of the graph of neighbours: what it costs, the lower of its ends, the other one.
type GraphEdge = (u32, u32, u32);

/// Replaces the cloud's normals by estimated ones of length 1. In each connected part of the graph of
/// neighbours the topmost point's normal points up, and the others follow from it across the edges along which
/// normals differ least. Points that coincide with all their neighbours get a normal of 0.
///
/// # Errors
/// If the user interrupts; if the temporary file for what memory has no room for cannot be written.
pub fn estimate_normals(cloud: &mut PointCloud, progress: &dyn Progress) -> Result<()> {
    let (points, room) = (&cloud.points, cloud.points.room().clone());
    progress.phase("estimating normals", Some(points.len() as u64), "points");
    let numbered = |n: usize| Some(NumberedPoint { position: points[n], number: n as u64 });
    let tree = KdTree::new(LargeArray::of_each(points.len(), &room, numbered)?);
    let graph = NeighbourGraph::of(&tree, progress)?;
    let mut forest = Forest::new(points.len(), &room)?;
    forest.span(&graph, EDGES_AT_ONCE)?;
    progress.check()?;
    let NeighbourGraph { normals: mut turned, around } = graph;
    drop(around);
    orient(tree.points(), &mut turned, forest)?;
    let mut normals = LargeArray::zeroed(points.len(), &room)?;
    for (point, normal) in tree.points().iter().zip(&turned) {
        normals[point.number as usize] = *normal;
    }
    progress.check()?;
    cloud.normals = normals;
    Ok(())
}

/// The direction in which the points extend least; 0 if they coincide.
fn plane_normal(points: impl Iterator<Item = [f64; 3]> + Clone) -> [f64; 3] {
    let count = points.clone().count() as f64;
    let mean: [f64; 3] = std::array::from_fn(|a| points.clone().map(|p| p[a]).sum::<f64>() / count);
    let mut m = [[0.0; 3]; 3];
    for p in points {
        for i in 0..3 {
            for j in 0..3 {
                m[i][j] += (p[i] - mean[i]) * (p[j] - mean[j]);
            }
        }
    }
    if m[0][0] + m[1][1] + m[2][2] == 0.0 {
        return [0.0; 3];
    }
    let vectors = eigenvectors(&mut m);
    let least = (0..3).fold(0, |best, i| if m[i][i] < m[best][best] { i } else { best });
    std::array::from_fn(|a| vectors[a][least])
}

/// Diagonalises a symmetric matrix by Jacobi rotations; the columns of the result are its eigenvectors.
fn eigenvectors(m: &mut [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m[p][q] == 0.0 {
                continue;
            }
            // tan of the angle that makes m[p][q] vanish, the smaller of the two.
            let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let turn = |row: &mut [f64; 3]| {
                let (a, b) = (row[p], row[q]);
                row[p] = c * a - s * b;
                row[q] = s * a + c * b;
            };
            m.iter_mut().for_each(turn);
            let (a, b) = (m[p], m[q]);
            for k in 0..3 {
                m[p][k] = c * a[k] - s * b[k];
                m[q][k] = s * a[k] + c * b[k];
            }
            v.iter_mut().for_each(turn);
        }
    }
    v
}

impl NeighbourGraph {
    fn of(tree: &KdTree<NumberedPoint>, progress: &dyn Progress) -> Result<NeighbourGraph> {
        let (points, room) = (tree.points(), tree.points().room());
        let around = |number: usize| {
            progress.advance(1);
            if progress.cancelled() { None } else { Some(around_point(number, tree)) }
        };
        let around = LargeArray::of_each(points.len(), room, around)?;
        progress.check()?;
        let there = points.len().min(NEIGHBOURS);
        let normal = |number: usize| {
            Some(plane_normal(around[number][..there].iter().map(|&other| points[other as usize].position)))
        };
        let normals = LargeArray::of_each(points.len(), room, normal)?;
        Ok(NeighbourGraph { normals, around })
    }

    /// How much the planes of two points differ.
    fn cost(&self, a: u32, b: u32) -> u32 {
        let along = dot(self.normals[a as usize], self.normals[b as usize]);
        ((1.0 - along.abs()).max(0.0) * COST_ONE) as u32
    }

    /// The edges from a point. Those to a point that has it among its neighbours are that one's, too.
    fn edges_of(&self, number: usize) -> impl Iterator<Item = GraphEdge> {
        let own = number as u32;
        let others = self.around[number].into_iter().filter(move |&other| other != own);
        others.map(move |other| (self.cost(own, other), own.min(other), own.max(other)))
    }
}

fn around_point(number: usize, tree: &KdTree<NumberedPoint>) -> AroundPoint {
    let mut around = [number as u32; NEIGHBOURS];
    let near = tree.around(tree.points()[number].position, NEIGHBOURS);
    around.iter_mut().zip(&near).for_each(|(to, neighbour)| *to = neighbour.number);
    around
}

/// A spanning forest of the graph of neighbours, the cost of an edge being how much the planes at its ends differ.
struct Forest {
    /// Of each point one that hangs together with it and has no higher number.
    parents: Vec<u32>,
    kept: LargeArray<[u32; 2]>,
}

impl Forest {
    fn new(points: usize, room: &ArrayRoom) -> Result<Forest> {
        Ok(Forest { parents: (0..points as u32).collect(), kept: LargeArray::new(room) })
    }

    /// Finds the edges of least cost (Kruskal 1956), those that cost less before others, so that most of these are known to
    /// join nothing when their turn comes. Equal costs are taken in the order of the points, as long as not more than
    /// `at_once` edges of one cost may join something.
    fn span(&mut self, graph: &NeighbourGraph, at_once: usize) -> Result<()> {
        let ends = ends_of_bands(graph, at_once);
        let mut from = 0;
        while let Some(&end) = ends.iter().find(|end| **end > from) {
            from = self.span_band(graph, (from, end), at_once)?;
        }
        Ok(())
    }

    /// Takes edges that cost at least `from`, and less than `to` or, if more than `at_once` of these may join something, less
    /// than what is returned.
    fn span_band(
        &mut self,
        graph: &NeighbourGraph,
        (from, mut to): (u32, u32),
        at_once: usize,
    ) -> Result<u32> {
        let mut edges: Vec<GraphEdge> = Vec::new();
        for first in (0..graph.normals.len()).step_by(POINTS_AT_ONCE) {
            let of_band = |edge: &GraphEdge| (from..to).contains(&edge.0);
            let numbers = first..graph.normals.len().min(first + POINTS_AT_ONCE);
            let some: Vec<GraphEdge> =
                numbers.into_par_iter().flat_map_iter(|n| graph.edges_of(n).filter(of_band)).collect();
            edges.extend(some.into_iter().filter(|edge| self.root_of(edge.1) != self.root_of(edge.2)));
            if edges.len() <= at_once {
                continue;
            }
            edges.par_sort_unstable();
            let middle = edges[edges.len() / 2].0;
            if middle > edges[0].0 {
                // The dearer ones come again.
                to = middle;
                edges.truncate(edges.partition_point(|edge| edge.0 < to));
            } else {
                edges.retain(|edge| edge.0 == middle);
                to = middle + 1;
                self.join(&mut edges)?;
            }
        }
        self.join(&mut edges)?;
        Ok(to)
    }

    /// Takes those of some edges that join what is apart.
    fn join(&mut self, edges: &mut Vec<GraphEdge>) -> Result<()> {
        edges.par_sort_unstable();
        for (_, a, b) in edges.drain(..) {
            let (root_a, root_b) = (self.root_of(a), self.root_of(b));
            if root_a != root_b {
                self.parents[root_a.max(root_b) as usize] = root_a.min(root_b);
                self.kept.push([a, b])?;
            }
        }
        Ok(())
    }

    fn root_of(&mut self, mut v: u32) -> u32 {
        let parents = &mut self.parents;
        while parents[v as usize] != v {
            parents[v as usize] = parents[parents[v as usize] as usize];
            v = parents[v as usize];
        }
        v
    }
}

/// Where ranges of costs end: the first has about `at_once` edges, each other one twice as many as the one before.
fn ends_of_bands(graph: &NeighbourGraph, at_once: usize) -> Vec<u32> {
    // By their three leading bits.
    let class_of = |cost: u32| {
        let bits = 32 - cost.leading_zeros();
        if bits <= 3 { cost } else { 4 * (bits - 1) + (cost >> (bits - 3) & 3) }
    };
    let first_of = |class: u32| if class < 8 { class } else { (4 + (class & 3)) << (class / 4 - 2) };
    let count = |mut counts: Vec<usize>, number: usize| {
        graph.edges_of(number).for_each(|edge| counts[class_of(edge.0) as usize] += 1);
        counts
    };
    let sum = |a: Vec<usize>, b: Vec<usize>| a.iter().zip(b).map(|(a, b)| a + b).collect();
    let none = || vec![0usize; 128];
    let counts = (0..graph.normals.len()).into_par_iter().fold(none, count).reduce(none, sum);
    let (mut ends, mut edges, mut enough) = (Vec::new(), 0usize, at_once);
    for (class, count) in (0u32..).zip(counts) {
        if edges > 0 && edges + count > enough {
            ends.push(first_of(class));
            (edges, enough) = (0, enough.saturating_mul(2));
        }
        edges += count;
    }
    ends.push(u32::MAX);
    ends
}

/// Turns normals the same way along the edges of a forest, from each tree's topmost point, whose normal
/// points up.
fn orient(points: &[NumberedPoint], normals: &mut LargeArray<[f64; 3]>, forest: Forest) -> Result<()> {
    let (room, count) = (normals.room().clone(), points.len());
    let tops = tops_of(points, &forest, &room)?;
    let edges = forest.kept;
    drop(forest.parents);
    let mut starts = LargeArray::<u32>::zeroed(count + 1, &room)?;
    edges.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    (1..starts.len()).for_each(|v| starts[v] += starts[v - 1]);
    // Once all are there, each start is where the next point's begin.
    let mut linked = LargeArray::<u32>::zeroed(2 * edges.len(), &room)?;
    for &[a, b] in &edges {
        for (from, to) in [(a, b), (b, a)] {
            linked[starts[from as usize] as usize] = to;
            starts[from as usize] += 1;
        }
    }
    drop(edges);
    let mut waiting = Vec::new();
    for &top in &tops {
        turn(&mut normals[top as usize], [0.0, 0.0, 1.0]);
        // From each point to all but the one that it was reached from.
        waiting.push((top, top));
        while let Some((v, before)) = waiting.pop() {
            let along = normals[v as usize];
            let begin = if v == 0 { 0 } else { starts[v as usize - 1] as usize };
            for &to in &linked[begin..starts[v as usize] as usize] {
                if to != before {
                    turn(&mut normals[to as usize], along);
                    waiting.push((to, v));
                }
            }
        }
    }
    Ok(())
}

/// The topmost point of each tree, of several the first.
fn tops_of(points: &[NumberedPoint], forest: &Forest, room: &ArrayRoom) -> Result<LargeArray<u32>> {
    let count = points.len();
    // Parents have lower numbers, so one pass in order finds all roots.
    let mut roots = LargeArray::<u32>::zeroed(count, room)?;
    for v in 0..count {
        let parent = forest.parents[v] as usize;
        roots[v] = if parent == v { v as u32 } else { roots[parent] };
    }
    let mut tops = LargeArray::of_each(count, room, |v| Some(v as u32))?;
    let height = |v: u32| points[v as usize].position[2];
    for v in 0..count as u32 {
        let top = &mut tops[roots[v as usize] as usize];
        if height(v) > height(*top) {
            *top = v;
        }
    }
    LargeArray::of_each(count, room, |v| (roots[v] == v as u32).then(|| tops[v]))
}

/// Makes the normal point the way of `along` rather than against it.
fn turn(normal: &mut [f64; 3], along: [f64; 3]) {
    if dot(*normal, along) < 0.0 {
        *normal = normal.map(|c| -c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_bench_data::Rng;

    /// Planes with normals at random or along an axis, around each of which are the numbers next to it.
    fn graph(count: usize, rng: &mut Rng) -> NeighbourGraph {
        let near = |n: usize, i: usize| (n + i).saturating_sub(NEIGHBOURS / 2).min(count - 1) as u32;
        let mut normal = || match rng.below(3) {
            0 => [0.0, 0.0, 1.0],
            _ => {
                let v: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
                let length = dot(v, v).sqrt();
                v.map(|c| c / length)
            }
        };
        let normals: Vec<[f64; 3]> = (0..count).map(|_| normal()).collect();
        let around: Vec<AroundPoint> = (0..count).map(|n| std::array::from_fn(|i| near(n, i))).collect();
        NeighbourGraph { normals: normals.into(), around: around.into() }
    }

    /// However few edges are in memory at once, the forest spans at the same cost.
    #[test]
    fn forests_do_not_depend_on_what_is_in_memory() {
        let mut rng = Rng::new(7);
        let graph = graph(5000, &mut rng);
        let cost =
            |forest: &Forest| -> u64 { forest.kept.iter().map(|&[a, b]| u64::from(graph.cost(a, b))).sum() };
        let room = ArrayRoom::unbounded();
        let mut all = Vec::new();
        for at_once in [usize::MAX / 2, 4000, 1000, 10] {
            let mut forest = Forest::new(5000, &room).unwrap();
            forest.span(&graph, at_once).unwrap();
            assert_eq!(forest.kept.len(), 4999);
            all.push(cost(&forest));
        }
        let ends = ends_of_bands(&graph, 4000);
        assert!(ends.len() >= 3 && ends.windows(2).all(|pair| pair[0] < pair[1]), "{ends:?}");
        assert_eq!(ends_of_bands(&graph, usize::MAX / 2), [u32::MAX]);
        assert!(all.iter().all(|cost| *cost == all[0]), "{all:?}");
    }
}
