//! Prisms over simple polygons.

use crate::Mesh;
use crate::trig::sin_cos;
use std::f64::consts::TAU;

/// A simple polygon, counter-clockwise, without repeated points.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon(
    /// Corners in order.
    pub Vec<[f64; 2]>,
);

impl Polygon {
    /// Regular with `n` ≥ 3 corners, the first on the x axis.
    pub fn regular(n: u32, radius: f64) -> Polygon {
        assert!(n >= 3);
        let corner = |i| {
            let (s, c) = sin_cos(TAU * f64::from(i) / f64::from(n));
            [radius * c, radius * s]
        };
        Polygon((0..n).map(corner).collect())
    }

    /// The square standing on a corner, |x| + |y| = `radius`: all sides at 45°.
    pub fn diamond(radius: f64) -> Polygon {
        Polygon(vec![[radius, 0.0], [0.0, radius], [-radius, 0.0], [0.0, -radius]])
    }

    /// An L: the square 0..`size` less its upper right part from `arm` on.
    pub fn ell(size: f64, arm: f64) -> Polygon {
        assert!(0.0 < arm && arm < size);
        Polygon(vec![[0.0, 0.0], [size, 0.0], [size, arm], [arm, arm], [arm, size], [0.0, size]])
    }

    /// A U: the square 0..`size` with a slot of width `size` − 2·`arm` from the top down to `arm`.
    pub fn slotted(size: f64, arm: f64) -> Polygon {
        assert!(0.0 < arm && 2.0 * arm < size);
        let r = size - arm;
        let points = [[0.0, 0.0], [size, 0.0], [size, size], [r, size], [r, arm], [arm, arm]];
        Polygon(points.into_iter().chain([[arm, size], [0.0, size]]).collect())
    }

    /// A toothed rack: the rectangle 0..(2·`teeth`+1)·`pitch` by 0..2·`pitch` with `teeth` square
    /// gaps in its upper side. Every side is parallel to an axis and many lie in common planes.
    pub fn rack(teeth: u32, pitch: f64) -> Polygon {
        let width = f64::from(2 * teeth + 1) * pitch;
        let mut points = vec![[0.0, 0.0], [width, 0.0]];
        for step in (0..=2 * teeth).rev() {
            let y = if step % 2 == 0 { 2.0 * pitch } else { pitch };
            points.push([f64::from(step + 1) * pitch, y]);
            points.push([f64::from(step) * pitch, y]);
        }
        Polygon(points)
    }

    /// A gear whose teeth are squares: the square 0..8·`pitch` with two square gaps in each side. Every side is
    /// parallel to an axis, so with an integer pitch every face of the prism is a lattice plane.
    pub fn gear(pitch: f64) -> Polygon {
        // One side walked in units of the pitch; the other three are its quarter turns about (4, 4).
        let side = [[0, 0], [2, 0], [2, 1], [3, 1], [3, 0], [5, 0], [5, 1], [6, 1], [6, 0]];
        let mut points = Vec::with_capacity(36);
        for turn in 0..4 {
            for [mut x, mut y] in side {
                for _ in 0..turn {
                    (x, y) = (8 - y, x);
                }
                points.push([f64::from(x) * pitch, f64::from(y) * pitch]);
            }
        }
        Polygon(points)
    }

    /// A star with `points` ≥ 3 spikes.
    pub fn star(points: u32, inner: f64, outer: f64) -> Polygon {
        let mut polygon = Polygon::regular(2 * points, outer);
        for corner in polygon.0.iter_mut().skip(1).step_by(2) {
            *corner = corner.map(|c| c * (inner / outer));
        }
        polygon
    }

    /// Enclosed area, positive for counter-clockwise order.
    pub fn area(&self) -> f64 {
        let p = &self.0;
        (0..p.len()).map(|i| 0.5 * turn([0.0; 2], p[i], p[(i + 1) % p.len()])).sum()
    }

    /// Ear clipping (Meisters 1975). Corners in the middle of a straight side are kept, so that walls and
    /// lids of a prism share every vertex.
    pub(crate) fn triangulated(&self) -> Vec<[u32; 3]> {
        let mut left: Vec<u32> = (0..self.0.len() as u32).collect();
        let mut triangles = Vec::with_capacity(left.len());
        while left.len() > 3 {
            let n = left.len();
            let ear =
                (0..n).find(|&i| self.is_ear(&left, [left[(i + n - 1) % n], left[i], left[(i + 1) % n]]));
            let i = ear.expect("a simple counter-clockwise polygon has an ear");
            triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
            left.remove(i);
        }
        triangles.push([left[0], left[1], left[2]]);
        triangles
    }

    fn is_ear(&self, left: &[u32], corner: [u32; 3]) -> bool {
        let [a, b, c] = corner.map(|i| self.0[i as usize]);
        let covers = |p| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
        turn(a, b, c) > 0.0 && !left.iter().any(|i| !corner.contains(i) && covers(self.0[*i as usize]))
    }
}

/// Twice the signed area of a, b, c.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The prism over `polygon` between heights `low` and `high`: 4·n − 4 triangles.
///
/// # Panics
/// If `low` ≥ `high` or the polygon is not simple and counter-clockwise.
pub fn extrude(polygon: &Polygon, low: f64, high: f64) -> Mesh {
    assert!(low < high, "an empty prism has no outside: {low} to {high}");
    let n = polygon.0.len() as u32;
    let at = |z: f64| polygon.0.iter().map(move |p| [p[0], p[1], z]);
    let mut triangles = Vec::with_capacity(4 * n as usize);
    for [a, b, c] in polygon.triangulated() {
        triangles.extend([[a, c, b], [n + a, n + b, n + c]]);
    }
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    Mesh { vertices: at(low).chain(at(high)).collect(), triangles }
}
