//! The triangles of a mesh, found by place: exact distances, and signs by winding numbers.

use super::boxes::{
    Block, BoxNodes, Boxes, Lanes, NodeLevels, Normals, Probe, Question, block_of, reciprocals,
};
use super::triangle::nearest_of_triangle;
use super::triangle_sort::{Extent, FacetCorners, PartSorter, TRIANGLE_BYTES, area_normal, parts, read_all};
use crate::error::{Error, Result};
use crate::large_array::{ArrayRoom, LargeArray};
use crate::lattice::{cross, dot, minus, mix};
use crate::part::temporary::require_room;
use crate::progress::Progress;
use crate::soup::Facets;
use crate::wide::{Simd, f32x8};
use std::path::Path;

/// Triangles in a run of boxes, and in a group.
const RUN: usize = 4;
const GROUP: usize = 2048;
/// Bytes of a triangle with its share of boxes.
const HELD_BYTES: u64 = 44;
/// Feet that are as near as this part of their squares are equally near: of an edge, found from its two sides.
const TIE: f64 = 1e-9;
/// A ray that passes so near to an edge, in parts of the triangle, asks another one.
const EDGE: f64 = 1e-9;
/// The winding number of a place is remembered that is farther than such a part of the size from the surface.
const CLEAR: f64 = 1e-6;
/// Directions of rays, none along anything that people draw.
const RAYS: [[f64; 3]; 6] = [
    [0.577_129, 0.577_811, 0.577_110],
    [-0.812_371, 0.331_907, 0.479_521],
    [0.253_117, -0.911_373, 0.324_571],
    [0.118_733, 0.421_319, -0.899_107],
    [-0.699_113, -0.573_901, 0.426_637],
    [0.911_741, -0.201_833, -0.357_719],
];

/// All triangles with area of a mesh, with positions of 32 bits as in mesh files: 44 bytes each, in groups of neighbours, in
/// mapped files beside memory where they are more than allowed.
pub struct Triangles {
    corners: LargeArray<FacetCorners>,
    /// Boxes around the triangles of each group.
    nodes: LargeArray<Lanes>,
    groups: Vec<Block>,
    boxes: Boxes,
    is_closed: bool,
    /// Six times what they enclose, by their orientation.
    volume: f64,
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

/// What was found at the places before, which tells much of a place nearby.
#[derive(Clone, Copy, Debug, Default)]
pub struct PreviousPlace {
    /// The last place, and how far the nearest point was.
    foot: Option<([f64; 3], f64)>,
    /// The last place off the surface, and its winding number.
    winding: Option<([f64; 3], i32)>,
}

impl PreviousPlace {
    /// How far the nearest point of a place is at most.
    pub(super) fn reach(&self, from: [f64; 3]) -> f64 {
        self.foot.map_or(f64::INFINITY, |(place, distance)| {
            let way = minus(from, place);
            distance + dot(way, way).sqrt()
        })
    }

