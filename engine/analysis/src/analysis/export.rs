//! A level of the octree as one dense grid.

use super::sample::trilinear;
use crate::brick::{Brick, point_index};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, NodeInfo, Walk, require_level};
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

    /// NumPy's name of the type.
    pub const fn numpy(self) -> &'static str {
        match self {
            Element::I16 => "<i2",
            Element::F32 => "<f4",
        }
    }
}

/// Takes, from any thread, rows of a layer: the place along y and z in bricks, the layer in 0..32, and the bytes of 32 rows
/// along x.
pub type TakeRows<'a> = dyn Fn([u32; 2], usize, &[u8]) -> Result<()> + Sync + 'a;

/// One level of a tree, seen as a dense cube of samples indexed `[z][y][x]`. Uniform leaves above the level
/// are exact; what [`Element`] says holds for the others.
pub struct Dense<'a> {
    tree: &'a dyn BrickTree,
    level: u8,
    element: Element,
    scale: f32,
}

impl<'a> Dense<'a> {
    /// The level of `tree`.
    ///
    /// # Errors
    /// [`Error::Setting`] if the tree has no node that deep.
    pub fn new(tree: &'a dyn BrickTree, level: u8, element: Element) -> Result<Dense<'a>> {
        require_level(tree, level)?;
        Ok(Dense { tree, level, element, scale: 1.0 })
    }

    /// With floats that are so many times the samples.
    #[must_use]
    pub fn scaled(self, scale: f32) -> Dense<'a> {
        Dense { scale, ..self }
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
        let strips =
            (0..bricks * bricks).map(|n| [(n % bricks) as u32, (n / bricks) as u32]).collect::<Vec<_>>();
        self.strips(&strips, progress, &|[y, z], layer, rows| {
            let first_row = u64::from(z) * BRICK_CELLS as u64 + layer as u64;
            let row = first_row * self.axis() as u64 + u64::from(y) * BRICK_CELLS as u64;
            write_at(row * (self.axis() * self.element.bytes()) as u64, rows)
        })
    }

    /// The 32 layers of the bricks at height `z`. The phase of `progress` is the caller's.
    ///
    /// # Errors
    /// As [`Dense::write`].
    pub fn slab(&self, z: u32, progress: &dyn Progress, take: &TakeRows<'_>) -> Result<()> {
        let strips = (0..1u32 << self.level).map(|y| [y, z]).collect::<Vec<_>>();
        self.strips(&strips, progress, take)
    }

