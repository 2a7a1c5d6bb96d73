//! Depth made visible: what lies behind its surroundings in the picture is darkened, as in eye-dome lighting (Boucheny
//! 2009), here by second differences of the depth, so that slopes stay as they are.

use crate::picture::Rgba;

/// Distances at which surroundings are looked at, in pixels of a picture 360 pixels high.
const REACHES: [usize; 3] = [1, 2, 5];
/// Most pixels that count as one of those.
const UNIT_MAX: usize = 6;
/// Directions, each with its opposite.
const PAIRS: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];
/// How much darker a pixel gets that lies as far behind its surroundings as they are beside it.
const STRENGTH: f64 = 0.55;
/// Differences of depth beyond so many times the distance count as that.
const STEEPEST: f64 = 3.0;

/// Rows of pixels with the depth of what they show, infinite where there is nothing.
pub(super) struct Band {
    pub width: usize,
    pub pixels: Vec<Rgba>,
    pub depths: Vec<f64>,
}

impl Band {
    pub fn rows(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }
}

/// A band between the one above it and the one below, if there are any.
pub(super) struct BandNeighbours<'a> {
    pub above: Option<&'a Band>,
    pub band: &'a Band,
    pub below: Option<&'a Band>,
    /// Pixels that count as one, by the picture's height.
    pub unit: usize,
}

/// Pixels that count as one in a picture so high.
pub(super) fn unit_of(height: u32) -> usize {
    ((height as usize + 180) / 360).clamp(1, UNIT_MAX)
}

impl BandNeighbours<'_> {
    /// The depth at a pixel beside the band's `at`; that of nothing is infinite.
    fn depth(&self, x: isize, y: isize) -> f64 {
        let rows = self.band.rows() as isize;
        let (band, y) = if y < 0 {
            (self.above, y + self.above.map_or(0, |band| band.rows() as isize))
        } else if y >= rows {
            (self.below, y - rows)
        } else {
            (Some(self.band), y)
        };
        match band {
            Some(band) if x >= 0 && (x as usize) < band.width && y >= 0 && (y as usize) < band.rows() => {
                band.depths[y as usize * band.width + x as usize]
            }
            _ => f64::INFINITY,
        }
    }

    /// A row of the band, darkened; `pixel` is the size of a pixel at a distance.
    pub fn row(&self, y: usize, pixel: impl Fn(f64) -> f64) -> Vec<Rgba> {
        let from = y * self.band.width;
        let row = &self.band.pixels[from..from + self.band.width];
        let darkened = |(x, colour): (usize, &Rgba)| {
            let depth = self.band.depths[from + x];
            if !depth.is_finite() {
                return *colour;
            }
            let light = self.light([x as isize, y as isize], depth, pixel(depth));
            let [r, g, b] = [0, 1, 2].map(|c| (f64::from(colour[c]) * light + 0.5) as u8);
            [r, g, b, colour[3]]
        };
        row.iter().enumerate().map(darkened).collect()
    }

    fn light(&self, [x, y]: [isize; 2], depth: f64, pixel: f64) -> f64 {
        let mut light = 1.0;
        for reach in REACHES {
            let reach = reach * self.unit;
            let mut behind = 0.0;
            for [dx, dy] in PAIRS {
                let [dx, dy] = [dx * reach as isize, dy * reach as isize];
                let length = reach as f64 * pixel * if dx == 0 || dy == 0 { 1.0 } else { 1.5 };
                let beside = [1, -1].map(|sign| self.depth(x + sign * dx, y + sign * dy));
                // Beside nothing there is nothing to be behind of.
                if beside.iter().all(|other| other.is_finite()) {
                    let [a, b] = beside.map(|other| ((depth - other) / length).clamp(-STEEPEST, STEEPEST));
                    behind += ((a + b) / 2.0).max(0.0);
                }
            }
            light /= 1.0 + STRENGTH * behind / PAIRS.len() as f64;
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn band(depth: impl Fn(usize, usize) -> f64) -> Band {
        let depths = (0..64).map(|n| depth(n % 8, n / 8)).collect();
        Band { width: 8, pixels: vec![[200, 100, 50, 255]; 64], depths }
    }

    #[test]
    fn slopes_stay_and_grooves_darken() {
        let slope = band(|x, y| 10.0 + x as f64 + 2.0 * y as f64);
        let groove = band(|x, _| if x == 4 { 12.0 } else { 10.0 });
        let nothing = band(|_, _| f64::INFINITY);
        let rows = |band: &Band| {
            let between = BandNeighbours { above: None, band, below: Some(&nothing), unit: 1 };
            between.row(4, |_| 1.0)
        };
        assert!(rows(&slope)[3..5].iter().all(|p| *p == [200, 100, 50, 255]));
        assert_eq!(rows(&nothing), nothing.pixels[..8]);
        let groove = rows(&groove);
        assert!(groove[4][0] < 150 && groove[4][3] == 255 && groove[0] == [200, 100, 50, 255], "{groove:?}");
    }
}
