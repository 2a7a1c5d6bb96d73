//! How the boundary of a cell is cut: the conventions for corners, edges and faces, the one rule that says
//! how a face is cut, and the table of loops for every corner mask, which is derived from that rule.
//!
//! *Manifold Dual Contouring*, Schaefer, Ju & Warren 2007, has one vertex per surface component in a cell.
//! Here a component is a loop of cuts on the cell's boundary.

use crate::lattice::Axis;
use std::sync::LazyLock;

/// The value in [`CellLoops::of_edge`] of an edge without a sign change.
pub(super) const NO_LOOP: u8 = u8::MAX;

/// Number, 0..12, of the edge along `axis` whose offsets along the other two axes `(u, v)` of
/// [`Axis::others`] are 0 or 1.
#[inline]
pub(super) const fn edge_index(axis: Axis, u: usize, v: usize) -> usize {
    4 * axis.index() + 2 * v + u
}

/// Axis of an edge and the offset of its lower end from the cell's lower corner.
#[inline]
pub(super) fn edge_lower(edge: usize) -> (Axis, [usize; 3]) {
    EDGE_LOWER[edge]
}

static EDGE_LOWER: [(Axis, [usize; 3]); 12] = {
    let mut all = [(Axis::X, [0; 3]); 12];
    let mut edge = 0;
    while edge < 12 {
        all[edge] = derive_edge(edge);
        edge += 1;
    }
    all
};

/// What [`edge_lower`] tabulates.
pub(super) const fn derive_edge(edge: usize) -> (Axis, [usize; 3]) {
    let axis = Axis::ALL[edge / 4];
    let (u, v) = axis.others();
    let mut offset = [0; 3];
    offset[u.index()] = edge & 1;
    offset[v.index()] = edge >> 1 & 1;
    (axis, offset)
}

/// The corners `(u, v)` of a unit square, counter-clockwise seen from the positive end of the axis that
/// completes `(u, v)` to a right-handed frame. Also the order of the four cells around an edge.
pub(super) const SQUARE: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

/// The cell in the quadrant `(u, v)` around the edge along `axis` whose lower sample is `low`.
#[inline]
pub(super) fn cell_around(axis: Axis, low: [i32; 3], [qu, qv]: [usize; 2]) -> [i32; 3] {
    let (u, v) = axis.others();
    let mut cell = low;
    cell[u.index()] += qu as i32 - 1;
    cell[v.index()] += qv as i32 - 1;
    cell
}

/// Cuts a face. `ring` lists the minimal edges round the face with the sign of the point where each starts;
/// every maximal run of inside points is cut off by one segment, which `segment` receives as (edge that
/// enters the run, edge that leaves it). Inside points on an ambiguous face are thus separated. Walked the
/// other way round the same runs are cut off, with the two edges swapped. Returns the number of runs.
pub(super) fn cut_runs<E: Copy>(ring: &[(E, bool)], mut segment: impl FnMut(E, E)) -> usize {
    let starts = |n: usize| ring[n % ring.len()].1;
    let Some(first) = (0..ring.len()).find(|&n| !starts(n) && starts(n + 1)) else { return 0 };
    let mut runs = 0;
    let mut enter = ring[first].0;
    for n in first..first + ring.len() {
        match (starts(n), starts(n + 1)) {
            (false, true) => enter = ring[n % ring.len()].0,
            (true, false) => {
                segment(enter, ring[n % ring.len()].0);
                runs += 1;
            }
            _ => {}
        }
    }
    runs
}

/// The loops that the cuts of a cell's six faces link into.
#[derive(Clone, Copy)]
pub(super) struct CellLoops {
    /// Number of loops, at most four.
    pub count: u8,
    /// Bit per face, number `2·axis + side`, that is cut twice.
    pub ambiguous: u8,
    /// Bit per ambiguous face whose two cuts belong to the same loop.
    pub rejoined: u8,
    /// Which loop passes through each of the 12 edges, or [`NO_LOOP`].
    pub of_edge: [u8; 12],
    /// Bit per edge, for each loop.
    pub edges: [u16; 4],
}

impl CellLoops {
    /// Numbers of the edges that a loop passes through.
    pub(super) fn edges_of(&self, of: usize) -> impl Iterator<Item = usize> + use<> {
        let edges = self.edges[of];
        (0..12).filter(move |edge| edges >> edge & 1 == 1)
    }
}

/// Loops by corner mask: bit `c` is set where corner `c` is inside.
pub(super) static CELL_LOOPS: LazyLock<Box<[CellLoops; 256]>> =
    LazyLock::new(|| Box::new(std::array::from_fn(|mask| derive_loops(mask as u8))));