    /// Keeps how far the nearest point was.
    pub(super) fn keep(&mut self, from: [f64; 3], distance: f64) {
        self.foot = Some((from, distance));
    }
}

impl Triangles {
    /// Of some sources together, in so many bytes of memory, with files in `folder` for what does not fit. Sources are read
    /// two or three times.
    ///
    /// # Errors
    /// If there are no triangles; what writing the file gives; [`Error::Interrupted`].
    pub fn new(
        sources: &[&dyn Facets],
        (memory, folder): (u64, &Path),
        progress: &dyn Progress,
    ) -> Result<Triangles> {
        let total = sources.iter().map(|source| source.facets()).sum();
        progress.phase("reading the reference", Some(total), "facets");
        let (mut balance, mut count) = (0u64, 0usize);
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let (mut first, mut volume) = (None, 0.0);
        read_all(sources, progress, |facet, has_area| {
            for n in 0..3 {
                balance = balance.wrapping_add(directed(facet[n], facet[(n + 1) % 3]));
            }
            if has_area {
                count += 1;
                // Counted from a corner of the mesh, which may lie far from the origin.
                let from = *first.get_or_insert(facet[0].map(f64::from));
                let [a, b, c] = facet.map(|corner| minus(corner.map(f64::from), from));
                volume += dot(a, cross(b, c));
                for c in facet {
                    (0..3).for_each(|a| (low[a], high[a]) = (low[a].min(c[a]), high[a].max(c[a])));
                }
            }
            Ok(())
        })?;
        if count == 0 {
            return Err(Error::setting("the reference has no triangle with area", "give a mesh of the part"));
        }
        let size = (0..3).map(|a| high[a] - low[a]).fold(f32::MIN_POSITIVE, f32::max);
        let extent = Extent::new(low, size);
        let mut triangles = Triangles {
            corners: LargeArray::new(&ArrayRoom::new(memory / 16 * 13, folder)),
            nodes: LargeArray::new(&ArrayRoom::new(memory / 16 * 3, folder)),
            groups: Vec::new(),
            boxes: Boxes::new(std::iter::empty(), 1),
            is_closed: balance == 0,
            volume,
        };
        if count as u64 * HELD_BYTES > memory {
            require_room(folder, count as u64 * HELD_BYTES)?;
        }
        let mut rest = Vec::new();
        let parts = parts(sources, extent, count, memory, progress)?;
        progress.phase("sorting the reference", Some(total), "facets");
        let mut sorter = PartSorter::new(&parts, count.min((memory / 4) as usize / TRIANGLE_BYTES), folder);
        read_all(
            sources,
            progress,
            |facet, has_area| {
                if has_area { sorter.add(extent.cube(&facet), facet) } else { Ok(()) }
            },
        )?;
        for part in 0..parts.len() {
            progress.check()?;
            let mut corners = sorter.part(part)?;
            corners.sort_by_cached_key(|facet| extent.place(facet));
            rest.append(&mut corners);
            let whole = rest.len() / GROUP * GROUP;
            rest[..whole].chunks(GROUP).try_for_each(|group| triangles.push(group))?;
            rest.drain(..whole);
        }
        if !rest.is_empty() {
            triangles.push(&rest)?;
        }
        triangles.boxes = Boxes::new(triangles.groups.iter().copied(), 1);
        Ok(triangles)
    }

    /// Adds a group: of so many triangles, but for the last.
    fn push(&mut self, corners: &[FacetCorners]) -> Result<()> {
        let block = |facet: &FacetCorners| block_of(facet.iter().map(|c| c.map(f64::from)), 0.0);
        let boxes = Boxes::new(corners.iter().map(block), RUN);
        self.groups.push(boxes.whole());
        self.nodes.extend_from_slice(&boxes.nodes)?;
        self.corners.extend_from_slice(corners)
    }

    /// The triangles of a group, with boxes around them.
    fn group(&self, number: usize) -> (&[FacetCorners], BoxNodes<'_>) {
        let from = number * GROUP;
        let corners = &self.corners[from..self.corners.len().min(from + GROUP)];
        let nodes = |count: usize| NodeLevels::over(count.div_ceil(RUN)).nodes();
        let first = number * nodes(GROUP);
        let nodes = &self.nodes[first..first + nodes(corners.len())];
        (corners, BoxNodes::new((nodes, &[]), (corners.len(), RUN), self.groups[number]))
    }

    /// Whether every edge has as many triangles on one side as on the other.
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Whether they are closed, and enclose less than nothing: what lies in them counts as outside.
    pub fn is_inside_out(&self) -> bool {
        self.is_closed && self.volume < 0.0
    }

    /// The box around all.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        self.boxes.whole().map(|end| end.map(f64::from))
    }

    /// The nearest point, of several triangles at an edge that of the one that sees the place best.
    pub fn nearest(&self, from: [f64; 3]) -> Nearest {
        self.nearest_within(from, f64::INFINITY)
    }

    /// The nearest point, which is known to be nearer than `most`.
    fn nearest_within(&self, from: [f64; 3], most: f64) -> Nearest {
        let best = Nearest { at: [0.0; 3], normal: [0.0; 3], distance: f64::INFINITY };
        let mut near = NearestOf { from, within: most * most, aligned: -1.0, best };
        self.ask(&mut near, from);
        near.best
    }

