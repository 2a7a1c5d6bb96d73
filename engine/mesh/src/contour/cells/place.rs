//! Placing the vertices of loops, group by group, and what is noted of each group for creases and corners.

use super::builder::{CellsBuilder, PendingLoop};
use super::special::apart;
use crate::contour::constrained_qef::{self, minimisers};
use crate::contour::crease::Crease;
use crate::contour::lanes::GROUP;
use crate::contour::qef::{MISS, PlaneSums};
use crate::contour::solve::SolvedGroup;
use crate::lattice::BRICK_CELLS;
use crate::wide::{Simd, dispatch, level};

impl CellsBuilder<'_> {
    /// Leaves the vertex of a loop, whose planes the group has, to it; `first` is the cell's first vertex.
    #[inline(always)]
    pub(super) fn push_vertex(&mut self, cell: [usize; 3], first: usize, is_lone: bool) {
        self.group.place(self.waiting.len(), cell);
        let vertex = self.cells.positions.len() as u32;
        self.waiting.push(PendingLoop { cell: cell.map(|c| c as u8), is_lone, first: first as u32, vertex });
        self.cells.positions.push([0.0; 3]);
        if self.waiting.len() == GROUP {
            self.place();
        }
    }

    /// Places the vertices that wait.
    pub(super) fn place(&mut self) {
        dispatch!(level(), simd => self.place_group(simd))
    }

    #[inline(always)]
    fn place_group<S: Simd>(&mut self, simd: S) {
        let margin = self.frame.margin;
        let solved = self.group.solve(simd, self.waiting.len(), margin, MISS);
        let places = self.frame.world_wide(simd, solved.corners, solved.at);
        for (lane, [x, y, z, _]) in places.into_iter().enumerate().take(self.waiting.len()) {
            let PendingLoop { cell, first, vertex, is_lone } = self.waiting[lane];
            let is_left = solved.left >> lane & 1 == 1;
            if !is_left && is_lone {
                self.cells.positions[vertex as usize] = [x, y, z];
                continue;
            }
            let cell = cell.map(usize::from);
            if is_lone {
                let pushed = self.outliers.push((&solved.terms, lane), (vertex, cell), margin);
                if let Some((names, points)) = pushed {
                    for ((vertex, cell), point) in names.into_iter().zip(points) {
                        self.cells.positions[vertex as usize] = self.frame.world(cell, point);
                    }
                }
            } else {
                let point = if is_left {
                    // The cell's next vertex must know where this one is.
                    minimisers(&solved.terms, constrained_qef::cell(margin))[lane]
                } else {
                    solved.points()[lane]
                };
                let (placed, own) = self.cells.positions.split_at_mut(vertex as usize);
                own[0] = apart(&self.frame, cell, point, &placed[first as usize..]);
            }
        }
        self.note_creases(&solved);
        self.note_sums(simd, &solved);
        self.waiting.clear();
    }

    /// Which cells of a group are creased.
    #[inline(always)]
    fn note_creases<S: Simd>(&mut self, solved: &SolvedGroup<S>) {
        let (mut creased, mut creases) = ([[0; 3]; GROUP], 0);
        let follows_creases = self.field.follows_creases();
        for (lane, &PendingLoop { cell, is_lone, .. }) in self.waiting.iter().enumerate().take(GROUP) {
            // Half of the cells are creased where surfaces are rough: which are is not foreseen, so it is no branch.
            let is_creased = is_lone && solved.flat >> lane & 1 == 0;
            creased[creases % GROUP] = cell;
            creases += usize::from(is_creased);
            if follows_creases && is_creased {
                self.sharp.extend(Crease::of(solved, lane).map(|crease| (cell.map(usize::from), crease)));
            }
        }
        self.creased.extend_from_slice(&creased[..creases.min(GROUP)]);
    }

    /// Adds up the planes of a group, for the search for corners.
    #[inline(always)]
    fn note_sums<S: Simd>(&mut self, simd: S, solved: &SolvedGroup<S>) {
        let Some(sums) = &mut self.sums else { return };
        let mut sum = self.sum.load(simd);
        let mut end = sums.len();
        sums.resize(end + GROUP, PlaneSums::default());
        for (lane, &PendingLoop { cell: [i, j, k], first, vertex, .. }) in
            self.waiting.iter().enumerate().take(GROUP)
        {
            // Of several loops of a cell the first counts, and what others leave is written over.
            sums[end].store(sum);
            end += usize::from(vertex == first);
            sum = (sum.0 + solved.sums[lane].0, sum.1 + solved.sums[lane].1);
            let row = usize::from(k) * BRICK_CELLS + usize::from(j);
            self.apart[row] |= ((solved.apart >> lane & 1) as u32) << (i % 32);
        }
        sums.truncate(end);
        self.sum = PlaneSums::of(sum);
    }

    /// Places the vertices that wait for others that need more.
    pub(super) fn place_outliers(&mut self) {
        let (frame, positions) = (&self.frame, &mut self.cells.positions);
        self.outliers.drain(frame.margin, |(vertex, cell), point| {
            positions[vertex as usize] = frame.world(cell, point);
        });
    }
}
