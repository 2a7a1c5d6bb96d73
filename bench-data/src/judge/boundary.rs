//! The boundary of the union of a closed soup: where its facets separate w < 0.5 from w ≥ 0.5.
//!
//! A point of a facet lies on the boundary if exactly one of the points a little above and below it is inside, by
//! winding numbers. Parts of facets inside of other pieces do not.

use crate::judge::tree::{BoxCorners, Bvh, BvhNode, bounds_of, corners, normal};
use crate::vector::{V3, add, dot, norm, scale, sub, unit};
use crate::{Rng, StlFacet};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// How far points above and below a facet are from it, in longest sides of the soup: four units of a lattice of 2^24 over
/// a cube around it, to which an input may be rounded. So pieces that touch are one, whatever rounding leaves between.
const NUDGE: f64 = 1e-6 / 4.0;
/// A part of a facet is not divided any more when this is less than what it is away, or less than the resolution.
const RELATIVE: f64 = 0.1;

/// The union of a closed soup.
pub struct Union {
    tree: Bvh,
    nudge: f64,
}

/// A point of the boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where it is.
    pub at: [f64; 3],
    /// The facet's unit normal, as the soup has it.
    pub normal: [f64; 3],
}

/// The nearest point of the boundary, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// The distance; at most a tenth of it, or the resolution, too large, and never too small.
    pub distance: f64,
    /// The point.
    pub point: SurfacePoint,
}

impl Union {
    /// The union of a soup, which must be closed: each directed edge has its opposite.
    pub fn new(soup: Vec<StlFacet>) -> Union {
        let [low, high] = bounds_of(&soup).map(|corner| corner.map(f64::from));
        let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        Union { tree: Bvh::new(soup), nudge: NUDGE * longest }
    }

