//! The sign-changing edges of a leaf with the vertices of the cells around each: what merging starts from.

use super::super::cells::BrickCells;
use super::super::edges::{NO_VERTEX, Quad};
use super::super::leaves::{LeafNeighbour, Leaves, direction_index, directions};
use super::super::qef::Vector;
use super::super::surface::HermiteSurface;
use super::super::topology::{SQUARE, cell_around, edge_index};
use super::vertex_merge::LEVELS;
use crate::lattice::{Axis, BRICK_CELLS};

/// Stands for a cell beyond the leaf.
pub(super) const BEYOND: u32 = u32::MAX;
/// Stands for a cell whose vertices stay as they are.
pub(super) const FROZEN: u32 = u32::MAX - 1;

/// A sign-changing edge.
pub(super) struct SignChangeEdge {
    pub axis: Axis,
    /// Its lower sample.
    pub low: [u8; 3],
    /// Levels of the planes across the other two axes that the edge lies in; see [`plane_level`].
    pub levels: [u8; 2],
    /// Vertices of the four cells around it in the order of [`SQUARE`], [`BEYOND`] or [`FROZEN`].
    pub vertices: [u32; 4],
    /// Where the surface crosses it, in cells of the leaf.
    pub point: Vector,
    /// Unit length.
    pub normal: Vector,
}

/// A face that is cut twice, seen from one of its cells.
pub(super) struct Ambiguous {
    /// The cell's vertices at the two cuts.
    pub vertices: [u32; 2],
    /// Level of its plane.
    pub level: u8,
}

/// The edges of a leaf and the vertices at them.
pub(super) struct LeafEdges {
    pub all: Vec<SignChangeEdge>,
    pub ambiguous: Vec<Ambiguous>,
    /// By level, those in a plane of it, and those in none of it or of a lower level.
    within: [Vec<u32>; LEVELS as usize + 2],
    beyond: [Vec<u32>; LEVELS as usize + 2],
    /// For each vertex, frozen ones and those on split faces too, where its edges begin in `edges`, and the end.
    starts: Vec<u32>,
    edges: Vec<u32>,
}

/// The least level of a node that has a plane in its inside: nodes of level `n` are 2ⁿ cells wide, and the plane
/// has `plane` cells of the leaf below it. Above [`LEVELS`] for the leaf's own faces.
pub(super) fn plane_level(plane: usize) -> u8 {
    if plane.is_multiple_of(BRICK_CELLS) { LEVELS + 1 } else { plane.trailing_zeros() as u8 + 1 }
}

/// Which cells of a leaf keep their vertices: those with edges of finer leaves on their boundary, and those next to
/// coarser leaves, whose cells count on them.
pub(super) struct FrozenCells {
    coarser: Vec<[i32; 3]>,
}

impl FrozenCells {
    pub(super) fn of(leaves: &Leaves, leaf: u32) -> FrozenCells {
        let around = leaves.around(leaf);
        let is_coarser = |d: &[i32; 3]| matches!(around[direction_index(*d)], LeafNeighbour::Coarser(_));
        FrozenCells { coarser: directions().filter(is_coarser).collect() }
    }

    /// Whether there may be any.
    fn is_any(&self, cells: &BrickCells) -> bool {
        !self.coarser.is_empty() || cells.mixed_cells() > 0
    }

    pub(super) fn holds(&self, cells: &BrickCells, cell: [usize; 3]) -> bool {
        let touches = |d: &[i32; 3]| {
            (0..3).all(|a| match d[a] {
                -1 => cell[a] == 0,
                0 => true,
                _ => cell[a] == BRICK_CELLS - 1,
            })
        };
        cells.row(cell[1], cell[2]).mixed >> cell[0] & 1 == 1 || self.coarser.iter().any(touches)
    }
}

