//! How two segments of a bead meet: in a mitre, or not at all.

use super::path::BeadPath;
use super::profile::Profile;
use crate::toolpath::Section;
use glam::DVec3;

/// Sections that differ by more than this part of the larger one are not joined. Slicers that vary the width
/// do so in steps of a few per cent.
const SECTION_CHANGE_MAX: f64 = 0.1;
/// Cosine of the most that the section may roll about the path from one segment to the next.
const ROLL_COS_MIN: f64 = 0.9;
/// Round profiles are drawn wider than their section to make up for the area that chords cut off: 1.29 times
/// where six sides draw a circle, 1.02 times where twelve draw the stadium of w = 3h.
const REACH_MARGIN: f64 = 1.3;
/// Squared sine of the angle to the tool's axis below which that says nothing about which way is sideways.
const UPRIGHT_SIN_SQUARED: f64 = 1e-4;

/// A segment with its frame: right-handed, across the path, up and along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FramedSegment {
    pub along: DVec3,
    pub across: DVec3,
    pub up: DVec3,
    pub length: f64,
    pub section: Section,
}

/// What happens at a point between two segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Joint {
    /// One ring in the bisecting plane.
    Mitre,
    /// Two tubes: the path bends or the section rolls too much.
    Bend,
    /// Two tubes: the sections differ too much.
    Section,
    /// Two tubes: the inner side of a mitre would run backwards.
    Fold,
}

/// Where the middle of the bead is when the tool's tip is at `point`: the tip runs along its upper side.
fn middle(course: &impl BeadPath, point: usize, height: f64) -> DVec3 {
    DVec3::from(course.points()[point]) - DVec3::from(course.axis(point)) * (height / 2.0)
}

impl FramedSegment {
    /// The segment from point `number` to the next.
    pub fn of(course: &impl BeadPath, number: usize) -> FramedSegment {
        let section = course.section(number);
        let ends = [number, number + 1].map(|point| middle(course, point, section.height));
        let mut step = ends[1] - ends[0];
        if step.length_squared() == 0.0 {
            // The tool turns about the middle of the bead; its tip moves.
            let [a, b] = [number, number + 1].map(|point| DVec3::from(course.points()[point]));
            step = b - a;
        }
        let length = step.length();
        let along = step / length;
        let axis = DVec3::from(course.axis(number)) + DVec3::from(course.axis(number + 1));
        let axis = if axis.length_squared() > 0.0 { axis } else { DVec3::from(course.axis(number)) };
        let sideways = axis.cross(along);
        let across = if sideways.length_squared() > UPRIGHT_SIN_SQUARED * axis.length_squared() {
            sideways
        } else {
            least_axis(along).cross(along)
        };
        let across = across / across.length();
        FramedSegment { along, across, up: along.cross(across), length, section }
    }
}

/// The axis of the world that a direction has least of.
fn least_axis(direction: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = direction.abs();
    if y <= x && y <= z {
        DVec3::Y
    } else if x <= z {
        DVec3::X
    } else {
        DVec3::Z
    }
}

/// Decides how `a` and the segment `b` that follows it meet, at a point where the tool's axis is `axis`.
pub(super) fn joint(
    profile: &Profile,
    bend_cos: f64,
    a: &FramedSegment,
    b: &FramedSegment,
    axis: DVec3,
) -> Joint {
    let differ = |p: f64, q: f64| (p - q).abs() > SECTION_CHANGE_MAX * p.max(q);
    if differ(a.section.width, b.section.width)
        || differ(a.section.height, b.section.height)
        || !profile.can_join(a.section, b.section)
    {
        return Joint::Section;
    }
    let cos = a.along.dot(b.along);
    // Across, carried over the bend by the least rotation.
    let carried = a.across - (a.along + b.along) * (a.across.dot(b.along) / (1.0 + cos));
    let roll_cos = carried.dot(b.across);
    if !(cos >= bend_cos && roll_cos >= ROLL_COS_MIN) {
        return Joint::Bend;
    }
    let ring = Ring::between(a, b);
    // Half the difference of heights moves the middle along the axis.
    let slip = |s: &FramedSegment| ((s.section.height - ring.section.height) / 2.0 * axis.dot(s.along)).abs();
    let reach = ring.reach;
    // Each end of a segment may take half of its length, so that both never meet.
    if reach + slip(a) >= a.length / 2.0 || reach + slip(b) >= b.length / 2.0 {
        Joint::Fold
    } else {
        Joint::Mitre
    }
}

/// Where a profile is drawn: the section, and the images of a unit across and a unit up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    pub section: Section,
    pub across: DVec3,
    pub up: DVec3,
    /// No corner lies farther than this before or behind the point, along either segment.
    reach: f64,
}

impl Ring {
    /// The end of a segment, at a right angle to it.
    pub fn end(segment: &FramedSegment) -> Ring {
        Ring { section: segment.section, across: segment.across, up: segment.up, reach: 0.0 }
    }

    /// The mitre of two segments: the section, in the plane that bisects them, stretched in the plane of the
    /// bend by 1 / cos(θ/2), so that either segment keeps its full section right up to it.
    pub fn between(a: &FramedSegment, b: &FramedSegment) -> Ring {
        let sum = a.along + b.along;
        let twice_cos = sum.length();
        let tangent = sum / twice_cos;
        let across = a.across + b.across;
        let across = across - tangent * across.dot(tangent);
        let across = across / across.length();
        let up = tangent.cross(across);
        // |e| = 2 sin(θ/2), so (1/c − 1) / |e|² = 1 / (4c(1 + c)) with c = cos(θ/2): no division by a small bend.
        let e = b.along - a.along;
        let cos = twice_cos / 2.0;
        let stretch = |unit: DVec3| unit + e * (unit.dot(e) / (4.0 * cos * (1.0 + cos)));
        let mean = |p: f64, q: f64| if p == q { p } else { (p + q) / 2.0 };
        let section = Section {
            width: mean(a.section.width, b.section.width),
            height: mean(a.section.height, b.section.height),
        };
        let reach = (section.width * across.dot(e).abs() + section.height * up.dot(e).abs()) / (4.0 * cos);
        Ring { section, across: stretch(across), up: stretch(up), reach: reach * REACH_MARGIN }
    }

    /// The middle of the ring at a point of the course.
    pub fn middle(&self, course: &impl BeadPath, point: usize) -> DVec3 {
        middle(course, point, self.section.height)
    }

    /// A corner of the profile relative to the middle.
    #[inline]
    pub fn place(&self, [across, up]: [f64; 2]) -> DVec3 {
        self.across * across + self.up * up
    }
}
