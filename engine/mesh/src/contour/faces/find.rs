//! Finding the vertices on faces between plain cells of one size.

mod uneven;

use super::{FaceVertices, Faces};
use crate::contour::cells::{BrickCells, CELL_ROWS, within};
use crate::contour::face_vertices::{SplitFace, face_key, face_of, middle, plain_edge_key};
use crate::contour::field::LevelSet;
use crate::contour::frame::SampleCoordinates;
use crate::contour::leaves::{LeafNeighbour, direction_index};
use crate::contour::local_index::Direction;
use crate::contour::loops::{LOOPS, LoopRegion, SLACK};
use crate::contour::planes::HermitePlane;
use crate::contour::surface::LeafSurface;
use crate::contour::topology::{CellCase, edge_index, edge_lower};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};
use std::sync::Arc;

/// How far within a face vertices stay towards which a crease passes beyond it.
const BESIDE: f64 = 1.0 / 1024.0;

/// Those of a leaf with these cells.
pub(in crate::contour) fn find(field: &LevelSet, leaf: u32, cells: &Arc<BrickCells>) -> Result<FaceVertices> {
    // Without active cells it may have let go of those below, whose polygons do not wait for it.
    if cells.rows.is_empty() {
        return Ok(FaceVertices::default());
    }
    let around = field.leaves.around(leaf);
    let own = Block::new(field, leaf, Arc::clone(cells));
    let mut lower = [None, None, None];
    let mut faces = Faces::default();
    for axis in 0..3 {
        let mut step = [0; 3];
        step[axis] = -1;
        if let LeafNeighbour::Same(other) = around[direction_index(step)] {
            let block = Block::new(field, other, field.cells(other)?);
            let last = |cell: &&[u8; 3]| usize::from(cell[axis]) == BRICK_CELLS - 1;
            for cell in block.cells.special.iter().filter(last) {
                let mut above = cell.map(usize::from);
                above[axis] = 0;
                faces.insert(axis, above);
            }
            lower[axis] = Some(block);
        }
    }
    for cell in &cells.special {
        for axis in 0..3 {
            let cell = cell.map(usize::from);
            faces.insert(axis, cell);
            let mut above = cell;
            above[axis] += 1;
            if above[axis] < BRICK_CELLS {
                faces.insert(axis, above);
            }
        }
    }
    let mut found = FaceSearch { field, leaf, own: &own, surface: None, found: FaceVertices::default() };
    for (axis, above) in faces.iter() {
        let mut below = above;
        let block = if above[axis] > 0 { Some(&own) } else { lower[axis].as_ref() };
        below[axis] = (above[axis] + BRICK_CELLS - 1) % BRICK_CELLS;
        if let Some(block) = block {
            found.face(Axis::ALL[axis], above, (block, below))?;
        }
    }
    found.uneven(&around)?;
    let mut found = found.found;
    found.extras.sort_unstable_by_key(|extra| (extra.face, extra.edge));
    for extra in cells.extras.iter().chain(&found.extras) {
        let (axis, cell) = face_of(extra.face);
        // No cell of the leaf is above its border.
        if cell.iter().all(|&c| c < BRICK_CELLS) {
            found.split.insert(axis.index(), cell);
        }
    }
    Ok(found)
}

/// The cells of a leaf and where they lie.
struct Block {
    leaf: u32,
    key: NodeKey,
    cells: Arc<BrickCells>,
    lattice: SampleCoordinates,
}

/// A cell without finer leaves around it, its loops and where their vertices lie, 0..1 along each axis of the cell.
struct CellView {
    kind: CellCase,
    /// Number of the first one.
    first: usize,
    positions: [[f32; 3]; LOOPS],
    vertices: [[f64; 3]; LOOPS],
    count: usize,
}

impl CellView {
    /// The vertex of the loop through an edge.
    fn vertex(&self, edge: usize) -> u32 {
        self.first as u32 + u32::from(self.kind.loops().of_edge[edge])
    }
}

impl Block {
    fn new(field: &LevelSet, leaf: u32, cells: Arc<BrickCells>) -> Block {
        let key = field.leaves.get(leaf).key;
        Block { leaf, key, cells, lattice: field.frame(key).lattice() }
    }

    fn sight(&self, cell: [usize; 3]) -> Option<CellView> {
        let (kind, first) = self.cells.plain(cell)?;
        let count = usize::from(kind.loops().count).min(LOOPS);
        let (mut positions, mut vertices) = ([[0.0; 3]; LOOPS], [[0.0; 3]; LOOPS]);
        positions[..count].copy_from_slice(self.cells.positions.get(first..first + count)?);
        for (vertex, position) in vertices.iter_mut().zip(&positions[..count]) {
            *vertex = within(&self.lattice, cell, *position);
        }
        Some(CellView { kind, first, positions, vertices, count })
    }
}

