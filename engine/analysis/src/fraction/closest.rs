//! The distance of points from a mesh, by a grid of cubes with the triangles that pass them.

use crate::contour::MeshArrays;
use crate::lattice::{dot, minus};
use std::collections::HashMap;

/// Cubes out from the one of a point in which triangles are looked for; farther ones are rare, and all are asked.
const RINGS: i32 = 12;

/// The triangles of a mesh, found by place.
pub(super) struct TriangleIndex<'a> {
    mesh: &'a MeshArrays,
    edge: f64,
    cubes: HashMap<[i32; 3], Vec<u32>>,
}

impl<'a> TriangleIndex<'a> {
    pub(super) fn new(mesh: &'a MeshArrays) -> TriangleIndex<'a> {
        let mut longest: Vec<f64> = (0..mesh.triangles.len())
            .step_by(1 + mesh.triangles.len() / 1000)
            .map(|n| extent(mesh, n))
            .collect();
        longest.sort_by(f64::total_cmp);
        let edge = longest.get(longest.len() / 2).copied().unwrap_or(1.0).max(f64::MIN_POSITIVE) * 1.5;
        let mut cubes: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for n in 0..mesh.triangles.len() {
            let [low, high] = bounds(mesh, n).map(|p| cube(p, edge));
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        cubes.entry([x, y, z]).or_default().push(n as u32);
                    }
                }
            }
        }
        TriangleIndex { mesh, edge, cubes }
    }

    /// The distance of a point from the nearest triangle; infinite of an empty mesh.
    pub(super) fn distance(&self, point: [f64; 3]) -> f64 {
        let middle = cube(point, self.edge);
        let mut nearest = f64::INFINITY;
        for ring in 0..=RINGS {
            // What lies in cubes so far out is as far away as those between.
            if nearest <= f64::from(ring - 1) * self.edge {
                return nearest;
            }
            for z in -ring..=ring {
                for y in -ring..=ring {
                    let is_side = z.abs() == ring || y.abs() == ring;
                    let step = if is_side { 1 } else { (2 * ring).max(1) as usize };
                    for x in (-ring..=ring).step_by(step) {
                        let at = [middle[0] + x, middle[1] + y, middle[2] + z];
                        let there = self.cubes.get(&at).into_iter().flatten();
                        nearest = there.map(|&n| self.from(n as usize, point)).fold(nearest, f64::min);
                    }
                }
            }
        }
        (0..self.mesh.triangles.len()).map(|n| self.from(n, point)).fold(nearest, f64::min)
    }

    fn from(&self, triangle: usize, point: [f64; 3]) -> f64 {
        let corners = self.mesh.triangles[triangle].map(|id| self.mesh.positions[id as usize].map(f64::from));
        from_triangle(corners, point)
    }
}

fn cube(point: [f64; 3], edge: f64) -> [i32; 3] {
    point.map(|c| (c / edge).floor() as i32)
}

fn bounds(mesh: &MeshArrays, triangle: usize) -> [[f64; 3]; 2] {
    let corners = mesh.triangles[triangle].map(|id| mesh.positions[id as usize].map(f64::from));
    [f64::min, f64::max].map(|f| std::array::from_fn(|a| f(f(corners[0][a], corners[1][a]), corners[2][a])))
}

fn extent(mesh: &MeshArrays, triangle: usize) -> f64 {
    let [low, high] = bounds(mesh, triangle);
    (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max)
}

/// The distance of a point from a triangle: from its plane where the foot lies in it, or else from the nearest edge.
fn from_triangle([a, b, c]: [[f64; 3]; 3], p: [f64; 3]) -> f64 {
    let normal = crate::lattice::cross(minus(b, a), minus(c, a));
    let square = dot(normal, normal);
    let sides = [(a, b), (b, c), (c, a)];
    let is_over =
        |(from, to): (_, _)| dot(crate::lattice::cross(normal, minus(to, from)), minus(p, from)) >= 0.0;
    if square > 0.0 && sides.into_iter().all(is_over) {
        return dot(normal, minus(p, a)).abs() / square.sqrt();
    }
    sides.into_iter().map(|(from, to)| from_segment(from, to, p)).fold(f64::INFINITY, f64::min)
}

fn from_segment(from: [f64; 3], to: [f64; 3], p: [f64; 3]) -> f64 {
    let along = minus(to, from);
    let length = dot(along, along);
    let t = if length > 0.0 { (dot(minus(p, from), along) / length).clamp(0.0, 1.0) } else { 0.0 };
    let apart: [f64; 3] = std::array::from_fn(|n| p[n] - from[n] - t * along[n]);
    dot(apart, apart).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_many_points_on_the_triangles() {
        let mut rng = brickfield_bench_data::Rng::new(7);
        let mut number = || rng.below(2000) as f64 / 1000.0 - 1.0;
        let positions: Vec<[f32; 3]> =
            (0..60).map(|_| std::array::from_fn(|_| 3.0 * number() as f32)).collect();
        let triangles: Vec<[u32; 3]> = (0..20).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let mesh = MeshArrays { positions, triangles };
        let found = TriangleIndex::new(&mesh);
        for _ in 0..20 {
            let p: [f64; 3] = std::array::from_fn(|_| 6.0 * number());
            let mut nearest = f64::INFINITY;
            for ids in &mesh.triangles {
                let [a, b, c] = ids.map(|id| mesh.positions[id as usize].map(f64::from));
                for i in 0..=60 {
                    for j in 0..=60 - i {
                        let (s, t) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                        let q: [f64; 3] =
                            std::array::from_fn(|n| a[n] + s * (b[n] - a[n]) + t * (c[n] - a[n]));
                        nearest = nearest.min(dot(minus(p, q), minus(p, q)).sqrt());
                    }
                }
            }
            let distance = found.distance(p);
            assert!(distance <= nearest + 1e-9 && nearest < distance + 0.1, "{distance} {nearest}");
        }
    }
}
