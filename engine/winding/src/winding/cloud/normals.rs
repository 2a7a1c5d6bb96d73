//! Normals of unoriented points: the plane through each point's neighbours, turned outward along a minimum
//! spanning tree (Hoppe et al. 1992, sections 3.1 to 3.3).
//!
//! Points are taken in the order of a k-d tree, bucket by bucket: neighbours, planes and the edges between the points of a bucket
//! are found while it is in memory, and of these edges only a spanning forest is kept, since no other can be in that of all points
//! (the dearest edge of a circle is in none). `forest.rs` joins the buckets.

use super::forest::{AroundPoint, Bucket, Forest, GraphEdge, NEIGHBOURS, bucket_forest, buckets_of};
use super::nearest::{KdTree, Located};
use crate::error::Result;
use crate::large_array::LargeArray;
use crate::progress::Progress;
use crate::soup::PointCloud;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use std::ops::Range;

/// Sweeps of the eigenvalue iteration, which converges quadratically: five or six suffice for 3 × 3.
const SWEEPS: usize = 12;
/// What is left beside the diagonal, as a share of it, that turns no vector any more.
const DIAGONAL: f64 = 1e-24;
/// Buckets that are in work at once.
const BUCKETS_AT_ONCE: usize = 16;

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

/// Points of a cloud in the order of the tree, with normals.
struct OrientedPoints {
    points: LargeArray<NumberedPoint>,
    normals: LargeArray<[f64; 3]>,
}

/// Replaces the cloud's normals by estimated ones of length 1. In each connected part of the graph of
/// neighbours the topmost point's normal points up, and the others follow from it across the edges along which
/// normals differ least. Points that coincide with all their neighbours get a normal of 0.
///
/// # Errors
/// If the user interrupts; if the temporary file for what memory has no room for cannot be written.
pub fn estimate_normals(cloud: &mut PointCloud, progress: &dyn Progress) -> Result<()> {
    let OrientedPoints { points, normals: found } = oriented(&cloud.points, progress)?;
    let mut normals = LargeArray::zeroed(points.len(), points.room())?;
    for (point, normal) in points.iter().zip(&found) {
        normals[point.number as usize] = *normal;
    }
    cloud.normals = normals;
    Ok(())
}

/// The points of a cloud in an order in which those near each other follow each other, with the normals of [`estimate_normals`].
/// Large clouds are quicker than there, whose normals go to pages all over a file.
///
/// # Errors
/// As [`estimate_normals`].
pub fn with_estimated_normals(cloud: PointCloud, progress: &dyn Progress) -> Result<PointCloud> {
    let OrientedPoints { points, normals } = oriented(&cloud.points, progress)?;
    drop(cloud);
    let positions = LargeArray::of_each(points.len(), points.room(), |n| Some(points[n].position))?;
    Ok(PointCloud { points: positions, normals })
}

fn oriented(points: &LargeArray<[f64; 3]>, progress: &dyn Progress) -> Result<OrientedPoints> {
    progress.phase("estimating normals", Some(points.len() as u64), "points");
    let numbered = |n: usize| Some(NumberedPoint { position: points[n], number: n as u64 });
    let tree = KdTree::new(LargeArray::of_each(points.len(), points.room(), numbered)?);
    let (mut normals, edges) = planes(&tree, progress)?;
    let points = tree.into_points();
    let forest = Forest::of(points.len(), edges)?;
    progress.check()?;
    forest.orient(&mut normals, |number| points[number as usize].position[2])?;
    progress.check()?;
    Ok(OrientedPoints { points, normals })
}

/// The normals of all planes, and edges among which are those of the spanning forest.
fn planes(
    tree: &KdTree<NumberedPoint>,
    progress: &dyn Progress,
) -> Result<(LargeArray<[f64; 3]>, LargeArray<GraphEdge>)> {
    let (count, room) = (tree.points().len(), tree.points().room());
    let mut normals = LargeArray::new(room);
    let mut edges = LargeArray::new(room);
    let mut crossing = LargeArray::<[u32; 2]>::new(room);
    for some in buckets_of(count).chunks(BUCKETS_AT_ONCE) {
        let found: Vec<Option<Bucket>> =
            some.par_iter().map(|range| bucket(range.clone(), tree, progress)).collect();
        progress.check()?;
        for bucket in found.into_iter().flatten() {
            normals.extend_from_slice(&bucket.normals)?;
            edges.extend_from_slice(&bucket.kept)?;
            crossing.extend_from_slice(&bucket.crossing)?;
        }
    }
    // Both ends have their normals now.
    let between = |n: usize| Some(GraphEdge::new(crossing[n], |v| normals[v as usize]));
    let between = LargeArray::of_each(crossing.len(), room, between)?;
    drop(crossing);
    edges.extend_from_slice(&between)?;
    Ok((normals, edges))
}

/// Planes and edges of some points; none if the user interrupts.
fn bucket(range: Range<usize>, tree: &KdTree<NumberedPoint>, progress: &dyn Progress) -> Option<Bucket> {
    let points = tree.points();
    let there = points.len().min(NEIGHBOURS);
    let plane = |number: usize| {
        progress.advance(1);
        if progress.cancelled() {
            return None;
        }
        let mut around = [number as u32; NEIGHBOURS];
        let near = tree.around(points[number].position, NEIGHBOURS);
        around.iter_mut().zip(&near).for_each(|(to, neighbour)| *to = neighbour.number);
        let normal = plane_normal(near[..there].iter().map(|neighbour| neighbour.place));
        Some((around, normal))
    };
    let all: Option<Vec<(AroundPoint, [f64; 3])>> = range.clone().into_par_iter().map(plane).collect();
    let (around, normals) = all?.into_iter().unzip();
    Some(bucket_forest(range.start as u32, around, normals))
}

/// The direction in which points extend least; 0 if they coincide.
pub fn plane_normal(points: impl Iterator<Item = [f64; 3]> + Clone) -> [f64; 3] {
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
        let beside = m[0][1].abs() + m[0][2].abs() + m[1][2].abs();
        if beside <= DIAGONAL * (m[0][0] + m[1][1] + m[2][2]) {
            break;
        }
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