    /// Lower and upper corner of the soup; infinite and inverted if no facet has an area.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        bounds_of(self.tree.facets()).map(|corner| corner.map(f64::from))
    }

    /// How far points on the two sides of the boundary are from it.
    pub fn nudge(&self) -> f64 {
        self.nudge
    }

    pub(crate) fn tree(&self) -> &Bvh {
        &self.tree
    }

    /// Whether w ≥ 0.5 at a point on none of the facets.
    pub fn is_inside(&self, p: [f64; 3]) -> bool {
        self.are_inside([p]) == [true]
    }

    /// The same at points close to each other.
    pub(crate) fn are_inside<const N: usize>(&self, points: [V3; N]) -> [bool; N] {
        self.tree.windings(points).map(|w| w > 0)
    }

    /// Whether a point of a facet lies on the boundary.
    pub fn is_boundary(&self, point: &SurfacePoint) -> bool {
        let [above, below] =
            self.are_inside([self.nudge, -self.nudge].map(|s| add(point.at, scale(point.normal, s))));
        above != below
    }

    /// Whether a wall or a gap at a point of the boundary is thinner than `thickness`: whether along the normal the inside
    /// or the outside ends sooner, looked at in eight places.
    pub fn is_thin(&self, point: &SurfacePoint, thickness: f64) -> bool {
        let sides = |s: f64| self.are_inside([s, -s].map(|s| add(point.at, scale(point.normal, s))));
        let near = sides(self.nudge);
        (1..=8).any(|n| sides(0.125 * f64::from(n) * thickness) != near)
    }

    /// Those of `candidates` points, spread evenly over the area of all facets, that lie on the boundary.
    pub fn samples(&self, candidates: u64, seed: u64) -> Vec<SurfacePoint> {
        let area = |facet: &StlFacet| norm(normal(&corners(facet)));
        let total: f64 = self.tree.facets().iter().map(area).sum();
        let (step, mut rng) = (total / candidates as f64, Rng::new(seed));
        let (mut passed, mut next, mut points) = (0.0, rng.range(0.0, 1.0) * step, Vec::new());
        for facet in self.tree.facets() {
            passed += area(facet);
            while next < passed {
                let facet = corners(facet);
                points.push(SurfacePoint { at: anywhere(&facet, &mut rng), normal: unit(normal(&facet)) });
                next += step;
            }
        }
        points.into_par_iter().filter(|point| self.is_boundary(point)).collect()
    }

    /// The point of the boundary that is nearest to `p`; none if there is no boundary.
    ///
    /// Best first over boxes, facets, and parts of facets: where the nearest point of a facet is buried in other pieces,
    /// the facet is divided until the parts that others cut are no larger than `resolution` or a tenth of the distance.
    pub fn nearest(&self, p: [f64; 3], resolution: f64) -> Option<NearestPoint> {
        let mut queue = BinaryHeap::new();
        queue.extend(self.tree.root().map(|node| Entry::node(self.tree.bounds(node), node, p)));
        while let Some(Entry { square, item }) = queue.pop() {
            let part = match item {
                Item::Node(node) => {
                    match self.tree.open(node) {
                        Ok(halves) => {
                            queue.extend(halves.map(|half| Entry::node(self.tree.bounds(half), half, p)));
                        }
                        Err(leaf) => queue.extend(leaf.map(|n| self.whole(n, p))),
                    }
                    continue;
                }
                Item::Part(part) => part,
            };
            let facet = corners(&self.tree.facets()[part.facet]);
            let distance = square.sqrt();
            let known = part.buried.is_some_and(|q| norm(sub(q, part.nearest)) < 0.1 * self.nudge);
            if !known {
                let point = SurfacePoint { at: part.nearest, normal: unit(normal(&facet)) };
                if self.is_boundary(&SurfacePoint { at: self.off_the_edge(&facet, part.nearest), ..point }) {
                    return Some(NearestPoint { distance, point });
                }
            }
            // What it is a part of was cut, if that has the same nearest point.
            if part.diameter() > resolution.max(RELATIVE * distance) && (known || self.is_cut(&part)) {
                queue.extend(part.quarters().map(|corners| {
                    let nearest = nearest_of(&corners, p);
                    Entry::part(Part { facet: part.facet, corners, nearest, buried: Some(part.nearest) }, p)
                }));
            }
        }
        None
    }

    fn whole(&self, facet: usize, p: V3) -> Entry {
        let corners = corners(&self.tree.facets()[facet]);
        Entry::part(Part { facet, corners, nearest: nearest_of(&corners, p), buried: None }, p)
    }

    /// Whether other facets pass through a part of a facet or lie in its plane, else it is buried as a whole or not at all.
    fn is_cut(&self, part: &Part) -> bool {
        let facets = self.tree.facets();
        let own = &facets[part.facet];
        let plane = unit(normal(&corners(own)));
        let mut is_cut = false;
        let bounds = |pick: fn(f64, f64) -> f64, off: f64| -> [f32; 3] {
            std::array::from_fn(|k| {
                let [a, b, c] = part.corners.map(|v| v[k]);
                (pick(pick(a, b), c) + off) as f32
            })
        };
        // The nudge is more than what rounding takes.
        self.tree.meeting(&[bounds(f64::min, -self.nudge), bounds(f64::max, self.nudge)], |n| {
            if n != part.facet && facets[n].iter().filter(|corner| own.contains(corner)).count() < 2 {
                let heights = corners(&facets[n]).map(|v| dot(plane, sub(v, part.corners[0])));
                is_cut |= heights.iter().any(|&h| h < self.nudge) && heights.iter().any(|&h| h > -self.nudge);
            }
        });
        is_cut
    }

    /// A point of a facet a little farther from its edges: on an edge the point below it would lie on the next facet.
    fn off_the_edge(&self, [a, b, c]: &[V3; 3], q: V3) -> V3 {
        let inward = sub(scale(add(add(*a, *b), *c), 1.0 / 3.0), q);
        let length = norm(inward);
        if length > 4.0 * self.nudge {
            add(q, scale(inward, 4.0 * self.nudge / length))
        } else {
            add(q, inward)
        }
    }
}

/// A point anywhere on a triangle.
pub(crate) fn anywhere([a, b, c]: &[V3; 3], rng: &mut Rng) -> V3 {
    let (mut s, mut t) = (rng.range(0.0, 1.0), rng.range(0.0, 1.0));
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    add(*a, add(scale(sub(*b, *a), s), scale(sub(*c, *a), t)))
}

