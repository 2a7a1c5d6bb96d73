//! How a bead becomes a solid: its cross-section, which bends are mitred, the caps at its ends.

use super::path::BeadPath;
use super::profile::{Profile, ProfileShape};
use crate::error::{Error, Result};
use glam::DVec3;
use std::f64::consts::PI;

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
    pub fn volume(&self, course: &impl BeadPath) -> f64 {
        let pairs = course.points().windows(2).enumerate();
        let of_pair = |(segment, pair): (usize, &[[f64; 3]])| {
            self.profile.area(course.section(segment)) * DVec3::from(pair[0]).distance(pair[1].into())
        };
        pairs.map(of_pair).sum()
    }
}
