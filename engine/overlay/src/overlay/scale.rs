//! Which colour stands for a number.

use crate::picture::Ramp;
use crate::voids::{Class, Void};

/// What has no number, or one that is of no interest.
const PLAIN: [u8; 3] = [196, 196, 196];
/// Deviations within what is allowed.
const ALLOWED: [u8; 3] = [170, 200, 160];
/// The share of a half of the ramp at which deviations beyond what is allowed begin, so that they differ from those within.
const STEP: f64 = 0.3;

/// The least number of two digits that is not below another: where a scale ends.
pub fn rounded_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let step = value.log10().floor() as i32 - 1;
    let power = 10f64.powi(step.abs());
    // Rounding must not add a step to what has two digits already.
    if step < 0 { (value * power * (1.0 - 1e-12)).ceil() / power } else { (value / power).ceil() * power }
}

/// Colours of voids by what they are taken for, as [`class_colour`] gives them.
const CLASSES: [[u8; 3]; 4] = [[49, 130, 189], [98, 170, 98], [203, 24, 29], [150, 110, 170]];

/// The colour of voids of a class; of those without one last.
pub fn class_colour(class: Option<Class>) -> [u8; 3] {
    match class {
        Some(Class::Pocket) => CLASSES[0],
        Some(Class::Infill) => CLASSES[1],
        Some(Class::Flaw) => CLASSES[2],
        None => CLASSES[3],
    }
}

/// The colour of a void by its equivalent diameter, along a ramp from 0 to the greatest.
pub fn size_colour(void: &Void, most: f64) -> [u8; 3] {
    Ramp::Rising.colour(void.equivalent_diameter() / most.max(f64::MIN_POSITIVE))
}

/// The colour at a share of the ramp of sizes.
pub fn size_along(share: f64) -> [u8; 3] {
    Ramp::Rising.colour(share)
}

/// Colours of thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThicknessScale {
    /// The thickness at the end of the ramp, in the store's unit.
    pub most: f64,
    /// Whether what is thicker is plain, else it has the colour of the end.
    pub is_limit: bool,
}

impl ThicknessScale {
    /// The colour of a thickness.
    pub fn colour(self, value: f64) -> [u8; 3] {
        if !value.is_finite() || self.is_limit && value >= self.most {
            return PLAIN;
        }
        Ramp::Rising.colour(value / self.most)
    }

    /// The colour at a share of the ramp.
    pub fn along(share: f64) -> [u8; 3] {
        Ramp::Rising.colour(share)
    }

    /// The colour of what has no number, or is beyond a limit.
    pub fn plain() -> [u8; 3] {
        PLAIN
    }
}

/// Colours of deviations: red outside of the reference, blue inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationScale {
    /// The deviation at the ends, in the store's unit.
    pub most: f64,
    /// What is allowed to either side; 0 for nothing.
    pub within: f64,
}

impl DeviationScale {
    /// The colour of a deviation.
    pub fn colour(self, value: f64) -> [u8; 3] {
        if !value.is_finite() {
            return PLAIN;
        }
        if self.within > 0.0 && value.abs() <= self.within {
            return ALLOWED;
        }
        let least = if self.within > 0.0 { STEP } else { 0.0 };
        let beyond = (value.abs() - self.within) / (self.most - self.within).max(f64::MIN_POSITIVE);
        let share = least + (1.0 - least) * beyond.min(1.0);
        Ramp::Diverging.colour(0.5 + 0.5 * share.copysign(value))
    }

    /// The colour at a share of the way from one end to the other.
    pub fn along(self, share: f64) -> [u8; 3] {
        self.colour(self.most * (2.0 * share - 1.0))
    }

    /// The colour of what is allowed.
    pub fn allowed() -> [u8; 3] {
        ALLOWED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_at_two_digits_and_keep_what_has_them() {
        for (value, end) in
            [(0.8, 0.8), (0.81, 0.81), (0.811, 0.82), (12.0, 12.0), (1234.0, 1300.0), (0.0, 1.0)]
        {
            assert!((rounded_up(value) - end).abs() < 1e-12 * end, "{value}: {}", rounded_up(value));
        }
        assert!(
            (1..2000).map(|n| f64::from(n) * 0.037).all(|value| rounded_up(value) >= value * (1.0 - 1e-12))
        );
    }

    #[test]
    fn limits_and_what_is_allowed_have_colours_of_their_own() {
        let scale = ThicknessScale { most: 2.0, is_limit: true };
        assert_eq!((scale.colour(2.0), scale.colour(f64::INFINITY)), (PLAIN, PLAIN));
        assert_eq!(ThicknessScale { is_limit: false, ..scale }.colour(5.0), Ramp::Rising.colour(1.0));
        let scale = DeviationScale { most: 1.0, within: 0.1 };
        assert_eq!((scale.colour(0.1), scale.colour(-0.1)), (ALLOWED, ALLOWED));
        let [over, under] = [0.11, -0.11].map(|value| scale.colour(value));
        assert!(over[0] > over[2] + 30 && under[2] > under[0] + 30, "{over:?} {under:?}");
        assert_eq!(scale.along(1.0), Ramp::Diverging.colour(1.0));
        assert_eq!(DeviationScale { most: 1.0, within: 0.0 }.colour(0.0), Ramp::Diverging.colour(0.5));
    }
}
