//! Pass 2: one polygon per sign-changing minimal edge, cut into triangles.
//!
//! *Ownership.* A minimal edge is a full lattice edge of the finest leaves around it. Its polygon belongs to
//! the one of these that lies above it, in the order of [`quadrant_rank`]; so a leaf needs its own cells and
//! those of neighbours of the same or a lower level, never a finer one's.
//!
//! *Triangles.* No mesh edge may be used by a second polygon unless it stands for a cut that both flank:
//! - the diagonal of a quadrilateral ends in a finest cell, because two coarser cells can face each other
//!   across several minimal edges of one line, while a finest cell has only this one;
//! - a polygon with an extra vertex on a face of a finest cell is a fan about that vertex: of the other
//!   polygon at that cut only the two cells at the face are the same;
//! - other polygons with extra vertices are fans about a finest cell's vertex.

use super::cells::{BrickCells, CellRow, edge_key, face_key};
use super::field::Field;
use super::leaves::{Around, Side, broken, direction_index};
use super::topology::{CELL_LOOPS, CellLoops, SQUARE, edge_index};
use crate::brick::SignChanges;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, Units};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One triangle of the mesh, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Numbers of the corners in the order in which vertices were handed to the sink; without meaning for a
    /// sink that shares none.
    pub ids: [u32; 3],
    /// World positions of the corners.
    pub corners: [[f32; 3]; 3],
}

/// The triangles that one leaf owns.
#[derive(Default)]
pub(super) struct LeafFacets {
    pub facets: Vec<Facet>,
    /// In square world units.
    pub area: f64,
    /// Signed volume under the triangles, seen from the root's centre, in cubic world units.
    pub volume: f64,
}

/// Room for facets that has been used before: fresh pages from the kernel cost a tenth of the time of contouring.
#[derive(Default)]
pub(super) struct Spare(Mutex<Vec<Vec<Facet>>>);

impl Spare {
    /// Empty room for at least so many.
    fn take(&self, facets: usize) -> Vec<Facet> {
        let mut room = self.lock().pop().unwrap_or_default();
        room.reserve(facets);
        room
    }

    /// Keeps what is used no more.
    pub(super) fn keep(&self, mut facets: Vec<Facet>) {
        facets.clear();
        if facets.capacity() > 0 {
            self.lock().push(facets);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Vec<Facet>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The triangles of `leaf`; `first_vertex` holds the number of each leaf's first vertex, if numbers are wanted.
pub(super) fn leaf_facets(
    field: &Field,
    leaf: u32,
    first_vertex: Option<&[u32]>,
    spare: &Spare,
) -> Result<LeafFacets> {
    let cells = field.cells(leaf)?;
    let Some(signs) = &cells.signs else { return Ok(LeafFacets::default()) };
    let key = field.leaves.get(leaf).key;
    let around = field.leaves.around(leaf);
    let facets = spare.take(2 * cells.len() + cells.len() / 8);
    let mut maker = Maker {
        field,
        leaf,
        key,
        around,
        first_vertex,
        table: &CELL_LOOPS,
        neighbours: Default::default(),
        facets,
    };
    for axis in Axis::ALL {
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                maker.row(axis, j, k, &cells, signs)?;
            }
        }
    }
    let centre = field.root.origin.map(|o| o + 0.5 * field.root.edge);
    Ok(measure(maker.facets, centre))
}

/// Sums area and volume in the order of the facets.
fn measure(facets: Vec<Facet>, centre: [f64; 3]) -> LeafFacets {
    let (mut area, mut volume) = (0.0, 0.0);
    for facet in &facets {
        let [a, b, c] =
            facet.corners.map(|p| -> [f64; 3] { std::array::from_fn(|n| f64::from(p[n]) - centre[n]) });
        let (u, v): ([f64; 3], [f64; 3]) =
            (std::array::from_fn(|n| b[n] - a[n]), std::array::from_fn(|n| c[n] - a[n]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        area += 0.5 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        volume += (n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) / 6.0;
    }
    LeafFacets { facets, area, volume }
}

/// Which of two equally fine leaves around an edge owns its polygon: the one of higher rank.
#[inline]
fn quadrant_rank([u, v]: [usize; 2]) -> usize {
    u + 2 * v
}

/// A corner of a polygon.
#[derive(Clone, Copy, Default)]
struct Corner {
    id: u32,
    position: [f32; 3],
    /// The vertex of one of the smallest cells around, or an extra vertex on such a cell's face.
    is_finest: bool,
    is_extra: bool,
}

/// A polygon: four cells and an extra vertex between each two at most.
#[derive(Default)]
struct Polygon {
    corners: [Corner; 8],
    count: usize,
}

impl Polygon {
    fn push(&mut self, corner: Corner) {
        self.corners[self.count] = corner;
        self.count += 1;
    }
}

/// One of the four cells around an edge.
struct Quadrant<'a> {
    leaf: u32,
    key: NodeKey,
    cell: [usize; 3],
    cells: &'a BrickCells,
}

/// Makes the facets of one leaf.
struct Maker<'a> {
    field: &'a Field<'a>,
    leaf: u32,
    key: NodeKey,
    around: Around,
    first_vertex: Option<&'a [u32]>,
    /// The loops of plain cells by corner mask.
    table: &'static [CellLoops; 256],
    /// Cells of the leaf itself and of its neighbours by direction, fetched when needed.
    neighbours: [Option<Arc<BrickCells>>; 27],
    facets: Vec<Facet>,
}

impl Maker<'_> {
    #[inline]
    fn first_vertex(&self, leaf: u32) -> u32 {
        self.first_vertex.map_or(0, |first| first[leaf as usize])
    }

