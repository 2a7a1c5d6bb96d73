//! Voids, each in a colour of its own.

use super::{Met, Tint};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube};
use crate::store::BrickTree;
use crate::voids::{VoidPlaces, Voids};

/// How far beyond the boundary the void is asked for, in cells: away from the samples of a void behind a thin wall.
const BEYOND: f64 = 0.35;

/// Colours the boundary of each void, and nothing else.
pub struct VoidTint<'a> {
    places: VoidPlaces<'a>,
    root: RootCube,
    colours: Vec<Option<[u8; 3]>>,
}

impl<'a> VoidTint<'a> {
    /// Of the voids that were found in a tree, with a colour for each in their order, or none for those
    /// that are not shown. What is read is kept in so many bytes.
    pub fn new(
        tree: &'a dyn BrickTree,
        found: &'a Voids,
        colours: Vec<Option<[u8; 3]>>,
        cache_bytes: u64,
    ) -> VoidTint<'a> {
        VoidTint { places: VoidPlaces::new(tree, found, cache_bytes), root: tree.root(), colours }
    }

    /// The number of the void at a world position in void; 0 outside of all, and of those that are not shown.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn number(&self, world: [f64; 3]) -> Result<u32> {
        let number = self.places.number(self.root.from_first_sample(world))?;
        Ok(if self.shows(number) { number } else { 0 })
    }

    /// Whether a void is shown.
    pub(super) fn shows(&self, number: u32) -> bool {
        self.colour_of(number).is_some()
    }

    /// The colour at a world position in void; `None` outside of all voids.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn at(&self, world: [f64; 3]) -> Result<Option<[u8; 3]>> {
        Ok(self.colour_of(self.number(world)?))
    }

    /// The number of the void just beyond a point of the boundary in a node, of which this is the outward unit normal; 0 if there
    /// is none.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn beyond(&self, key: NodeKey, world: [f64; 3], normal: [f64; 3]) -> Result<u32> {
        if !self.places.any_in(key) {
            return Ok(0);
        }
        let step = BEYOND * self.root.spacing(key.level());
        self.number(std::array::from_fn(|a| world[a] + step * normal[a]))
    }

    fn colour_of(&self, number: u32) -> Option<[u8; 3]> {
        (number as usize).checked_sub(1).and_then(|void| self.colours.get(void).copied().flatten())
    }
}

impl Tint for VoidTint<'_> {
    fn colour(&self, met: Met) -> Result<Option<[u8; 3]>> {
        let number = self.beyond(met.key, met.at, met.normal)?;
        Ok(self.colour_of(number))
    }

    fn is_slow(&self) -> bool {
        false
    }

    fn is_plain(&self, key: NodeKey) -> bool {
        !self.places.any_in(key)
    }
}
