//! What rays pass, and what a round of them leaves.

use brickfield_shaders::{Shell, TreeNode};

/// What rays pass, apart from bricks.
#[derive(Clone, Copy, Debug)]
pub struct RayScene<'a> {
    /// The tree's nodes; children stand behind their parents.
    pub nodes: &'a [TreeNode],
    /// Surfaces, at most four.
    pub shells: &'a [Shell],
    /// Colours and stops, `TABLE_ENTRIES` of them.
    pub tables: &'a [[f32; 4]],
    /// Whether there is a haze.
    pub haze: bool,
    /// Whether pages have winding numbers.
    pub counts: bool,
}

/// What a round left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoundEnd {
    /// Rays that wait for bricks, or for the next round.
    pub waiting: u32,
    /// Bricks that they want and that can be brought, by `RayCaster::wanted`.
    pub wanted: u32,
}
