//! Cells with several loops: planes that keep what belongs to one loop from what belongs to another.
//!
//! For any two loops of a cell there is a plane with the edges that one crosses on one side and those of the other on
//! the other side. Let each vertex lie on the side of its own loop's edges, and the points where mesh edges leave the
//! cell, too.
//!
//! Then the parts of the surface within the cell cannot meet, as those of one loop lie in the convex hull of these.

use super::topology::{CellCase, KINDS, edge_lower};
use std::sync::LazyLock;

/// Loops of a cell, and pairs of them, at most.
pub(super) const LOOPS: usize = 4;
const PAIRS: usize = LOOPS * (LOOPS - 1) / 2;

/// What rounding may change of a sum of three numbers in 0..1.
pub(super) const SLACK: f64 = 1e-12;

/// Two loops of a cell lie where `normal`·p is at most `low`, and at least `high`; p is 0..1 along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct SeparatingSlab {
    normal: [i8; 3],
    low: i8,
    high: i8,
}

/// By kind and pair (i, j), i < j, at j·(j − 1)/2 + i.
static GAPS: LazyLock<Box<[[SeparatingSlab; PAIRS]; KINDS]>> = LazyLock::new(|| {
    let mut gaps = Box::new([[SeparatingSlab::default(); PAIRS]; KINDS]);
    for (kind, gaps) in CellCase::all().zip(gaps.iter_mut()) {
        for (i, j) in pairs(kind.loops().count.into()) {
            gaps[j * (j - 1) / 2 + i] = widest(kind, i, j);
        }
    }
    gaps
});

/// The gap between loops i < j of a cell.
fn gap(kind: CellCase, i: usize, j: usize) -> &'static SeparatingSlab {
    &GAPS[kind.index()][j * (j - 1) / 2 + i]
}

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(|j| (0..j).map(move |i| (i, j)))
}

/// Ends of the edges of a loop.
fn ends(kind: CellCase, of: usize) -> impl Iterator<Item = [i8; 3]> {
    kind.loops().edges_of(of).flat_map(|edge| {
        let (axis, low) = edge_lower(edge);
        let low = low.map(|c| c as i8);
        let mut high = low;
        high[axis.index()] += 1;
        [low, high]
    })
}

fn along(normal: [i8; 3], at: [i8; 3]) -> i8 {
    (0..3).map(|a| normal[a] * at[a]).sum()
}

/// The gap with the most room of all whose normals have components −1, 0 and 1, the first one of equals.
fn widest(kind: CellCase, i: usize, j: usize) -> SeparatingSlab {
    let normals = (0..27i8).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]);
    let gaps = normals.map(|normal| {
        let low = ends(kind, i).map(|at| along(normal, at)).max().unwrap_or_default();
        let high = ends(kind, j).map(|at| along(normal, at)).min().unwrap_or_default();
        SeparatingSlab { normal, low, high }
    });
    let room = |gap: &SeparatingSlab| if gap.normal == [0; 3] { i8::MIN } else { gap.high - gap.low };
    gaps.reduce(|best, gap| if room(&gap) > room(&best) { gap } else { best }).unwrap_or_default()
}

impl SeparatingSlab {
    fn along(&self, at: [f64; 3]) -> f64 {
        (0..3).map(|a| f64::from(self.normal[a]) * at[a]).sum()
    }

    /// Where between them the vertices of the two loops are kept apart, if they are.
    fn offset(&self, [first, second]: [[f64; 3]; 2]) -> Option<f64> {
        let [first, second] = [first, second].map(|vertex| self.along(vertex));
        let offset = ((first + second) / 2.0).clamp(self.low.into(), self.high.into());
        (first < offset - SLACK && offset + SLACK < second).then_some(offset)
    }
}

/// Which loops of a cell, by bit, are not kept apart from another one by their `vertices`.
pub(super) fn tangled(kind: CellCase, vertices: &[[f64; 3]]) -> u8 {
    let tangled = pairs(vertices.len().min(LOOPS))
        .filter(|&(i, j)| gap(kind, i, j).offset([vertices[i], vertices[j]]).is_none());
    tangled.fold(0, |all, (i, j)| all | 1 << i | 1 << j)
}

/// The part of a cell that belongs to one loop: where `normal`·p ≤ `offset` for each of some planes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoopRegion {
    planes: [([f64; 3], f64); LOOPS - 1],
    count: usize,
}

impl LoopRegion {
    /// That of loop `of` of a cell with these vertices. Vertices that are not kept apart give no plane.
    pub(super) fn new(kind: CellCase, of: usize, vertices: &[[f64; 3]]) -> LoopRegion {
        let mut part = LoopRegion::default();
        for (i, j) in pairs(vertices.len().min(LOOPS)).filter(|&(i, j)| i == of || j == of) {
            let gap = gap(kind, i, j);
            if let Some(offset) = gap.offset([vertices[i], vertices[j]]) {
                let sign = if i == of { 1.0 } else { -1.0 };
                part.planes[part.count] = (gap.normal.map(|c| sign * f64::from(c)), sign * offset);
                part.count += 1;
            }
        }
        part
    }

