//! One picture: a scene as an eye sees it.

use super::camera::Ray;
use super::style::{Style, VolumeStyle};
use super::{COARSE_PIXELS, Eye, Scene};
use crate::lattice::NodeKey;
use crate::picture::Label;

/// Pixels along the side of a tile, which a thread takes at once.
pub(super) const TILE: u32 = 32;

/// A scene as one eye sees it.
pub struct Frame<'s> {
    pub(super) scene: &'s Scene<'s>,
    pub(super) eye: &'s Eye,
    pub(super) supersample: u32,
    pub(super) cell_pixels: f64,
    /// Words in it when it is written, by pixels.
    pub(super) labels: Vec<Label>,
}

impl<'s> Frame<'s> {
    /// The same quickly: one ray a pixel, and from the coarse levels.
    pub fn coarse(&self) -> Frame<'s> {
        let cell_pixels = self.cell_pixels.max(COARSE_PIXELS);
        let labels = self.labels.clone();
        Frame { scene: self.scene, eye: self.eye, supersample: 1, cell_pixels, labels }
    }

    /// The ray through a point of the picture, in pixels from its upper left corner.
    pub fn ray(&self, at: [f64; 2]) -> Ray {
        self.eye.camera.ray(at)
    }

    /// The same with words in it when it is written to a file.
    pub fn with_labels(self, labels: Vec<Label>) -> Frame<'s> {
        Frame { labels, ..self }
    }

    /// Where a point of the world is seen, in pixels from the upper left corner, and the size of a pixel there; `None` behind
    /// the eye.
    pub fn seen_at(&self, world: [f64; 3]) -> Option<([f64; 2], f64)> {
        self.eye.camera.seen_at(world)
    }

    pub(super) fn style(&self) -> &'s Style {
        &self.scene.bricks.style
    }

    /// The length in a brick that has the opacity of a haze, in world units.
    pub(super) fn stretch(&self, volume: &VolumeStyle, key: NodeKey) -> f64 {
        volume.stretch.unwrap_or_else(|| self.scene.bricks.tree.root().spacing(key.level()))
    }
}
