//! The piece of surface around one crossing: its polygon, bent so that it passes all of the polygon's corners.
//!
//! The crossing and its normal are exact, and corners stand on the surface to the fourth order. The quadratic form through
//! them is the surface to the third order, and a plane where the surface is plane.

use super::boxes::{Block, block_of};
pub(super) use super::quadratic::{Crossing, Shape};
use super::quadratic::{bent, roots, slope, solved};
use super::triangle::{nearest_of_triangle, through_triangle};
use crate::lattice::{dot, frame, minus};
use bytemuck::{Pod, Zeroable};

/// Below this height of all corners over the tangent plane, in cells, a polygon is plane.
const PLANE: f64 = 1e-5;
/// How far beside its polygon a ray still meets a patch, in cells: polygons of bent patches do not quite meet.
const SLACK: f64 = 0.02;
/// A ray whose cosine with the normal is less than this passes along a surface and not through it.
const GRAZING: f64 = 0.02;
/// Steps of Newton's method.
const STEPS: usize = 4;

/// Neighbours are of one plane whose slopes and heights, in cells, are as small as this: more than rounding makes of them.
const EVEN: f64 = 1e-3;

/// The surface around a crossing; lengths in cells, places counted from the leaf's corner.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Patch {
    /// The crossing.
    pub at: [f32; 3],
    /// The unit normal there, outward.
    pub normal: [f32; 3],
    /// The quadratic form in the tangent plane: xx, xy, yy. Heights are half of it.
    pub bend: [f32; 3],
    /// Everything of the patch is within this of the crossing.
    pub radius: f32,
    /// Its corners among those of the leaf.
    pub first: u32,
    pub count: u16,
    /// See [`Patch::shape`].
    code: u16,
}

/// A point of a patch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    /// The square of its distance from what was asked about.
    pub squared: f64,
    pub at: [f64; 3],
    /// The unit normal there.
    pub normal: [f64; 3],
}

