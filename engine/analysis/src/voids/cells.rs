//! The cells of a node by what is known of them, in groups that hang together.

use super::components::{Components, Connectivity};
use super::covered::ROWS;
use crate::brick::{POINTS, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use std::collections::BTreeSet;

/// Stands for a cell that is solid for certain.
pub(super) const NONE: u16 = u16::MAX;

/// What is known of the cells of a node, as bits by row k·33 + j. Cells that are neither are void for certain.
pub(super) struct CellBits {
    /// Solid for certain.
    pub solid: Vec<u64>,
    /// Touched by a surface, so either.
    pub touched: Vec<u64>,
}

impl CellBits {
    /// Nothing touches any cell, and none is solid.
    pub fn void() -> CellBits {
        CellBits { solid: vec![0; ROWS], touched: vec![0; ROWS] }
    }
}

/// Cells of a node that may be void, as groups that hang together within it.
#[derive(Clone, Debug, Default)]
pub(super) struct VoidCells {
    /// By group: whether its cells may be solid as well as void. The others are void for certain.
    pub either: Vec<bool>,
    /// By axis and side: the groups of the cells on a face, or the only one of a node that is one group as a whole.
    faces: [[Vec<u16>; 2]; 3],
    /// Components of the store's leaf that have samples here, and the groups of these.
    pub components: BTreeSet<(u16, u16)>,
    /// Groups that touch each other across a face of cells.
    pub beside: BTreeSet<(u16, u16)>,
}

impl VoidCells {
    /// All cells of a node are one group, to which the components belong that are void.
    pub fn whole(components: impl Iterator<Item = u16>, either: bool) -> VoidCells {
        let face = || [vec![0], vec![0]];
        VoidCells {
            either: vec![either],
            faces: [face(), face(), face()],
            components: components.map(|c| (c, 0)).collect(),
            beside: BTreeSet::new(),
        }
    }

    /// In groups. `sample` tells of which component the sample at a cell's lower corner is, if it is void.
    pub fn grouped(known: &CellBits, sample: impl Fn([usize; 3]) -> Option<u16>) -> VoidCells {
        let mut groups = vec![NONE; POINTS];
        let void = put_groups(&mut groups, 0, |row| !known.solid[row] & !known.touched[row]);
        let either = put_groups(&mut groups, void, |row| !known.solid[row] & known.touched[row]);
        let group = |[i, j, k]: [usize; 3]| groups[(k * BRICK_POINTS + j) * BRICK_POINTS + i];
        let mut cells = VoidCells {
            either: (0..void).map(|_| false).chain((0..either).map(|_| true)).collect(),
            ..VoidCells::default()
        };
        let mut last = (NONE, NONE);
        for n in 0..BRICK_CELLS.pow(3) {
            let at = [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / BRICK_CELLS / BRICK_CELLS];
            let own = group(at);
            if own == NONE {
                continue;
            }
            if let Some(component) = sample(at) {
                cells.components.insert((component, own));
            }
            for a in 0..3 {
                let mut next = at;
                next[a] += 1;
                let other = group(next);
                let pair = (own.min(other), own.max(other));
                if other != NONE && other != own && pair != last {
                    cells.beside.insert(pair);
                    last = pair;
                }
            }
        }
        for (axis, upper) in Axis::ALL.into_iter().flat_map(|axis| [(axis, false), (axis, true)]) {
            let at = |p: usize, q: usize| match (axis, if upper { BRICK_CELLS - 1 } else { 0 }) {
                (Axis::X, w) => [w, p, q],
                (Axis::Y, w) => [p, w, q],
                (Axis::Z, w) => [p, q, w],
            };
            let places = (0..BRICK_CELLS * BRICK_CELLS).map(|n| (n % BRICK_CELLS, n / BRICK_CELLS));
            let face: Vec<u16> = places.map(|(p, q)| group(at(p, q))).collect();
            // Most faces are solid as a whole, or void.
            if face.iter().all(|group| *group == face[0]) {
                cells.faces[axis.index()][usize::from(upper)] =
                    if face[0] == NONE { Vec::new() } else { vec![face[0]] };
            } else {
                cells.faces[axis.index()][usize::from(upper)] = face;
            }
        }
        cells
    }

    /// The groups along a face: none where all of it is solid, one where all is of one group.
    pub fn face(&self, axis: Axis, upper: bool) -> &[u16] {
        &self.faces[axis.index()][usize::from(upper)]
    }

    /// The group of a cell on a face.
    pub fn at(&self, axis: Axis, upper: bool, [p, q]: [usize; 2]) -> u16 {
        let face = self.face(axis, upper);
        match face.len() {
            0 => NONE,
            1 => face[0],
            _ => face[q * BRICK_CELLS + p],
        }
    }
}

/// Numbers the groups of cells of one kind that hang together across faces, from `first` on; gives how many there are. Cells
/// are bits by row.
fn put_groups(groups: &mut [u16], first: usize, row: impl Fn(usize) -> u64) -> usize {
    let own = |place: usize| {
        let is_row = place % BRICK_POINTS < BRICK_CELLS && place / BRICK_POINTS < BRICK_CELLS;
        if is_row { row(place) & ((1 << BRICK_CELLS) - 1) } else { 0 }
    };
    if (0..ROWS).all(|place| own(place) == 0) {
        return 0;
    }
    let signs = SignChanges::from_fn(|n| own(n / BRICK_POINTS) >> (n % BRICK_POINTS) & 1 == 0);
    let components = Components::of_signs(&signs, Connectivity::VoidSix);
    let mut count = 0;
    let mut number = |solid: &bool| {
        let number = (first + count) as u16;
        count += usize::from(!solid);
        if *solid { NONE } else { number }
    };
    let numbers: Vec<u16> = components.solid.iter().map(&mut number).collect();
    for place in 0..ROWS {
        for run in components.row(place % BRICK_POINTS, place / BRICK_POINTS) {
            let group = numbers[usize::from(run.label)];
            if group != NONE {
                let begin = place * BRICK_POINTS;
                groups[begin + usize::from(run.from)..begin + usize::from(run.to)].fill(group);
            }
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_three_kinds_are_grouped() {
        // A wall of cells that a surface touches, with solid on one half of it, parts the node in two.
        let mut known = CellBits::void();
        for k in 0..BRICK_CELLS {
            for j in 0..BRICK_CELLS {
                let row = k * BRICK_POINTS + j;
                if j < 16 { known.solid[row] |= 1 << 10 } else { known.touched[row] |= 1 << 10 }
            }
        }
        let cells = VoidCells::grouped(&known, |at| (at == [20, 0, 0]).then_some(3));
        assert_eq!(cells.either, [false, false, true]);
        assert_eq!(cells.beside, BTreeSet::from([(0, 2), (1, 2)]));
        assert_eq!(cells.components, BTreeSet::from([(3, 1)]));
        assert_eq!((cells.face(Axis::X, false), cells.face(Axis::X, true)), (&[0][..], &[1][..]));
        assert_eq!(cells.at(Axis::Z, true, [10, 3]), NONE);
        assert_eq!(cells.at(Axis::Z, true, [10, 20]), 2);
        assert!(VoidCells::whole([0].into_iter(), true).at(Axis::Y, false, [3, 4]) == 0);
    }
}
