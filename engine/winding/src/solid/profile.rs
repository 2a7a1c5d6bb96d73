//! The cross-section of a bead, in lattice units.

use std::f64::consts::{FRAC_PI_4, PI};

/// The shape between a bead's width and its height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Outline {
    /// A rectangle with half discs at its sides; standing upright where a bead is higher than wide.
    #[default]
    Stadium,
    /// An ellipse.
    Ellipse,
}

impl Outline {
    /// As stores and the command line have it.
    #[inline]
    pub fn name(self) -> &'static str {
        match self {
            Outline::Stadium => "stadium",
            Outline::Ellipse => "ellipse",
        }
    }

    /// Inverse of [`Outline::name`].
    #[inline]
    pub fn from_name(name: &str) -> Option<Outline> {
        [Outline::Stadium, Outline::Ellipse].into_iter().find(|outline| outline.name() == name)
    }
}

/// A cross-section with the tool's axis, as the numbers of one inequality. With d the distance from the
/// segment in the plane perpendicular to n, and n the height above that plane, a point is inside where
///
/// aspect · max(0, d − flat_side)² + max(0, |n| − flat_top)² ≤ radius²
///
/// The left side is convex along every line, and smooth where it is positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidProfile {
    /// Where the tool's axis points, a unit vector.
    pub axis: [f64; 3],
    /// Half of the section's width, in units.
    pub half_width: f64,
    /// Half of its height, in units.
    pub half_height: f64,
    /// Half the width of the flat upper side, in units; 0 for an ellipse.
    pub flat_side: f64,
    /// Half the height of the flat sides of a stadium that stands upright, in units.
    pub flat_top: f64,
    /// (height / width)² of an ellipse, 1 for a stadium.
    pub aspect: f64,
    /// The radius of a stadium's rounding, half the height of an ellipse; in units.
    pub radius: f64,
}

impl SolidProfile {
    /// The section with these half extents.
    #[inline]
    pub fn new(outline: Outline, half_width: f64, half_height: f64, axis: [f64; 3]) -> SolidProfile {
        let (radius, aspect) = match outline {
            Outline::Stadium => (if half_width < half_height { half_width } else { half_height }, 1.0),
            Outline::Ellipse => (half_height, (half_height / half_width) * (half_height / half_width)),
        };
        let (flat_side, flat_top) = match outline {
            Outline::Stadium => (half_width - radius, half_height - radius),
            Outline::Ellipse => (0.0, 0.0),
        };
        SolidProfile { axis, half_width, half_height, flat_side, flat_top, aspect, radius }
    }

    /// Whether the section has an area.
    #[inline]
    pub fn is_solid(&self) -> bool {
        self.half_width > 0.0 && self.half_height > 0.0
    }

    /// Area of the section, in square units.
    #[inline]
    pub fn area(&self) -> f64 {
        let SolidProfile { flat_side, flat_top, aspect, radius, .. } = *self;
        let round = 1.0 / aspect.sqrt();
        let within = flat_top * (flat_side + radius * round);
        4.0 * (within + flat_side * radius + FRAC_PI_4 * radius * radius * round)
    }

    /// Volume of both round ends of a segment, in cubic units: of the section's half, turned about n.
    #[inline]
    pub fn end_volume(&self) -> f64 {
        let SolidProfile { flat_side, flat_top, aspect, radius, .. } = *self;
        let round = 1.0 / aspect.sqrt();
        let half_width = flat_side + radius * round;
        let curved = flat_side * flat_side * radius
            + 2.0 * FRAC_PI_4 * flat_side * radius * radius * round
            + 2.0 / 3.0 * radius * radius * radius * round * round;
        2.0 * PI * (flat_top * half_width * half_width + curved)
    }

    /// How far the section reaches from the centre line along a direction whose cosine with n is `cosine`,
    /// its round ends included.
    #[inline]
    pub fn reach(&self, cosine: f64) -> f64 {
        let along_n = cosine * cosine;
        let across = if along_n < 1.0 { 1.0 - along_n } else { 0.0 };
        let round = self.radius * (across / self.aspect + along_n).sqrt();
        self.flat_side * across.sqrt() + self.flat_top * cosine.abs() + round
    }
}