fn cross2(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn corner(ring: &[[f32; 3]], n: usize) -> [f64; 3] {
    ring[if n < ring.len() { n } else { 0 }].map(f64::from)
}

/// Whether a point is on the inner side of all edges of a polygon, as all inner points of a convex one are.
#[inline]
fn is_left_of_all(ring: &[[f32; 3]], [x, y]: [f64; 2]) -> bool {
    let Some(&[ax, ay, _]) = ring.last() else { return false };
    let (mut ax, mut ay) = (f64::from(ax), f64::from(ay));
    for &[bx, by, _] in ring {
        let (bx, by) = (f64::from(bx), f64::from(by));
        if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0 {
            return false;
        }
        (ax, ay) = (bx, by);
    }
    true
}

/// The point of a polygon around the origin that is nearest to `x`.
fn clamped(ring: &[[f32; 3]], x: [f64; 2]) -> [f64; 2] {
    if is_left_of_all(ring, x) {
        return x;
    }
    let mut best = (f64::INFINITY, x);
    for n in 0..ring.len() {
        let ([ax, ay, _], [bx, by, _]) = (corner(ring, n), corner(ring, n + 1));
        let (a, b) = ([ax, ay], [bx, by]);
        let along = [bx - ax, by - ay];
        let away = [x[0] - ax, x[1] - ay];
        if cross2(a, x) >= 0.0 && cross2(x, b) >= 0.0 && cross2(along, away) >= 0.0 {
            return x;
        }
        let length = along[0] * along[0] + along[1] * along[1];
        let t = if length > 0.0 {
            ((away[0] * along[0] + away[1] * along[1]) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let near = [ax + t * along[0], ay + t * along[1]];
        let squared = (x[0] - near[0]).powi(2) + (x[1] - near[1]).powi(2);
        if squared < best.0 {
            best = (squared, near);
        }
    }
    best.1
}

impl Patch {
    /// Around a crossing with an exact normal. `corners` are those of its polygon, counter-clockwise from outside; they are
    /// added to `ring`, in the frame of the normal. `beside` are crossings of polygons that share a corner.
    pub fn new(
        (at, normal): Crossing,
        corners: &[[f64; 3]],
        beside: &[Crossing],
        ring: &mut Vec<[f32; 3]>,
    ) -> Patch {
        let [u, v] = frame(normal);
        let first = ring.len();
        let local: Vec<[f64; 3]> =
            corners.iter().map(|c| minus(*c, at)).map(|w| [dot(w, u), dot(w, v), dot(w, normal)]).collect();
        let slopes: Vec<[f64; 5]> =
            beside.iter().filter_map(|crossing| slope((at, normal), [u, v], *crossing)).collect();
        let mut local = local;
        let is_even = |[_, _, p, q, z]: &[f64; 5]| p.abs().max(q.abs()).max(z.abs()) <= EVEN;
        if slopes.len() >= 2 && slopes.iter().all(is_even) {
            // A corner beside the plane of all crossings around is one that no cell could place.
            local.iter_mut().for_each(|c| c[2] = 0.0);
        }
        ring.extend(local.iter().map(|c| c.map(|c| c as f32)));
        let highest = local.iter().fold(0.0f64, |most, [_, _, z]| most.max(z.abs()));
        let (bend, shape) = if highest <= PLANE { ([0.0; 3], Shape::Plane) } else { bent(&local, &slopes) };
        let farthest = local.iter().map(|c| dot(*c, *c)).fold(0.0, f64::max).sqrt();
        let size = bend.iter().fold(0.0f64, |most, b| most.max(b.abs()));
        let flat = local.iter().map(|[x, y, _]| x * x + y * y).fold(0.0, f64::max);
        let rise = if shape == Shape::Bent { size * flat } else { 0.0 };
        Patch {
            at: at.map(|c| c as f32),
            normal: normal.map(|c| c as f32),
            bend: bend.map(|c| c as f32),
            radius: (farthest.max((flat + rise * rise).sqrt()) + 1e-4) as f32,
            first: first as u32,
            count: local.len() as u16,
            code: shape as u16,
        }
    }

    /// How it bends.
    pub fn shape(&self) -> Shape {
        match self.code {
            0 => Shape::Plane,
            1 => Shape::Bent,
            _ => Shape::Rough,
        }
    }

    pub fn ring<'a>(&self, rings: &'a [[f32; 3]]) -> &'a [[f32; 3]] {
        &rings[self.first as usize..self.first as usize + usize::from(self.count)]
    }

    /// Corners of the polygon, counted from the leaf's corner.
    pub fn corners<'a>(&self, rings: &'a [[f32; 3]]) -> impl Iterator<Item = [f64; 3]> + use<'a> {
        let (at, normal) = (self.at.map(f64::from), self.normal.map(f64::from));
        let [u, v] = frame(normal);
        self.ring(rings).iter().map(move |c| {
            let [x, y, z] = c.map(f64::from);
            std::array::from_fn(|a| at[a] + x * u[a] + y * v[a] + z * normal[a])
        })
    }

    /// Corners of the polygon, moved into the tangent plane if it is bent, and how far the patch may be from their hull with the
    /// crossing.
    pub fn slab<'a>(&self, rings: &'a [[f32; 3]]) -> (impl Iterator<Item = [f64; 3]> + use<'a>, f64) {
        let (at, normal) = (self.at.map(f64::from), self.normal.map(f64::from));
        let [u, v] = frame(normal);
        let is_bent = self.shape() == Shape::Bent;
        let ring = self.ring(rings);
        let corners = ring.iter().map(move |c| {
            let [x, y, z] = c.map(f64::from);
            let z = if is_bent { 0.0 } else { z };
            std::array::from_fn(|a| at[a] + x * u[a] + y * v[a] + z * normal[a])
        });
        let flat = ring.iter().map(|[x, y, _]| f64::from(x * x + y * y)).fold(0.0, f64::max);
        let [xx, xy, yy] = self.bend.map(f64::from);
        let bend = 0.5 * (xx + yy).abs() + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        (corners, if is_bent { 0.5 * bend * flat + 1e-4 } else { 1e-5 })
    }

    /// A box around all of it. Corners do not bound a saddle: between them it may stand higher than all.
    pub fn block(&self, rings: &[[f32; 3]]) -> Block {
        let (corners, margin) = self.slab(rings);
        block_of(corners.chain(std::iter::once(self.at.map(f64::from))), margin)
    }

    /// The area of the polygon.
    pub fn area(&self, rings: &[[f32; 3]]) -> f64 {
        let ring = self.ring(rings);
        let twice = |n| {
            let c = crate::lattice::cross(corner(ring, n), corner(ring, n + 1));
            dot(c, c).sqrt()
        };
        0.5 * (0..ring.len()).map(twice).sum::<f64>()
    }

    /// The size of both curvatures at the crossing together.
    pub fn bend_size(&self) -> f64 {
        let [xx, xy, yy] = self.bend.map(f64::from);
        (xx * xx + 2.0 * xy * xy + yy * yy).sqrt()
    }

    /// How far normals within the patch may be from that at the crossing: a slope is the tangent of an angle, and what unit
    /// vectors differ by is less.
    pub fn turn(&self) -> f32 {
        self.bend_size() as f32 * self.radius
    }

    fn height(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
        let [xx, xy, yy] = self.bend.map(f64::from);
        let slope = [xx * x + xy * y, xy * x + yy * y];
        (0.5 * (slope[0] * x + slope[1] * y), slope)
    }

    /// The unit normal of the quadratic form so far away from the crossing.
    pub fn normal_at(&self, away: [f64; 3]) -> [f64; 3] {
        let normal = self.normal.map(f64::from);
        if self.shape() != Shape::Bent {
            return normal;
        }
        let [u, v] = frame(normal);
        self.on_bent([dot(away, u), dot(away, v)], 0.0, ([0.0; 3], normal, u, v)).normal
    }

    /// Whether all of the patch is certainly farther than the square `within` from a place whose distance from the crossing
    /// has this square, and which is so high above the tangent plane: the quadratic form within the circle around all corners.
    #[inline]
    pub fn is_beyond(&self, square: f64, height: f64, within: f64) -> bool {
        let radius = f64::from(self.radius);
        let reach = square.sqrt() - radius;
        if self.shape() == Shape::Rough || reach > 0.0 && reach * reach > within {
            return reach > 0.0 && reach * reach > within;
        }
        let beside = (square - height * height).max(0.0).sqrt();
        // By how much the quadratic form comes nearer beside its crossing: its larger bend towards the place.
        let [xx, xy, yy] = self.bend.map(f64::from);
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let bend = 1.0 - (height * mean + height.abs() * (half * half + xy * xy).sqrt());
        let least = if bend > 0.0 && beside <= bend * radius {
            -beside * beside / bend
        } else {
            (bend * radius - 2.0 * beside) * radius
        };
        square + least > within
    }

    /// Whether the quadratic form is certainly farther than the square `within` from a place in the frame of the crossing: as
    /// far as the circle around all corners, along each of its principal directions by itself.
    pub fn bent_is_beyond(&self, [x, y]: [f64; 2], z: f64, within: f64) -> bool {
        let radius = f64::from(self.radius);
        let [xx, xy, yy] = self.bend.map(f64::from);
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let turn = (half * half + xy * xy).sqrt().max(f64::MIN_POSITIVE);
        // Squares of what the place is beside the crossing along both.
        let square = x * x + y * y;
        let first = (0.5 * (square + ((x * x - y * y) * half + 2.0 * x * y * xy) / turn)).clamp(0.0, square);
        let least = |bend: f64, square: f64| {
            let (bend, beside) = (1.0 - z * bend, square.sqrt());
            if bend > 0.0 && beside <= bend * radius {
                -square / bend
            } else {
                (bend * radius - 2.0 * beside) * radius
            }
        };
        square + z * z + least(mean + turn, first) + least(mean - turn, square - first) > within
    }

    /// The point that is nearest to `from`, if it is as near as the square `within`.
    pub fn nearest(&self, rings: &[[f32; 3]], from: [f64; 3], within: f64) -> Option<Touch> {
        let (at, normal) = (self.at.map(f64::from), self.normal.map(f64::from));
        let away = minus(from, at);
        if self.is_beyond(dot(away, away), dot(away, normal), within) {
            return None;
        }
        let [u, v] = frame(normal);
        let (x0, z0) = ([dot(away, u), dot(away, v)], dot(away, normal));
        let ring = self.ring(rings);
        let touch = match self.shape() {
            Shape::Plane => {
                let x = clamped(ring, x0);
                let squared = (x[0] - x0[0]).powi(2) + (x[1] - x0[1]).powi(2) + z0 * z0;
                let on = std::array::from_fn(|a| at[a] + x[0] * u[a] + x[1] * v[a]);
                Touch { squared, at: on, normal }
            }
            Shape::Bent if self.bent_is_beyond(x0, z0, within) => return None,
            Shape::Bent => {
                let (squared, x) = self.nearest_bent(ring, x0, z0);
                self.on_bent(x, squared, (at, normal, u, v))
            }
            Shape::Rough => nearest_rough(ring, [x0[0], x0[1], z0], (at, normal, u, v)),
        };
        (touch.squared <= within).then_some(touch)
    }

    fn on_bent(&self, x: [f64; 2], squared: f64, (at, normal, u, v): Frame) -> Touch {
        let (z, slope) = self.height(x);
        let on = std::array::from_fn(|a| at[a] + x[0] * u[a] + x[1] * v[a] + z * normal[a]);
        let over = 1.0 / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        let turned = std::array::from_fn(|a| (normal[a] - slope[0] * u[a] - slope[1] * v[a]) * over);
        Touch { squared, at: on, normal: turned }
    }

    /// The nearest of a few points of the polygon, for places at a centre of curvature or beyond it: there what is perpendicular
    /// may be farthest.
    #[cold]
    fn nearest_of_few(&self, ring: &[[f32; 3]], x0: [f64; 2], z0: f64) -> [f64; 2] {
        let squared =
            |x: &[f64; 2]| (x[0] - x0[0]).powi(2) + (x[1] - x0[1]).powi(2) + (self.height(*x).0 - z0).powi(2);
        let ends = (0..ring.len()).flat_map(|n| {
            let ([ax, ay, _], [bx, by, _]) = (corner(ring, n), corner(ring, n + 1));
            [[ax, ay], [0.5 * (ax + bx), 0.5 * (ay + by)]]
        });
        let tried = ends.flat_map(|end| [end, end.map(|c| 0.5 * c)]).chain([[0.0; 2], clamped(ring, x0)]);
        tried.min_by(|a, b| squared(a).total_cmp(&squared(b))).unwrap_or(x0)
    }

    /// Newton's method in the tangent plane, kept within the polygon.
    fn nearest_bent(&self, ring: &[[f32; 3]], x0: [f64; 2], z0: f64) -> (f64, [f64; 2]) {
        let [xx, xy, yy] = self.bend.map(f64::from);
        let cost = |x: [f64; 2], z: f64| (x[0] - x0[0]).powi(2) + (x[1] - x0[1]).powi(2) + (z - z0).powi(2);
        // Where the normals of the quadratic form pass the point, to the first order.
        let begin = solved([1.0 - z0 * xx, -z0 * xy, 1.0 - z0 * yy], x0);
        let mut x = begin.map_or_else(|| self.nearest_of_few(ring, x0, z0), |begin| clamped(ring, begin));
        let (mut z, mut slope) = self.height(x);
        let mut best = cost(x, z);
        for _ in 0..STEPS {
            let rise = z - z0;
            let g = [x[0] - x0[0] + rise * slope[0], x[1] - x0[1] + rise * slope[1]];
            let gauss = [1.0 + slope[0] * slope[0], slope[0] * slope[1], 1.0 + slope[1] * slope[1]];
            let newton = [gauss[0] + rise * xx, gauss[1] + rise * xy, gauss[2] + rise * yy];
            let Some(step) = solved(newton, g).or_else(|| solved(gauss, g)) else { break };
            let mut is_better = false;
            for part in [1.0, 0.3] {
                let y = clamped(ring, [x[0] - part * step[0], x[1] - part * step[1]]);
                let (zy, sy) = self.height(y);
                let there = cost(y, zy);
                if there < best {
                    is_better = best - there > 1e-10 * best;
                    (x, z, slope, best) = (y, zy, sy, there);
                    break;
                }
            }
            if !is_better {
                break;
            }
        }
        (best, x)
    }

    /// Where a ray from p of unit direction d meets the patch between two places along it, the first such place; with the
    /// normal there.
    pub fn met(
        &self,
        rings: &[[f32; 3]],
        (p, d): ([f64; 3], [f64; 3]),
        [least, most]: [f64; 2],
        outward: bool,
    ) -> Option<(f64, [f64; 3])> {
        let (at, normal) = (self.at.map(f64::from), self.normal.map(f64::from));
        let away = minus(p, at);
        let middle = -dot(away, d);
        let beside = dot(away, away) - middle * middle;
        let radius = f64::from(self.radius) + SLACK;
        if beside > radius * radius || middle + radius < least || middle - radius > most {
            return None;
        }
        let [u, v] = frame(normal);
        let ring = self.ring(rings);
        let (x0, z0) = ([dot(away, u), dot(away, v)], dot(away, normal));
        let (dx, dz) = ([dot(d, u), dot(d, v)], dot(d, normal));
        let is_met = |t: f64, turned: [f64; 3]| {
            let through = dot(turned, d);
            t > least && t < most && through.abs() > GRAZING && (through > 0.0) == outward
        };
        if self.shape() == Shape::Rough {
            let local = ([x0[0], x0[1], z0], [dx[0], dx[1], dz]);
            return (0..ring.len())
                .filter_map(|n| {
                    let corners = [[0.0; 3], corner(ring, n), corner(ring, n + 1)];
                    let t = through_triangle(local.0, local.1, corners)?;
                    is_met(t, normal).then_some((t, normal))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
        }
        // z0 + t·dz = (x0 + t·dx)ᵀ B (x0 + t·dx) / 2, from the middle on, where numbers are small.
        let (xm, zm) = ([x0[0] + middle * dx[0], x0[1] + middle * dx[1]], z0 + middle * dz);
        let (height, slope) = self.height(xm);
        let a = self.height(dx).0;
        let b = slope[0] * dx[0] + slope[1] * dx[1] - dz;
        let c = height - zm;
        let mut found: Option<(f64, [f64; 3])> = None;
        for step in roots(a, b, c).into_iter().flatten() {
            let t = middle + step;
            let x = [x0[0] + t * dx[0], x0[1] + t * dx[1]];
            let near = clamped(ring, x);
            let off = (x[0] - near[0]).powi(2) + (x[1] - near[1]).powi(2);
            let turned = self.on_bent(x, 0.0, (at, normal, u, v)).normal;
            if off <= SLACK * SLACK && is_met(t, turned) && found.is_none_or(|(first, _)| t < first) {
                found = Some((t, turned));
            }
        }
        found
    }
}

/// Place, normal, and two vectors across it.
type Frame = ([f64; 3], [f64; 3], [f64; 3], [f64; 3]);

fn nearest_rough(ring: &[[f32; 3]], from: [f64; 3], frame: Frame) -> Touch {
    let (at, normal, u, v) = frame;
    let mut best = (f64::INFINITY, [0.0; 3]);
    for n in 0..ring.len() {
        let corners = [[0.0; 3], corner(ring, n), corner(ring, n + 1)];
        let near = nearest_of_triangle(from, corners);
        let away = minus(from, near);
        let squared = dot(away, away);
        if squared < best.0 {
            best = (squared, near);
        }
    }
    let (squared, [x, y, z]) = best;
    let on = std::array::from_fn(|a| at[a] + x * u[a] + y * v[a] + z * normal[a]);
    // Where corners could not be placed, normals of triangles tell less than that of the crossing.
    Touch { squared, at: on, normal }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(v: [f64; 3]) -> [f64; 3] {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    }

    /// A patch of a ball about the origin, whose corners are about a cell apart.
    fn of_ball(radius: f64, normal: [f64; 3]) -> (Patch, Vec<[f32; 3]>) {
        let normal = unit(normal);
        let [u, v] = frame(normal);
        let around = [[-0.4, -0.5], [0.6, -0.5], [0.5, 0.6], [-0.5, 0.4]];
        let corners = around.map(|[x, y]: [f64; 2]| {
            let w: [f64; 3] = std::array::from_fn(|a| radius * normal[a] + x * u[a] + y * v[a]);
            unit(w).map(|c| c * radius)
        });
        let mut ring = Vec::new();
        let patch = Patch::new((normal.map(|c| c * radius), normal), &corners, &[], &mut ring);
        (patch, ring)
    }

    #[test]
    fn boxes_hold_all_of_saddles_and_bowls() {
        let (normal, at) = ([0.0, 0.0, 1.0], [5.0, 6.0, 7.0]);
        let [u, v] = frame(normal);
        let place = |[x, y, z]: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|a| at[a] + x * u[a] + y * v[a] + z * normal[a])
        };
        let mut bent = 0;
        for (n, [xx, xy, yy]) in [[0.3, 0.01, -0.3], [0.3, 0.1, 0.2], [0.4, 0.0, -0.39], [-0.2, 0.2, 0.1]]
            .into_iter()
            .flat_map(|bend| (0..16).map(move |n| (n, bend)))
        {
            let height = |[x, y]: [f64; 2]| 0.5 * (xx * x * x + yy * y * y) + xy * x * y;
            let corners: Vec<[f64; 3]> = (0..4)
                .map(|c| {
                    let turn = (f64::from(c) + f64::from(n) / 16.0) * std::f64::consts::FRAC_PI_2;
                    let flat = [0.7 * turn.cos(), 0.7 * turn.sin()];
                    place([flat[0], flat[1], height(flat)])
                })
                .collect();
            let mut ring = Vec::new();
            // Corners on two lines leave open what crossings around tell.
            let beside = [[0.9, 0.1], [-0.2, 0.8], [-0.7, -0.3], [0.3, -0.9]].map(|[x, y]: [f64; 2]| {
                let turned = unit([-(xx * x + xy * y), -(xy * x + yy * y), 1.0]);
                (place([x, y, height([x, y])]), turned)
            });
            let patch = Patch::new((at, normal), &corners, &beside, &mut ring);
            bent += u32::from(patch.shape() == Shape::Bent);
            let [low, high] = patch.block(&ring);
            for (i, j) in (0..=8).flat_map(|i| (0..=8).map(move |j| (i, j))) {
                // A place of the polygon, by its corners.
                let (s, t) = (f64::from(i) / 8.0, f64::from(j) / 8.0);
                let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
                let flat = [0, 1].map(|a| (0..4).map(|c| weights[c] * f64::from(ring[c][a])).sum::<f64>());
                let on = place([flat[0], flat[1], patch.height(flat).0]);
                assert!((0..3).all(|a| f64::from(low[a]) <= on[a] && on[a] <= f64::from(high[a])), "{on:?}");
            }
        }
        assert!(bent > 50, "{bent}");
    }

    #[test]
    fn a_patch_of_a_ball_is_the_ball() {
        for radius in [2.5, 4.0, 10.0, 100.0] {
            let (patch, ring) = of_ball(radius, [0.3, -0.5, 0.8]);
            assert_eq!(patch.shape(), Shape::Bent);
            let tolerance = 0.1 / radius.powi(3);
            for away in [-0.5 * radius, -0.1, 0.0, 0.2, 3.0] {
                let (n, [u, v]) = (unit([0.3, -0.5, 0.8]), frame(unit([0.3, -0.5, 0.8])));
                let q = unit(std::array::from_fn(|a| radius * n[a] + 0.2 * u[a] - 0.3 * v[a]))
                    .map(|c| c * (radius + away));
                let touch = patch.nearest(&ring, q, f64::INFINITY).unwrap();
                assert!((touch.squared.sqrt() - away.abs()).abs() < tolerance + 1e-5, "{radius} {away}");
                let radial = unit(touch.at);
                assert!((dot(touch.at, touch.at).sqrt() - radius).abs() < tolerance + 1e-5);
                assert!(dot(radial, touch.normal) > 1.0 - 0.02 / radius.powi(2), "{radius} {away}");
            }
            let towards = patch.normal.map(|c| -f64::from(c));
            let from = patch.normal.map(|c| f64::from(c) * (radius + 3.0));
            let met = patch.met(&ring, (from, towards), [0.0, 10.0], false).unwrap();
            assert!((met.0 - 3.0).abs() < 1e-5);
            assert!(patch.met(&ring, (from, towards), [0.0, 10.0], true).is_none());
        }
    }

    #[test]
    fn beyond_centres_of_curvature_the_nearest_point_is_found() {
        let ring: Vec<[f32; 3]> =
            vec![[-0.5, -0.6, 0.0], [0.6, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.6, 0.5, 0.0]];
        let mut worst = 0.0f64;
        for n in 0..2000u64 {
            let random = |a: u64| crate::lattice::mix(8 * n + a) as f64 / u64::MAX as f64 - 0.5;
            let bend = [0, 1, 2].map(|a| (1.2 * random(a)) as f32);
            let (at, normal) = ([0.0; 3], [0.0, 0.0, 1.0]);
            let patch = Patch { at, normal, bend, radius: 1.5, first: 0, count: 4, code: 1 };
            let from = [3, 4, 5].map(|a| 6.0 * random(a));
            let [xx, xy, yy] = bend.map(|b| f64::from(b) * from[2]);
            if solved([1.0 - xx, -xy, 1.0 - yy], [0.0; 2]).is_some() {
                continue;
            }
            let touch = patch.nearest(&ring, from, f64::INFINITY).unwrap();
            let mut least = f64::INFINITY;
            for (i, j) in (0..=60).flat_map(|i| (0..=60).map(move |j| (i, j))) {
                let x = [i, j].map(|c| f64::from(c - 30) / 45.0);
                if is_left_of_all(&ring, x) {
                    let z = patch.height(x).0;
                    least = least
                        .min((x[0] - from[0]).powi(2) + (x[1] - from[1]).powi(2) + (z - from[2]).powi(2));
                }
            }
            worst = worst.max(touch.squared.sqrt() - least.sqrt());
        }
        assert!(worst < 0.15, "{worst}");
    }

    #[test]
    fn a_plane_is_exact_and_ends_at_its_polygon() {
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        let mut ring = Vec::new();
        let patch = Patch::new(([0.25, 0.0, 0.0], [0.0, 0.0, 1.0]), &corners, &[], &mut ring);
        assert_eq!(patch.shape(), Shape::Plane);
        assert!((patch.area(&ring) - 4.0).abs() < 1e-6);
        let touch = patch.nearest(&ring, [0.5, -0.75, 3.0], f64::INFINITY).unwrap();
        assert_eq!((touch.squared, touch.at), (9.0, [0.5, -0.75, 0.0]));
        let touch = patch.nearest(&ring, [4.0, 0.0, -4.0], f64::INFINITY).unwrap();
        assert_eq!((touch.squared, touch.at), (25.0, [1.0, 0.0, 0.0]));
        assert!(patch.nearest(&ring, [4.0, 0.0, -4.0], 24.0).is_none());
    }

    #[test]
    fn corners_that_no_quadratic_form_passes_are_taken_as_they_are() {
        let corners = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.2], [-0.5, 0.5, 0.0]];
        let mut ring = Vec::new();
        let patch = Patch::new(([0.0; 3], [0.0, 0.0, 1.0]), &corners, &[], &mut ring);
        assert_eq!(patch.shape(), Shape::Rough);
        let touch = patch.nearest(&ring, [0.5, 0.5, 0.3], f64::INFINITY).unwrap();
        assert!((touch.squared.sqrt() - 0.1).abs() < 0.02);
    }
}
