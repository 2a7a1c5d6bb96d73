//! Legends of colours that something else than w decides: swatches with names, and bars with ticks.

use super::canvas::Canvas;
use super::colour::{Rgba, WHITE};
use super::font::{GLYPH_HEIGHT, text_width};

const INK: Rgba = [40, 40, 40, 255];
const LINE: Rgba = [200, 200, 200, 255];
/// Width of a bar, in dots of the lettering.
const BAR: usize = 160;

/// A bar of colours. Places on it are shares of its length, from 0 to 1.
pub struct Bar<'a> {
    /// The colour at a place.
    pub colour: &'a dyn Fn(f64) -> [u8; 3],
    /// Places with what is written there, from the left; where a text would touch the one before it is left out.
    pub ticks: Vec<(f64, String)>,
}

/// What stands below a picture.
pub struct Legend<'a> {
    /// What the colours mean.
    pub title: String,
    /// A bar.
    pub bar: Option<Bar<'a>>,
    /// Colours with their names.
    pub swatches: Vec<([u8; 3], String)>,
}

impl Legend<'_> {
    /// As pixels, for a picture of that width; wider where it has to be.
    pub fn draw(&self, width: usize) -> Canvas {
        let largest = ((width + 200) / 400).clamp(1, 16);
        let fits = |dot: &usize| self.place(None, *dot).0 <= width;
        let dot = (1..=largest).rev().find(fits).unwrap_or(1);
        let (needed, height) = self.place(None, dot);
        let full = width.max(needed);
        let mut canvas = Canvas::new(full, height, WHITE);
        canvas.fill([0, 0], [full, dot], LINE);
        self.place(Some(&mut canvas), dot);
        canvas
    }

    /// Draws it, if there is a canvas; returns the size that it takes.
    fn place(&self, mut canvas: Option<&mut Canvas>, dot: usize) -> (usize, usize) {
        let (gap, side) = (6 * dot, GLYPH_HEIGHT * dot);
        let (mut x, y) = (gap, gap);
        let write = |canvas: &mut Option<&mut Canvas>, at: [usize; 2], text: &str| {
            if let Some(canvas) = canvas {
                canvas.text(at, text, dot, INK);
            }
        };
        write(&mut canvas, [x, y], &self.title);
        x += text_width(&self.title, dot) + gap;
        if let Some(bar) = &self.bar {
            let half = |text: &str| text_width(text, dot) / 2;
            x += bar.ticks.first().map_or(0, |(_, text)| half(text));
            let length = BAR * dot;
            if let Some(canvas) = &mut canvas {
                canvas.fill([x, y], [length, side], INK);
                for step in dot..length - dot {
                    let share = (step - dot) as f64 / (length - 2 * dot - 1) as f64;
                    let [r, g, b] = (bar.colour)(share);
                    canvas.fill([x + step, y + dot], [1, side - 2 * dot], [r, g, b, 255]);
                }
            }
            let mut free = 0;
            for (share, text) in &bar.ticks {
                let at = x + (share.clamp(0.0, 1.0) * (length - dot) as f64 + 0.5) as usize;
                let left = at.saturating_sub(half(text));
                if left < free {
                    continue;
                }
                if let Some(canvas) = &mut canvas {
                    canvas.fill([at, y + side], [dot, 2 * dot], INK);
                }
                write(&mut canvas, [left, y + side + 3 * dot], text);
                free = left + text_width(text, dot) + 3 * dot;
            }
            x = (x + length).max(free) + gap;
        }
        for (colour, name) in &self.swatches {
            if let Some(canvas) = &mut canvas {
                let [r, g, b] = *colour;
                canvas.fill([x, y], [2 * side, side], INK);
                canvas.fill([x + dot, y + dot], [2 * side - 2 * dot, side - 2 * dot], [r, g, b, 255]);
            }
            x += 2 * side + 2 * dot;
            write(&mut canvas, [x, y], name);
            x += text_width(name, dot) + gap;
        }
        let ticks = if self.bar.is_some() { side + 3 * dot } else { 0 };
        (x, y + side + ticks + gap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legends_have_all_colours_and_fit_where_they_can() {
        let ramp = |share: f64| [(share * 200.0) as u8, 0, 7];
        let ticks = vec![(0.0, "0".to_owned()), (0.01, "left out".to_owned()), (1.0, "2.5".to_owned())];
        let swatches = vec![([1, 2, 3], "thicker".to_owned())];
        let legend =
            Legend { title: "thickness in mm".to_owned(), bar: Some(Bar { colour: &ramp, ticks }), swatches };
        let canvas = legend.draw(900);
        assert_eq!(canvas.width(), 900);
        let pixels: Vec<Rgba> = canvas.rows().flatten().copied().collect();
        for colour in [[0, 0, 7, 255], [200, 0, 7, 255], [1, 2, 3, 255], INK] {
            assert!(pixels.contains(&colour), "{colour:?}");
        }
        // Narrower pictures have smaller letters, down to a width that it needs.
        let narrow = legend.draw(10);
        assert!(narrow.width() > 300 && narrow.rows().count() < canvas.rows().count());
    }
}