    /// All edges along `axis` whose lower samples lie in the row (j, k) and that this leaf owns.
    fn row(&mut self, axis: Axis, j: usize, k: usize, cells: &BrickCells, signs: &SignChanges) -> Result<()> {
        let mut bits = signs.edges(axis, j, k);
        if bits == 0 {
            return Ok(());
        }
        let on_border = |c: usize| c == 0 || c == BRICK_CELLS;
        let row_on_border = (axis != Axis::Y && on_border(j)) || (axis != Axis::Z && on_border(k));
        let rows = if row_on_border { None } else { Some(rows_around(cells, axis, j, k)) };
        while bits != 0 {
            let i = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let low = [i, j, k];
            let inside = signs.row(j, k) >> i & 1 == 1;
            match &rows {
                Some(rows)
                    if (axis == Axis::X || !on_border(i)) && self.plain(axis, i, rows, cells, inside) => {}
                _ => self.general(axis, low, inside)?,
            }
        }
        Ok(())
    }

    /// The polygon of an edge among four plain cells of this leaf, none of which has a split face; false if
    /// they are not of that kind.
    #[inline]
    fn plain(&mut self, axis: Axis, i: usize, rows: &[CellRow; 4], cells: &BrickCells, inside: bool) -> bool {
        let (u, v) = axis.others();
        let mut polygon = [0u32; 4];
        let mut ambiguous = 0;
        for (n, [qu, qv]) in SQUARE.into_iter().enumerate() {
            let at = i - usize::from((u == Axis::X && qu == 0) || (v == Axis::X && qv == 0));
            let edge = edge_index(axis, 1 - qu, 1 - qv);
            let Some((vertex, loops)) = cells.plain_vertex(self.table, rows[n], at, edge) else {
                return false;
            };
            ambiguous |= loops.ambiguous;
            polygon[n] = vertex;
        }
        if ambiguous != 0 {
            return false;
        }
        let first = self.first_vertex(self.leaf);
        let corners = polygon.map(|vertex| (first + vertex, cells.positions[vertex as usize]));
        let [a, b, c, d] = corners;
        let is_first = shorter(&corners.map(|corner| corner.1), true, true);
        // From here on the quadrilateral is cut from its first corner to its third.
        let [a, b, c, d] = if is_first { [a, b, c, d] } else { [b, c, d, a] };
        let (b, d) = if inside { (b, d) } else { (d, b) };
        self.facets.push(Facet { ids: [a.0, b.0, c.0], corners: [a.1, b.1, c.1] });
        self.facets.push(Facet { ids: [a.0, c.0, d.0], corners: [a.1, c.1, d.1] });
        true
    }