    /// Whether a point is in the part.
    pub(super) fn holds(&self, at: [f64; 3]) -> bool {
        self.planes[..self.count].iter().all(|(normal, offset)| dot(normal, at) < offset - SLACK)
    }

    /// How far to go from a point `at` towards `inner`, which lies in the part, 0 to 1, to be in the part: not at all,
    /// or until an eighth of the way between `inner` and the planes is left.
    pub(super) fn pull(&self, at: [f64; 3], inner: [f64; 3]) -> f64 {
        let mut pull = 0.0f64;
        for (normal, offset) in &self.planes[..self.count] {
            let (at, inner) = (dot(normal, at), dot(normal, inner));
            if at >= offset - SLACK {
                let goal = offset - (offset - inner) / 8.0;
                pull = pull.max(((at - goal) / (at - inner)).clamp(0.0, 1.0));
            }
        }
        pull
    }
}

fn dot(normal: &[f64; 3], at: [f64; 3]) -> f64 {
    (0..3).map(|a| normal[a] * at[a]).sum()
}

#[cfg(test)]
mod tests {
    use super::super::face_vertices::middle;
    use super::*;
    use crate::lattice::Axis;
    use proptest::prelude::*;

    #[test]
    fn every_two_loops_of_a_cell_have_a_plane_between_them() {
        let (mut all, mut tight) = (0, 0);
        for kind in CellCase::all() {
            for (i, j) in pairs(kind.loops().count.into()) {
                let gap = gap(kind, i, j);
                assert!(gap.normal != [0; 3] && gap.low <= gap.high, "{kind:?}: {gap:?}");
                assert!(ends(kind, i).all(|at| along(gap.normal, at) <= gap.low));
                assert!(ends(kind, j).all(|at| along(gap.normal, at) >= gap.high));
                all += 1;
                tight += usize::from(gap.low == gap.high);
            }
        }
        // All but two corners that are opposite each other.
        assert_eq!(all - tight, 8);
    }

    /// A coordinate is off by a seventh of a cell at most, where cells are seven steps of 32 bits wide: half a step by its
    /// own rounding, half a step by that of the planes of the lattice. Places on faces are counted from these.
    #[test]
    fn middles_stay_in_their_parts_however_they_are_rounded() {
        for kind in CellCase::all() {
            let loops = kind.loops();
            for (i, j) in pairs(loops.count.into()) {
                let gap = gap(kind, i, j);
                // How far along each axis a place of one of the two may be moved.
                let room = |of: usize, at: [f64; 3], axes: &[Axis]| {
                    let room = match of == i {
                        true => f64::from(gap.low) - gap.along(at),
                        false => gap.along(at) - f64::from(gap.high),
                    };
                    room / axes.iter().map(|axis| f64::from(gap.normal[axis.index()].abs())).sum::<f64>()
                };
                for of in [i, j] {
                    let mut mean = [0.0; 3];
                    for edge in loops.edges_of(of) {
                        let at = middle([edge; 2]);
                        (0..3).for_each(|a| mean[a] += at[a] / f64::from(loops.edges[of].count_ones()));
                    }
                    assert!(room(of, mean, &Axis::ALL) > 1.0 / 7.0, "{kind:?}");
                }
                for (axis, side) in Axis::ALL.into_iter().flat_map(|axis| [(axis, 0), (axis, 1)]) {
                    let (u, v) = axis.others();
                    for (enter, leave) in loops.face_cuts(axis, side) {
                        let of = usize::from(loops.of_edge[enter]);
                        let at = middle([enter, leave]);
                        assert!((of != i && of != j) || room(of, at, &[u, v]) > 1.0 / 14.0, "{kind:?}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn means_of_crossings_are_never_tangled_and_points_are_pulled_into_parts(
            kind in (0..KINDS).prop_map(|n| CellCase::all().nth(n).unwrap()),
            at in prop::collection::vec(0.001f64..0.999, 12),
            far in prop::array::uniform3(0.0f64..1.0),
        ) {
            let loops = kind.loops();
            let mean = |of: usize| -> [f64; 3] {
                let mut sum = [0.0; 3];
                for edge in loops.edges_of(of) {
                    let (axis, low) = edge_lower(edge);
                    let mut p = low.map(|c| c as f64);
                    p[axis.index()] += at[edge];
                    (0..3).for_each(|a| sum[a] += p[a]);
                }
                sum.map(|c| c / f64::from(loops.edges[of].count_ones()))
            };
            let vertices: Vec<[f64; 3]> = (0..loops.count.into()).map(mean).collect();
            prop_assert_eq!(tangled(kind, &vertices), 0);
            for of in 0..vertices.len() {
                let part = LoopRegion::new(kind, of, &vertices);
                prop_assert_eq!(part.count, vertices.len() - 1);
                for other in 0..vertices.len() {
                    prop_assert_eq!(part.pull(vertices[other], vertices[of]) > 0.0, other != of);
                }
                let pull = part.pull(far, vertices[of]);
                let pulled = std::array::from_fn(|a| far[a] + pull * (vertices[of][a] - far[a]));
                prop_assert_eq!(part.pull(pulled, vertices[of]), 0.0);
                prop_assert_eq!((part.holds(far), part.holds(pulled)), (pull == 0.0, true));
            }
        }
    }
}