    /// The distance from the mesh, below 0 inside: where w ≥ 1 of a closed one, else behind the nearest triangle. With the
    /// nearest point. What was found at the place before, which should be near, makes the search short.
    pub fn signed(&self, from: [f64; 3], last: &mut PreviousPlace) -> (f64, Nearest) {
        let mut nearest = self.nearest_within(from, last.reach(from) * (1.0 + TIE));
        if nearest.distance == f64::INFINITY {
            nearest = self.nearest(from);
        }
        let winding = if self.is_closed { self.winding(from, last.winding) } else { None };
        let behind = || dot(minus(from, nearest.at), nearest.normal) < 0.0;
        let inside = winding.map_or_else(behind, |w| w >= 1);
        last.keep(from, nearest.distance);
        if let Some(winding) = winding.filter(|_| nearest.distance > CLEAR * f64::from(self.boxes.size())) {
            last.winding = Some((from, winding));
        }
        (if inside { -nearest.distance } else { nearest.distance }, nearest)
    }

    /// The winding number: that of a place where it is known and what is passed on the way there, else what a ray passes.
    /// `None` if all of them pass edges.
    fn winding(&self, from: [f64; 3], known: Option<([f64; 3], i32)>) -> Option<i32> {
        if let Some((place, winding)) = known {
            let way = minus(place, from);
            let length = dot(way, way).sqrt();
            let toward = way.map(|c| c / length.max(f64::MIN_POSITIVE));
            if let Some(passed) = self.passed(from, toward, length) {
                return Some(winding + passed);
            }
        }
        RAYS.into_iter().find_map(|ray| self.passed(from, ray, f64::INFINITY))
    }

    /// By how much the winding number of a place exceeds that at the end of a way, whose triangles are counted; `None` if it
    /// passes an edge.
    fn passed(&self, from: [f64; 3], toward: [f64; 3], length: f64) -> Option<i32> {
        let mut passed = Passed { from, toward, length, over: reciprocals(toward), count: Some(0) };
        self.ask(&mut passed, from);
        passed.count
    }

    /// Asks all triangles, those in near boxes first.
    fn ask(&self, question: &mut impl TriangleQuestion, from: [f64; 3]) {
        let probe = Probe::new(from, self.boxes.size());
        self.boxes.search(&mut OfGroups { triangles: self, question, probe, from });
    }

    /// Points of the mesh: corners of triangles, and points spread evenly by area, at most so many of each.
    pub fn samples(&self, most: usize) -> Vec<[f64; 3]> {
        let step = self.corners.len().div_ceil(most).max(1);
        let mut points: Vec<_> =
            self.corners.iter().step_by(step).map(|facet| facet[0].map(f64::from)).collect();
        let total: f64 = self.corners.iter().map(area).sum();
        let count = most.min(self.corners.len().max(20_000));
        let (mut passed, mut next, mut spread) = (0.0, 0usize, Vec::new());
        for facet in &self.corners {
            passed += area(facet);
            while next < count && (next as f64 + 0.5) * total <= passed * count as f64 {
                spread.push(within(facet, next));
                next += 1;
            }
        }
        points.append(&mut spread);
        points
    }
}

/// A point of a triangle by numbers that look random, the same for every run.
fn within(facet: &FacetCorners, number: usize) -> [f64; 3] {
    let bits = mix((number as u64).wrapping_mul(crate::lattice::GOLDEN));
    let (mut s, mut t) =
        ((bits >> 32) as f64 / 4_294_967_296.0, (bits & 0xffff_ffff) as f64 / 4_294_967_296.0);
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    let [a, b, c] = facet.map(|c| c.map(f64::from));
    std::array::from_fn(|n| a[n] + s * (b[n] - a[n]) + t * (c[n] - a[n]))
}

/// Something to ask of triangles.
trait TriangleQuestion {
    /// See [`Question::nearness`].
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, probe: &Probe) -> f32x8<S>;
    /// See [`Question::counts`].
    fn counts(&self, nearness: f32) -> bool;
    /// Looks at a triangle.
    fn visit(&mut self, corners: &FacetCorners);
}