    /// The polygon of any edge, if this leaf owns it.
    fn general(&mut self, axis: Axis, low: [usize; 3], inside: bool) -> Result<()> {
        if !self.owns(axis, low) {
            return Ok(());
        }
        let polygon = self.polygon(axis, low)?;
        let corners = &polygon.corners[..polygon.count];
        triangulate(corners, |a, b, c| {
            let (b, c) = if inside { (b, c) } else { (c, b) };
            let [a, b, c] = [a, b, c].map(|n: usize| corners[n]);
            let corners = [a.position, b.position, c.position];
            self.facets.push(Facet { ids: [a.id, b.id, c.id], corners });
        });
        Ok(())
    }

    /// The cell in one quadrant around an edge, in this leaf's own coordinates, -1..=32.
    fn quadrant_cell(axis: Axis, low: [usize; 3], [qu, qv]: [usize; 2]) -> [i32; 3] {
        let (u, v) = axis.others();
        let mut cell = low.map(|c| c as i32);
        cell[u.index()] += qu as i32 - 1;
        cell[v.index()] += qv as i32 - 1;
        cell
    }

    fn owns(&self, axis: Axis, low: [usize; 3]) -> bool {
        let mut best = (0, false);
        for quadrant in SQUARE {
            let cell = Self::quadrant_cell(axis, low, quadrant);
            let d = direction(cell);
            match self.around[direction_index(d)] {
                Side::Finer => return false,
                Side::Same(_) => best = best.max((quadrant_rank(quadrant) + 1, d == [0; 3])),
                Side::Coarser(_) | Side::Outside => {}
            }
        }
        best.1
    }

    /// The leaf in whose cells `cell` lies and its place among the directions.
    fn neighbour(&self, cell: [i32; 3]) -> Result<(u32, usize)> {
        let n = direction_index(direction(cell));
        let (Side::Same(leaf) | Side::Coarser(leaf)) = self.around[n] else { return Err(broken(self.key)) };
        Ok((leaf, n))
    }

    /// The cell of the tree that holds `cell`; its neighbour's cells must have been fetched.
    fn quadrant(&self, cell: [i32; 3]) -> Result<Quadrant<'_>> {
        let (leaf, n) = self.neighbour(cell)?;
        let cells = self.neighbours[n].as_deref().ok_or_else(|| broken(self.key))?;
        let key = self.field.leaves.get(leaf).key;
        let shift = self.key.level() - key.level();
        let (own_first, first) = (self.key.first_sample(), key.first_sample());
        let cell =
            std::array::from_fn(|a| (((own_first[a] as i32 + cell[a]) >> shift) - first[a] as i32) as usize);
        Ok(Quadrant { leaf, key, cell, cells })
    }

    /// The corners of an edge's polygon, counter-clockwise seen from the edge's upper end.
    fn polygon(&mut self, axis: Axis, low: [usize; 3]) -> Result<Polygon> {
        let bits = self.key.spacing_bits();
        let lower: Units = std::array::from_fn(|a| self.key.base()[a] + ((low[a] as i32) << bits));
        let places = SQUARE.map(|quadrant| Self::quadrant_cell(axis, low, quadrant));
        for place in places {
            let (leaf, n) = self.neighbour(place)?;
            if self.neighbours[n].is_none() {
                self.neighbours[n] = Some(self.field.cells(leaf)?);
            }
        }
        let [a, b, c, d] = places.map(|place| self.quadrant(place));
        let quadrants = [a?, b?, c?, d?];
        let is_same = |a: &Quadrant, b: &Quadrant| a.leaf == b.leaf && a.cell == b.cell;
        let mut polygon = Polygon::default();
        for n in 0..4 {
            let [before, this, after] = [&quadrants[(n + 3) % 4], &quadrants[n], &quadrants[(n + 1) % 4]];
            if !is_same(before, this) {
                let [qu, qv] = SQUARE[n];
                let key = edge_key(relative(lower, this.key, this.cell), axis, self.key.level());
                let vertex = this.cells.vertex(this.cell, edge_index(axis, 1 - qu, 1 - qv), key);
                let vertex = vertex.ok_or_else(|| broken(this.key))?;
                polygon.push(self.corner(this, vertex, false, this.key.level() == self.key.level()));
            }
            if !is_same(this, after)
                && let Some((owner, vertex)) = self.extra(axis, n, this, after, lower)
            {
                polygon.push(self.corner(owner, vertex, true, owner.key.level() == self.key.level()));
            }
        }
        Ok(polygon)
    }

    fn corner(&self, quadrant: &Quadrant<'_>, vertex: u32, is_extra: bool, is_finest: bool) -> Corner {
        let id = self.first_vertex(quadrant.leaf) + vertex;
        Corner { id, position: quadrant.cells.positions[vertex as usize], is_finest, is_extra }
    }

    /// The extra vertex on the face between quadrant `n` and the next, with the leaf that owns the face.
    fn extra<'q, 'a>(
        &self,
        axis: Axis,
        n: usize,
        this: &'q Quadrant<'a>,
        after: &'q Quadrant<'a>,
        lower: Units,
    ) -> Option<(&'q Quadrant<'a>, u32)> {
        let (u, v) = axis.others();
        // Quadrants 0, 1 and 2, 3 differ along u, the others along v; 0 → 1 and 1 → 2 go up.
        let across = if n.is_multiple_of(2) { u } else { v };
        let (below, above) = if n < 2 { (this, after) } else { (after, this) };
        let owner = if below.key.level() > above.key.level() { below } else { above };
        let mut corner = owner.cell;
        corner[across.index()] += usize::from(std::ptr::eq(owner, below));
        let key = edge_key(relative(lower, owner.key, corner), axis, self.key.level());
        owner.cells.extra(face_key(across, corner), key).map(|vertex| (owner, vertex))
    }
}

