//! The bricks that a thread looks at, around a plane.

use super::face::Layer;
use super::plane::Plane;
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, MAX_LEVEL, NodeKey};
use crate::store::{BrickTree, tell_ahead};
use std::cell::OnceCell;
use std::sync::Arc;

/// A brick and where its samples lie.
pub(super) struct PlacedBrick {
    pub key: NodeKey,
    pub brick: Arc<Brick>,
    /// First sample, in units from the root's first one.
    pub base: [f64; 3],
    /// Distance of samples in units.
    pub spacing: f64,
    /// The boundary in the plane; made when it is first asked for.
    layer: OnceCell<Option<Layer>>,
}

impl PlacedBrick {
    fn holds(&self, at: [f64; 3]) -> bool {
        let edge = self.spacing * BRICK_CELLS as f64;
        (0..3).all(|a| at[a] >= self.base[a] && at[a] < self.base[a] + edge)
    }

    /// The boundary in a plane `height` units above the root's first sample, always the same one; `None` if the brick is
    /// uniform.
    pub fn layer(&self, plane: Plane, height: f64) -> Option<&Layer> {
        let height = (height - self.base[plane.axis.index()]) / self.spacing;
        self.layer.get_or_init(|| Layer::new(&self.brick, plane, height)).as_ref()
    }

    /// A position in samples from the brick's first one, 0 to 32.
    pub fn local(&self, at: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (at[a] - self.base[a]) / self.spacing)
    }
}

/// Finds bricks by place and keeps those found until told otherwise.
pub(super) struct BrickFinder<'a> {
    tree: &'a dyn BrickTree,
    level: u8,
    held: Vec<PlacedBrick>,
    last: usize,
}

impl<'a> BrickFinder<'a> {
    /// Of the tree cut off at `level`, whose interior nodes stand for what is below them.
    pub fn new(tree: &'a dyn BrickTree, level: u8) -> BrickFinder<'a> {
        BrickFinder { tree, level, held: Vec::new(), last: 0 }
    }

    /// Lets go of all bricks.
    pub fn clear(&mut self) {
        self.held.clear();
        self.last = 0;
    }

    /// How many bricks are kept.
    pub fn count(&self) -> usize {
        self.held.len()
    }

    /// The brick whose cells hold a position, in units from the root's first sample; `None` outside the root.
    pub fn at(&mut self, at: [f64; 3]) -> Result<Option<&PlacedBrick>> {
        if !self.held.get(self.last).is_some_and(|held| held.holds(at)) {
            self.last = match self.held.iter().position(|held| held.holds(at)) {
                Some(found) => found,
                None => {
                    let Some(key) = node_at(self.tree, self.level, at) else { return Ok(None) };
                    self.take(key)?
                }
            };
        }
        Ok(self.held.get(self.last))
    }

    fn take(&mut self, key: NodeKey) -> Result<usize> {
        let brick = match self.tree.node(key).and_then(|node| node.uniform()) {
            Some(w) => Arc::new(Brick::Uniform(w)),
            None => self.tree.brick(key)?,
        };
        let (base, spacing) = (key.base().map(f64::from), f64::from(1u32 << key.spacing_bits()));
        self.held.push(PlacedBrick { key, brick, base, spacing, layer: OnceCell::new() });
        Ok(self.held.len() - 1)
    }
}

/// Tells a tree whose bricks come from elsewhere that those at these positions will be asked for next.
pub(super) fn tell_places(tree: &dyn BrickTree, level: u8, places: impl Iterator<Item = [f64; 3]>) {
    if !tree.is_elsewhere() {
        return;
    }
    let is_read = |key: &NodeKey| tree.node(*key).is_some_and(|node| node.uniform().is_none());
    let mut keys: Vec<NodeKey> = places.filter_map(|at| node_at(tree, level, at)).filter(is_read).collect();
    keys.sort_unstable();
    keys.dedup();
    tell_ahead(tree, &keys);
}

/// The leaf, or the interior node of the level, whose cells hold the position.
fn node_at(tree: &dyn BrickTree, level: u8, at: [f64; 3]) -> Option<NodeKey> {
    let deepest = NodeKey::deepest_holding(at)?;
    let mut keys = (0..=level.min(MAX_LEVEL)).filter_map(|level| deepest.ancestor(level));
    keys.find(|key| tree.node(*key).is_some_and(|node| node.leaf || key.level() == level))
}

/// Interpolates `value` of the samples around a position, in samples from the brick's first one.
pub(super) fn trilinear(brick: &Brick, at: [f64; 3], value: impl Fn(f64) -> f64) -> f64 {
    if let Brick::Uniform(w) = brick {
        return value(f64::from(*w));
    }
    let low: [usize; 3] = at.map(|a| (a as usize).min(BRICK_CELLS - 1));
    let part: [f64; 3] = std::array::from_fn(|a| at[a] - low[a] as f64);
    let corner =
        |dx: usize, dy: usize, dz: usize| value(brick.value([low[0] + dx, low[1] + dy, low[2] + dz]));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), part[0]);
    let face = |dz| mix(row(0, dz), row(1, dz), part[1]);
    mix(face(0), face(1), part[2])
}

/// The whole number of the nearest sample around a position in the plane that is on the same side of the boundary.
pub(super) fn nearest(held: &PlacedBrick, plane: Plane, height: f64, at: [f64; 3]) -> i16 {
    let Some(layer) = held.layer(plane, height) else { return held.brick.sample([0; 3]) };
    let uv = plane.within(at);
    let low = uv.map(|c| (c as usize).min(BRICK_CELLS - 1));
    // The boundary may pass where samples around are on both sides.
    let mut around = [(0.0, 0); 8];
    for (n, (distance, w)) in around.iter_mut().enumerate() {
        let (corner, above) = ([low[0] + (n & 1), low[1] + (n >> 1 & 1)], n & 4 != 0);
        let off = [uv[0] - corner[0] as f64, uv[1] - corner[1] as f64, layer.part() - f64::from(above)];
        *distance = off.iter().map(|c| c * c).sum::<f64>();
        *w = layer.sample(corner, above);
    }
    let is_mixed = around.iter().any(|(_, w)| (*w >= 1) != (around[0].1 >= 1));
    let is_inside = is_mixed.then(|| layer.is_inside_at(uv));
    let on_side = around.iter().filter(|(_, w)| is_inside.is_none_or(|inside| (*w >= 1) == inside));
    // The last of several that are as near, as rounding up gives it.
    on_side.rev().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, w)| *w)
}
