//! A toolpath as numbered triangles, none of which is kept.

use super::profile::{Profile, ProfileShape};
use super::tube::{Joints, Tube, for_tubes};
use crate::error::{Error, Result};
use crate::toolpath::Toolpath;
use glam::DVec3;
use std::f64::consts::PI;
use std::ops::Range;

/// Sharpest bend that may be mitred: beyond it a mitre is longer than the bead is wide.
const BEND_MAX_DEGREES: f64 = 120.0;

/// How beads become solids.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepOptions {
    /// The cross-section.
    pub shape: ProfileShape,
    /// Sides of a round cross-section: an even number from 6 to 256.
    pub sides: usize,
    /// Bends sharper than this are split instead of mitred, in degrees from 0 to 120.
    pub bend: f64,
}

impl Default for SweepOptions {
    /// Stadiums of 12 sides: their chords stay within 3.5 % of the height from the true outline. 45° as the
    /// limit of bends: a mitre sticks out by 8 % there.
    fn default() -> SweepOptions {
        SweepOptions { shape: ProfileShape::Stadium, sides: 12, bend: 45.0 }
    }
}

/// Checked options, and what follows from them.
#[derive(Clone, Debug)]
pub struct Sweep {
    pub(super) profile: Profile,
    pub(super) bend_cos: f64,
    /// Steps of a cap, (sin θ, cos θ): how far out, in halves of the width, and what is left of the section. The
    /// last one is the tip.
    pub(super) caps: Vec<[f64; 2]>,
}

impl Sweep {
    /// Checks the options.
    ///
    /// # Errors
    /// [`Error::Setting`] if the number of sides or the bend is out of range.
    pub fn new(options: &SweepOptions) -> Result<Sweep> {
        let SweepOptions { shape, sides, bend } = options;
        if !(0.0..=BEND_MAX_DEGREES).contains(bend) {
            return Err(Error::setting(
                format!("bends of {bend}° cannot be the limit of what is mitred"),
                format!("choose an angle from 0 to {BEND_MAX_DEGREES}"),
            ));
        }
        let profile = Profile::new(shape, *sides)?;
        let steps = profile.cap_steps();
        let step = |j: usize| {
            let (sin, cos) = libm::sincos(PI / 2.0 * j as f64 / steps as f64);
            [sin, cos]
        };
        let caps = (1..=steps).map(step).collect();
        Ok(Sweep { profile, bend_cos: libm::cos(bend.to_radians()), caps })
    }

    /// The cross-section.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Bands of a tube of so many points.
    pub(super) fn bands(&self, points: usize) -> u64 {
        (points + 2 * self.caps.len() - 1) as u64
    }

    /// Triangles of a tube of so many points.
    pub(super) fn facets(&self, points: usize) -> u64 {
        2 * self.profile.sides() as u64 * (self.bands(points) - 1)
    }

    /// Volume of a bead as slicers reckon it: area of the section times length, ends cut square.
    pub fn volume(&self, course: &impl super::BeadPath) -> f64 {
        let pairs = course.points().windows(2).enumerate();
        let of_pair = |(segment, pair): (usize, &[[f64; 3]])| {
            self.profile.area(course.section(segment)) * DVec3::from(pair[0]).distance(pair[1].into())
        };
        pairs.map(of_pair).sum()
    }
}

/// One tube in the list of all of them.
#[derive(Clone, Copy, Debug)]
struct Entry {
    bead: u32,
    /// First point, within the bead. It ends where the next tube of the bead begins, or with the bead.
    first_point: u32,
    /// Triangles of all tubes before it.
    first_facet: u64,
}

/// A toolpath and its sweep: a soup of closed tubes, by number. Takes 16 bytes a tube beside the toolpath.
#[derive(Clone, Debug)]
pub struct SweptToolpath {
    toolpath: Toolpath,
    sweep: Sweep,
    tubes: Vec<Entry>,
    facets: u64,
    joints: Joints,
}

impl SweptToolpath {
    /// Splits all beads into tubes and counts their triangles; makes none.
    pub fn new(toolpath: Toolpath, sweep: Sweep) -> SweptToolpath {
        let (mut tubes, mut facets, mut joints) = (Vec::new(), 0, Joints::default());
        for bead in 0..toolpath.len() {
            for_tubes(&sweep, &(&toolpath, bead), &mut joints, |points| {
                tubes.push(Entry {
                    bead: bead as u32,
                    first_point: points.start as u32,
                    first_facet: facets,
                });
                facets += sweep.facets(points.len());
            });
        }
        SweptToolpath { toolpath, sweep, tubes, facets, joints }
    }

    /// The toolpath.
    pub fn toolpath(&self) -> &Toolpath {
        &self.toolpath
    }

    /// How it is swept.
    pub fn sweep(&self) -> &Sweep {
        &self.sweep
    }

    /// How the segments of all beads were joined.
    pub fn joints(&self) -> Joints {
        self.joints
    }

    /// Closed surfaces.
    pub fn tubes(&self) -> u64 {
        self.tubes.len() as u64
    }

    /// Triangles.
    pub fn facets(&self) -> u64 {
        self.facets
    }

    /// Memory taken, the toolpath's included.
    pub fn heap_bytes(&self) -> u64 {
        self.toolpath.heap_bytes() + size_of_val(self.tubes.as_slice()) as u64
    }

    /// Volume of all beads as slicers reckon it (see [`Sweep::volume`]), in the order of the file.
    pub fn bead_volume(&self) -> f64 {
        (0..self.toolpath.len()).map(|bead| self.sweep.volume(&(&self.toolpath, bead))).sum()
    }

    /// Calls `each` with the triangles of `range` in order, counter-clockwise seen from outside; what lies
    /// beyond [`Self::facets`] is left out. Takes time by the length of the range, wherever it begins.
    pub fn for_facets(&self, range: Range<u64>, mut each: impl FnMut([DVec3; 3])) {
        let end = range.end.min(self.facets);
        if range.start >= end {
            return;
        }
        let first = self.tubes.partition_point(|tube| tube.first_facet <= range.start) - 1;
        for (number, tube) in self.tubes.iter().enumerate().skip(first) {
            if tube.first_facet >= end {
                break;
            }
            let course = (&self.toolpath, tube.bead as usize);
            let part = range.start.saturating_sub(tube.first_facet)..end - tube.first_facet;
            Tube::new(&self.sweep, &course, self.points_of(number)).for_facets(part, &mut each);
        }
    }

    /// The points of a tube within its bead.
    fn points_of(&self, number: usize) -> Range<usize> {
        let tube = self.tubes[number];
        let end = match self.tubes.get(number + 1) {
            Some(next) if next.bead == tube.bead => next.first_point as usize + 1,
            _ => self.toolpath.points(tube.bead as usize).len(),
        };
        tube.first_point as usize..end
    }

    /// Replaces the content of `out` by the triangles of `range`, as [`Self::for_facets`] tells them.
    pub fn read(&self, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        out.clear();
        self.for_facets(range, |corners| out.push(corners.map(|corner| corner.to_array())));
    }
}