/// A question to the groups of a mesh.
struct OfGroups<'a, Q> {
    triangles: &'a Triangles,
    question: &'a mut Q,
    probe: Probe,
    from: [f64; 3],
}

impl<Q: TriangleQuestion> Question for OfGroups<'_, Q> {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        self.question.nearness(simd, boxes, &self.probe)
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        self.question.counts(nearness)
    }

    fn visit(&mut self, thing: usize) -> bool {
        let (from, question) = (self.from, &mut *self.question);
        let (corners, boxes) = self.triangles.group(thing);
        boxes.search(&mut OfGroup { corners, question, probe: Probe::new(from, boxes.size()) });
        false
    }
}

/// A question to the triangles of a group.
struct OfGroup<'a, Q> {
    corners: &'a [FacetCorners],
    question: &'a mut Q,
    probe: Probe,
}

impl<Q: TriangleQuestion> Question for OfGroup<'_, Q> {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        self.question.nearness(simd, boxes, &self.probe)
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        self.question.counts(nearness)
    }

    #[inline]
    fn visit(&mut self, thing: usize) -> bool {
        self.question.visit(&self.corners[thing]);
        false
    }
}

/// The nearest point of triangles.
struct NearestOf {
    from: [f64; 3],
    /// The square of the least distance.
    within: f64,
    /// How well the best one sees the place: the cosine between its normal and the way to the place.
    aligned: f64,
    best: Nearest,
}

impl TriangleQuestion for NearestOf {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, probe: &Probe) -> f32x8<S> {
        boxes.squared_from(simd, probe, ((self.within * (1.0 + TIE)) as f32).next_up())
    }

    #[inline(always)]
    fn counts(&self, nearness: f32) -> bool {
        f64::from(nearness) <= self.within * (1.0 + TIE)
    }

    fn visit(&mut self, corners: &FacetCorners) {
        let at = nearest_of_triangle(self.from, corners.map(|c| c.map(f64::from)));
        let away = minus(self.from, at);
        let squared = dot(away, away);
        if squared > self.within * (1.0 + TIE) {
            return;
        }
        let Some(normal) = area_normal(corners) else { return };
        let distance = squared.sqrt();
        let aligned = dot(away, normal).abs() / distance.max(f64::MIN_POSITIVE);
        if squared < self.within * (1.0 - TIE) || aligned > self.aligned {
            (self.aligned, self.best) = (aligned, Nearest { at, normal, distance });
        }
        self.within = self.within.min(squared);
    }
}

/// The winding number less that at the end of a way, by the triangles that it passes; `None` if it passes an edge.
struct Passed {
    from: [f64; 3],
    toward: [f64; 3],
    length: f64,
    over: [f32; 3],
    count: Option<i32>,
}

impl TriangleQuestion for Passed {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, probe: &Probe) -> f32x8<S> {
        boxes.entered(simd, probe, self.over, (self.length as f32).next_up())
    }

    #[inline(always)]
    fn counts(&self, _: f32) -> bool {
        self.count.is_some()
    }

    fn visit(&mut self, corners: &FacetCorners) {
        let corners = corners.map(|c| c.map(f64::from));
        self.count =
            self.count.and_then(|w| Some(w + passed(self.from, (self.toward, self.length), corners)?));
    }
}

/// What a triangle adds to the winding number; `None` if the way passes one of its edges or along it.
fn passed(from: [f64; 3], (toward, length): ([f64; 3], f64), [a, b, c]: [[f64; 3]; 3]) -> Option<i32> {
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
    if least < -EDGE || along < 0.0 || along > length {
        return Some(0);
    }
    if least < EDGE {
        return None;
    }
    // Out of the part through a face that is seen from behind.
    Some(if turn < 0.0 { 1 } else { -1 })
}

