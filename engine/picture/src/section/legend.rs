//! What stands below a section: where it lies, a scale bar, and which colour means what.

use crate::picture::{Canvas, GLYPH_HEIGHT, Rgba, Scale, WHITE, text_width};

const INK: Rgba = [40, 40, 40, 255];
/// Width of a gradient, in dots of the lettering.
const GRADIENT: usize = 96;

/// What a legend says.
pub(super) struct SectionLegend<'a> {
    pub title: String,
    /// Colours of w, where it is shown.
    pub scale: Option<Scale>,
    /// Smallest and largest w.
    pub range: (i16, i16),
    /// Size of a pixel in world units.
    pub pixel: f64,
    pub unit: &'a str,
}

impl SectionLegend<'_> {
    /// Two lines below a picture of that width, wider than it where they have to be: title and scale bar, then colours.
    pub fn draw(&self, width: usize) -> Canvas {
        let dot = ((width + 200) / 400).clamp(1, 16);
        let (gap, line) = (6 * dot, (GLYPH_HEIGHT + 5) * dot);
        let (bar, length) = self.scale_bar(width);
        let label = format!("{} {}", plain(length), self.unit);
        let first = text_width(&self.title, dot) + text_width(&label, dot) + bar + 4 * gap;
        let second = self.colours(None, dot, [gap, 0]) + gap;
        let full = width.max(first).max(second);
        let lines = if self.scale.is_some() { 2 } else { 1 };
        let mut canvas = Canvas::new(full, lines * line + gap, WHITE);
        canvas.fill([0, 0], [full, dot], [200, 200, 200, 255]);
        canvas.text([gap, gap], &self.title, dot, INK);
        let left = full - gap - bar;
        let top = gap + GLYPH_HEIGHT * dot;
        canvas.fill([left, top - 2 * dot], [bar, 2 * dot], INK);
        for end in [left, left + bar - dot] {
            canvas.fill([end, top - 5 * dot], [dot, 5 * dot], INK);
        }
        canvas.text([left - gap - text_width(&label, dot), gap], &label, dot, INK);
        self.colours(Some(&mut canvas), dot, [gap, gap + line]);
        canvas
    }

    /// Pixels and world length of a bar of 1, 2 or 5 times a power of ten, a quarter of the picture long or less.
    fn scale_bar(&self, width: usize) -> (usize, f64) {
        let most = (width as f64 * self.pixel / 4.0).max(self.pixel * 4.0);
        let mut power = 1.0f64;
        while power > most {
            power /= 10.0;
        }
        while power * 10.0 <= most {
            power *= 10.0;
        }
        let length = [5.0, 2.0, 1.0].map(|n| n * power).into_iter().find(|length| *length <= most);
        let length = length.unwrap_or(power);
        ((length / self.pixel + 0.5).max(1.0) as usize, length)
    }

    /// Draws the colours, if there is a canvas, from a pixel on; returns where they end.
    fn colours(&self, mut canvas: Option<&mut Canvas>, dot: usize, [mut x, y]: [usize; 2]) -> usize {
        let Some(scale) = self.scale else { return x };
        let side = GLYPH_HEIGHT * dot;
        let text = |canvas: &mut Option<&mut Canvas>, x: &mut usize, text: &str| {
            if let Some(canvas) = canvas {
                canvas.text([*x, y], text, dot, INK);
            }
            *x += text_width(text, dot);
        };
        let framed = |canvas: &mut Option<&mut Canvas>, x: usize, width: usize, w: &dyn Fn(usize) -> f64| {
            let Some(canvas) = canvas else { return };
            canvas.fill([x, y], [width, side], INK);
            for step in dot..width - dot {
                let colour = scale.colour(w(step - dot));
                canvas.fill([x + step, y + dot], [1, side - 2 * dot], colour);
            }
        };
        text(&mut canvas, &mut x, "w");
        match scale {
            Scale::Counted => {
                for w in self.whole_numbers() {
                    x += 6 * dot;
                    framed(&mut canvas, x, 2 * side, &|_| f64::from(w));
                    x += 2 * side + 2 * dot;
                    let more = w == Scale::COUNTED_LAST && i32::from(self.range.1) > w;
                    let name = if w < 0 { "<0".to_owned() } else { w.to_string() };
                    text(&mut canvas, &mut x, &(name + if more { "+" } else { "" }));
                }
            }
            Scale::Even(last) => {
                x += 6 * dot;
                text(&mut canvas, &mut x, "0");
                x += 2 * dot;
                let steps = ((GRADIENT - 2) * dot - 1) as f64;
                framed(&mut canvas, x, GRADIENT * dot, &|step| last * step as f64 / steps);
                x += (GRADIENT + 2) * dot;
                text(&mut canvas, &mut x, &plain(last));
            }
        }
        x
    }

    fn whole_numbers(&self) -> impl Iterator<Item = i32> {
        let (low, high) = (i32::from(self.range.0), i32::from(self.range.1));
        low.clamp(-1, 0)..=high.clamp(0, Scale::COUNTED_LAST)
    }
}

/// A number with as many digits as it needs, six after the point at most.
pub fn plain(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
