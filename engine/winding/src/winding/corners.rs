//! Winding numbers on a coarse lattice: the corners from which bricks are evaluated.

use super::scan::{SampleCube, ScanFacet};
use crate::lattice::{NodeKey, ROOT_BITS, Triangle, bounds};
use crate::wide::{Simd, dispatch, level};

/// The corner samples of all bricks `stride` levels below a node: 2^stride along each axis.
///
/// Triangles are added in any order and from any number of partial grids; the result is a sum of integers.
#[derive(Clone, Debug)]
pub struct CornerGrid {
    block: SampleCube,
    origin: [i32; 3],
    /// Jumps between neighbouring corners: along z in the column (0, 0), along y in the face x = 0, along
    /// x everywhere.
    column: Vec<i64>,
    face: Vec<i64>,
    rows: Vec<i64>,
}

impl CornerGrid {
    /// An empty grid for the bricks `stride` levels below `node`.
    pub fn new(node: NodeKey, stride: u8) -> CornerGrid {
        let across = 1usize << stride;
        let shift = ROOT_BITS - u32::from(node.level()) - u32::from(stride);
        CornerGrid {
            block: SampleCube { shift, last: across as i32 - 1 },
            origin: node.base().map(|b| b + 1),
            column: vec![0; across],
            face: vec![0; across * across],
            rows: vec![0; across * across * across],
        }
    }

    /// Adds one triangle's crossings.
    #[inline]
    pub fn add(&mut self, t: &Triangle) {
        // Most triangles lie between two lines.
        let (min, max) = bounds(t);
        let cell = |at: i32, axis: usize| (at - self.origin[axis]) >> self.block.shift;
        if (0..3).map(|axis| u32::from(cell(min[axis], axis) != cell(max[axis], axis))).sum::<u32>() < 2 {
            return;
        }
        dispatch!(level(), simd => {
            if let Some(facet) = ScanFacet::new(simd, t, self.origin, self.block) {
                self.add_facet(simd, &facet);
            }
        });
    }

    #[inline(always)]
    fn add_facet<S: Simd>(&mut self, simd: S, facet: &ScanFacet) {
        let (block, across) = (self.block, self.block.last as usize + 1);
        let jump = |axis| i64::from(facet.jump(axis));
        let at = |slow: i32, fast: i32| slow as usize * across + fast as usize;
        facet.scan::<S, 2>(simd, block, [0, 0], |c| self.column[c.lower as usize + 1] += jump(2));
        facet.scan::<S, 1>(simd, block, [block.last, 0], |c| self.face[at(c.u, c.lower + 1)] += jump(1));
        facet.scan::<S, 0>(simd, block, [block.last; 2], |c| {
            self.rows[at(c.v, c.u) * across + c.lower as usize + 1] += jump(0);
        });
    }

    /// Adds another grid of the same node and stride.
    pub fn merge(&mut self, other: &CornerGrid) {
        for (mine, theirs) in
            [(&mut self.column, &other.column), (&mut self.face, &other.face), (&mut self.rows, &other.rows)]
        {
            mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        }
    }

    /// The jumps that the grid has gathered, to be kept elsewhere.
    pub fn jumps(&self) -> impl Iterator<Item = i64> {
        [&self.column, &self.face, &self.rows].into_iter().flatten().copied()
    }

    /// The grid of jumps that [`Self::jumps`] has listed; `None` if there are more or fewer than such a grid has.
    pub fn from_jumps(node: NodeKey, stride: u8, jumps: &[i64]) -> Option<CornerGrid> {
        let mut grid = CornerGrid::new(node, stride);
        let (column, rest) = jumps.split_at_checked(grid.column.len())?;
        let (face, rows) = rest.split_at_checked(grid.face.len())?;
        if rows.len() != grid.rows.len() {
            return None;
        }
        (grid.column, grid.face, grid.rows) = (column.to_vec(), face.to_vec(), rows.to_vec());
        Some(grid)
    }

    /// The winding numbers, x fastest, given the one at the node's own corner.
    pub fn finish(mut self, corner: i64) -> Vec<i64> {
        let across = self.block.last as usize + 1;
        self.column[0] = corner;
        for k in 0..across {
            if k > 0 {
                self.column[k] += self.column[k - 1];
            }
            let face = &mut self.face[k * across..][..across];
            face[0] = self.column[k];
            for j in 0..across {
                if j > 0 {
                    face[j] += face[j - 1];
                }
                let row = &mut self.rows[(k * across + j) * across..][..across];
                row[0] = face[j];
                (1..across).for_each(|i| row[i] += row[i - 1]);
            }
        }
        self.rows
    }
}