impl LeafEdges {
    pub(super) fn of(leaves: &Leaves, leaf: u32, changes: &HermiteSurface, cells: &BrickCells) -> LeafEdges {
        let frozen = FrozenCells::of(leaves, leaf);
        let is_any_frozen = frozen.is_any(cells);
        let quads = cells.quads();
        let mut all = Vec::with_capacity(changes.planes.len());
        let (mut within, mut beyond) = (<[Vec<u32>; _]>::default(), <[Vec<u32>; _]>::default());
        for axis in Axis::ALL {
            let (u, v) = axis.others();
            changes.signs.for_edges(axis, |low| {
                let number = all.len();
                let plane = &changes.planes[number];
                let mut point = low.map(|c| c as f64);
                point[axis.index()] += f64::from(plane.fraction);
                let mut vertices = [BEYOND; 4];
                // None if the leaf's polygons have been made before.
                let quad = quads.get(number).unwrap_or(&Quad::UNKNOWN).vertices;
                for (n, quadrant) in SQUARE.into_iter().enumerate() {
                    let cell = cell_around(axis, low.map(|c| c as i32), quadrant).map(|c| c as usize);
                    if cell.iter().any(|&c| c >= BRICK_CELLS) {
                        continue;
                    }
                    vertices[n] = if is_any_frozen && frozen.holds(cells, cell) {
                        FROZEN
                    } else if quad[n] != NO_VERTEX {
                        u32::from(quad[n])
                    } else {
                        let [qu, qv] = quadrant;
                        cells.plain_vertex(cell, edge_index(axis, 1 - qu, 1 - qv)).unwrap_or(FROZEN)
                    };
                }
                let levels = [u, v].map(|a| plane_level(low[a.index()]));
                let [a, b] = levels.map(usize::from);
                within[a].push(number as u32);
                if a != b {
                    within[b].push(number as u32);
                }
                beyond[1..a.min(b)].iter_mut().for_each(|beyond| beyond.push(number as u32));
                all.push(SignChangeEdge {
                    axis,
                    low: low.map(|c| c as u8),
                    levels,
                    vertices,
                    point,
                    normal: plane.normal.map(f64::from),
                });
            });
        }
        drop(quads);
        let (starts, edges) = by_vertex(&all, cells.len());
        let ambiguous = ambiguous(cells, &frozen);
        LeafEdges { all, ambiguous, within, beyond, starts, edges }
    }

    /// Those in a plane of `level`, in order; of the level above [`LEVELS`] those on the leaf's faces.
    pub(super) fn within(&self, level: u8) -> impl Iterator<Item = &SignChangeEdge> {
        self.within[usize::from(level)].iter().map(|&edge| &self.all[edge as usize])
    }

    /// Those whose planes are of higher levels than `level`, in order.
    pub(super) fn beyond(&self, level: u8) -> impl Iterator<Item = &SignChangeEdge> {
        self.beyond[usize::from(level)].iter().map(|&edge| &self.all[edge as usize])
    }

    /// The edges of a vertex' cell that its loop passes through.
    pub(super) fn at(&self, vertex: u32) -> impl Iterator<Item = &SignChangeEdge> {
        let range = self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
        self.edges[range].iter().map(|&edge| &self.all[edge as usize])
    }

    /// The cell of a vertex that is not frozen.
    pub(super) fn cell_of(&self, vertex: u32) -> [usize; 3] {
        let Some(crossing) = self.at(vertex).next() else { return [0; 3] };
        let n = crossing.vertices.iter().position(|&v| v == vertex).unwrap_or(0);
        cell_around(crossing.axis, crossing.low.map(i32::from), SQUARE[n]).map(|c| c as usize)
    }
}

fn by_vertex(all: &[SignChangeEdge], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let named = || {
        all.iter().enumerate().flat_map(|(n, crossing)| {
            crossing.vertices.into_iter().filter(|&v| v < FROZEN).map(move |v| (n as u32, v as usize))
        })
    };
    let mut starts = vec![0u32; vertices + 2];
    named().for_each(|(_, vertex)| starts[vertex + 2] += 1);
    for n in 2..starts.len() {
        starts[n] += starts[n - 1];
    }
    let mut edges = vec![0; starts[vertices + 1] as usize];
    for (edge, vertex) in named() {
        edges[starts[vertex + 1] as usize] = edge;
        starts[vertex + 1] += 1;
    }
    starts.pop();
    (starts, edges)
}

fn ambiguous(cells: &BrickCells, frozen: &FrozenCells) -> Vec<Ambiguous> {
    let mut found = Vec::new();
    for (j, k) in (0..BRICK_CELLS).flat_map(|k| (0..BRICK_CELLS).map(move |j| (j, k))) {
        let row = cells.row(j, k);
        let mut bits = row.active & !row.mixed;
        while bits != 0 {
            let cell = [bits.trailing_zeros() as usize, j, k];
            bits &= bits - 1;
            let slot = row.slot(cell[0]);
            let loops = cells.kinds[slot].loops();
            if loops.ambiguous == 0 || frozen.holds(cells, cell) {
                continue;
            }
            let first = cells.first[slot];
            for face in (0..6).filter(|face| loops.ambiguous >> face & 1 == 1) {
                let (axis, side) = (Axis::ALL[face / 2], face % 2);
                let of_edge = |edge: usize| first + u32::from(loops.of_edge[edge]);
                let mut cuts = loops.face_cuts(axis, side).map(|(enter, _)| of_edge(enter));
                if let (Some(a), Some(b)) = (cuts.next(), cuts.next()) {
                    found.push(Ambiguous { vertices: [a, b], level: plane_level(cell[axis.index()] + side) });
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::BRICK_POINTS;

    #[test]
    fn planes_belong_to_the_smallest_node_around_them() {
        assert_eq!([1, 2, 3, 4, 12, 16, 31].map(plane_level), [1, 2, 1, 3, 3, 5, 1]);
        assert!([0, BRICK_POINTS - 1].map(plane_level).iter().all(|&level| level > LEVELS));
    }
}
