//! The sums behind the samples of bricks, laid open for whoever computes them elsewhere.

use super::cell::{CellPlan, ExpansionSum};
use super::cells::{BoundedTree, CellPoints, PlannedPoints};
use super::sample_blocks::{BLOCK_BITS, for_blocks};
use super::{ClusterTree, SurfaceElement};
use crate::lattice::{NodeKey, Units};
use std::ops::Range;
use std::sync::Arc;

/// Samples of some bricks, in blocks that see the tree alike.
#[derive(Default)]
pub struct SumBlocks {
    blocks: Vec<SumBlock>,
    samples: Vec<BlockSample>,
    bricks: usize,
}

/// One block, or what of it lies in a brick.
pub struct SumBlock {
    plan: Arc<CellPlan>,
    /// Number of the brick.
    pub brick: usize,
    /// Position of the block's first sample.
    pub low: Units,
    /// log₂ of the distance of its samples.
    pub spacing: u32,
    /// Samples along its edge, of which a brick may hold a part.
    pub steps: u32,
    /// Numbers of the brick's among the samples of all blocks.
    pub samples: Range<usize>,
}

/// A sample of a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockSample {
    /// Its linear index in the brick.
    pub index: u16,
    /// Its steps from the block's first, three bits an axis, x lowest.
    pub place: u16,
}

/// A cluster as the sum sees it.
#[derive(Clone, Copy, Debug)]
pub struct ClusterParts {
    /// About which it is expanded.
    pub center: [f64; 3],
    /// Distance of its farthest point.
    pub reach: f64,
    /// With r the way to the centre, it adds d·r/r³ …
    pub dipole: [f64; 3],
    /// … + q·(xx, yy, zz, xy, yz, zx)/r⁵ …
    pub quadrupole: [f64; 6],
    /// … + t·(xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz)/r⁷.
    pub octupole: [f64; 10],
}

impl<E: SurfaceElement> ClusterTree<E> {
    /// All clusters, by number.
    pub fn cluster_parts(&self) -> impl Iterator<Item = ClusterParts> {
        self.clusters().iter().map(|cluster| {
            let (dipole, quadrupole, octupole) = cluster.expansion.factors();
            let (center, reach) = (cluster.center, cluster.reach.farthest);
            ClusterParts { center, reach, dipole, quadrupole, octupole }
        })
    }
}

impl SumBlocks {
    /// Empties it.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.samples.clear();
        self.bricks = 0;
    }

    /// All blocks, brick by brick.
    pub fn blocks(&self) -> &[SumBlock] {
        &self.blocks
    }

    /// Samples of all blocks.
    pub fn samples(&self) -> &[BlockSample] {
        &self.samples
    }

    /// Bricks that were added.
    pub fn bricks(&self) -> usize {
        self.bricks
    }

    /// Adds the samples of a brick that are wanted, by their linear indices.
    pub(super) fn add<E: SurfaceElement>(
        &mut self,
        cells: BoundedTree<'_, E>,
        key: NodeKey,
        is_wanted: impl Fn(u16) -> bool,
    ) {
        let SumBlocks { blocks, samples, bricks } = self;
        let mut wanted = Vec::new();
        for_blocks(key, |spacing, of_block| {
            wanted.clear();
            wanted.extend(of_block.iter().filter(|(_, index)| is_wanted(*index)));
            cells.find(
                spacing + BLOCK_BITS,
                spacing,
                &wanted,
                &mut |PlannedPoints { plan, low, steps }, found| {
                    let from = samples.len();
                    samples.extend(found.iter().map(|(position, index)| {
                        let step = |a: usize| ((position[a] - low[a]) >> spacing) as u16;
                        BlockSample { index: *index, place: step(0) | step(1) << 3 | step(2) << 6 }
                    }));
                    blocks.push(SumBlock {
                        plan,
                        brick: *bricks,
                        low,
                        spacing,
                        steps,
                        samples: from..samples.len(),
                    });
                },
            );
        });
        *bricks += 1;
    }

    /// The sums at some samples of a block, by their numbers.
    pub(super) fn settle<E: SurfaceElement>(
        &self,
        cells: &BoundedTree<'_, E>,
        block: &SumBlock,
        samples: &[usize],
    ) -> Vec<f64> {
        let position = |number: &usize| -> Units {
            let place = i32::from(self.samples[*number].place);
            std::array::from_fn(|a| block.low[a] + ((place >> (3 * a) & 7) << block.spacing))
        };
        let positions: Vec<Units> = samples.iter().map(position).collect();
        let mut points = CellPoints { values: vec![0.0; positions.len()], positions };
        cells.sum(block.sum(), &mut points);
        points.values
    }
}

impl SumBlock {
    fn sum(&self) -> &ExpansionSum {
        match &*self.plan {
            CellPlan::Here(sum) => sum,
            CellPlan::Divide => unreachable!("what is divided was looked for in its parts"),
        }
    }

    /// Tells blocks apart: those of several bricks with the same number see the tree alike.
    pub fn number(&self) -> usize {
        Arc::as_ptr(&self.plan).addr()
    }

    /// The polynomial of what is far, about the middle of the block: powers of x, y, z that fall, those of z first, with
    /// their coefficients.
    pub fn polynomial(&self) -> impl Iterator<Item = ([usize; 3], f64)> {
        self.sum().local.coefficients()
    }

    /// Clusters that add to the sum.
    pub fn clusters(&self) -> &[u32] {
        &self.sum().clusters
    }

    /// Elements that add to it one by one.
    pub fn elements(&self) -> &[u32] {
        &self.sum().elements
    }
}
