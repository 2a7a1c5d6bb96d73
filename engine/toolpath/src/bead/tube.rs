//! One tube: a closed surface of bands between rings.

use super::joint::{FramedSegment, Joint, Ring, joint};
use super::path::BeadPath;
use super::sweep::Sweep;
use glam::DVec3;
use std::ops::{AddAssign, Range};

/// How a bead's segments were joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Joints {
    /// In a mitre.
    pub mitred: u64,
    /// Split because of the bend, or because the section would roll.
    pub split_bends: u64,
    /// Split because the sections differ.
    pub split_sections: u64,
    /// Split because a mitre would have folded over: the bead is wide for its bend and its short segments.
    pub split_folds: u64,
}

impl AddAssign for Joints {
    fn add_assign(&mut self, other: Joints) {
        self.mitred += other.mitred;
        self.split_bends += other.split_bends;
        self.split_sections += other.split_sections;
        self.split_folds += other.split_folds;
    }
}

/// Tells the tubes of a bead in order, and counts its joints.
pub(super) fn for_tubes(
    sweep: &Sweep,
    course: &impl BeadPath,
    joints: &mut Joints,
    mut each: impl FnMut(Range<usize>),
) {
    let count = course.points().len();
    if count < 2 {
        return;
    }
    let mut first = 0;
    let mut before = FramedSegment::of(course, 0);
    for point in 1..count - 1 {
        let after = FramedSegment::of(course, point);
        let axis = DVec3::from(course.axis(point));
        let joint = joint(&sweep.profile, sweep.bend_cos, &before, &after, axis);
        match joint {
            Joint::Mitre => joints.mitred += 1,
            Joint::Bend => joints.split_bends += 1,
            Joint::Section => joints.split_sections += 1,
            Joint::Fold => joints.split_folds += 1,
        }
        if joint != Joint::Mitre {
            each(first..point + 1);
            first = point;
        }
        before = after;
    }
    each(first..count);
}

/// One closed surface: the points `points` of a bead, swept.
///
/// Its rings are numbered from the tip of one cap to that of the other: a tip, the rings of the cap, one ring
/// a point, the rings of the other cap, a tip. Band b lies between the rings b and b + 1; the first and the
/// last are fans of n triangles about a tip, the others have 2n.
///
/// It is closed for every simple polygon: neighbouring bands share a ring bit by bit, and a tip is one point,
/// so each directed edge is cancelled by its reverse. It does not cross itself: rings of a cap are scaled copies
/// of one polygon in parallel planes, and between mitres every corner moves forward (see [`Joint::Fold`]).
pub(super) struct Tube<'a, C> {
    sweep: &'a Sweep,
    course: &'a C,
    points: Range<usize>,
    /// The last segment whose frame was needed, and that frame.
    held: Option<(usize, FramedSegment)>,
    corners: Vec<[f64; 2]>,
}

impl<'a, C: BeadPath> Tube<'a, C> {
    pub fn new(sweep: &'a Sweep, course: &'a C, points: Range<usize>) -> Tube<'a, C> {
        Tube { sweep, course, points, held: None, corners: Vec::new() }
    }

    /// Calls `each` with the triangles of `range`, in order, by their corners counter-clockwise seen from
    /// outside. Makes only the rings that they need.
    pub fn for_facets(&mut self, range: Range<u64>, mut each: impl FnMut([DVec3; 3])) {
        let sides = self.sweep.profile.sides() as u64;
        let bands = self.sweep.bands(self.points.len());
        let end = range.end.min(self.sweep.facets(self.points.len()));
        if range.start >= end {
            return;
        }
        // Bands begin at 0, n, 3n, 5n, ...
        let mut band = if range.start < sides { 0 } else { 1 + (range.start - sides) / (2 * sides) };
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        self.ring(band as usize, &mut upper);
        let mut next = range.start;
        while next < end {
            std::mem::swap(&mut lower, &mut upper);
            self.ring(band as usize + 1, &mut upper);
            let begin = if band == 0 { 0 } else { sides * (2 * band - 1) };
            let (first, last) = ((next - begin) as usize, (end - begin) as usize);
            let all = if band == 0 || band == bands - 1 { sides } else { 2 * sides } as usize;
            let part = first..last.min(all);
            next = begin + part.end as u64;
            if band == 0 {
                part.for_each(|v| each([lower[0], upper[v + 1], upper[v]]));
            } else if band == bands - 1 {
                part.for_each(|v| each([lower[v], lower[v + 1], upper[0]]));
            } else {
                part.for_each(|i| {
                    let v = i / 2;
                    let third = [lower[v + 1], upper[v]][i % 2];
                    each(if i % 2 == 0 {
                        [lower[v], third, upper[v + 1]]
                    } else {
                        [lower[v], upper[v + 1], third]
                    });
                });
            }
            band += 1;
        }
    }

    /// Replaces `out` by the corners of a ring, the first one repeated at the end; by one point for a tip.
    fn ring(&mut self, number: usize, out: &mut Vec<DVec3>) {
        let (steps, points) = (self.sweep.caps.len(), self.points.len());
        if number < steps {
            self.cap(self.points.start, steps - 1 - number, out);
        } else if number < steps + points {
            let point = self.points.start + number - steps;
            let ring = self.mitre(point);
            let middle = ring.middle(self.course, point);
            self.sweep.profile.draw(ring.section, &mut self.corners);
            out.clear();
            out.extend(self.corners.iter().map(|&corner| middle + ring.place(corner)));
            out.push(out[0]);
        } else {
            self.cap(self.points.end - 1, number - steps - points, out);
        }
    }

    /// The ring at a point: square at the ends of the tube, a mitre within it.
    fn mitre(&mut self, point: usize) -> Ring {
        if point == self.points.start {
            Ring::end(&self.segment(point))
        } else if point == self.points.end - 1 {
            Ring::end(&self.segment(point - 1))
        } else {
            let before = self.segment(point - 1);
            Ring::between(&before, &self.segment(point))
        }
    }

    /// A step of the cap at the first or last point; the last step is the tip.
    fn cap(&mut self, point: usize, step: usize, out: &mut Vec<DVec3>) {
        let is_start = point == self.points.start;
        let segment = self.segment(if is_start { point } else { point - 1 });
        let outward = if is_start { -segment.along } else { segment.along };
        let ring = Ring::end(&segment);
        let [advance, scale] = self.sweep.caps[step];
        let core = ring.place(self.sweep.profile.centroid(ring.section));
        let middle = ring.middle(self.course, point) + outward * (ring.section.width / 2.0 * advance) + core;
        out.clear();
        if step + 1 == self.sweep.caps.len() {
            out.push(middle);
            return;
        }
        self.sweep.profile.draw(ring.section, &mut self.corners);
        out.extend(self.corners.iter().map(|&corner| middle + (ring.place(corner) - core) * scale));
        out.push(out[0]);
    }

    /// The frame of a segment; the last one asked for is kept, since neighbouring rings share it.
    fn segment(&mut self, number: usize) -> FramedSegment {
        match self.held {
            Some((held, segment)) if held == number => segment,
            _ => {
                let segment = FramedSegment::of(self.course, number);
                self.held = Some((number, segment));
                segment
            }
        }
    }
}
