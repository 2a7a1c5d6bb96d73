//! What is written: levels of a tree with the type of their values.

use crate::analysis::{Dense, Element};
use crate::distance::BAND;
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use crate::store::BrickTree;

/// How many levels a file of a format holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LevelSupport {
    /// One.
    One,
    /// Any number, each a volume of its own.
    Several,
    /// All, as one volume of which readers take what they need; or one.
    Nested,
}

/// What samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Winding numbers.
    Winding,
    /// Signed distances near the surface, of a [`crate::distance::DistanceTree`]; floats, in world units.
    Distance,
    /// Diameters of a [`crate::distance::LocalThickness`], 0 where nothing is measured; floats, in world units.
    Thickness,
    /// Numbers of regions, as of voids, 0 where there is none; integers.
    Labels,
}

/// Levels of a tree with the type of their values.
pub struct Volume<'a> {
    /// The tree.
    pub tree: &'a dyn BrickTree,
    /// The levels, the finest first; not empty.
    pub levels: Vec<u8>,
    /// What they hold; of distances one level.
    pub quantity: Quantity,
    /// Type of the values.
    pub element: Element,
    /// Name of the values, as in `w`.
    pub name: &'a str,
    /// The store's unit of length, as in `mm`, where it is known.
    pub unit: Option<&'a str>,
    /// JSON that describes the volume, for formats with a description beside the file.
    pub description: &'a str,
}

impl Volume<'_> {
    /// The finest level.
    pub fn finest(&self) -> u8 {
        self.levels[0]
    }

    /// Samples of the finest level along each axis.
    pub fn axis(&self) -> usize {
        BRICK_CELLS << self.finest()
    }

    /// The finest level as a dense grid.
    pub(crate) fn dense(&self) -> Result<Dense<'_>> {
        Ok(Dense::new(self.tree, self.finest(), self.element)?.scaled(self.scale(self.finest())))
    }

    /// What a sample of 1 is as a float.
    pub(crate) fn scale(&self, level: u8) -> f32 {
        match self.quantity {
            Quantity::Winding | Quantity::Labels => 1.0,
            Quantity::Distance | Quantity::Thickness => self.spacing(level) as f32,
        }
    }

    /// The sample of what is empty.
    pub(crate) fn background(&self) -> i16 {
        match self.quantity {
            Quantity::Winding | Quantity::Thickness | Quantity::Labels => 0,
            Quantity::Distance => BAND,
        }
    }

    /// World position of the sample `[0][0][0]` of every level.
    pub fn origin(&self) -> [f64; 3] {
        self.tree.root().to_world([1.0; 3])
    }

    /// World distance of two samples of a level.
    pub fn spacing(&self, level: u8) -> f64 {
        self.tree.root().spacing(level)
    }

    /// Bytes of all samples of all levels.
    pub(crate) fn dense_bytes(&self) -> u128 {
        let samples = self.levels.iter().map(|&level| ((BRICK_CELLS as u128) << level).pow(3)).sum::<u128>();
        samples * self.element.bytes() as u128
    }
}
