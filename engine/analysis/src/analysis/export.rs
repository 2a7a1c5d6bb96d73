//! A level of the octree as one dense grid.

use super::sample::trilinear;
use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, Walk};
use rayon::prelude::*;
use std::sync::Arc;

/// Type of the grid's elements, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Element {
    /// Exact integers; of open input the nearest ones. Where a leaf ends above the level: its nearest sample that is not above the position
    /// along any axis.
    #[default]
    I16,
    /// 32-bit floats. Where a leaf ends above the level: trilinear between its samples.
    F32,
}

impl Element {
    /// Bytes of an element.
    pub const fn bytes(self) -> usize {
        match self {
            Element::I16 => 2,
            Element::F32 => 4,
        }
    }
}

/// One level of a tree, seen as a dense cube of samples indexed `[z][y][x]`. Uniform leaves above the level
/// are exact; what [`Element`] says holds for the others.
pub struct Dense<'a> {
    tree: &'a dyn BrickTree,
    level: u8,
    element: Element,
}

impl<'a> Dense<'a> {
    /// The level of `tree`.
    ///
    /// # Errors
    /// [`Error::Setting`] if the tree has no node that deep.
    pub fn new(tree: &'a dyn BrickTree, level: u8, element: Element) -> Result<Dense<'a>> {
        let deepest = tree.deepest_level();
        if level > deepest {
            return Err(Error::setting(
                format!("there is no level {level}, the deepest is {deepest}"),
                format!("choose a level from 0 to {deepest}"),
            ));
        }
        Ok(Dense { tree, level, element })
    }

    /// Samples along each axis.
    pub fn axis(&self) -> usize {
        BRICK_CELLS << self.level
    }

    /// World position of the sample `[0][0][0]`.
    pub fn origin(&self) -> [f64; 3] {
        self.tree.root().to_world([1.0; 3])
    }

    /// World distance of two samples.
    pub fn spacing(&self) -> f64 {
        self.tree.root().spacing(self.level)
    }

    /// Bytes of the whole grid.
    pub fn bytes(&self) -> u128 {
        (self.axis() as u128).pow(3) * self.element.bytes() as u128
    }

    /// Writes all elements. `write_at` gets byte offsets from the grid's first element, from any thread, and
    /// every byte once. Works in strips, one row of bricks along x each, so memory is 32² rows of samples a
    /// thread, and every brick is decoded once.
    ///
    /// # Errors
    /// What reading the tree and `write_at` give; [`Error::Interrupted`].
    pub fn write(
        &self,
        progress: &dyn Progress,
        write_at: &(dyn Fn(u64, &[u8]) -> Result<()> + Sync),
    ) -> Result<()> {
        let bricks = 1u64 << self.level;
        progress.phase("exporting", Some(bricks * bricks), "strips");
        let row_bytes = self.axis() * self.element.bytes();
        let place = |number: u64| ((number % bricks) as u32, (number / bricks) as u32);
        let walk = Walk::new(self.tree, (bricks * bricks * bricks) as usize, |step| {
            let (y, z) = place(step as u64 / bricks);
            let key = self.node_at([(step as u64 % bricks) as u32, y, z]).ok()?;
            self.tree.node(key).filter(|node| node.min != node.max || node.fractions).map(|_| key)
        });
        // Handed out in order, so that all threads together go through the store from one end to the other.
        let strips = (0..bricks * bricks).par_bridge();
        strips.try_for_each_init(Vec::new, |strip: &mut Vec<u8>, number| {
            progress.check()?;
            let (y, z) = place(number);
            walk.at((number * bricks) as usize);
            self.fill(y, z, strip)?;
            let axis = self.axis() as u64;
            for (k, layer) in strip.chunks_exact(row_bytes * BRICK_CELLS).enumerate() {
                let [first_y, first_z] = [y, z].map(|b| u64::from(b) * BRICK_CELLS as u64);
                let first_row = (first_z + k as u64) * axis + first_y;
                write_at(first_row * row_bytes as u64, layer)?;
            }
            progress.advance(1);
            Ok(())
        })
    }

    /// The strip of the bricks (·, y, z): 32 layers of 32 rows.
    fn fill(&self, y: u32, z: u32, strip: &mut Vec<u8>) -> Result<()> {
        let size = self.element.bytes();
        let row_bytes = self.axis() * size;
        strip.resize(row_bytes * BRICK_CELLS * BRICK_CELLS, 0);
        let mut last: Option<(NodeKey, Arc<Brick>)> = None;
        for x in 0..1u32 << self.level {
            let key = self.node_at([x, y, z])?;
            let brick = match last.take() {
                Some((last, brick)) if last == key => brick,
                _ => self.tree.brick(key)?,
            };
            let part = Part::new(&brick, key, self.level, [x, y, z]);
            for (row, bytes) in strip.chunks_exact_mut(row_bytes).enumerate() {
                let at = &mut bytes[x as usize * BRICK_CELLS * size..][..BRICK_CELLS * size];
                part.fill_row([row % BRICK_CELLS, row / BRICK_CELLS], self.element, at);
            }
            last = Some((key, brick));
        }
        Ok(())
    }

    /// The node of the level at brick position `position`, or the leaf above it.
    fn node_at(&self, position: [u32; 3]) -> Result<NodeKey> {
        let key = NodeKey::new(self.level, position);
        (0..=self.level)
            .rev()
            .filter_map(|level| key?.ancestor(level))
            .find(|&key| self.tree.node(key).is_some())
            .ok_or_else(|| Error::setting("the tree has no root", "build it again"))
    }
}

/// The part of a brick that fills 32³ elements of the grid.
struct Part<'a> {
    brick: &'a Brick,
    /// Levels between the brick and the grid.
    up: u32,
    /// First element, in the grid's steps from the brick's first sample.
    first: [usize; 3],
}

impl Part<'_> {
    fn new(brick: &Brick, key: NodeKey, level: u8, position: [u32; 3]) -> Part<'_> {
        let up = u32::from(level - key.level());
        let of_brick = key.position();
        let first = std::array::from_fn(|a| (position[a] - (of_brick[a] << up)) as usize * BRICK_CELLS);
        Part { brick, up, first }
    }

    /// Fills the row along x at `[j, k]` of the part.
    fn fill_row(&self, [j, k]: [usize; 2], element: Element, out: &mut [u8]) {
        let at = |i: usize| [self.first[0] + i, self.first[1] + j, self.first[2] + k];
        match element {
            Element::I16 => {
                for (i, bytes) in out.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                    *bytes = self.brick.sample(at(i).map(|s| s >> self.up)).to_le_bytes();
                }
            }
            Element::F32 => {
                let step = f64::from(1u32 << self.up).recip();
                for (i, bytes) in out.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                    *bytes = (trilinear(self.brick, at(i).map(|s| s as f64 * step)) as f32).to_le_bytes();
                }
            }
        }
    }
}
