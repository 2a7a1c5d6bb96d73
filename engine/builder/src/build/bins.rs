//! Sorting pieces into the cubes they touch.

use super::field::PieceField;
use crate::lattice::{NodeKey, ROOT_BITS, Units, morton};
use std::ops::Range;

/// Finds the descendants of a node, `stride` levels below it, that a piece touches. A descendant's cube
/// is the closed one from its sample 0 to its sample 32.
#[derive(Clone, Copy)]
pub(super) struct Binner {
    origin: Units,
    /// log₂ of a descendant's edge in units.
    shift: u32,
    /// Descendants along an axis, minus one.
    last: i32,
    stride: u32,
    node: NodeKey,
    /// Numbers of the descendants that pieces are sorted by; the others are left out.
    kept: (u32, u32),
}

impl Binner {
    pub fn new(node: NodeKey, stride: u8) -> Binner {
        let stride = u32::from(stride);
        let shift = ROOT_BITS - u32::from(node.level()) - stride;
        let kept = (0, 1 << (3 * stride));
        Binner { node, origin: node.base().map(|b| b + 1), shift, last: (1 << stride) - 1, stride, kept }
    }

    /// The same for sorting by some of the descendants only.
    pub fn keeping(self, cells: Range<u64>) -> Binner {
        Binner { kept: (cells.start as u32, cells.end as u32), ..self }
    }

    /// Numbers of the descendants that are kept.
    pub fn kept(&self) -> Range<usize> {
        self.kept.0 as usize..self.kept.1 as usize
    }

    /// The node whose descendants are meant.
    pub fn node(&self) -> NodeKey {
        self.node
    }

    /// Levels from the node to its descendants.
    pub fn stride(&self) -> u8 {
        self.stride as u8
    }

    /// Number of descendants.
    pub fn cells(&self) -> usize {
        1 << (3 * self.stride)
    }

    /// Calls `cell` with the Morton number, within the node, of every descendant touched.
    #[inline]
    pub fn for_touched<F: PieceField>(&self, field: &F, piece: &F::Piece, mut cell: impl FnMut(usize)) {
        // Bounds of triangles are even and cube faces odd, so none lies on a face; those of solids have a margin.
        let (min, max) = field.bounds(piece);
        let from: Units = std::array::from_fn(|a| (min[a] - self.origin[a]) >> self.shift);
        let to: Units = std::array::from_fn(|a| (max[a] - self.origin[a]) >> self.shift);
        let within = (0..3).all(|a| from[a] >= 0 && to[a] <= self.last);
        if within && from == to {
            return cell(number(from));
        }
        self.for_touched_of_many(field, piece, from, to, within, &mut cell);
    }