struct FaceSearch<'a> {
    field: &'a LevelSet<'a>,
    leaf: u32,
    own: &'a Block,
    /// Of the leaf, once it is needed.
    surface: Option<Arc<LeafSurface>>,
    found: FaceVertices,
}

impl FaceSearch<'_> {
    /// Gives each cut of the lower face of the cell `above` a vertex if it needs one.
    fn face(&mut self, axis: Axis, above: [usize; 3], (block, below): (&Block, [usize; 3])) -> Result<()> {
        let is_crossed = |(kind, _): &(CellCase, usize)| kind.loops().face_cuts(axis, 0).next().is_some();
        if !self.own.cells.plain(above).as_ref().is_some_and(is_crossed) {
            return Ok(());
        }
        let (Some(upper), Some(lower)) = (self.own.sight(above), block.sight(below)) else { return Ok(()) };
        let face = face_key(axis, above);
        for (enter, leave) in upper.kind.loops().face_cuts(axis, 0) {
            let keys = [enter, leave].map(|edge| plain_edge_key(edge, axis, self.own.key));
            if self.own.cells.extra(face, keys[0]).is_some() {
                continue;
            }
            let annexed = || [self.own.cells.annexed(above), block.cells.annexed(below)];
            let Some(at) = self.leaving(axis, above, ([&upper, &lower], annexed), [enter, leave])? else {
                continue;
            };
            let sides = ([block.leaf, lower.vertex(on_other_side(axis, enter))], upper.vertex(enter));
            self.found.push(face, keys, at, sides, self.own.cells.len());
        }
        Ok(())
    }

    /// Where on the face the mesh edge of a cut should pass, if it does not pass well by itself: where the planes of the
    /// cut's two crossings meet on the face, or else where it does pass, pulled into both loops' parts towards the middle
    /// between the crossings. `annexed` tells what the two cells have annexed; few faces need it.
    fn leaving(
        &mut self,
        axis: Axis,
        above: [usize; 3],
        ([upper, lower], annexed): ([&CellView; 2], impl Fn() -> [Option<Direction>; 2]),
        cut: [usize; 2],
    ) -> Result<Option<[f32; 3]>> {
        let a = axis.index();
        let of_upper = usize::from(upper.kind.loops().of_edge[cut[0]]);
        let of_lower = usize::from(lower.kind.loops().of_edge[on_other_side(axis, cut[0])]);
        let (Some(from), Some(to)) =
            (lower.positions[..lower.count].get(of_lower), upper.vertices[..upper.count].get(of_upper))
        else {
            return Ok(None);
        };
        let from = within(&self.own.lattice, above, *from);
        let share = from[a] / (from[a] - to[a]);
        let mut passing: [f64; 3] = std::array::from_fn(|n| from[n] + share * (to[n] - from[n]));
        passing[a] = 0.0;
        let parts = [
            LoopRegion::new(upper.kind, of_upper, &upper.vertices[..upper.count]),
            LoopRegion::new(lower.kind, of_lower, &lower.vertices[..lower.count]),
        ];
        let face = SplitFace::new(&self.own.lattice, axis, above);
        // Where it would have a vertex it must be well, too: what passes within half a step of a border gets one.
        let rounded = face.seen(face.rounded(passing));
        let is_between = share > 0.0 && share < 1.0;
        if is_between && [passing, rounded].iter().all(|&at| holds(axis, &parts, at)) {
            return Ok(None);
        }
        let annexed = annexed();
        // The face between the annexed cells is shared, too: both vertices are within the same slabs across it.
        if is_between && annexed[0].is_some() && annexed[0] == annexed[1] {
            return Ok(None);
        }
        let planes = self.planes(above, cut)?;
        let inner = std::array::from_fn(|n| (planes[0].0[n] + planes[1].0[n]) / 2.0);
        let mut start = meeting(axis, planes).or(is_between.then_some(rounded)).unwrap_or(inner);
        if annexed.iter().any(Option::is_some) {
            start = beside(axis, planes, start);
        }
        let pull = pull(axis, &parts, start, inner);
        let pulled = std::array::from_fn(|n| start[n] + pull * (inner[n] - start[n]));
        let mut places = [pulled, inner].map(|at| face.place(at)).into_iter();
        let place = places.find(|place| holds(axis, &parts, face.seen(*place)));
        Ok(Some(place.unwrap_or_else(|| face.place(middle(cut)))))
    }

    /// The surface of the leaf.
    fn surface(&mut self) -> Result<Arc<LeafSurface>> {
        let surface = match &self.surface {
            Some(surface) => surface,
            None => self.surface.insert(self.field.surface(self.leaf)?),
        };
        Ok(Arc::clone(surface))
    }

    /// The planes of the crossings on two edges of a cell, in its coordinates; points stay away from the edges' ends.
    fn planes(&mut self, cell: [usize; 3], edges: [usize; 2]) -> Result<[HermitePlane; 2]> {
        let surface = self.surface()?;
        Ok(edges.map(|edge| {
            let (along, offset) = edge_lower(edge);
            let mut at = offset.map(|c| c as f64);
            let LeafSurface::Changes(changes) = &*surface else { return (at, [0.0; 3]) };
            let plane = changes.plane(along, std::array::from_fn(|n| cell[n] + offset[n]));
            at[along.index()] += f64::from(plane.fraction).clamp(1.0 / 64.0, 63.0 / 64.0);
            (at, plane.normal.map(f64::from))
        }))
    }
}

