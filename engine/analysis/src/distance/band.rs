//! Signed distances near a surface as a tree of bricks, for level sets in the files of other tools.

use super::brick_feet::BrickFeet;
use super::brick_sides::sides_of;
use super::level_nodes::LevelNodes;
use super::sides::{DeepBrick, Sides};
use super::surface::Surface;
use crate::brick::{Brick, POINTS, Samples, point_position};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, NodeInfo};
use std::sync::Arc;

/// Half the width of the band, in samples, as in OpenVDB.
pub const BAND: i16 = 3;
/// Binary places of distances in samples.
const PLACES: u8 = 12;
/// A node or a run of samples is beyond the band if its middle is, by its reach and so many cells: more than errors of distances.
const CERTAIN: f64 = 0.1;

/// Signed distances from the surface w = 0.5 at the samples of one level, below 0 inside, at most [`BAND`] in size. Their unit
/// is the level's spacing, and they are rounded to 1/4096 of it. Nodes beyond the band are uniform. Bricks are made when they
/// are asked for.
pub struct DistanceTree<'a> {
    sides: Sides<'a>,
    surface: &'a Surface,
    level: u8,
    /// Cells of the deepest level between two samples.
    step: f64,
    nodes: LevelNodes,
}

impl<'a> DistanceTree<'a> {
    /// Of a tree and its surface, at a level.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if there is no surface or no such level; what reading gives;
    /// [`crate::error::Error::Interrupted`].
    pub fn new(
        tree: &'a dyn BrickTree,
        surface: &'a Surface,
        level: u8,
        progress: &dyn Progress,
    ) -> Result<DistanceTree<'a>> {
        surface.require_any()?;
        let nodes = LevelNodes::new(tree, level)?;
        let step = f64::from(1u32 << (tree.deepest_level() - level));
        let sides = Sides::new(tree)?;
        let mut made = DistanceTree { sides, surface, level, step, nodes };
        progress.phase("finding the band", None, "nodes");
        made.nodes = made
            .nodes
            .divided(progress, &|key| Ok(made.beyond(key)?.map_or((-BAND, BAND), |side| (side, side))))?;
        Ok(made)
    }

    /// What all samples of a node are, if it is beyond the band.
    fn beyond(&self, key: NodeKey) -> Result<Option<i16>> {
        let size = self.step * f64::from(BRICK_CELLS as u32) * f64::from(1u32 << (self.level - key.level()));
        let middle = key.position().map(|p| (f64::from(p) + 0.5) * size);
        let reach = 0.5 * 3f64.sqrt() * size + f64::from(BAND) * self.step + CERTAIN;
        if self.surface.closest(middle, reach).is_some() {
            return Ok(None);
        }
        let inside = match self.sides.sample(middle.map(|c| c.round() as i64))? {
            Some(inside) => inside,
            // In a coarser leaf, where there is no sample.
            None => self.is_foot_inside(middle),
        };
        Ok(Some(if inside { -BAND } else { BAND }))
    }

    /// Whether a place is inside, as its nearest point of the surface says.
    fn is_foot_inside(&self, at: [f64; 3]) -> bool {
        self.surface.closest(at, f64::INFINITY).is_some_and(|foot| foot.inside)
    }

    /// The samples of a brick whose first one stands there.
    fn samples(&self, first: [f64; 3]) -> Result<Samples> {
        let mut samples = Samples::fractions(PLACES);
        let one = f64::from(1u32 << PLACES) / self.step;
        let band = f64::from(BAND) * self.step;
        let feet = BrickFeet::new(self.surface, first, self.step, band + CERTAIN)?;
        let known = self.known_sides(&feet, first)?;
        let sides = sides_of(&feet, known, |at| self.is_foot_inside(at));
        for (index, (sample, inside)) in samples.0.iter_mut().zip(sides).enumerate() {
            let distance = feet.distance(index).map_or(band, |distance| distance.min(band));
            *sample = (if inside { -distance } else { distance } * one).round() as i16;
        }
        Ok(samples)
    }

    /// Whether the samples of a brick are inside, as far as samples of the tree tell it: not in coarser leaves.
    fn known_sides(&self, feet: &BrickFeet, first: [f64; 3]) -> Result<Vec<Option<bool>>> {
        // On the deepest level it is a brick of the tree.
        let part =
            if self.step == 1.0 { self.sides.part(first.map(|c| c as i64))? } else { DeepBrick::Unknown };
        let known = |index| match &part {
            DeepBrick::All(inside) => Ok(Some(*inside)),
            DeepBrick::Samples(brick) => Ok(Some(brick.sample(point_position(index)) >= 1)),
            DeepBrick::Unknown => self.sides.sample(feet.place(index).map(|c| c as i64)),
        };
        (0..POINTS).map(known).collect()
    }
}

impl BrickTree for DistanceTree<'_> {
    fn root(&self) -> RootCube {
        self.surface.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        self.nodes.node(key)
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.nodes.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.level
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.nodes.brick(key, PLACES, || {
            self.samples(key.position().map(|p| f64::from(p) * f64::from(BRICK_CELLS as u32) * self.step))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::tests::{ball, surface, uneven_tree};
    use crate::progress::Silent;

    /// Deep nodes too, which are beyond the band and have no sample of the tree in them.
    #[test]
    fn within_coarser_leaves_distances_have_their_sides() {
        let shape = ball(30.0);
        let tree = uneven_tree(&shape);
        let surface = surface(&tree);
        for level in 0..=2 {
            let distances = DistanceTree::new(&tree, &surface, level, &Silent).unwrap();
            let step = tree.root().spacing(level);
            let mut deep = 0;
            for (number, key) in distances.keys().into_iter().enumerate() {
                let Some(node) = distances.node(key).filter(|node| node.leaf) else { continue };
                deep += usize::from(node.uniform() == Some(-BAND));
                if node.uniform().is_none() && number % 5 > 0 {
                    continue;
                }
                let brick = distances.brick(key).unwrap();
                for index in (0..POINTS).step_by(61) {
                    let ijk = point_position(index);
                    let size = tree.root().spacing(key.level());
                    let position = key.position();
                    let at = std::array::from_fn(|a| {
                        size * (f64::from(position[a]) * BRICK_CELLS as f64 + ijk[a] as f64)
                    });
                    let expected = (shape(surface.to_world(at.map(|c| c / surface.cell()))) / step)
                        .clamp(-f64::from(BAND), f64::from(BAND));
                    let found = brick.value(ijk);
                    assert!((found - expected).abs() < 0.05, "{key} {ijk:?}: {found} {expected}");
                }
            }
            assert_eq!(deep > 0, level == 2);
        }
    }
}
