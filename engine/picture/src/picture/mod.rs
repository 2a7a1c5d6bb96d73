//! Pictures as rows of pixels: colours, a canvas with lettering, PNG files written row by row.
//!
//! Knows nothing of bricks; [`crate::section`] and [`crate::render`] decide what the pixels are. Colours are 8-bit sRGB, and
//! all arithmetic on them is exact or in plain f64, so that a picture has the same bytes whoever draws it.

mod canvas;
mod colour;
mod font;
mod labels;
mod legend;
mod png_file;
mod ramp;

pub use canvas::Canvas;
pub use colour::{Rgba, Scale, WHITE, mean};
pub use font::{GLYPH_HEIGHT, GLYPH_WIDTH, text_width};
pub use labels::Label;
pub(crate) use labels::{LabelPixels, marks};
pub use legend::{Bar, Legend};
pub use png_file::{ANIMATED_SIDE_MAX, Animation, PngRows, write_apng, write_png};
pub use ramp::Ramp;

/// Most pixels along a side of a picture.
pub const SIDE_MAX: u32 = 65_535;
