//! Pictures of an octree, with the feature `pictures`.

use crate::lattice::Axis;
use crate::octree::Octree;
use crate::render::{RenderOptions, Scene, View, write_frame};
use crate::section::{Plane, SectionPicture, SectionSummary, write_picture};
use crate::{Error, Result, Silent};
use std::path::Path;

/// Pixels of the longer side of the part in a section.
const PIXELS: u32 = 1024;

impl Octree {
    /// A plane section as a PNG, 1024 pixels along its longer side.
    ///
    /// # Errors
    /// As [`write_picture`].
    pub fn write_slice(&self, path: impl AsRef<Path>, axis: Axis, at: f64) -> Result<SectionSummary> {
        let plane = Plane { axis, at };
        let (low, high) = self.bounds();
        let longer =
            plane.sides().map(|side| high[side.index()] - low[side.index()]).into_iter().fold(0.0, f64::max);
        let window = plane.window([low, high]);
        let pixel = Some(longer / f64::from(PIXELS));
        let legend = Some(self.unit().to_owned());
        let what = SectionPicture { plane, window, pixel, level: None, legend, labels: Vec::new() };
        write_picture(self.tree(), &what, path.as_ref(), &Silent)
    }

    /// The part as a PNG of 1024 × 1024 pixels, seen from `view`: iso, top, bottom, front, back, left or right.
    ///
    /// # Errors
    /// A view of another name, an empty part, a path that cannot be written.
    pub fn write_picture(&self, path: impl AsRef<Path>, view: &str) -> Result<()> {
        let view = View::named(view).ok_or_else(|| {
            Error::setting(format!("no view is called {view:?}"), "choose iso, top or front")
        })?;
        let (low, high) = self.bounds();
        let options = RenderOptions::of([low, high], view);
        let scene = Scene::new(self.tree(), &options)?;
        scene.frames().try_for_each(|frame| write_frame(&frame, None, path.as_ref(), &Silent))
    }
}
