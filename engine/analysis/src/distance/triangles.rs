//! The triangles of a mesh, found by place: exact distances, and signs by winding numbers.

use super::boxes::{Boxes, Lanes, Normals, Probe, Question, WIDE, block_of, reciprocals};
use super::patch::nearest_of_triangle;
use crate::error::{Error, Result};
use crate::lattice::{cross, dot, minus, mix, morton};
use crate::progress::Progress;
use crate::soup::{Facets, runs};

/// Triangles in a run of boxes.
const RUN: usize = 4;
/// Feet that are as near as this part of their squares are equally near: of an edge, found from its two sides.
const TIE: f64 = 1e-9;
/// A ray that passes so near to an edge, in parts of the triangle, asks another one.
const EDGE: f64 = 1e-9;
/// Directions of rays, none along anything that people draw.
const RAYS: [[f64; 3]; 6] = [
    [0.577_129, 0.577_811, 0.577_110],
    [-0.812_371, 0.331_907, 0.479_521],
    [0.253_117, -0.911_373, 0.324_571],
    [0.118_733, 0.421_319, -0.899_107],
    [-0.699_113, -0.573_901, 0.426_637],
    [0.911_741, -0.201_833, -0.357_719],
];

/// All triangles with area of a mesh, with positions of 32 bits as in mesh files: 60 bytes each.
pub struct Triangles {
    corners: Vec<[[f32; 3]; 3]>,
    boxes: Boxes,
    is_closed: bool,
}

/// The nearest point of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Where it is.
    pub at: [f64; 3],
    /// The unit normal of its triangle.
    pub normal: [f64; 3],
    /// How far it is.
    pub distance: f64,
}

impl Triangles {
    /// Of some sources together.
    ///
    /// # Errors
    /// If there are no triangles; [`Error::Interrupted`].
    pub fn new(sources: &[&dyn Facets], progress: &dyn Progress) -> Result<Triangles> {
        let total = sources.iter().map(|source| source.facets()).sum();
        progress.phase("reading the reference", Some(total), "facets");
        let mut corners: Vec<[[f32; 3]; 3]> = Vec::new();
        let (mut read, mut balance) = (Vec::new(), 0u64);
        for (source, range) in runs(sources) {
            progress.check()?;
            sources[source].read(range, &mut read);
            progress.advance(read.len() as u64);
            for facet in &read {
                let facet = facet.map(|c| c.map(|c| c as f32));
                for n in 0..3 {
                    balance = balance.wrapping_add(directed(facet[n], facet[(n + 1) % 3]));
                }
                if area_normal(&facet).is_some() {
                    corners.push(facet);
                }
            }
        }
        if corners.is_empty() {
            return Err(Error::setting("the reference has no triangle with area", "give a mesh of the part"));
        }
        let whole = block_of(corners.iter().flatten().map(|c| c.map(f64::from)), 0.0);
        let size = (0..3).map(|a| whole[1][a] - whole[0][a]).fold(f32::MIN_POSITIVE, f32::max);
        let place = |facet: &[[f32; 3]; 3]| {
            morton(std::array::from_fn(|a| {
                let middle = (facet[0][a] + facet[1][a] + facet[2][a]) / 3.0;
                (((middle - whole[0][a]) / size).clamp(0.0, 1.0) * 2_097_151.0) as u32
            }))
        };
        corners.sort_by_cached_key(place);
        let block = |facet: &[[f32; 3]; 3]| block_of(facet.iter().map(|c| c.map(f64::from)), 0.0);
        let boxes = Boxes::new(corners.iter().map(block), RUN);
        Ok(Triangles { corners, boxes, is_closed: balance == 0 })
    }

