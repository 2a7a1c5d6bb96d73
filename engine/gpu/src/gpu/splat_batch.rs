//! Splats of some tiles of a picture, and how many of both have room.

use brickfield_shaders::{STEPS_MAX, SplatTile, SplatView, TileSplat};

/// Splats that a device draws together.
#[derive(Debug, Default)]
pub struct SplatBatch {
    /// The eye.
    pub view: SplatView,
    /// By size of cells: how far splats reach along the axes, one divided by the square of the radius, and how far behind the
    /// nearest splat others belong to it.
    pub sizes: Vec<[f32; 4]>,
    /// Tiles.
    pub tiles: Vec<SplatTile>,
    /// Their splats.
    pub splats: Vec<TileSplat>,
}

/// For how many tiles and splats there is room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplatCapacity {
    /// Tiles.
    pub tiles: usize,
    /// Splats, each as often as tiles have it.
    pub splats: usize,
}

impl SplatCapacity {
    /// With how many splats a tile is drawn at once at most.
    pub fn of_tile(&self) -> usize {
        self.splats.min(STEPS_MAX as usize)
    }
}
