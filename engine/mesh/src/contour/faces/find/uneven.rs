//! Faces of cells next to leaves of other levels.
//!
//! Such a cell is bounded by minimal faces and edges, its own or those of finer leaves ([`crate::contour::transition_cells`]), and
//! what [`crate::contour::envelope`] says of cells of one size holds of it as well. It is convex, and its vertex is
//! strictly inside.
//!
//! So the triangles between that vertex and the line in which the surface passes the cell's boundary meet nowhere if
//! the line does not meet itself. On a minimal face the line goes from a point of one minimal edge to where the mesh
//! edge passes the face, and on to a point of another.
//!
//! Between cells of two sizes the mesh edge may well pass beside the face, though; then it gets a vertex on it.
//!
//! Faces of cells with several loops that are next to finer leaves have vertices in any case (`cells/cones`).

use super::*;
use crate::contour::face_vertices::edge_key;
use crate::contour::leaves::{LeafNeighbours, broken, cell_in};
use crate::contour::transition_cells::{MixedCell, MixedCut, TransitionLeaf};
use crate::lattice::Units;

/// A cut of a face that the leaf owns.
struct FaceCut {
    /// The two edges that it joins, named relative to the face's lower corner.
    edges: [u64; 2],
    /// Lower end, axis and level of the first.
    first: (Units, Axis, u8),
    /// The planes of their crossings, 0..1 along the face.
    planes: [HermitePlane; 2],
    /// Where its vertex is if it must have one, as [`MixedCut::at`].
    at: [f32; 3],
}

/// The leaves beyond the faces of a leaf, 2·axis + side, where it owns faces there.
type Others = [Option<Block>; 6];

impl FaceSearch<'_> {
    /// Gives each cut of a face a vertex that needs one, where the leaf owns the face and one of the cells at it is next to a
    /// leaf of another level.
    pub(super) fn uneven(&mut self, around: &LeafNeighbours) -> Result<()> {
        let own = self.own;
        let others = self.others(around)?;
        let is_even = |other: &Block| other.key.level() == own.key.level() && other.cells.mixed_cells() == 0;
        if own.cells.mixed_cells() == 0 && others.iter().flatten().all(is_even) {
            return Ok(());
        }
        let mut surroundings = TransitionLeaf::new(self.field, self.leaf, around);
        for n in 0..CELL_ROWS {
            let row = own.cells.rows[n];
            let mut bits = row.active;
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.uneven_cell([i, n % BRICK_CELLS, n / BRICK_CELLS], &others, &mut surroundings)?;
            }
        }
        Ok(())
    }

    fn others(&self, around: &LeafNeighbours) -> Result<Others> {
        let mut others = [const { None }; 6];
        for (face, other) in others.iter_mut().enumerate() {
            let mut step = [0; 3];
            step[face / 2] = 2 * (face % 2) as i32 - 1;
            *other = match around[direction_index(step)] {
                LeafNeighbour::Coarser(leaf) => Some(leaf),
                LeafNeighbour::Same(leaf) if face % 2 == 0 => Some(leaf),
                _ => None,
            }
            .map(|leaf| Ok(Block::new(self.field, leaf, self.field.cells(leaf)?)))
            .transpose()?;
        }
        Ok(others)
    }

    fn uneven_cell(
        &mut self,
        cell: [usize; 3],
        others: &Others,
        surroundings: &mut TransitionLeaf,
    ) -> Result<()> {
        let own = self.own;
        let is_mixed = own.cells.is_mixed(cell);
        let mut mixed: Option<MixedCell> = None;
        for (axis, side) in Axis::ALL.into_iter().flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let Some((other, beyond)) = own.beyond((axis, side), cell, others) else { continue };
            let is_uneven = is_mixed || other.key.level() < own.key.level() || other.cells.is_mixed(beyond);
            if !is_uneven {
                continue;
            }
            let mut corner = cell;
            corner[axis.index()] += side;
            let cuts = if is_mixed {
                let mixed = match &mixed {
                    Some(mixed) => mixed,
                    None => mixed.insert(surroundings.loops(cell)?),
                };
                let here = |cut: &&MixedCut| cut.face == Some(face_key(axis, corner));
                mixed.cuts.iter().filter(here).map(|cut| FaceCut::of_mixed(axis, mixed, cut)).collect()
            } else {
                self.plain_cuts(cell, axis, side)?
            };
            for cut in cuts {
                self.uneven_cut((axis, side), [(own, cell), (other, beyond)], corner, &cut)?;
            }
        }
        Ok(())
    }

    /// The cuts of a face of a plain cell of the leaf.
    fn plain_cuts(&mut self, cell: [usize; 3], axis: Axis, side: usize) -> Result<Vec<FaceCut>> {
        let Some((kind, _)) = self.own.cells.plain(cell) else { return Ok(Vec::new()) };
        let surface = self.surface()?;
        let Some(changes) = surface.changes() else { return Ok(Vec::new()) };
        let (key, lattice) = (self.own.key, &self.own.lattice);
        let mut corner = cell;
        corner[axis.index()] += side;
        let mut cuts = Vec::new();
        for (enter, leave) in kind.loops().face_cuts(axis, side) {
            let planes = self.planes(cell, [enter, leave])?.map(|plane| onto(axis, plane));
            let ends = [enter, leave].map(|edge| {
                let (along, offset) = edge_lower(edge);
                (along, std::array::from_fn(|a| cell[a] + offset[a]))
            });
            let [p, q] = ends.map(|end| self.field.minimal_edge((self.leaf, changes), lattice, end));
            let from_base = |a: usize| (ends[0].1[a] as i32) << key.spacing_bits();
            cuts.push(FaceCut {
                edges: [enter, leave].map(|edge| plain_edge_key(edge, axis, key)),
                first: (std::array::from_fn(|a| key.base()[a] + from_base(a)), ends[0].0, key.level()),
                planes,
                at: SplitFace::new(lattice, axis, corner).half_way([&p?, &q?]),
            });
        }
        Ok(cuts)
    }

    /// Gives a cut of the face between two cells a vertex if it needs one.
    fn uneven_cut(
        &mut self,
        (axis, side): (Axis, usize),
        cells: [(&Block, [usize; 3]); 2],
        corner: [usize; 3],
        cut: &FaceCut,
    ) -> Result<()> {
        let [(own, _), (other, _)] = cells;
        let face = face_key(axis, corner);
        if own.cells.extra(face, cut.edges[0]).is_some() {
            return Ok(());
        }
        let [Some(own_vertex), Some(other_vertex)] = cells.map(|(block, cell)| block.vertex(cell, cut.first))
        else {
            return Err(broken(own.key));
        };
        let [upper, lower] = if side == 0 { [0, 1] } else { [1, 0] };
        let ends = [own.cells.positions[own_vertex as usize], other.cells.positions[other_vertex as usize]];
        let parts = [(cells[0], own_vertex), (cells[1], other_vertex)]
            .map(|((block, cell), vertex)| block.part(cell, vertex));
        let (ends, parts) = ([ends[lower], ends[upper]], [parts[upper], parts[lower]]);
        let must = cells.iter().any(|(block, cell)| block.cells.has_several_loops(*cell));
        let at = if must { Some(cut.at) } else { passage(&own.lattice, (axis, corner), &parts, ends, cut) };
        let Some(at) = at else { return Ok(()) };
        self.found.push(face, cut.edges, at, ([other.leaf, other_vertex], own_vertex), own.cells.len());
        Ok(())
    }
}