/// A point of a cell's lower face as one of the upper face of the cell below.
fn on_lower(axis: Axis, mut at: [f64; 3]) -> [f64; 3] {
    at[axis.index()] = 1.0;
    at
}

/// Whether a point of a cell's lower face across `axis` is on the face and in the parts of the loops above and below.
fn holds(axis: Axis, [upper, lower]: &[LoopRegion; 2], at: [f64; 3]) -> bool {
    let is_there = (0..3).all(|n| n == axis.index() || (at[n] > SLACK && at[n] < 1.0 - SLACK));
    is_there && upper.holds(at) && lower.holds(on_lower(axis, at))
}

/// How far to go, 0 to 1, from a point of the face towards `inner`, which is there, to be there.
fn pull(axis: Axis, [upper, lower]: &[LoopRegion; 2], at: [f64; 3], inner: [f64; 3]) -> f64 {
    let mut pull = upper.pull(at, inner).max(lower.pull(on_lower(axis, at), on_lower(axis, inner)));
    for n in (0..3).filter(|&n| n != axis.index() && !(at[n] > 0.0 && at[n] < 1.0)) {
        let goal = if at[n] < 0.5 { inner[n] / 8.0 } else { 1.0 - (1.0 - inner[n]) / 8.0 };
        pull = pull.max((at[n] - goal) / (at[n] - inner[n]));
    }
    pull
}

/// As near on the lower face of a cell across `axis` as can be to where a crease passes beyond it: on one of two planes, or
/// off both where neither passes the face.
fn beside(axis: Axis, planes: [HermitePlane; 2], at: [f64; 3]) -> [f64; 3] {
    let (u, v) = axis.others();
    let (u, v) = (u.index(), v.index());
    let mut nearest = at.map(|c| c.clamp(BESIDE, 1.0 - BESIDE));
    nearest[axis.index()] = 0.0;
    if nearest == at {
        return at;
    }
    let mut least = f64::INFINITY;
    for (p, n) in planes {
        // From p along the plane.
        let along = [-n[v], n[u]];
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for (a, along) in [u, v].into_iter().zip(along) {
            let (s, t) = ((BESIDE - p[a]) / along, (1.0 - BESIDE - p[a]) / along);
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
        if enter <= leave {
            let square = along[0] * along[0] + along[1] * along[1];
            let to = ((at[u] - p[u]) * along[0] + (at[v] - p[v]) * along[1]) / square;
            let to = to.clamp(enter, leave);
            let place = [p[u] + to * along[0], p[v] + to * along[1]];
            let distance = (place[0] - at[u]).powi(2) + (place[1] - at[v]).powi(2);
            if distance < least {
                least = distance;
                (nearest[u], nearest[v]) = (place[0], place[1]);
            }
        }
    }
    nearest
}

/// Where two planes meet on the lower face of a cell across `axis`, if they do at an angle of more than 6°.
fn meeting(axis: Axis, [(p, m), (q, n)]: [HermitePlane; 2]) -> Option<[f64; 3]> {
    let (u, v) = axis.others();
    let (u, v) = (u.index(), v.index());
    let determinant = m[u] * n[v] - m[v] * n[u];
    let squares = (m[u] * m[u] + m[v] * m[v]) * (n[u] * n[u] + n[v] * n[v]);
    if determinant * determinant <= 0.01 * squares {
        return None;
    }
    let (d, e) = (m[u] * p[u] + m[v] * p[v], n[u] * q[u] + n[v] * q[v]);
    let mut at = [0.0; 3];
    at[u] = (d * n[v] - e * m[v]) / determinant;
    at[v] = (m[u] * e - n[u] * d) / determinant;
    (at[u] > 0.0 && at[u] < 1.0 && at[v] > 0.0 && at[v] < 1.0).then_some(at)
}

/// The edge of the lower face of a cell as one of the upper face of the cell below.
fn on_other_side(axis: Axis, edge: usize) -> usize {
    let (along, mut low) = edge_lower(edge);
    low[axis.index()] = 1;
    let (u, v) = along.others();
    edge_index(along, low[u.index()], low[v.index()])
}