/// The point of a triangle nearest to `p` (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5).
pub(crate) fn nearest_of(&[a, b, c]: &[V3; 3], p: V3) -> V3 {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        return add(a, scale(ab, d1 / (d1 - d3)));
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
        return add(a, scale(ac, d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    let (e, f) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e >= 0.0 && f >= 0.0 && e + f > 0.0 {
        return add(b, scale(sub(c, b), e / (e + f)));
    }
    let sum = va + vb + vc;
    if sum == 0.0 { a } else { add(a, add(scale(ab, vb / sum), scale(ac, vc / sum))) }
}

/// A part of a facet.
struct Part {
    facet: usize,
    corners: [V3; 3],
    /// Its point nearest to the one asked for.
    nearest: V3,
    /// That of what it is a part of, which is buried.
    buried: Option<V3>,
}

impl Part {
    fn diameter(&self) -> f64 {
        let [a, b, c] = self.corners;
        norm(sub(b, a)).max(norm(sub(c, b))).max(norm(sub(a, c)))
    }

    fn quarters(&self) -> [[V3; 3]; 4] {
        let [a, b, c] = self.corners;
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| scale(add(p, q), 0.5));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    }
}

enum Item {
    Node(BvhNode),
    Part(Part),
}

/// Something to look at, nearest first.
struct Entry {
    /// Square of its distance, or less.
    square: f64,
    item: Item,
}

impl Entry {
    fn node(bounds: &BoxCorners, node: BvhNode, p: V3) -> Entry {
        let [low, high] = bounds.map(|corner| corner.map(f64::from));
        let off: V3 = std::array::from_fn(|k| (low[k] - p[k]).max(p[k] - high[k]).max(0.0));
        Entry { square: dot(off, off), item: Item::Node(node) }
    }

    fn part(part: Part, p: V3) -> Entry {
        let off = sub(part.nearest, p);
        Entry { square: dot(off, off), item: Item::Part(part) }
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Entry) -> Ordering {
        other.square.total_cmp(&self.square)
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Entry) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Entry) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::pile::random_pile;
    use crate::shapes::cuboid;

    #[test]
    fn the_boundary_of_two_boxes_is_known() {
        let boxes = [cuboid([0.0; 3], [10.0; 3]), cuboid([5.0, 2.0, 2.0], [15.0, 8.0, 8.0])];
        let union = Union::new(Mesh::merged(&boxes).soup());
        let at = |p| union.nearest(p, 1e-3).unwrap();
        assert_eq!(at([-2.0, 5.0, 5.0]).distance, 2.0);
        assert_eq!(at([-3.0, -4.0, 5.0]).distance, 5.0);
        // The middle of the small box's buried end: 3 from its own sides, and 4 from where they leave the large one.
        let middle = at([6.0, 5.0, 5.0]);
        assert!((middle.distance - 5.0).abs() < 0.25 && middle.distance >= 5.0, "{middle:?}");
        assert!((at([10.5, 5.0, 5.0]).distance - 3.0).abs() < 1e-9);
        // On the large box's face, 1 deep in the small one.
        assert!((at([10.0, 5.0, 7.0]).distance - 1.0).abs() < 1e-3, "{:?}", at([10.0, 5.0, 7.0]));
        // 600 of the large one less 36 of the common face, and 5 by 6 four times and the end of the small one.
        let (all, seen) = (600.0 + 72.0 + 240.0, 600.0 - 36.0 + 120.0 + 36.0);
        let share = union.samples(100_000, 1).len() as f64 / 100_000.0;
        assert!((share - seen / all).abs() < 0.003, "{share}");
    }

    #[test]
    fn walls_and_gaps_are_thin() {
        let walls = [cuboid([0.0; 3], [1.0, 10.0, 10.0]), cuboid([3.0, 0.0, 0.0], [10.0; 3])];
        let union = Union::new(Mesh::merged(&walls).soup());
        let [wall, gap] = [0.0, 3.0].map(|x| SurfacePoint { at: [x, 5.0, 5.0], normal: [-1.0, 0.0, 0.0] });
        assert_eq!([0.9, 1.1].map(|t| union.is_thin(&wall, t)), [false, true]);
        assert_eq!([1.9, 2.2].map(|t| union.is_thin(&gap, t)), [false, true]);
    }

    /// Faces that touch, faces that are there twice, and pieces inside out are no boundary.
    #[test]
    fn what_does_not_separate_inside_from_outside_is_no_boundary() {
        let (left, right) = (cuboid([0.0; 3], [1.0; 3]), cuboid([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]));
        let touching = Union::new(Mesh::merged(&[left.clone(), right]).soup());
        assert!((touching.nearest([1.0, 0.5, 0.4], 1e-3).unwrap().distance - 0.4).abs() < 1e-9);
        let twice = Union::new(Mesh::merged(&[left.clone(), left.clone()]).soup());
        assert_eq!(twice.samples(1000, 1).len(), 1000);
        let reversed = Union::new(left.flipped().soup());
        assert_eq!((reversed.samples(1000, 1).len(), reversed.nearest([0.0; 3], 0.01)), (0, None));
    }

    /// Against the nearest of many samples.
    #[test]
    fn nearest_points_are_those_of_many_samples() {
        let pile = Mesh::merged(&random_pile(5, 12));
        let (low, high) = pile.bounds();
        let union = Union::new(pile.soup());
        let samples = union.samples(200_000, 3);
        let spacing = (pile.area() / 200_000.0).sqrt();
        let mut rng = Rng::new(4);
        for _ in 0..40 {
            let p = std::array::from_fn(|k| rng.range(low[k], high[k]));
            let nearest = union.nearest(p, 0.1 * spacing).unwrap();
            let sampled = samples.iter().map(|s| norm(sub(s.at, p))).fold(f64::MAX, f64::min);
            assert!(nearest.distance <= sampled * 1.06 + 0.1 * spacing, "{nearest:?} {sampled}");
            assert!(nearest.distance >= sampled - 3.0 * spacing, "{nearest:?} {sampled}");
            assert!((norm(sub(nearest.point.at, p)) - nearest.distance).abs() < 1e-9);
        }
    }
}