fn area(facet: &FacetCorners) -> f64 {
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
        let held = (1 << 20, Path::new("."));
        let triangles = Triangles::new(&[&facets], held, &Silent).unwrap();
        assert!(triangles.is_closed());
        for (p, expected) in [
            ([-1.0, 1.0, 1.0], 1.0),
            ([0.5, 0.5, 0.25], -0.25),
            ([4.0, 2.0, 2.5], 1.0),
            ([1.5, 1.5, 1.25], -0.25),
            ([3.5, 3.5, 3.5], 0.75f64.sqrt()),
        ] {
            let signed = triangles.signed(p, &mut PreviousPlace::default());
            assert!((signed.0 - expected).abs() < 1e-9, "{p:?} {signed:?}");
        }
        assert!(!triangles.is_inside_out());
        let turned: Vec<_> = facets.iter().map(|&[a, b, c]| [a, c, b]).collect();
        assert!(Triangles::new(&[&turned], held, &Silent).unwrap().is_inside_out());
        facets.pop();
        let open = Triangles::new(&[&facets], held, &Silent).unwrap();
        assert!(!open.is_closed() && !open.is_inside_out());
    }

    #[test]
    fn places_before_change_no_sign() {
        let mut facets = cube(0.0, 2.0);
        (0..12).for_each(|n| facets.extend(cube(0.25 * f64::from(n), 1.5)));
        let triangles = Triangles::new(&[&facets], (1 << 20, Path::new(".")), &Silent).unwrap();
        let mut last = PreviousPlace::default();
        let mut inside = 0;
        for n in 0..4000u64 {
            let random = |a: u64| (mix(3 * n + a) >> 11) as f64 / (1u64 << 53) as f64;
            // A walk through all of it; now and then on the lattice, where faces and edges are.
            let step = 0.1 * (n % 64) as f64 - 1.0;
            let mut p = [0, 1, 2].map(|a| step + random(a));
            if n % 5 == 0 {
                p = p.map(|c| (c * 4.0).round() * 0.25);
            }
            let (a, b) = (triangles.signed(p, &mut last), triangles.signed(p, &mut PreviousPlace::default()));
            let (a, b) = (a.0, b.0);
            assert!((a - b).abs() < 1e-9 || a == -b && b.abs() < 1e-9, "{p:?} {a} {b}");
            inside += usize::from(a < 0.0);
        }
        assert!((800..3200).contains(&inside), "{inside}");
    }

    #[test]
    fn samples_are_spread_by_area() {
        let held = (1 << 20, Path::new("."));
        let triangles = Triangles::new(&[&cube(0.0, 2.0)], held, &Silent).unwrap();
        let samples = triangles.samples(3000);
        let above = samples.iter().filter(|p| p[2] == 2.0).count();
        assert!((480..540).contains(&above), "{above}");
    }

    #[test]
    fn what_does_not_fit_gives_the_same_numbers() {
        // A ball of facets, which are many, and a far one that makes most cubes empty.
        let facet = |n: u64| -> [[f64; 3]; 3] {
            let corner =
                |k: u64| [0, 1, 2].map(|a| (mix(9 * n + 3 * k + a) >> 11) as f64 / (1u64 << 53) as f64);
            let middle = corner(7).map(|c| 20.0 * c);
            [0, 1, 2].map(|k| std::array::from_fn(|a| middle[a] + corner(k)[a]))
        };
        let mut facets: Vec<[[f64; 3]; 3]> = (0..9000).map(facet).collect();
        facets.push([[300.0, 0.0, 0.0], [300.0, 1.0, 0.0], [300.0, 0.0, 1.0]]);
        let folder = tempfile::tempdir().unwrap();
        let all = Triangles::new(&[&facets], (1 << 30, folder.path()), &Silent).unwrap();
        for memory in [400_000, 150_000, 1000] {
            let some = Triangles::new(&[&facets], (memory, folder.path()), &Silent).unwrap();
            assert_eq!(some.groups.len(), all.groups.len());
            assert_eq!(some.samples(700), all.samples(700));
            let mut last = PreviousPlace::default();
            for n in 0..300 {
                let p = facet(77_777 + n)[0].map(|c| 1.2 * c - 2.0);
                let (a, b) = (some.signed(p, &mut last), all.signed(p, &mut PreviousPlace::default()));
                assert_eq!((a.0, a.1.at, a.1.normal), (b.0, b.1.at, b.1.normal));
            }
        }
    }
}
