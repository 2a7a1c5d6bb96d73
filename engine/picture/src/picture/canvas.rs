//! A small picture in memory: legends and their lettering.

use super::colour::Rgba;
use super::font::{GLYPH_HEIGHT, GLYPH_WIDTH, glyph};

/// Pixels in rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    width: usize,
    pixels: Vec<Rgba>,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: usize, height: usize, colour: Rgba) -> Canvas {
        Canvas { width, pixels: vec![colour; width * height] }
    }

    /// A canvas of pixels that are there already, `width` a row from the top.
    pub fn of(width: usize, pixels: Vec<Rgba>) -> Canvas {
        assert!(width > 0 && pixels.len().is_multiple_of(width), "rows are whole");
        Canvas { width, pixels }
    }

    /// Its pixels, row by row from the top.
    pub fn into_pixels(self) -> Vec<Rgba> {
        self.pixels
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Its rows, from the top.
    pub fn rows(&self) -> impl Iterator<Item = &[Rgba]> {
        self.pixels.chunks_exact(self.width)
    }

    /// Fills a rectangle with the upper left pixel `at`; what lies outside is left out.
    pub fn fill(&mut self, at: [usize; 2], size: [usize; 2], colour: Rgba) {
        let end = (at[0] + size[0]).min(self.width);
        for row in self.pixels.chunks_exact_mut(self.width).skip(at[1]).take(size[1]) {
            if at[0] < end {
                row[at[0]..end].fill(colour);
            }
        }
    }

    /// Lays another canvas over it, with its upper left pixel `at`; what lies outside is left out.
    pub fn lay(&mut self, at: [usize; 2], other: &Canvas) {
        let width = other.width.min(self.width.saturating_sub(at[0]));
        let rows = self.pixels.chunks_exact_mut(self.width).skip(at[1]);
        for (row, pixels) in rows.zip(other.rows()).filter(|_| width > 0) {
            row[at[0]..at[0] + width].copy_from_slice(&pixels[..width]);
        }
    }

    /// Writes text with the upper left pixel `at`, each dot of a letter `dot` pixels wide.
    pub fn text(&mut self, at: [usize; 2], text: &str, dot: usize, colour: Rgba) {
        for (number, letter) in text.chars().enumerate() {
            let left = at[0] + number * (GLYPH_WIDTH + 1) * dot;
            for (y, row) in glyph(letter).into_iter().enumerate().take(GLYPH_HEIGHT) {
                for x in (0..GLYPH_WIDTH).filter(|x| row >> (GLYPH_WIDTH - 1 - x) & 1 == 1) {
                    self.fill([left + x * dot, at[1] + y * dot], [dot, dot], colour);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{WHITE, text_width};

    #[test]
    fn letters_stand_where_they_should_and_are_cut_off_at_the_border() {
        const BLACK: Rgba = [0, 0, 0, 255];
        let mut canvas = Canvas::new(14, 9, WHITE);
        canvas.text([1, 1], "1L", 1, BLACK);
        let drawn: Vec<String> = canvas
            .rows()
            .map(|row| row.iter().map(|p| if *p == BLACK { '#' } else { '.' }).collect())
            .collect();
        let expected = [
            "..............",
            "...#...#......",
            "..##...#......",
            "...#...#......",
            "...#...#......",
            "...#...#......",
            "...#...#......",
            "..###..#####..",
            "..............",
        ];
        assert_eq!(drawn, expected);
        canvas.text([10, 5], "888", 3, BLACK);
        let dots = Canvas::new(3, 2, [7, 7, 7, 255]);
        for (at, count) in [([0, 0], 6), ([12, 8], 2), ([14, 0], 0), ([0, 9], 0)] {
            let mut under = Canvas::new(14, 9, WHITE);
            under.lay(at, &dots);
            assert_eq!(under.rows().flatten().filter(|pixel| **pixel != WHITE).count(), count, "{at:?}");
        }
        assert_eq!(text_width("888", 3), 51);
    }
}