impl Block {
    /// The cell beyond a face of one of this leaf's, and its leaf, if this leaf owns the face.
    fn beyond<'b>(
        &'b self,
        (axis, side): (Axis, usize),
        cell: [usize; 3],
        others: &'b Others,
    ) -> Option<(&'b Block, [usize; 3])> {
        let a = axis.index();
        let mut beyond = cell.map(|c| c as i32);
        beyond[a] += 2 * side as i32 - 1;
        if (0..BRICK_CELLS as i32).contains(&beyond[a]) {
            // Within the leaf faces belong to their upper cells.
            return (side == 0).then_some((self, beyond.map(|c| c as usize)));
        }
        let other = others[2 * a + side].as_ref()?;
        Some((other, cell_in(other.key, self.key, beyond)))
    }

    /// The vertex of a cell's loop through a minimal edge.
    fn vertex(&self, cell: [usize; 3], (lower, along, level): (Units, Axis, u8)) -> Option<u32> {
        let bits = self.key.spacing_bits();
        let relative: Units =
            std::array::from_fn(|a| lower[a] - self.key.base()[a] - ((cell[a] as i32) << bits));
        let (u, v) = along.others();
        let [u, v] = [u, v].map(|axis| (relative[axis.index()] >> bits) as usize);
        self.cells.vertex(cell, edge_index(along, u, v), edge_key(relative, along, level))
    }

    /// The part of a cell that belongs to the loop with this vertex; all of it unless it is a plain cell with several.
    fn part(&self, cell: [usize; 3], vertex: u32) -> LoopRegion {
        self.sight(cell).map_or(LoopRegion::default(), |sight| {
            LoopRegion::new(sight.kind, vertex as usize - sight.first, &sight.vertices[..sight.count])
        })
    }
}

impl FaceCut {
    fn of_mixed(axis: Axis, mixed: &MixedCell, cut: &MixedCut) -> FaceCut {
        let [enter, leave] = mixed.ends(cut);
        FaceCut {
            edges: cut.edges,
            first: (enter.lower, enter.edge.axis, enter.level),
            planes: [enter, leave].map(|crossing| onto(axis, crossing.plane)),
            at: cut.at,
        }
    }
}

/// A plane through a point of a face, whose coordinate across the face is 0.
fn onto(axis: Axis, (mut point, normal): HermitePlane) -> HermitePlane {
    point[axis.index()] = 0.0;
    (point, normal)
}

/// Where on a face the mesh edge between two vertices, the lower one first, should pass, if it does not pass well by
/// itself; `parts` are those of the upper and the lower loop.
fn passage(
    lattice: &SampleCoordinates,
    (axis, corner): (Axis, [usize; 3]),
    parts: &[LoopRegion; 2],
    ends: [[f32; 3]; 2],
    cut: &FaceCut,
) -> Option<[f32; 3]> {
    let face = SplitFace::new(lattice, axis, corner);
    let a = axis.index();
    let plane = f64::from(lattice[a][corner[a]]);
    let [from, to] = ends.map(|end| f64::from(end[a]) - plane);
    let share = from / (from - to);
    let is_between = share > 0.0 && share < 1.0;
    let [low, high] = ends.map(|end| face.seen(end));
    let passing = std::array::from_fn(|n| low[n] + share * (high[n] - low[n]));
    let rounded = if is_between { face.seen(face.rounded(passing)) } else { passing };
    if is_between && [passing, rounded].iter().all(|&at| holds(axis, parts, at)) {
        return None;
    }
    let inner = face.seen(cut.at);
    let start = meeting(axis, cut.planes).or(is_between.then_some(rounded)).unwrap_or(inner);
    let pull = pull(axis, parts, start, inner);
    let place = face.place(std::array::from_fn(|n| start[n] + pull * (inner[n] - start[n])));
    Some(if holds(axis, parts, face.seen(place)) { place } else { cut.at })
}
