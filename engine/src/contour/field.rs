//! The tree as the contouring stages see it: its leaves, their surfaces and their cells, cached.

use super::cache::Cache;
use super::cells::BrickCells;
use super::leaves::Leaves;
use super::surface::{Level, Surface};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use crate::store::BrickTree;
use std::sync::Arc;

/// A level set of a tree, ready to be contoured leaf by leaf from any thread.
pub(super) struct Field<'a> {
    pub root: RootCube,
    pub leaves: Leaves,
    tree: &'a dyn BrickTree,
    level: Level,
    surfaces: Cache<Surface>,
    cells: Cache<BrickCells>,
}

impl<'a> Field<'a> {
    /// `truncate` as in [`super::ContourOptions::level`].
    pub(super) fn new(
        tree: &'a dyn BrickTree,
        level: Level,
        truncate: Option<u8>,
        cache_bytes: usize,
    ) -> Result<Field<'a>> {
        let leaves = Leaves::new(tree, truncate, level.threshold)?;
        // Surfaces serve only cells between levels; cells are asked for again by every neighbour.
        let (surfaces, cells) = (Cache::new(cache_bytes / 4), Cache::new(cache_bytes - cache_bytes / 4));
        Ok(Field { root: tree.root(), leaves, tree, level, surfaces, cells })
    }

    pub(super) fn surface(&self, leaf: u32) -> Result<Arc<Surface>> {
        self.surfaces.get_or_make(leaf, || {
            let surface = Surface::load(self.tree, self.leaves.get(leaf), self.level)?;
            let bytes = surface.heap_bytes() + size_of::<Surface>();
            Ok((surface, bytes))
        })
    }

    pub(super) fn cells(&self, leaf: u32) -> Result<Arc<BrickCells>> {
        self.cells.get_or_make(leaf, || {
            let cells = BrickCells::build(self, leaf)?;
            let bytes = cells.heap_bytes();
            Ok((cells, bytes))
        })
    }

    /// Where the cells of `key` lie in the world.
    pub(super) fn frame(&self, key: NodeKey) -> Frame {
        Frame::new(self.root, key)
    }
}

/// From cell coordinates of a brick to the world.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    origin: [f64; 3],
    spacing: f64,
    /// How far vertices stay away from their cell's faces, as a share of the cell.
    pub margin: f64,
}

impl Frame {
    fn new(root: RootCube, key: NodeKey) -> Frame {
        let spacing = root.spacing(key.level());
        let farthest = root.origin.iter().fold(0.0f64, |m, &o| m.max(o.abs()).max((o + root.edge).abs()));
        // Two steps of f32 on each side keep vertices of different cells apart; 1/256 does where cells are
        // large against the distance from the origin.
        let steps = 2.0 * farthest * f64::from(f32::EPSILON) / spacing;
        let margin = steps.clamp(1.0 / 256.0, 0.25);
        Frame { origin: root.to_world(key.base().map(|b| f64::from(b) + 1.0)), spacing, margin }
    }

    /// World position of the point `at`, 0..1 an axis, of a cell.
    #[inline]
    pub(super) fn world(&self, cell: [usize; 3], at: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|a| (self.origin[a] + (cell[a] as f64 + at[a]) * self.spacing) as f32)
    }
}
