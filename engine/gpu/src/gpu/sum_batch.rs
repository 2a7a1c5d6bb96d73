//! Samples that a device sums over a cluster tree, and how many of them have room.

use brickfield_shaders::{Block, COEFFICIENTS};

/// Samples of some bricks.
#[derive(Debug, Default)]
pub struct SumInput {
    /// Blocks of samples.
    pub blocks: Vec<Block>,
    /// By block: the coefficients of its polynomial, without the constant.
    pub coefficients: Vec<[f32; COEFFICIENTS as usize]>,
    /// Numbers of clusters and elements.
    pub terms: Vec<u32>,
    /// By row of four samples: the number of its block; in the ninth bit whether they are every second one; below, three
    /// bits an axis, the place of the first in the block.
    pub rows: Vec<u32>,
}

impl SumInput {
    /// Empties it.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.coefficients.clear();
        self.terms.clear();
        self.rows.clear();
    }
}

/// How much of each thing there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SumCapacity {
    /// Bricks.
    pub bricks: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Blocks.
    pub blocks: usize,
    /// Terms.
    pub terms: usize,
}