    /// Whether every edge has as many triangles on one side as on the other.
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// The box around all.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        self.boxes.whole().map(|end| end.map(f64::from))
    }

    /// The nearest point, of several triangles at an edge that of the one that sees the place best.
    pub fn nearest(&self, from: [f64; 3]) -> Nearest {
        let none = Nearest { at: [0.0; 3], normal: [0.0; 3], distance: f64::INFINITY };
        let probe = Probe::new(from, self.boxes.size());
        let mut near = NearestOf {
            corners: &self.corners,
            from,
            probe,
            within: f64::INFINITY,
            aligned: -1.0,
            best: none,
        };
        let found = self.boxes.search(&mut near);
        debug_assert!(found.is_ok());
        near.best
    }

    /// The distance from the mesh, below 0 inside: where w ≥ 1 of a closed one, else behind the nearest triangle. With the
    /// nearest point.
    pub fn signed(&self, from: [f64; 3]) -> (f64, Nearest) {
        let nearest = self.nearest(from);
        let behind = || dot(minus(from, nearest.at), nearest.normal) < 0.0;
        let winding =
            if self.is_closed { RAYS.iter().find_map(|ray| self.winding(from, *ray)) } else { None };
        let inside = winding.map_or_else(behind, |w| w >= 1);
        (if inside { -nearest.distance } else { nearest.distance }, nearest)
    }

    /// The winding number by the triangles that a ray passes; `None` if it passes an edge.
    fn winding(&self, from: [f64; 3], toward: [f64; 3]) -> Option<i32> {
        let probe = Probe::new(from, self.boxes.size());
        let over = reciprocals(toward);
        let mut passed = Passed { corners: &self.corners, from, toward, probe, over, count: Some(0) };
        let found = self.boxes.search(&mut passed);
        debug_assert!(found.is_ok());
        passed.count
    }

    /// Points of the mesh: corners of triangles, and points spread evenly by area, at most so many of each.
    pub fn samples(&self, most: usize) -> Vec<[f64; 3]> {
        let step = self.corners.len().div_ceil(most).max(1);
        let mut points: Vec<[f64; 3]> =
            self.corners.iter().step_by(step).map(|facet| facet[0].map(f64::from)).collect();
        let areas: Vec<f64> = self.corners.iter().map(area).collect();
        let total: f64 = areas.iter().sum();
        let count = most.min(self.corners.len().max(20_000));
        let mut passed = 0.0;
        let mut next = 0usize;
        for (facet, area) in self.corners.iter().zip(areas) {
            passed += area;
            while next < count && (next as f64 + 0.5) * total <= passed * count as f64 {
                // Numbers that look random, the same for every run.
                let bits = mix((next as u64).wrapping_mul(crate::lattice::GOLDEN));
                let (mut s, mut t) =
                    ((bits >> 32) as f64 / 4_294_967_296.0, (bits & 0xffff_ffff) as f64 / 4_294_967_296.0);
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                let [a, b, c] = facet.map(|c| c.map(f64::from));
                points.push(std::array::from_fn(|n| a[n] + s * (b[n] - a[n]) + t * (c[n] - a[n])));
                next += 1;
            }
        }
        points
    }
}

/// The nearest point of triangles.
struct NearestOf<'a> {
    corners: &'a [[[f32; 3]; 3]],
    from: [f64; 3],
    probe: Probe,
    /// The square of the least distance.
    within: f64,
    /// How well the best one sees the place: the cosine between its normal and the way to the place.
    aligned: f64,
    best: Nearest,
}

impl Question for NearestOf<'_> {
    #[inline]
    fn nearness(&self, boxes: &Lanes, _: Option<&Normals>) -> [f32; WIDE] {
        boxes.squared_from(&self.probe, ((self.within * (1.0 + TIE)) as f32).next_up())
    }

    #[inline]
    fn counts(&self, nearness: f32) -> bool {
        f64::from(nearness) <= self.within * (1.0 + TIE)
    }

    fn visit(&mut self, thing: usize) -> Result<()> {
        let at = nearest_of_triangle(self.from, self.corners[thing].map(|c| c.map(f64::from)));
        let away = minus(self.from, at);
        let squared = dot(away, away);
        if squared > self.within * (1.0 + TIE) {
            return Ok(());
        }
        let Some(normal) = area_normal(&self.corners[thing]) else { return Ok(()) };
        let distance = squared.sqrt();
        let aligned = dot(away, normal).abs() / distance.max(f64::MIN_POSITIVE);
        if squared < self.within * (1.0 - TIE) || aligned > self.aligned {
            (self.aligned, self.best) = (aligned, Nearest { at, normal, distance });
        }
        self.within = self.within.min(squared);
        Ok(())
    }
}

/// The winding number by the triangles that a ray passes; `None` if it passes an edge.
struct Passed<'a> {
    corners: &'a [[[f32; 3]; 3]],
    from: [f64; 3],
    toward: [f64; 3],
    probe: Probe,
    over: [f32; 3],
    count: Option<i32>,
}

