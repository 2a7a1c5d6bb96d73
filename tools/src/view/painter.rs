//! Pictures of a store that get better and better.

use super::session::Shot;
use brickfield_engine::picture::Rgba;
use brickfield_engine::render::{RenderOptions, Scene, Style, Tint};
use brickfield_engine::{Error, Progress};
use std::time::{Duration, Instant};

/// How long the first picture may take: twenty a second look like a movement.
const FIRST_TIME: Duration = Duration::from_millis(40);
/// Sides of the pixels of a first picture, in pixels of the window; the largest for the very first one, when all bricks
/// are yet to be read.
const COARSENESS: [u32; 2] = [2, 16];
/// Size of the cells of a first picture, in its own pixels.
const FIRST_CELL_PIXELS: f64 = 1.0;

/// A part of a picture that is being painted.
pub struct Rows<'a> {
    /// Width and height of the whole picture at this step: the window's, or less.
    pub size: [u32; 2],
    /// Number of the first row, from the top.
    pub from: u32,
    /// One row after the other.
    pub pixels: &'a [Rgba],
}

/// What tells a painter to leave off.
#[derive(Clone, Copy)]
pub struct StopConditions<'a> {
    /// Another picture is wanted, or none.
    pub another: &'a dyn Progress,
    /// No picture is wanted any more.
    pub over: &'a dyn Progress,
}

/// Whose pixels a complete picture has. What was found is the processor's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelSource {
    /// Those of `render --backend cpu`.
    #[default]
    Processor,
    /// Those of `render --backend vulkan`.
    Device,
}

/// Paints what a session wants to see. The window knows nothing else of whoever does it.
pub trait Painter {
    /// Paints a shot in steps, the first of them within some 50 ms, and hands over rows as they are done. All rows of the
    /// last step have the shot's size, and are those of `render`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] as soon as it is over, and behind the first step as soon as another picture is wanted; what
    /// reading the store gives.
    fn paint(
        &mut self,
        shot: &Shot,
        until: StopConditions<'_>,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<PixelSource, Error>;
}

/// A style and what lies behind.
#[derive(Clone)]
pub struct Appearance<'a> {
    pub style: Style,
    pub background: Rgba,
    /// Colours of what was found; the processor paints these.
    pub tint: Option<&'a dyn Tint>,
}

/// The processor, by rays.
pub struct CpuPainter<'a> {
    looks: Vec<Appearance<'a>>,
    /// What the shots have in common.
    options: RenderOptions,
    /// The last one: its index and bricks are at hand for the next.
    pub(super) scene: Scene<'a>,
    coarseness: u32,
}

impl<'a> CpuPainter<'a> {
    /// Paints what `scene` shows in the styles that shots name by their number. Of its `options`, what a shot says does
    /// not matter.
    pub fn new(scene: Scene<'a>, looks: Vec<Appearance<'a>>, options: RenderOptions) -> CpuPainter<'a> {
        CpuPainter { looks, options, scene, coarseness: COARSENESS[1] }
    }

    /// The options for a picture of a shot.
    pub(super) fn options(&self, shot: &Shot) -> RenderOptions {
        let Appearance { style, background, .. } = self.looks[shot.style].clone();
        RenderOptions {
            style,
            background,
            view: shot.view,
            focus: Some(shot.focus),
            cuts: shot.cut.into_iter().collect(),
            size: shot.size,
            ..self.options.clone()
        }
    }

    /// The colours of what was found, if the shot shows that.
    pub(super) fn tint(&self, shot: &Shot) -> Option<&'a dyn Tint> {
        self.looks[shot.style].tint
    }

    /// The scene of a picture, which takes the place of the last one.
    pub(super) fn scene_of(
        &mut self,
        options: &RenderOptions,
        tint: Option<&'a dyn Tint>,
    ) -> Result<&Scene<'a>, Error> {
        let scene = self.scene.with(options)?;
        self.scene = match tint {
            Some(tint) => scene.tinted(tint),
            None => scene,
        };
        Ok(&self.scene)
    }

    /// Draws one step of a shot.
    fn step(
        &mut self,
        (options, tint): (&RenderOptions, Option<&'a dyn Tint>),
        stop: &dyn Progress,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<(), Error> {
        for frame in self.scene_of(options, tint)?.frames() {
            frame.draw(stop, in_rows(options.size, show))?;
        }
        Ok(())
    }
}

impl Painter for CpuPainter<'_> {
    fn paint(
        &mut self,
        shot: &Shot,
        until: StopConditions<'_>,
        show: &mut dyn FnMut(Rows<'_>),
    ) -> Result<PixelSource, Error> {
        let (whole, tint) = (self.options(shot), self.tint(shot));
        let started = Instant::now();
        // Another picture does not stop it: who moves all the time would see nothing.
        self.step((&first(&whole, self.coarseness), tint), until.over, show)?;
        self.coarseness = next_coarseness(self.coarseness, COARSENESS, started.elapsed());
        if whole.supersample > 1 {
            self.step((&RenderOptions { supersample: 1, ..whole.clone() }, tint), until.another, show)?;
        }
        self.step((&whole, tint), until.another, show)?;
        Ok(PixelSource::Processor)
    }
}

/// Hands over a picture row by row.
pub(super) fn in_rows(
    size: [u32; 2],
    show: &mut dyn FnMut(Rows<'_>),
) -> impl FnMut(&[Rgba]) -> Result<(), Error> {
    let mut from = 0;
    move |pixels| {
        show(Rows { size, from, pixels });
        from += 1;
        Ok(())
    }
}

/// A first picture in place of the whole one, of pixels that are so many times as large.
pub(super) fn first(whole: &RenderOptions, coarseness: u32) -> RenderOptions {
    RenderOptions {
        size: whole.size.map(|side| side.div_ceil(coarseness)),
        supersample: 1,
        cell_pixels: whole.cell_pixels.max(FIRST_CELL_PIXELS),
        ..whole.clone()
    }
}

/// Sides of the pixels of the next first picture, by the time that this one took: pixels go with the square.
pub(super) fn next_coarseness(now: u32, [least, most]: [u32; 2], took: Duration) -> u32 {
    let wanted = f64::from(now) * (took.as_secs_f64() / FIRST_TIME.as_secs_f64()).sqrt();
    // Halfway, so that one slow picture does not make the next ones blurred.
    let wanted = (f64::from(now) + wanted) / 2.0;
    (wanted.round() as u32).clamp(least, most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_pictures_get_as_fine_as_time_allows() {
        let converge = |start: u32, seconds_a_pixel: f64| {
            (0..20).fold(start, |coarse, _| {
                let pixels = 1280.0 * 720.0 / f64::from(coarse * coarse);
                next_coarseness(coarse, COARSENESS, Duration::from_secs_f64(pixels * seconds_a_pixel))
            })
        };
        for start in COARSENESS {
            assert_eq!(converge(start, 1e-9), COARSENESS[0]);
            assert_eq!(converge(start, 1e-3), COARSENESS[1]);
            // 400 ns a pixel: 100,000 pixels, so about 3 × 3 of the window each.
            assert!((3..=4).contains(&converge(start, 4e-7)));
        }
    }
}