/// The cell rows of the four cells around the edges of a row, all within the leaf.
fn rows_around(cells: &BrickCells, axis: Axis, j: usize, k: usize) -> [CellRow; 4] {
    let (u, v) = axis.others();
    SQUARE.map(|[qu, qv]| {
        let below = |a: Axis| usize::from((u == a && qu == 0) || (v == a && qv == 0));
        cells.row(j - below(Axis::Y), k - below(Axis::Z))
    })
}

/// In which direction a cell with coordinates -1..=32 lies from the leaf.
#[inline]
fn direction(cell: [i32; 3]) -> [i32; 3] {
    cell.map(|c| i32::from(c >= BRICK_CELLS as i32) - i32::from(c < 0))
}

/// A position minus the lattice point (i, j, k) of a leaf.
#[inline]
fn relative(at: Units, key: NodeKey, point: [usize; 3]) -> Units {
    std::array::from_fn(|a| at[a] - key.base()[a] - ((point[a] as i32) << key.spacing_bits()))
}

/// True if a quadrilateral is to be cut from corner 0 to corner 2: along the shorter of the diagonals that
/// are allowed, along this one if they are equal.
#[inline]
fn shorter(p: &[[f32; 3]; 4], is_first_allowed: bool, is_second_allowed: bool) -> bool {
    let squared =
        |a: [f32; 3], b: [f32; 3]| (0..3).map(|n| (f64::from(a[n]) - f64::from(b[n])).powi(2)).sum::<f64>();
    is_first_allowed && (!is_second_allowed || squared(p[0], p[2]) <= squared(p[1], p[3]))
}

/// Cuts a polygon into triangles by the rules at the top of this file.
fn triangulate(corners: &[Corner], mut triangle: impl FnMut(usize, usize, usize)) {
    let count = corners.len();
    let extra = corners.iter().position(|c| c.is_extra && c.is_finest);
    let is_plain_quad = count == 4 && corners.iter().all(|c| !c.is_extra);
    let apex = match extra {
        Some(extra) => extra,
        None if is_plain_quad => {
            let finest = |n: usize| corners[n].is_finest || corners[n + 2].is_finest;
            let positions = std::array::from_fn(|n| corners[n].position);
            usize::from(!shorter(&positions, finest(0), finest(1)))
        }
        None => corners.iter().position(|c| c.is_finest).unwrap_or(0),
    };
    for n in 1..count.saturating_sub(1) {
        triangle(apex, (apex + n) % count, (apex + n + 1) % count);
    }
}