    #[inline(never)]
    fn for_touched_of_many<F: PieceField>(
        &self,
        field: &F,
        piece: &F::Piece,
        from: Units,
        to: Units,
        within: bool,
        cell: &mut dyn FnMut(usize),
    ) {
        // A piece that leaves the node may miss a cube that its bounding box meets. One that stays inside
        // and spans cubes along one axis only touches them all, because it is connected.
        let surely = within && (0..3).filter(|&a| from[a] < to[a]).count() == 1;
        let (first, last) = (from.map(|c| c.max(0)), to.map(|c| c.min(self.last)));
        let held = field.points(piece).map(|p| [0, 1, 2].map(|a| (p[a] - self.origin[a]) >> self.shift));
        let mut test = None;
        let mut touches = |low: Units| {
            let test = test.get_or_insert_with(|| field.cube_test(piece, 1 << self.shift));
            test(low)
        };
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let row = number([0, y, z]);
                for x in first[0]..=last[0] {
                    let at = [x, y, z];
                    let low = std::array::from_fn(|a| self.origin[a] + (at[a] << self.shift));
                    // A cube that holds a vertex needs no test; for a small facet that is most of them.
                    if surely || held.contains(&at) || touches(low) {
                        cell(row | number([x, 0, 0]));
                    }
                }
            }
        }
    }

    /// Indices of `pieces` by descendant. Void ones are left out, and descendants that are not kept.
    pub fn sort_indices<F: PieceField>(&self, field: &F, pieces: &[F::Piece]) -> CellLists {
        self.sort_some(field, pieces, usize::MAX).0
    }

    /// [`Self::sort_indices`] of the first pieces, until they touch `enough` descendants; and how many pieces that are.
    fn sort_some<F: PieceField>(&self, field: &F, pieces: &[F::Piece], enough: usize) -> (CellLists, usize) {
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(enough.min(pieces.len() * 3 / 2));
        let mut starts = vec![0u32; self.cells() + 1];
        let mut taken = pieces.len();
        for (index, piece) in pieces.iter().enumerate() {
            if pairs.len() >= enough {
                taken = index;
                break;
            }
            if field.is_void(piece) {
                continue;
            }
            self.for_touched(field, piece, |cell| {
                if (self.kept.0..self.kept.1).contains(&(cell as u32)) {
                    pairs.push((cell as u32, index as u32));
                    starts[cell + 1] += 1;
                }
            });
        }
        (1..starts.len()).for_each(|c| starts[c] += starts[c - 1]);
        let mut next = starts.clone();
        let mut indices = vec![0; pairs.len()];
        for (cell, index) in pairs {
            indices[next[cell as usize] as usize] = index;
            next[cell as usize] += 1;
        }
        (CellLists { starts, indices }, taken)
    }
}

/// The Morton number of a descendant.
#[inline]
fn number(at: Units) -> usize {
    morton(at.map(|c| c as u32)) as usize
}

/// For each descendant, in Morton order, the indices of the pieces that touch it.
pub(super) struct CellLists {
    starts: Vec<u32>,
    indices: Vec<u32>,
}

impl CellLists {
    /// Number of descendants.
    pub fn cells(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether no piece touches any of some descendants.
    pub fn are_empty(&self, cells: &Range<usize>) -> bool {
        self.starts[cells.start] == self.starts[cells.end]
    }

    pub fn of(&self, cell: usize) -> &[u32] {
        &self.indices[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// A run of pieces sorted by the job that needs them; one that touches several jobs' cubes is repeated.
pub(super) struct SortedRun<P> {
    starts: Vec<u32>,
    pieces: Vec<P>,
}

impl<P: Copy> SortedRun<P> {
    /// Sorts `pieces`; void ones are left out.
    pub fn new<F: PieceField<Piece = P>>(field: &F, binner: &Binner, pieces: &[P]) -> SortedRun<P> {
        SortedRun::of_some(field, binner, pieces, usize::MAX).0
    }

    /// [`Self::new`] of the first pieces, until they touch `enough` cubes; and how many pieces that are.
    pub fn of_some<F: PieceField<Piece = P>>(
        field: &F,
        binner: &Binner,
        pieces: &[P],
        enough: usize,
    ) -> (SortedRun<P>, usize) {
        let (lists, taken) = binner.sort_some(field, pieces, enough);
        let pieces = lists.indices.iter().map(|&i| pieces[i as usize]).collect();
        (SortedRun { starts: lists.starts, pieces }, taken)
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        (size_of_val(self.starts.as_slice()) + size_of_val(self.pieces.as_slice())) as u64
    }

    /// Number of pieces, repeated ones counted as often.
    pub fn pieces(&self) -> u64 {
        self.pieces.len() as u64
    }

    /// The cubes that pieces touch, each with those.
    pub fn cells(&self) -> impl Iterator<Item = (usize, &[P])> {
        (0..self.starts.len() - 1).map(|cell| (cell, self.of(cell))).filter(|(_, pieces)| !pieces.is_empty())
    }

    pub fn of(&self, cell: usize) -> &[P] {
        &self.pieces[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}
