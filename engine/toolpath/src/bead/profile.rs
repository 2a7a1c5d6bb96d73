//! The cross-section of a bead as a polygon.

use crate::error::{Error, Result};
use crate::toolpath::Section;
use std::f64::consts::PI;

/// Fewest and most sides of a round section. Below, it is not round; above, sides are shorter than the
/// lattice resolves.
const SIDES: std::ops::RangeInclusive<usize> = 6..=256;
/// Most corners of a given outline: more than this is a mistake, and checking it takes the square of them.
pub(super) const OUTLINE_MAX: usize = 1024;
/// Fewest steps of a cap: two have 85 % of the volume of a round one, three 93 %. Half of a toolpath's triangles
/// may well be caps, so there are no more than a section of few sides calls for.
const CAP_STEPS_MIN: usize = 2;
/// Sides of a round section for each step of a cap.
const SIDES_A_CAP_STEP: usize = 6;

/// Form of the cross-section within its width and height.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ProfileShape {
    /// A rectangle between two half circles, the form that slicers assume.
    #[default]
    Stadium,
    /// An ellipse.
    Ellipse,
    /// A rectangle.
    Rectangle,
    /// A simple polygon around the origin, (across, up) in units of width and height, counter-clockwise, within
    /// ±1/2; [`super::read_outline`] makes one.
    Outline(Vec<[f64; 2]>),
}

/// A cross-section that can be drawn at any size, always with the same number of corners.
///
/// Round forms keep their area: an inscribed polygon would lose 6 % of it with 8 sides and 1.4 % with 12.
#[derive(Clone, Debug)]
pub struct Profile {
    shape: ProfileShape,
    /// Of the round forms, (cos, sin) of the corners: of the right half circle, or of the whole ellipse.
    unit: Vec<[f64; 2]>,
    /// Corners.
    sides: usize,
    /// What makes up for the area that chords cut off: stadium, straight part to be added, in radii; ellipse,
    /// factor on the width.
    correction: f64,
    /// In units of width and height.
    centroid: [f64; 2],
    /// Area in units of width times height; of the stadium, without meaning.
    unit_area: f64,
}

impl Profile {
    /// The profile of a shape, `sides` being the number of sides of round forms.
    ///
    /// # Errors
    /// [`Error::Setting`] if `sides` is odd or beyond reason.
    pub fn new(shape: &ProfileShape, sides: usize) -> Result<Profile> {
        if !(SIDES.contains(&sides) && sides.is_multiple_of(2)) {
            let (least, most) = (SIDES.start(), SIDES.end());
            return Err(Error::setting(
                format!("a section of {sides} sides cannot be drawn"),
                format!("choose an even number of sides from {least} to {most}"),
            ));
        }
        // Starts at the bottom and goes round counter-clockwise; the sine of ±π/2 is exactly ±1.
        let at = |i: usize, chords: usize, turn: f64| {
            let (sin, cos) = libm::sincos(-PI / 2.0 + turn * i as f64 / chords as f64);
            [cos, sin]
        };
        let mut profile = Profile {
            shape: shape.clone(),
            unit: Vec::new(),
            sides,
            correction: 0.0,
            centroid: [0.0; 2],
            unit_area: 1.0,
        };
        match shape {
            ProfileShape::Stadium => {
                let chords = sides / 2 - 1;
                profile.unit = (0..=chords).map(|i| at(i, chords, PI)).collect();
                // The chords of both halves cut off r²(π − m sin(π/m)), which a strip of height 2r makes good.
                profile.correction = (PI - chords as f64 * libm::sin(PI / chords as f64)) / 2.0;
            }
            ProfileShape::Ellipse => {
                profile.unit = (0..sides).map(|i| at(i, sides, 2.0 * PI)).collect();
                let turn = 2.0 * PI / sides as f64;
                profile.correction = turn / libm::sin(turn);
                profile.unit_area = PI / 4.0;
            }
            ProfileShape::Rectangle => profile.sides = 4,
            ProfileShape::Outline(corners) => {
                profile.sides = corners.len();
                (profile.unit_area, profile.centroid) = moments(corners);
            }
        }
        Ok(profile)
    }

    /// Corners, whatever the size.
    pub fn sides(&self) -> usize {
        self.sides
    }

    /// Area of the cross-section, which the polygon has too.
    pub fn area(&self, section: Section) -> f64 {
        let Section { width, height } = section;
        match self.shape {
            ProfileShape::Stadium => section.stadium_area(),
            _ => self.unit_area * width * height,
        }
    }

    /// Steps from the end of a tube to the tip of its cap.
    pub(super) fn cap_steps(&self) -> usize {
        match self.shape {
            ProfileShape::Stadium | ProfileShape::Ellipse => {
                (self.sides / SIDES_A_CAP_STEP).max(CAP_STEPS_MIN)
            }
            _ => CAP_STEPS_MIN,
        }
    }

