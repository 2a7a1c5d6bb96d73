//! How the boundary of a cell is cut: the conventions for corners, edges and faces, and how a face is cut. Also the
//! table of loops for every corner mask and every choice at its ambiguous faces, which is derived from that.
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
/// every maximal run of inside points is cut off by one segment, which `segment` receives as the places in the ring of the
/// edge that enters the run and of the one that leaves it. Inside points of a face that is cut twice are thus separated.
/// Walked the other way round the same runs are cut off, with the two edges swapped.
pub(super) fn cut_runs<E>(ring: &[(E, bool)], mut segment: impl FnMut(usize, usize)) {
    let starts = |n: usize| ring[n % ring.len()].1;
    let Some(first) = (0..ring.len()).find(|&n| !starts(n) && starts(n + 1)) else { return };
    let mut enter = first;
    for n in first..first + ring.len() {
        match (starts(n), starts(n + 1)) {
            (false, true) => enter = n % ring.len(),
            (true, false) => segment(enter, n % ring.len()),
            _ => {}
        }
    }
}

/// How many corners of a face a run holds that [`cut_runs`] finds between these places of a ring with so many edges;
/// `corners` are the places of the edges that start there.
pub(super) fn corners_in_run([enter, leave]: [usize; 2], corners: [usize; 4], edges: usize) -> usize {
    let from_enter = |place: usize| (place + edges - enter - 1) % edges;
    corners.iter().filter(|&&corner| from_enter(corner) <= from_enter(leave)).count()
}

/// The loops that the cuts of a cell's six faces link into.
#[derive(Clone, Copy)]
pub(super) struct CellLoops {
    /// Bit `c` is set where corner `c` is inside.
    pub mask: u8,
    /// Bit per ambiguous face whose two inside corners are joined on it: it is the outside ones that are cut off.
    pub joined: u8,
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

    /// The cuts of a face as pairs of edges; two where the face is ambiguous.
    pub(super) fn face_cuts(&self, axis: Axis, side: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let ring = face_ring(self.mask, axis, side);
        let mut cuts = [None; 2];
        let mut n = 0;
        cut_runs(&ring, |enter, leave| {
            cuts[n] = Some((ring[enter].0, ring[leave].0));
            n += 1;
        });
        if self.joined >> (2 * axis.index() + side) & 1 == 1
            && let [Some(first), Some(second)] = &mut cuts
        {
            // Round the outside corners, on the same side of which the inside is.
            std::mem::swap(&mut first.1, &mut second.1);
        }
        cuts.into_iter().flatten()
    }
}

/// How the boundary of a plain cell is cut: by its corner mask, and by which of its ambiguous faces are joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct CellCase(u16);

/// Number of kinds.
pub(super) const KINDS: usize = 530;

/// Loops by kind, and by mask where its kinds with joined faces begin.
static TABLE: LazyLock<(Box<[CellLoops]>, [u16; 256])> = LazyLock::new(|| {
    let mut loops: Vec<CellLoops> = (0..=255).map(|mask| derive_loops(mask, 0)).collect();
    let starts = std::array::from_fn(|mask| {
        let start = loops.len() as u16;
        let ambiguous = loops[mask].ambiguous;
        if may_join(mask as u8) {
            let subsets = (1..=ambiguous).filter(|joined| joined & !ambiguous == 0);
            loops.extend(subsets.map(|joined| derive_loops(mask as u8, joined)));
        }
        start
    });
    (loops.into(), starts)
});

/// Whether inside corners may be joined on faces of a cell. Not where all six are ambiguous, as two of the kinds have
/// loops then between which no plane passes.
pub(super) fn may_join(mask: u8) -> bool {
    !matches!(mask, 0b0110_1001 | 0b1001_0110)
}

impl CellCase {
    /// That of a cell with this corner mask none of whose faces is joined.
    #[inline]
    pub(super) fn of(mask: u8) -> CellCase {
        CellCase(mask.into())
    }

    /// That of a cell with these faces joined, which are ambiguous, if it [`may_join`].
    pub(super) fn joined(mask: u8, faces: u8) -> CellCase {
        let ambiguous = CellCase::of(mask).loops().ambiguous;
        let faces = if may_join(mask) { faces & ambiguous } else { 0 };
        if faces == 0 {
            return CellCase::of(mask);
        }
        // Its place among the subsets of the ambiguous faces, which ascend.
        let before = (1..faces).filter(|joined| joined & !ambiguous == 0).count();
        CellCase(TABLE.1[usize::from(mask)] + before as u16)
    }

    /// Its loops.
    #[inline(always)]
    pub(super) fn loops(self) -> &'static CellLoops {
        &TABLE.0[usize::from(self.0)]
    }

    /// Its number, below [`KINDS`].
    #[inline]
    pub(super) fn index(self) -> usize {
        self.0.into()
    }

    /// All of them.
    pub(super) fn all() -> impl Iterator<Item = CellCase> {
        (0..KINDS as u16).map(CellCase)
    }
}

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

fn derive_loops(mask: u8, joined: u8) -> CellLoops {
    let mut loops = CellLoops {
        mask,
        joined,
        count: 0,
        ambiguous: 0,
        rejoined: 0,
        of_edge: [NO_LOOP; 12],
        edges: [0; 4],
    };
    let mut next = [None; 12];
    let mut cuts = [[None; 2]; 6];
    for (face, cut) in cuts.iter_mut().enumerate() {
        for (n, (enter, leave)) in loops.face_cuts(Axis::ALL[face / 2], face % 2).enumerate() {
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
    fn every_kind_has_closed_loops_over_exactly_its_sign_changes() {
        assert_eq!(TABLE.0.len(), KINDS);
        let mut most = 0;
        for kind in CellCase::all() {
            let loops = kind.loops();
            let mask = loops.mask;
            assert_eq!(CellCase::joined(mask, loops.joined), kind);
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
        assert_eq!([0, 255, 0b0110_1001].map(|mask| CellCase::of(mask).loops().count), [0, 0, 4]);
    }

    #[test]
    fn both_cells_cut_a_shared_face_alike() {
        for (signs, is_joined) in (0..16u8).flat_map(|signs| [(signs, false), (signs, true)]) {
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
                    let faces = u8::from(is_joined) << (2 * axis.index() + side);
                    for (a, b) in CellCase::joined(mask(side), faces).loops().face_cuts(axis, side) {
                        let (a, b) = (name(a), name(b));
                        cuts.push(if side == 1 { (a, b) } else { (b, a) });
                    }
                    cuts.sort();
                    cuts
                };
                assert_eq!(cuts(0), cuts(1));
            }
        }
    }
}