impl Question for Passed<'_> {
    #[inline]
    fn nearness(&self, boxes: &Lanes, _: Option<&Normals>) -> [f32; WIDE] {
        boxes.entered(&self.probe, self.over, f32::INFINITY)
    }

    #[inline]
    fn counts(&self, _: f32) -> bool {
        self.count.is_some()
    }

    fn visit(&mut self, thing: usize) -> Result<()> {
        let corners = self.corners[thing].map(|c| c.map(f64::from));
        self.count = self.count.and_then(|w| Some(w + passed(self.from, self.toward, corners)?));
        Ok(())
    }
}

/// What a triangle adds to the winding number; `None` if the ray passes one of its edges or along it.
fn passed(from: [f64; 3], toward: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Option<i32> {
    let (ab, ac) = (minus(b, a), minus(c, a));
    let q = cross(toward, ac);
    let turn = dot(ab, q);
    let size = (dot(ab, ab) * dot(ac, ac)).sqrt();
    let away = minus(from, a);
    if turn.abs() <= 1e-12 * size {
        // Nearly along the plane: of no matter unless it is in it.
        let normal = cross(ab, ac);
        let off = dot(normal, away).abs();
        return (off > 1e-9 * size * dot(away, away).sqrt().max(size.sqrt())).then_some(0);
    }
    let u = dot(away, q) / turn;
    let r = cross(away, ab);
    let v = dot(toward, r) / turn;
    let least = u.min(v).min(1.0 - u - v);
    let along = dot(ac, r) / turn;
    if least < -EDGE || along < 0.0 {
        return Some(0);
    }
    if least < EDGE {
        return None;
    }
    // Out of the part through a face that is seen from behind.
    Some(if turn < 0.0 { 1 } else { -1 })
}

fn area_normal(facet: &[[f32; 3]; 3]) -> Option<[f64; 3]> {
    let [a, b, c] = facet.map(|c| c.map(f64::from));
    let normal = cross(minus(b, a), minus(c, a));
    let length = dot(normal, normal).sqrt();
    (length > 0.0 && length.is_finite()).then(|| normal.map(|c| c / length))
}

fn area(facet: &[[f32; 3]; 3]) -> f64 {
    let [a, b, c] = facet.map(|c| c.map(f64::from));
    let normal = cross(minus(b, a), minus(c, a));
    0.5 * dot(normal, normal).sqrt()
}

/// A number for an edge in a direction, which its opposite takes away again.
fn directed(from: [f32; 3], to: [f32; 3]) -> u64 {
    // Both zeros are one place.
    let name = |p: [f32; 3]| p.map(|c| u64::from((c + 0.0).to_bits()));
    let hash = |p: [u64; 3]| {
        p.into_iter().fold(0, |hash: u64, c| mix(hash ^ c.wrapping_add(crate::lattice::GOLDEN)))
    };
    let (a, b) = (name(from), name(to));
    if a <= b {
        mix(hash(a) ^ hash(b).rotate_left(17))
    } else {
        mix(hash(b) ^ hash(a).rotate_left(17)).wrapping_neg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn cube(at: f64, size: f64) -> Vec<[[f64; 3]; 3]> {
        let corner = |n: usize| [0, 1, 2].map(|a| at + size * (n >> a & 1) as f64);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|t| t.map(corner)).collect()
    }

    #[test]
    fn distances_of_overlapping_cubes_have_signs_of_their_union() {
        let mut facets = cube(0.0, 2.0);
        facets.extend(cube(1.0, 2.0));
        let triangles = Triangles::new(&[&facets], &Silent).unwrap();
        assert!(triangles.is_closed());
        for (p, expected) in [
            ([-1.0, 1.0, 1.0], 1.0),
            ([0.5, 0.5, 0.25], -0.25),
            ([4.0, 2.0, 2.5], 1.0),
            ([1.5, 1.5, 1.25], -0.25),
            ([3.5, 3.5, 3.5], 0.75f64.sqrt()),
        ] {
            assert!((triangles.signed(p).0 - expected).abs() < 1e-9, "{p:?} {:?}", triangles.signed(p));
        }
        facets.pop();
        assert!(!Triangles::new(&[&facets], &Silent).unwrap().is_closed());
    }

    #[test]
    fn samples_are_spread_by_area() {
        let triangles = Triangles::new(&[&cube(0.0, 2.0)], &Silent).unwrap();
        let samples = triangles.samples(3000);
        let above = samples.iter().filter(|p| p[2] == 2.0).count();
        assert!((480..540).contains(&above), "{above}");
    }
}
