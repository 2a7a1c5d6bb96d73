//! Ramps of colours for numbers other than winding numbers.

use super::colour::between;

/// Colours of even steps of lightness and hue in OKLab (Ottosson 2020).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// From bright yellow for the least through red to blue for the greatest.
    Rising,
    /// From blue below through grey in the middle to red above.
    Diverging,
}

const RISING: [[u8; 3]; 13] = [
    [249, 224, 63],
    [255, 200, 81],
    [255, 179, 91],
    [254, 156, 95],
    [255, 131, 100],
    [247, 109, 117],
    [228, 95, 139],
    [205, 86, 157],
    [178, 79, 171],
    [147, 75, 181],
    [115, 72, 184],
    [79, 70, 181],
    [32, 68, 171],
];

const DIVERGING: [[u8; 3]; 13] = [
    [34, 86, 187],
    [66, 110, 195],
    [96, 133, 202],
    [127, 156, 209],
    [158, 178, 214],
    [189, 200, 218],
    [222, 222, 222],
    [224, 195, 191],
    [224, 169, 161],
    [222, 142, 131],
    [218, 113, 101],
    [212, 82, 70],
    [204, 40, 35],
];

impl Ramp {
    /// The colour at a share of the way, 0 to 1; what lies beyond has the colour of that end.
    pub fn colour(self, share: f64) -> [u8; 3] {
        match self {
            Ramp::Rising => between(&RISING, share),
            Ramp::Diverging => between(&DIVERGING, share),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_end_where_they_should_and_rise_without_jumps() {
        assert_eq!(Ramp::Rising.colour(-1.0), RISING[0]);
        assert_eq!(Ramp::Rising.colour(7.0), RISING[12]);
        assert_eq!(Ramp::Diverging.colour(0.5), [222; 3]);
        let light = |c: [u8; 3]| 2 * u32::from(c[0]) + 7 * u32::from(c[1]) + u32::from(c[2]);
        assert!(RISING.is_sorted_by(|a, b| light(*a) > light(*b)));
        assert!(DIVERGING[..7].is_sorted_by(|a, b| light(*a) < light(*b)));
        assert!(DIVERGING[6..].is_sorted_by(|a, b| light(*a) > light(*b)));
    }
}
