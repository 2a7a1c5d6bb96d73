//! Beads: a cross-section swept along a polyline.

use crate::Mesh;
use crate::trig::sin_cos;
use crate::vector::{V3, add, cross, dot, norm, scale, sub, unit};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A convex cross-section about the origin, counter-clockwise with u across and v up.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexSection(Vec<[f64; 2]>);

impl ConvexSection {
    /// `n` ≥ 3 points on an ellipse. The inscribed polygon has n/2π·sin(2π/n) of the ellipse's area.
    pub fn ellipse(n: u32, width: f64, height: f64) -> ConvexSection {
        assert!(n >= 3 && width > 0.0 && height > 0.0);
        let point = |i| {
            let (s, c) = sin_cos(TAU * (f64::from(i) + 0.5) / f64::from(n));
            [0.5 * width * c, 0.5 * height * s]
        };
        ConvexSection((0..n).map(point).collect())
    }

    /// A stadium, the usual model of a deposited bead: a rectangle between two half circles of diameter
    /// `height`, each with half of the `n` points; `n` even, at least 6, `width` > `height`.
    pub fn stadium(n: u32, width: f64, height: f64) -> ConvexSection {
        assert!(n >= 6 && n.is_multiple_of(2) && width > height && height > 0.0);
        let half = n / 2;
        let point = |i| {
            let (s, c) = sin_cos(PI * (f64::from(i) / f64::from(half - 1) - 0.5));
            [0.5 * (width - height) + 0.5 * height * c, 0.5 * height * s]
        };
        let right: Vec<[f64; 2]> = (0..half).map(point).collect();
        let left = right.iter().map(|p| [-p[0], -p[1]]);
        ConvexSection(right.iter().copied().chain(left).collect())
    }

    /// The points in order.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.0
    }

    /// Largest distance across, along u.
    pub fn width(&self) -> f64 {
        let (low, high) = self.0.iter().fold((0.0f64, 0.0f64), |(l, h), p| (l.min(p[0]), h.max(p[0])));
        high - low
    }
}

/// How a bead ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeadEnd {
    /// A flat fan of n − 2 triangles.
    Flat,
    /// That many ever smaller rings that round the end off over half the bead's width, then a fan.
    Fused(u32),
}

impl BeadEnd {
    /// Rings added at each end.
    pub fn rings(self) -> u32 {
        match self {
            BeadEnd::Flat => 0,
            BeadEnd::Fused(rings) => rings,
        }
    }

    /// (distance beyond the end in widths, scale) of ring `j`, counted outward from 1.
    fn ring(self, j: u32) -> (f64, f64) {
        let (s, c) = sin_cos(FRAC_PI_2 * f64::from(j) / f64::from(self.rings()));
        // The last ring must not shrink to a point: its vertices would weld and its fan vanish.
        (0.5 * s, c.max(0.125))
    }
}

/// Sweeps `section` along `path`, with mitred joints and both ends closed.
///
/// Each ring is the previous one carried along its segment into the plane that halves the joint's angle,
/// so every segment is a true prism of the section, and the section does not twist against the path. `up` says
/// where v points at the start; any other direction is taken if it runs along the path. With n points in the
/// section, s segments and r cap rings the bead has 2n·s + 4n·r + 2(n − 2) triangles.
///
/// # Panics
/// If the path has fewer than two points, repeats one, or turns by more than 150° at one.
pub fn sweep(path: &[[f64; 3]], section: &ConvexSection, up: [f64; 3], cap: BeadEnd) -> Mesh {
    assert!(path.len() >= 2, "a bead needs two points");
    let along: Vec<V3> = path.windows(2).map(|p| unit(sub(p[1], p[0]))).collect();
    let (first, last) = (along[0], along[along.len() - 1]);
    let mut offsets = placed(section, first, up);
    let mut rings = Rings { n: section.0.len() as u32, mesh: Mesh::default() };

    for j in (1..=cap.rings()).rev() {
        let (beyond, shrink) = cap.ring(j);
        let centre = sub(path[0], scale(first, beyond * section.width()));
        rings.push(centre, offsets.iter().map(|&o| scale(o, shrink)));
    }
    rings.push(path[0], offsets.iter().copied());
    for (joint, t) in along.windows(2).enumerate() {
        let normal = add(t[0], t[1]);
        // |t0 + t1| = 2 cos(turn/2), which the mitre divides by.
        assert!(norm(normal) > 0.517, "the path turns by more than 150° at point {}", joint + 1);
        let carry = |o: V3| sub(o, scale(t[0], dot(o, normal) / dot(t[0], normal)));
        rings.push(path[joint + 1], offsets.iter().map(|&o| carry(o)));
        offsets = offsets.iter().map(|&o| carry(o)).map(|o| sub(o, scale(t[1], dot(o, t[1])))).collect();
    }
    let end = path[path.len() - 1];
    rings.push(end, offsets.iter().copied());
    for j in 1..=cap.rings() {
        let (beyond, shrink) = cap.ring(j);
        let centre = add(end, scale(last, beyond * section.width()));
        rings.push(centre, offsets.iter().map(|&o| scale(o, shrink)));
    }
    rings.closed()
}

/// The section's points as offsets across the direction `along`.
fn placed(section: &ConvexSection, along: V3, up: V3) -> Vec<V3> {
    let mut side = cross(up, along);
    if norm(side) < 1e-6 {
        // The axis that runs least along the path.
        let axis = (0..3).min_by(|&a, &b| along[a].abs().total_cmp(&along[b].abs())).unwrap_or(0);
        let mut other = [0.0; 3];
        other[axis] = 1.0;
        side = cross(other, along);
    }
    let u = unit(side);
    let v = cross(along, u);
    section.0.iter().map(|p| add(scale(u, p[0]), scale(v, p[1]))).collect()
}

/// A tube under construction: rings of `n` vertices, each joined to the one before.
struct Rings {
    n: u32,
    mesh: Mesh,
}

impl Rings {
    fn push(&mut self, centre: V3, offsets: impl Iterator<Item = V3>) {
        let (n, base) = (self.n, self.mesh.vertices.len() as u32);
        self.mesh.vertices.extend(offsets.map(|o| add(centre, o)));
        if base == 0 {
            return;
        }
        let below = base - n;
        for i in 0..n {
            let j = (i + 1) % n;
            let [a, b, c, d] = [below + i, below + j, base + j, base + i];
            self.mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }

    fn closed(mut self) -> Mesh {
        let top = self.mesh.vertices.len() as u32 - self.n;
        for i in 1..self.n - 1 {
            self.mesh.triangles.extend([[0, i + 1, i], [top, top + i, top + i + 1]]);
        }
        self.mesh
    }
}

/// Points on the helix of `radius` about the z axis, rising by `pitch` a turn: turns·steps + 1 of them.
pub fn helix(turns: u32, steps: u32, radius: f64, pitch: f64) -> Vec<[f64; 3]> {
    let point = |i| {
        let (s, c) = sin_cos(TAU * f64::from(i) / f64::from(steps));
        [radius * c, radius * s, pitch * f64::from(i) / f64::from(steps)]
    };
    (0..=turns * steps).map(point).collect()
}

/// A round tube of `diameter` along a helix. With `pitch` < `diameter` it overlaps itself, with w = 2 (and 3 where
/// the pitch is below half of it) between the turns.
pub fn spiral_tube(turns: u32, steps: u32, radius: f64, pitch: f64, diameter: f64) -> Mesh {
    let section = ConvexSection::ellipse(16, diameter, diameter);
    sweep(&helix(turns, steps, radius, pitch), &section, [0.0, 0.0, 1.0], BeadEnd::Flat)
}
