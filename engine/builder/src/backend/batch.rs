//! Bricks on their way to a device and back.

use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples};
use crate::error::Result;
use crate::gpu::{BatchInput, BatchOutput};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, Triangle, Units};
use crate::winding::{Evaluation, Evaluator, TriangleList};
use brickfield_shaders as shaders;
use std::ops::Range;

/// Triangles of a brick that a device takes.
const PAIRS_OF_BRICK_MAX: usize = shaders::PAIRS_OF_BRICK_MAX as usize;

// Bricks are the same on both sides.
const _: () = assert!(shaders::POINTS as usize == BRICK_POINTS && shaders::CELLS as usize == BRICK_CELLS);

/// A leaf to evaluate, or a node that may become one.
#[derive(Clone, Copy)]
pub struct BatchLeaf<'a, P = Triangle> {
    /// The brick.
    pub key: NodeKey,
    /// Its sample (0, 0, 0).
    pub corner: i16,
    /// Pieces of the field.
    pub array: &'a [P],
    /// Those of them that touch the brick.
    pub indices: &'a [u32],
}

impl<'a> BatchLeaf<'a> {
    /// On the processor.
    ///
    /// # Errors
    /// As [`Evaluator::evaluate`].
    pub fn evaluate(&self, evaluator: &'a mut Evaluator) -> Result<Evaluation<'a>> {
        evaluator.evaluate(self.key, self.corner, TriangleList { array: self.array, indices: self.indices })
    }
}

/// How many of the leaves, from the first on, make a batch of at most so many bricks and pairs; none if the first is beyond
/// what a device takes.
pub(super) fn fitting(leaves: &[BatchLeaf<'_>], bricks: usize, pairs: usize) -> usize {
    let mut sum = 0;
    let fits = |leaf: &&BatchLeaf<'_>| {
        sum += leaf.indices.len();
        sum <= pairs && leaf.indices.len() <= PAIRS_OF_BRICK_MAX
    };
    leaves.iter().take(bricks).take_while(fits).count()
}

/// Writes a batch down.
pub(super) fn pack(input: &mut BatchInput, leaves: &[BatchLeaf<'_>]) {
    input.clear();
    for (number, leaf) in (0..).zip(leaves) {
        input.bricks.push(shaders::Brick { corner: leaf.corner.into(), ..shaders::Brick::default() });
        let origin = leaf.key.base().map(|base| base + 1);
        let owner = number | leaf.key.spacing_bits() << 16;
        let relative = |v: Units| std::array::from_fn(|axis| v[axis] - origin[axis]);
        let pair = |&index: &u32| shaders::Pair { vertices: leaf.array[index as usize].map(relative), owner };
        input.pairs.extend(leaf.indices.iter().map(pair));
    }
}

/// The brick with this number in a batch; `None` if the device could not do it.
pub(super) fn unpack(output: &BatchOutput<'_>, number: usize) -> Option<Brick> {
    const FAILED: u32 = shaders::EXCESS | shaders::FULL | shaders::TORN | shaders::CROWDED;
    let brick = &output.bricks[number];
    if brick.flags & FAILED != 0 {
        return None;
    }
    if brick.flags & shaders::VARIES == 0 {
        return Some(Brick::Uniform(brick.corner as i16));
    }
    let from = brick.edges_from as usize;
    let along_x = from + brick.edges_x as usize;
    let along_y = along_x + brick.edges_y as usize;
    let of = |range: Range<usize>| -> Vec<HermiteEdge> {
        let edge =
            |&[offset, normal]: &[u32; 2]| HermiteEdge { offset: offset as u16, normal: OctNormal(normal) };
        // A device may name any places; a brick with too few edges is found by who takes it.
        output.hermite.get(range).unwrap_or_default().iter().map(edge).collect()
    };
    let edges = [of(from..along_x), of(along_x..along_y), of(along_y..from + brick.edges as usize)];
    Some(Brick::Counts { samples: unpack_samples(output, number), hermite: Hermite { edges } })
}

/// By edge of a row: all bits of the samples behind it, none of the others.
static BEHIND: [[i16; BRICK_POINTS]; BRICK_CELLS] = {
    let mut behind = [[0; BRICK_POINTS]; BRICK_CELLS];
    let mut edge = 0;
    while edge < BRICK_CELLS {
        let mut sample = edge + 1;
        while sample < BRICK_POINTS {
            behind[edge][sample] = -1;
            sample += 1;
        }
        edge += 1;
    }
    behind
};

fn unpack_samples(output: &BatchOutput<'_>, number: usize) -> Samples {
    const LINE_WORDS: usize = shaders::LINE_WORDS as usize;
    let lines = output.jumps[number].as_chunks::<LINE_WORDS>().0;
    let mut samples = Vec::with_capacity(POINTS);
    for ([start, touched], words) in output.rows[number].iter().zip(lines) {
        let mut row = [*start as i16; BRICK_POINTS];
        let biased = words.map(|word| word.wrapping_add(shaders::JUMP_BIAS));
        let biased: &[u8] = bytemuck::cast_slice(&biased);
        let mut left = *touched;
        while left != 0 {
            let edge = left.trailing_zeros() as usize;
            let jump = i16::from(biased[edge]) - 128;
            // All of them, so that it is done in vectors.
            row.iter_mut().zip(&BEHIND[edge]).for_each(|(w, bits)| *w = w.wrapping_add(jump & bits));
            left &= left - 1;
        }
        samples.extend_from_slice(&row);
    }
    Samples(samples.into_boxed_slice().try_into().expect("the length is POINTS"), 0)
}
