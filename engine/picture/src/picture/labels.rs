//! Words within a picture: where each stands, and its pixels.

use super::canvas::Canvas;
use super::colour::{Rgba, WHITE};
use super::font::{GLYPH_HEIGHT, text_width};

/// Pixels of a letter's dot, and around a word.
const DOT: usize = 2;
const MARGIN: usize = 2;
const BLACK: Rgba = [0, 0, 0, 255];

/// A word at a place of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Where its middle is: world coordinates by the axes of `Plane::sides` in sections, pixels from the upper left corner in
    /// pictures in space.
    pub at: [f64; 2],
    /// What is written.
    pub text: String,
}

impl Label {
    /// Pixels that a word takes.
    pub fn size(text: &str) -> [usize; 2] {
        [text_width(text, DOT) + 2 * MARGIN, GLYPH_HEIGHT * DOT + 2 * MARGIN]
    }
}

/// The pixels of a word, with the upper left one of the picture that they cover first.
pub(crate) struct LabelPixels {
    at: [usize; 2],
    canvas: Canvas,
}

impl LabelPixels {
    fn overlaps(&self, other: &LabelPixels) -> bool {
        let size = |mark: &LabelPixels| [mark.canvas.width(), mark.canvas.rows().count()];
        let (own, theirs) = (size(self), size(other));
        (0..2).all(|a| self.at[a] < other.at[a] + theirs[a] && other.at[a] < self.at[a] + own[a])
    }

    /// Puts what of the word lies in a row of the picture into it.
    pub fn put(&self, y: usize, row: &mut [Rgba]) {
        let own = y.checked_sub(self.at[1]).and_then(|own| self.canvas.rows().nth(own));
        for (pixel, word) in row.iter_mut().skip(self.at[0]).zip(own.into_iter().flatten()) {
            *pixel = *word;
        }
    }
}

/// The marks of labels in a picture of this size, each first label before those that it would cover: these are left out, as are
/// those beside the picture. `place` gives the pixel at a label's middle, from the upper left one.
pub(crate) fn marks(
    labels: &[Label],
    size: [usize; 2],
    place: impl Fn([f64; 2]) -> [f64; 2],
) -> Vec<LabelPixels> {
    let mut marks: Vec<LabelPixels> = Vec::new();
    for label in labels {
        let word = Label::size(&label.text);
        let middle = place(label.at);
        let inside = (0..2).all(|a| middle[a] >= 0.0 && middle[a] < size[a] as f64);
        if !inside || (0..2).any(|a| word[a] > size[a]) {
            continue;
        }
        let at = [0, 1].map(|a| (middle[a] as usize).saturating_sub(word[a] / 2).min(size[a] - word[a]));
        let mut canvas = Canvas::new(word[0], word[1], WHITE);
        canvas.text([MARGIN; 2], &label.text, DOT, BLACK);
        let mark = LabelPixels { at, canvas };
        if !marks.iter().any(|other| mark.overlaps(other)) {
            marks.push(mark);
        }
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_in_the_picture_and_cover_no_others() {
        let label = |x: f64, y: f64, text: &str| Label { at: [x, y], text: text.to_owned() };
        let labels =
            [label(30.0, 25.0, "7"), label(34.0, 26.0, "8"), label(1.0, 1.0, "9"), label(-5.0, 3.0, "1")];
        let found = marks(&labels, [60, 40], |at| at);
        assert_eq!(found.len(), 2);
        assert_eq!(found[1].at, [0, 0]);
        let mut row = vec![BLACK; 60];
        found[0].put(25, &mut row);
        let white = row.iter().filter(|pixel| **pixel == WHITE).count();
        assert!(white > 4 && white < 14, "{white}");
        let before = row.clone();
        found[0].put(39, &mut row);
        assert_eq!(row, before);
    }
}