/// The ring of a face of a plain cell: edges with the sign of their start, counter-clockwise from outside.
fn face_ring(mask: u8, axis: Axis, side: usize) -> [(usize, bool); 4] {
    let (u, v) = axis.others();
    let corner = |n: usize| {
        let [cu, cv] = SQUARE[n % 4];
        side << axis.index() | cu << u.index() | cv << v.index()
    };
    std::array::from_fn(|n| {
        // The lower face is seen from below, so its ring runs backwards.
        let (from, to) = if side == 1 { (corner(n), corner(n + 1)) } else { (corner(4 - n), corner(3 - n)) };
        let along = Axis::ALL[(from ^ to).trailing_zeros() as usize];
        let (eu, ev) = along.others();
        let low = from & to;
        (edge_index(along, low >> eu.index() & 1, low >> ev.index() & 1), mask >> from & 1 == 1)
    })
}

/// The cuts of a face of a plain cell as pairs of edges; two where the face is ambiguous.
pub(super) fn face_cuts(mask: u8, axis: Axis, side: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut cuts = [None; 2];
    let mut n = 0;
    cut_runs(&face_ring(mask, axis, side), |enter, leave| {
        cuts[n] = Some((enter, leave));
        n += 1;
    });
    cuts.into_iter().flatten()
}

fn derive_loops(mask: u8) -> CellLoops {
    let mut loops = CellLoops { count: 0, ambiguous: 0, rejoined: 0, of_edge: [NO_LOOP; 12], edges: [0; 4] };
    let mut next = [None; 12];
    let mut cuts = [[None; 2]; 6];
    for (face, cut) in cuts.iter_mut().enumerate() {
        for (n, (enter, leave)) in face_cuts(mask, Axis::ALL[face / 2], face % 2).enumerate() {
            next[enter] = Some(leave);
            cut[n] = Some(enter);
        }
    }
    for start in 0..12 {
        let mut edge = start;
        while let (Some(after), NO_LOOP) = (next[edge], loops.of_edge[edge]) {
            loops.of_edge[edge] = loops.count;
            loops.edges[loops.count as usize] |= 1 << edge;
            edge = after;
        }
        if loops.of_edge[start] == loops.count {
            loops.count += 1;
        }
    }
    for (face, cut) in cuts.iter().enumerate() {
        if let [Some(a), Some(b)] = *cut {
            loops.ambiguous |= 1 << face;
            loops.rejoined |= u8::from(loops.of_edge[a] == loops.of_edge[b]) << face;
        }
    }
    loops
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mask_has_closed_loops_over_exactly_its_sign_changes() {
        let mut most = 0;
        for mask in 0..=255u8 {
            let loops = &CELL_LOOPS[mask as usize];
            let mut union = 0;
            for l in 0..loops.count as usize {
                assert_eq!(union & loops.edges[l], 0);
                assert!(loops.edges[l].count_ones() >= 3);
                union |= loops.edges[l];
            }
            for edge in 0..12 {
                let (axis, low) = edge_lower(edge);
                let low = low[0] | low[1] << 1 | low[2] << 2;
                let changes = (mask >> low ^ mask >> (low | 1 << axis.index())) & 1 == 1;
                assert_eq!(union >> edge & 1 == 1, changes, "mask {mask} edge {edge}");
                assert_eq!(loops.of_edge[edge] == NO_LOOP, !changes);
            }
            most = most.max(loops.count);
        }
        assert_eq!(most, 4);
        assert_eq!((CELL_LOOPS[0].count, CELL_LOOPS[255].count, CELL_LOOPS[0b0110_1001].count), (0, 0, 4));
    }

    #[test]
    fn both_cells_cut_a_shared_face_alike() {
        for signs in 0..16u8 {
            for axis in Axis::ALL {
                let (u, v) = axis.others();
                let corner = |side: usize, n: usize| {
                    side << axis.index() | SQUARE[n][0] << u.index() | SQUARE[n][1] << v.index()
                };
                let mask = |side| (0..4).fold(0u8, |m, n| m | (signs >> n & 1) << corner(side, n));
                let cuts = |side: usize| {
                    let mut cuts = Vec::new();
                    // Name an edge of the face by its axis and its place across the face.
                    let name = |edge: usize| {
                        let (along, mut low) = edge_lower(edge);
                        low[axis.index()] = 0;
                        (along.index(), low)
                    };
                    cut_runs(&face_ring(mask(side), axis, side), |a, b| {
                        let (a, b) = (name(a), name(b));
                        cuts.push(if side == 1 { (a, b) } else { (b, a) });
                    });
                    cuts.sort();
                    cuts
                };
                assert_eq!(cuts(0), cuts(1));
            }
        }
    }
}