    /// The bricks at places in y and z, all along x.
    fn strips(&self, places: &[[u32; 2]], progress: &dyn Progress, take: &TakeRows<'_>) -> Result<()> {
        let bricks = 1usize << self.level;
        let row_bytes = self.axis() * self.element.bytes();
        let walk = Walk::new(self.tree, places.len() * bricks, |step| {
            let [y, z] = places[step / bricks];
            let (key, node) = covering(self.tree, self.level, [(step % bricks) as u32, y, z]).ok()?;
            node.uniform().is_none().then_some(key)
        });
        // Handed out in order, so that all threads together go through the store from one end to the other.
        let strips = places.iter().enumerate().par_bridge();
        strips.try_for_each_init(Vec::new, |strip: &mut Vec<u8>, (number, &[y, z])| {
            progress.check()?;
            walk.at(number * bricks);
            self.fill(y, z, strip)?;
            for (layer, rows) in strip.chunks_exact(row_bytes * BRICK_CELLS).enumerate() {
                take([y, z], layer, rows)?;
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
            let (key, _) = covering(self.tree, self.level, [x, y, z])?;
            let brick = match last.take() {
                Some((last, brick)) if last == key => brick,
                _ => self.tree.brick(key)?,
            };
            let block = BrickBlock::new(&brick, key, self.level, [x, y, z]);
            for (row, bytes) in strip.chunks_exact_mut(row_bytes).enumerate() {
                let at = &mut bytes[x as usize * BRICK_CELLS * size..][..BRICK_CELLS * size];
                block.fill_row([row % BRICK_CELLS, row / BRICK_CELLS], (self.element, self.scale), at);
            }
            last = Some((key, brick));
        }
        Ok(())
    }
}

/// The node at a place of a level, or the coarser leaf that covers it. Positions are in bricks of the level.
///
/// # Errors
/// [`Error::Setting`] if the tree has no node there, as an unfinished one may.
pub fn covering(tree: &dyn BrickTree, level: u8, position: [u32; 3]) -> Result<(NodeKey, NodeInfo)> {
    let key = NodeKey::new(level, position);
    let mut up = (0..=level).rev().filter_map(|level| key?.ancestor(level));
    up.find_map(|key| tree.node(key).map(|node| (key, node))).ok_or_else(|| {
        Error::setting(
            "the store has no brick there yet",
            "give the command that builds it again: it goes on",
        )
    })
}

/// Samples of a level in the place of one brick: those of its node, or of the part of a coarser leaf that covers it.
pub struct BrickBlock<'a> {
    brick: &'a Brick,
    /// Levels between the brick and the grid.
    up: u32,
    /// First element, in the grid's steps from the brick's first sample.
    first: [usize; 3],
}

impl BrickBlock<'_> {
    /// The place `position`, in bricks of `level`, in the brick of the node `key` that covers it.
    pub fn new(brick: &Brick, key: NodeKey, level: u8, position: [u32; 3]) -> BrickBlock<'_> {
        let up = u32::from(level - key.level());
        let of_brick = key.position();
        let first = std::array::from_fn(|a| (position[a] - (of_brick[a] << up)) as usize * BRICK_CELLS);
        BrickBlock { brick, up, first }
    }

    /// The integer sample at `[i, j, k]`, each in 0..=32.
    pub fn integer(&self, ijk: [usize; 3]) -> i16 {
        self.brick.sample(std::array::from_fn(|a| (self.first[a] + ijk[a]) >> self.up))
    }

    /// The sample at `[i, j, k]`, each in 0..=32; between samples of a coarser leaf trilinear.
    pub fn float(&self, ijk: [usize; 3]) -> f32 {
        if self.up == 0 {
            return self.brick.value(ijk) as f32;
        }
        let step = f64::from(1u32 << self.up).recip();
        trilinear(self.brick, std::array::from_fn(|a| (self.first[a] + ijk[a]) as f64 * step)) as f32
    }

    /// The integer samples of the row along x at `[j, k]`, from its first on.
    pub fn integers(&self, [j, k]: [usize; 2], out: &mut [i16]) {
        match self.row([j, k], out.len()) {
            Some((row, 0)) => out.copy_from_slice(row),
            _ => out.iter_mut().enumerate().for_each(|(i, value)| *value = self.integer([i, j, k])),
        }
    }

    /// The samples of the row along x at `[j, k]`, from its first on.
    pub fn floats(&self, [j, k]: [usize; 2], out: &mut [f32]) {
        match self.row([j, k], out.len()) {
            Some((row, places)) => {
                // A power of two: no product is rounded.
                let unit = ((1u32 << places) as f32).recip();
                out.iter_mut().zip(row).for_each(|(value, &stored)| *value = f32::from(stored) * unit);
            }
            None => out.iter_mut().enumerate().for_each(|(i, value)| *value = self.float([i, j, k])),
        }
    }

    /// A row as it is stored, with its binary places, if each of its samples is one of the brick.
    fn row(&self, [j, k]: [usize; 2], count: usize) -> Option<(&[i16], u8)> {
        match self.brick {
            Brick::Counts { samples, .. } if self.up == 0 => {
                Some((&samples.0[point_index([0, j, k])..][..count], samples.1))
            }
            _ => None,
        }
    }

    /// Fills the row along x at `[j, k]`.
    fn fill_row(&self, at: [usize; 2], (element, scale): (Element, f32), out: &mut [u8]) {
        match element {
            Element::I16 => {
                let mut row = [0; BRICK_CELLS];
                self.integers(at, &mut row);
                out.as_chunks_mut::<2>()
                    .0
                    .iter_mut()
                    .zip(row)
                    .for_each(|(b, value)| *b = value.to_le_bytes());
            }
            Element::F32 => {
                let mut row = [0.0; BRICK_CELLS];
                self.floats(at, &mut row);
                let bytes = out.as_chunks_mut::<4>().0;
                bytes.iter_mut().zip(row).for_each(|(b, value)| *b = (value * scale).to_le_bytes());
            }
        }
    }
}
