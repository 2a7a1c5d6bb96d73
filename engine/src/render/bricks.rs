//! Bricks as rays want them, kept under a byte budget.

use super::field::{Field, Scratch};
use super::style::Style;
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::{BrickCache, BrickTree};
use std::sync::Arc;

/// Bricks that a thread has at hand without asking the others: a tile's rays pass the same few again and again.
const AT_HAND: usize = 32;

/// What is made of a brick.
pub(super) struct Prepared {
    /// Distances from the boundary; `None` where all samples lie on one side of it, or where nobody asks.
    pub boundary: Option<Field>,
    /// What else the style shows: w from 0 to 1, or where w passes 1.5.
    pub shown: Option<Field>,
    /// Whether the first sample lies inside, which tells of all where `boundary` is `None`.
    pub is_inside: bool,
    /// For styles that ask for w itself.
    pub brick: Option<Arc<Brick>>,
}

impl Prepared {
    fn new(brick: Arc<Brick>, style: Style, scratch: &mut Scratch) -> Prepared {
        let boundary = if style == Style::Boundary { None } else { Field::boundary(&brick, scratch) };
        let shown = match (style, &*brick) {
            (Style::Boundary, Brick::Counts { samples, .. }) => Field::fraction(samples, super::LEAST_SEEN),
            (Style::Overlap, _) => Field::level(&brick, 1.5),
            _ => None,
        };
        let is_inside = brick.sample([0; 3]) >= 1;
        Prepared { boundary, shown, is_inside, brick: (style == Style::Overlap).then_some(brick) }
    }

    fn heap_bytes(&self) -> usize {
        let fields = usize::from(self.boundary.is_some()) + usize::from(self.shown.is_some());
        fields * Field::heap_bytes() + self.brick.as_ref().map_or(0, |brick| brick.heap_bytes())
    }
}

/// All bricks of a tree.
pub(super) struct Bricks<'a> {
    pub tree: &'a dyn BrickTree,
    style: Style,
    cache: BrickCache<Prepared>,
}

/// A thread's own bricks, and room to make more.
#[derive(Default)]
pub(super) struct Lane {
    held: Vec<Option<(NodeKey, Arc<Prepared>)>>,
    scratch: Scratch,
}

impl<'a> Bricks<'a> {
    /// Keeps at most `bytes_max` of what it makes.
    pub fn new(tree: &'a dyn BrickTree, style: Style, bytes_max: u64) -> Bricks<'a> {
        Bricks { tree, style, cache: BrickCache::new(bytes_max) }
    }

    /// The brick of a node, prepared. Two threads may both prepare one, to the same content.
    pub fn get(&self, key: NodeKey, lane: &mut Lane) -> Result<Arc<Prepared>> {
        let [x, y, z] = key.position();
        let slot = (x ^ y << 2 ^ z << 4 ^ x >> 5 ^ y >> 3) as usize % AT_HAND;
        lane.held.resize(AT_HAND, None);
        if let Some((_, prepared)) = lane.held[slot].as_ref().filter(|(held, _)| *held == key) {
            return Ok(Arc::clone(prepared));
        }
        let prepared = match self.cache.get(key) {
            Some(prepared) => prepared,
            None => {
                let brick = self.tree.brick_once(key)?;
                let prepared = Arc::new(Prepared::new(brick, self.style, &mut lane.scratch));
                self.cache.insert(key, &prepared, prepared.heap_bytes());
                prepared
            }
        };
        lane.held[slot] = Some((key, Arc::clone(&prepared)));
        Ok(prepared)
    }

    /// How many were found, and how many had to be made.
    pub fn found_and_made(&self) -> (u64, u64) {
        let stats = self.cache.stats();
        (stats.hits, stats.misses)
    }
}
