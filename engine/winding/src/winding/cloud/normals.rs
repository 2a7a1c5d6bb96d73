//! Normals of unoriented points: the plane through each point's neighbours, turned outward along a minimum
//! spanning tree (Hoppe et al. 1992, sections 3.1 to 3.3).

use super::nearest::KdTree;
use crate::error::Result;
use crate::lattice::dot;
use crate::progress::Progress;
use crate::soup::PointCloud;
use rayon::prelude::*;

/// Neighbours, the point itself among them, that give its plane, and that it hands its orientation to.
const NEIGHBOURS: usize = 16;
/// Sweeps of the eigenvalue iteration, which converges quadratically: five or six suffice for 3 × 3.
const SWEEPS: usize = 12;

/// Replaces the cloud's normals by estimated ones of length 1. In each connected part of the graph of
/// neighbours the topmost point's normal points up, and the others follow from it across the edges along which
/// normals differ least. Points that coincide with all their neighbours get a normal of 0.
///
/// # Errors
/// If the user interrupts.
pub fn estimate_normals(cloud: &mut PointCloud, progress: &dyn Progress) -> Result<()> {
    let points = &cloud.points;
    progress.phase("estimating normals", Some(points.len() as u64), "points");
    let tree = KdTree::new(points);
    let found: Vec<([f64; 3], Vec<u32>)> = points
        .par_iter()
        .map(|p| {
            let around: Vec<u32> = tree.around(*p, NEIGHBOURS).iter().map(|n| n.number).collect();
            progress.advance(1);
            (plane_normal(around.iter().map(|&n| points[n as usize])), around)
        })
        .collect();
    progress.check()?;
    let (mut normals, around): (Vec<[f64; 3]>, Vec<Vec<u32>>) = found.into_iter().unzip();
    let edges = spanning_edges(&normals, &around);
    orient(points, &mut normals, &edges);
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

/// The edges of a minimum spanning forest of the graph of neighbours, the cost of an edge being how much the
/// planes at its ends differ (Kruskal 1956). Equal costs are taken in the order of the points.
fn spanning_edges(normals: &[[f64; 3]], around: &[Vec<u32>]) -> Vec<(u32, u32)> {
    let of_point = |(a, near): (usize, &Vec<u32>)| -> Vec<(u32, u32, u32)> {
        let a = a as u32;
        let cost = |b: u32| 1.0 - dot(normals[a as usize], normals[b as usize]).abs();
        // 2^-30 resolves costs better than normals are known.
        let edge = |&b: &u32| ((cost(b).max(0.0) * f64::from(1 << 30)) as u32, a.min(b), a.max(b));
        near.iter().filter(|&&b| b != a).map(edge).collect()
    };
    let mut edges: Vec<(u32, u32, u32)> = around.par_iter().enumerate().flat_map_iter(of_point).collect();
    edges.par_sort_unstable();
    edges.dedup();
    let mut parents: Vec<u32> = (0..normals.len() as u32).collect();
    let mut kept = Vec::with_capacity(normals.len());
    for (_, a, b) in edges {
        let (root_a, root_b) = (root_of(&mut parents, a), root_of(&mut parents, b));
        if root_a != root_b {
            parents[root_a.max(root_b) as usize] = root_a.min(root_b);
            kept.push((a, b));
        }
    }
    kept
}

fn root_of(parents: &mut [u32], mut v: u32) -> u32 {
    while parents[v as usize] != v {
        parents[v as usize] = parents[parents[v as usize] as usize];
        v = parents[v as usize];
    }
    v
}

/// Turns normals the same way along the edges of a forest, from each tree's topmost point, whose normal
/// points up.
fn orient(points: &[[f64; 3]], normals: &mut [[f64; 3]], edges: &[(u32, u32)]) {
    let mut starts = vec![0u32; points.len() + 1];
    edges.iter().flat_map(|&(a, b)| [a, b]).for_each(|v| starts[v as usize + 1] += 1);
    (1..starts.len()).for_each(|v| starts[v] += starts[v - 1]);
    let mut next = starts.clone();
    let mut linked = vec![0u32; 2 * edges.len()];
    for &(a, b) in edges {
        for (from, to) in [(a, b), (b, a)] {
            linked[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        }
    }
    let mut by_height: Vec<u32> = (0..points.len() as u32).collect();
    by_height.sort_by(|&a, &b| points[b as usize][2].total_cmp(&points[a as usize][2]));
    let mut done = vec![false; points.len()];
    let mut waiting = Vec::new();
    for top in by_height {
        if done[top as usize] {
            continue;
        }
        done[top as usize] = true;
        turn(&mut normals[top as usize], [0.0, 0.0, 1.0]);
        waiting.push(top);
        while let Some(v) = waiting.pop() {
            let along = normals[v as usize];
            for &to in &linked[starts[v as usize] as usize..starts[v as usize + 1] as usize] {
                if !std::mem::replace(&mut done[to as usize], true) {
                    turn(&mut normals[to as usize], along);
                    waiting.push(to);
                }
            }
        }
    }
}

/// Makes the normal point the way of `along` rather than against it.
fn turn(normal: &mut [f64; 3], along: [f64; 3]) {
    if dot(*normal, along) < 0.0 {
        *normal = normal.map(|c| -c);
    }
}
