//! Colours, and which one stands for a winding number.

/// Red, green, blue and opacity, sRGB, not multiplied by the opacity.
pub type Rgba = [u8; 4];

/// Opaque white, the colour of w = 0.
pub const WHITE: Rgba = [255; 4];

/// From pale to dark through green, teal and blue to violet: even steps of lightness, from 0.98 to 0.24, and an even turn of
/// hue in OKLab (Ottosson 2020), so that equal differences of w look equal.
const EVEN: [[u8; 3]; 17] = [
    [248, 248, 248],
    [231, 235, 219],
    [208, 224, 196],
    [178, 214, 178],
    [142, 205, 169],
    [98, 195, 166],
    [26, 183, 170],
    [6, 165, 171],
    [0, 147, 169],
    [0, 130, 166],
    [5, 111, 163],
    [20, 92, 163],
    [45, 72, 149],
    [55, 53, 131],
    [59, 35, 111],
    [58, 16, 88],
    [54, 0, 65],
];

/// Of whole winding numbers from 0: blues where all is well, warm colours where more than two pieces overlap.
const COUNTED: [[u8; 3]; 7] = [
    [255, 255, 255],
    [158, 202, 225],
    [49, 130, 189],
    [253, 141, 60],
    [203, 24, 29],
    [122, 1, 119],
    [40, 0, 60],
];

/// Of winding numbers below 0: pieces inside out.
const NEGATIVE: [u8; 3] = [120, 190, 32];

/// How colours stand for winding numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// One colour for each whole number.
    Counted,
    /// Even steps from 0 to the number.
    Even(f64),
}

impl Scale {
    /// The whole number from which on [`Scale::Counted`] has one colour for all.
    pub const COUNTED_LAST: i32 = COUNTED.len() as i32 - 1;

    /// The colour of `w`.
    pub fn colour(self, w: f64) -> Rgba {
        let [r, g, b] = match self {
            Scale::Counted if w < -0.5 => NEGATIVE,
            Scale::Counted => COUNTED[(w + 0.5).clamp(0.0, f64::from(Scale::COUNTED_LAST)) as usize],
            Scale::Even(last) => between(&EVEN, w / last),
        };
        [r, g, b, 255]
    }
}

/// The colour at `t`, 0 to 1, of a table of even steps.
pub(super) fn between(table: &[[u8; 3]], t: f64) -> [u8; 3] {
    let at = t.clamp(0.0, 1.0) * (table.len() - 1) as f64;
    let low = (at as usize).min(table.len() - 2);
    let part = at - low as f64;
    std::array::from_fn(|c| {
        let [a, b] = [low, low + 1].map(|n| f64::from(table[n][c]));
        (a + (b - a) * part + 0.5) as u8
    })
}

/// The mean of colours, each with the weight of its opacity.
pub fn mean(colours: &[Rgba]) -> Rgba {
    let opacity: u32 = colours.iter().map(|c| u32::from(c[3])).sum();
    if opacity == 0 {
        return [0; 4];
    }
    let channel = |n: usize| -> u8 {
        let sum: u32 = colours.iter().map(|c| u32::from(c[n]) * u32::from(c[3])).sum();
        ((sum + opacity / 2) / opacity) as u8
    };
    let count = colours.len() as u32;
    [channel(0), channel(1), channel(2), ((opacity + count / 2) / count) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_have_colours_of_their_own_and_even_ones_darken() {
        let all: Vec<Rgba> = (-1..=Scale::COUNTED_LAST).map(|w| Scale::Counted.colour(w.into())).collect();
        for (n, colour) in all.iter().enumerate() {
            assert!(!all[..n].contains(colour), "{n}");
        }
        assert_eq!(Scale::Counted.colour(0.0), WHITE);
        assert_eq!(Scale::Counted.colour(1e9), all[all.len() - 1]);
        let light = |c: [u8; 3]| 2 * u32::from(c[0]) + 7 * u32::from(c[1]) + u32::from(c[2]);
        assert!(EVEN.is_sorted_by(|a, b| light(*a) > light(*b)));
        assert_eq!(Scale::Even(3.0).colour(0.0), [248, 248, 248, 255]);
        assert_eq!(Scale::Even(3.0).colour(3.0), [54, 0, 65, 255]);
        assert_eq!(Scale::Even(1.0).colour(0.5 / 16.0), [240, 242, 234, 255]);
    }

    #[test]
    fn means_count_what_is_seen() {
        assert_eq!(mean(&[[10, 20, 30, 255], [20, 40, 60, 255]]), [15, 30, 45, 255]);
        assert_eq!(mean(&[[10, 20, 30, 255], [0, 0, 0, 0]]), [10, 20, 30, 128]);
        assert_eq!(mean(&[[9; 4]; 4]), [9; 4]);
        assert_eq!(mean(&[[9, 9, 9, 0]]), [0; 4]);
    }
}
