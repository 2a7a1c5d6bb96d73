//! Signed distances near a surface as a tree of bricks, for level sets in the files of other tools.

use super::level_nodes::LevelNodes;
use super::sample_box::SampleBox;
use super::sides::Sides;
use super::surface::{Foot, Surface};
use crate::brick::{Brick, Samples, point_index};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube, dot, minus};
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
    /// [`Error::Setting`] if there is no surface or no such level; what reading gives; [`Error::Interrupted`].
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
        if self.surface.closest(middle, reach)?.is_some() {
            return Ok(None);
        }
        let inside = self.sides.inside(middle, reach, false)?;
        Ok(Some(if inside { -BAND } else { BAND }))
    }

    /// The signed distance at a sample, in cells, of a foot within the band or none.
    fn signed(&self, at: [f64; 3], foot: Option<Foot>) -> Result<f64> {
        let band = f64::from(BAND) * self.step;
        let inside = match (self.sides.sample(at.map(|c| c as i64))?, foot) {
            (Some(inside), _) => inside,
            (None, Some(foot)) => foot.inside,
            // In a coarser leaf, where there is no sample.
            (None, None) => self.surface.closest(at, f64::INFINITY)?.is_some_and(|foot| foot.inside),
        };
        let distance = foot.map_or(band, |foot| foot.distance.min(band));
        Ok(if inside { -distance } else { distance })
    }

    /// Fills a box of samples of a brick whose first sample lies at `first`; the surface is within so many cells of its middle.
    fn fill(&self, samples: &mut Samples, first: [f64; 3], part: SampleBox, within: f64) -> Result<()> {
        let place = |ijk: [f64; 3]| -> [f64; 3] { std::array::from_fn(|a| first[a] + ijk[a] * self.step) };
        let here = place(part.middle());
        let one = f64::from(1u32 << PLACES);
        let band = f64::from(BAND) * self.step;
        if part.is_single() {
            let foot = self.surface.closest(here, within.min(band + CERTAIN))?;
            samples.0[point_index(part.low)] = (self.signed(here, foot)? / self.step * one).round() as i16;
            return Ok(());
        }
        let reach = part.reach() * self.step + band + CERTAIN;
        let Some(foot) = self.surface.closest(here, within.min(reach))? else {
            let corner = place(part.low.map(|c| c as f64));
            part.fill(&mut samples.0[..], (self.signed(corner, None)? / self.step * one) as i16);
            return Ok(());
        };
        for half in part.halves() {
            let away = minus(place(half.middle()), here);
            self.fill(samples, first, half, foot.distance + dot(away, away).sqrt() + CERTAIN)?;
        }
        Ok(())
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
            let mut samples = Samples::fractions(PLACES);
            let first = key.position().map(|p| f64::from(p) * f64::from(BRICK_CELLS as u32) * self.step);
            self.fill(&mut samples, first, SampleBox::BRICK, f64::INFINITY)?;
            Ok(samples)
        })
    }
}