    /// Whether corners of the two sizes belong together one by one: those of a stadium that stands on end
    /// begin elsewhere.
    pub(super) fn can_join(&self, a: Section, b: Section) -> bool {
        self.shape != ProfileShape::Stadium || (a.width >= a.height) == (b.width >= b.height)
    }

    /// What caps shrink to, as (across, up) from the middle.
    pub(super) fn centroid(&self, section: Section) -> [f64; 2] {
        [self.centroid[0] * section.width, self.centroid[1] * section.height]
    }

    /// The corners in units of width and height, (across, up), counter-clockwise, as the section of this size has
    /// them: a stadium's straight part depends on it.
    pub fn outline(&self, section: Section) -> Vec<[f64; 2]> {
        let mut corners = Vec::new();
        self.draw(section, &mut corners);
        corners.iter().map(|[across, up]| [across / section.width, up / section.height]).collect()
    }

    /// Replaces `out` by the corners, (across, up) from the middle, counter-clockwise.
    pub(super) fn draw(&self, section: Section, out: &mut Vec<[f64; 2]>) {
        let Section { width, height } = section;
        out.clear();
        match &self.shape {
            ProfileShape::Stadium => {
                let lies = width >= height;
                let (small, large) = if lies { (height, width) } else { (width, height) };
                let radius = small / 2.0;
                let straight = (large - small) / 2.0 + radius * self.correction / 2.0;
                let right = |[cos, sin]: &[f64; 2]| [straight + radius * cos, radius * sin];
                // The other half is this one, turned by half a turn; on end, all is turned by a quarter.
                out.extend(self.unit.iter().map(right));
                out.extend_from_within(..);
                out[self.unit.len()..].iter_mut().for_each(|[y, z]| (*y, *z) = (-*y, -*z));
                if !lies {
                    out.iter_mut().for_each(|[y, z]| (*y, *z) = (-*z, *y));
                }
            }
            ProfileShape::Ellipse => {
                let (half_width, half_height) = (width / 2.0 * self.correction, height / 2.0);
                out.extend(self.unit.iter().map(|[cos, sin]| [half_width * cos, half_height * sin]));
            }
            ProfileShape::Rectangle => {
                let (y, z) = (width / 2.0, height / 2.0);
                out.extend([[-y, -z], [y, -z], [y, z], [-y, z]]);
            }
            ProfileShape::Outline(corners) => {
                out.extend(corners.iter().map(|[y, z]| [y * width, z * height]))
            }
        }
    }
}

/// Signed area and centroid of a polygon.
pub(super) fn moments(corners: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let (mut twice, mut sum) = (0.0, [0.0; 2]);
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let cross = a[0] * b[1] - a[1] * b[0];
        twice += cross;
        (0..2).for_each(|n| sum[n] += cross * (a[n] + b[n]));
    }
    (twice / 2.0, sum.map(|s| s / (3.0 * twice)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(shape: &ProfileShape, sides: usize, width: f64, height: f64) -> Vec<[f64; 2]> {
        let mut out = Vec::new();
        Profile::new(shape, sides).unwrap().draw(Section { width, height }, &mut out);
        out
    }

    #[test]
    fn polygons_have_the_area_of_what_they_stand_for() {
        for sides in [6, 8, 12, 14, 16, 64] {
            for shape in [ProfileShape::Stadium, ProfileShape::Ellipse, ProfileShape::Rectangle] {
                for (width, height) in [(0.6, 0.2), (0.4, 0.4), (0.3, 0.5)] {
                    let section = Section { width, height };
                    let (area, centroid) = moments(&drawn(&shape, sides, width, height));
                    let truth = Profile::new(&shape, sides).unwrap().area(section);
                    assert!(
                        (area / truth - 1.0).abs() < 1e-12,
                        "{shape:?} {sides} {section:?}: {area} {truth}"
                    );
                    assert!(centroid.iter().all(|c| c.abs() < 1e-12), "{shape:?}: {centroid:?}");
                }
            }
        }
        let stadium =
            Profile::new(&ProfileShape::Stadium, 8).unwrap().area(Section { width: 6.0, height: 1.5 });
        assert!((stadium - (1.5 * 4.5 + PI * 2.25 / 4.0)).abs() < 1e-12);
    }

    #[test]
    fn heights_are_kept_and_widths_nearly() {
        for sides in [8, 12, 14, 32] {
            let corners = drawn(&ProfileShape::Stadium, sides, 0.6, 0.2);
            let extent = |n: usize| corners.iter().map(|c| c[n]).fold(0.0f64, f64::max) * 2.0;
            assert_eq!(extent(1), 0.2);
            assert!((extent(0) / 0.6 - 1.0).abs() < 0.02, "{sides}: {}", extent(0));
            assert_eq!(corners.len(), sides);
        }
    }

    #[test]
    fn odd_and_wild_numbers_of_sides_are_refused() {
        for sides in [0, 2, 7, 258] {
            let message = Profile::new(&ProfileShape::Stadium, sides).unwrap_err().to_string();
            assert!(message.contains("even number"), "{message}");
        }
    }
}
