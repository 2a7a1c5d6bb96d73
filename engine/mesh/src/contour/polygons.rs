//! One polygon per sign-changing minimal edge, cut into triangles.
//!
//! *Ownership.* A minimal edge is a full lattice edge of the finest leaves around it. Its polygon belongs to
//! the one of these that lies above it, in the order of [`quadrant_rank`]; so a leaf needs its own cells and
//! those of neighbours of the same or a lower level, never a finer one's.
//!
//! *Triangles.* A polygon stays within the envelope of its edge ([`super::envelope`]). Quadrilaterals are cut along a
//! diagonal that does; of two, along the one that meets the edge nearer to where the surface does. Triangles stay what
//! they are if they do. All others, as those with extra vertices, become fans about a vertex on the edge.
//!
//! No mesh edge may be used by a second polygon unless it stands for a cut that both flank. So the diagonal of a
//! quadrilateral ends in a finest cell: two coarser cells can face each other across several minimal edges of one
//! line, while a finest cell has only this one.
//!
//! Polygons with a merged vertex have no vertices on edges; there
//! - a polygon with an extra vertex on a face of a finest cell is a fan about that vertex: of the other
//!   polygon at that cut only the two cells at the face are the same;
//! - other polygons with extra vertices are fans about a finest cell's vertex.

mod around;
mod merged;

use super::adaptive::{EdgeFilter, OWN, SharedVertex};
use super::buffer_pool::BufferPool;
use super::cells::BrickCells;
use super::cut::{BOTH, Cutter, FacetBytes, FacetMeasures, QuadSplit, Vertex, tag};
use super::edges::{NO_VERTEX, Quad};
use super::envelope::MinimalEdge;
use super::field::LevelSet;
use super::leaves::{LeafNeighbour, LeafNeighbours, direction_index};
use super::sink::MeshEncoding;
use super::topology::{SQUARE, cell_around, edge_index};
use super::triangle_names::{TriangleNames, first_bytes};
use super::vertices::LeafVertices;
use crate::brick::SignChanges;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use crate::wide::{dispatch, level};
use std::sync::Arc;

/// The triangles that one leaf owns.
#[derive(Default)]
pub(super) struct LeafFacets {
    pub count: usize,
    /// What is wanted of them.
    pub bytes: Vec<u8>,
    /// How they name vertices.
    pub names: TriangleNames,
    pub measured: FacetMeasures,
    /// The vertices on edges, whose numbers follow those of the leaf's others.
    pub edge_vertices: Vec<[f32; 3]>,
    /// The edges that these are on, where normals are wanted.
    pub fan_edges: Vec<MinimalEdge>,
    /// Normals of all vertices of the leaf, where they are wanted.
    pub normals: Vec<[f32; 3]>,
}

/// How the facets of a mesh are made, beside the field.
pub(super) struct FacetOptions {
    /// What is wanted of them.
    pub wanted: FacetBytes,
    /// Room for the bytes of leaves.
    pub spare: BufferPool<u8>,
    /// Whether vertices are to have normals.
    pub normals: bool,
}

impl FacetOptions {
    /// For a sink with this encoding.
    pub(super) fn new(encoding: Option<MeshEncoding>, normals: bool) -> FacetOptions {
        FacetOptions { wanted: first_bytes(encoding), spare: BufferPool::default(), normals }
    }
}

/// The triangles of `leaf` with these vertices, which is done with then, as are the cells that no other leaf needs. Not
/// inlined, so that a profile tells them from the vertices.
#[inline(never)]
pub(super) fn leaf_facets(
    field: &LevelSet,
    leaf: u32,
    vertices: &LeafVertices,
    making: &FacetOptions,
) -> Result<LeafFacets> {
    if vertices.cells.signs.is_none() {
        field.release(leaf);
        return Ok(LeafFacets::default());
    }
    let centre = field.root.origin.map(|o| o + 0.5 * field.root.edge);
    let mut cutter = Cutter::new(centre, TriangleNames::ON_EDGES, making.wanted, making.spare.take());
    cutter.fan_edges = making.normals.then(Vec::new);
    let quads = vertices.cells.take_quads();
    let (cutter, names) = FacetMaker::new(field, leaf, vertices.clone(), cutter).make(&quads)?;
    field.spare_quads.keep(quads);
    field.release(leaf);
    let Cutter { count, bytes, measured, edge_vertices, fan_edges, .. } = cutter;
    let fan_edges = fan_edges.unwrap_or_default();
    Ok(LeafFacets { count, bytes, names, measured, edge_vertices, fan_edges, normals: Vec::new() })
}

/// The triangles of a leaf as they would be with what is merged so far, as far as they are wanted, for
/// [`super::triangle_names::each_whole`], and how they name vertices; the names of the corners of polygons with a merged vertex bear a
/// [`MergeMark`].
pub(super) fn named_facets(
    field: &LevelSet,
    leaf: u32,
    wanted: &EdgeFilter,
) -> Result<(Vec<u8>, TriangleNames)> {
    let vertices = field.vertices(leaf)?;
    let BrickCells { signs: Some(signs), ranks: Some(ranks), .. } = &*vertices.cells else {
        return Ok(Default::default());
    };
    let edges = wanted.edges(signs, ranks);
    if edges.is_empty() {
        return Ok(Default::default());
    }
    let quads = vertices.cells.quads();
    let cutter = Cutter::new([0.0; 3], TriangleNames::ON_EDGES, first_bytes(None), Vec::new());
    let mut maker = FacetMaker::new(field, leaf, vertices.clone(), cutter);
    (maker.mark, maker.only_wide) = (MergeMark::FIRST, wanted.only_wide);
    maker.merged_edges(signs, &quads, &edges)?;
    Ok((maker.cutter.finish().bytes, maker.names))
}

/// What tells polygons with a merged vertex from others and from each other: their triangles follow each other but for those
/// of others, and two such polygons that follow each other have different marks.
pub(super) struct MergeMark;

impl MergeMark {
    const FIRST: u32 = 1 << 31;
    const TURN: u32 = 1 << 30;
    /// Places of names that marks leave room for.
    pub(super) const MOST_PLACES: usize = 1 << 14;

    /// A name without its mark, and the mark, zero without one.
    pub(super) fn split(name: u32) -> (u32, u32) {
        let mark = name & (MergeMark::FIRST | MergeMark::TURN);
        (name ^ mark, mark)
    }
}

/// Which of two equally fine leaves around an edge owns its polygon: the one of higher rank.
#[inline]
fn quadrant_rank([u, v]: [usize; 2]) -> usize {
    u + 2 * v
}

/// A corner of a polygon.
#[derive(Clone, Copy, Default)]
struct Corner {
    vertex: SharedVertex,
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

/// An edge of the leaf: its axis, its lower sample, and where it is crossed as in [`Quad`].
type Edge = (Axis, [usize; 3], u16);

/// What is common to all edges along an axis on one face or edge of the leaf's border.
#[derive(Clone, Copy)]
enum Border {
    Unknown,
    /// Their polygons belong to another leaf.
    Foreign,
    /// Around them are leaves of this one's level, whose cells are fetched.
    Equal([Quarter; 4]),
    /// Leaves of several levels meet.
    Uneven,
}

/// Where the cell in one quadrant around such edges is found.
#[derive(Clone, Copy, Default)]
struct Quarter {
    /// The leaf, as a direction.
    direction: usize,
    /// What leads from the edge's lower sample to the cell, along each axis modulo the cells of a leaf.
    step: [usize; 3],
    /// Which of the cell's edges it is.
    edge: usize,
    leaf: u32,
}

/// Makes the facets of one leaf.
struct FacetMaker<'a> {
    field: &'a LevelSet<'a>,
    key: NodeKey,
    around: LeafNeighbours,
    names: TriangleNames,
    /// Set in the names of the corners of polygons with a merged vertex; zero unless they are asked for.
    mark: u32,
    /// No other polygons are made than those with a vertex of several leaves.
    only_wide: bool,
    /// Cells and vertices of the leaf itself and of its neighbours by direction, fetched when needed.
    neighbours: [Option<LeafVertices>; 27],
    /// By axis and where the edges along it lie: 0, 1 or 2 for the lower border, the inside, the upper border along
    /// each of the other two.
    borders: [Border; 27],
    /// World coordinates of the leaf's samples by axis.
    lattice: [[f32; BRICK_POINTS]; 3],
    cutter: Cutter,
}

impl<'a> FacetMaker<'a> {
    fn new(field: &'a LevelSet<'a>, leaf: u32, vertices: LeafVertices, cutter: Cutter) -> FacetMaker<'a> {
        let names = TriangleNames::new(leaf, vertices.positions().len() + vertices.on_faces().len());
        let key = field.leaves.get(leaf).key;
        let mut neighbours = [const { None }; 27];
        neighbours[OWN] = Some(vertices);
        FacetMaker {
            field,
            key,
            around: field.leaves.around(leaf),
            names,
            mark: 0,
            only_wide: false,
            neighbours,
            borders: [Border::Unknown; 27],
            lattice: field.frame(key).lattice(),
            cutter,
        }
    }

    /// Makes the facets of all polygons that the leaf owns; `quads` as in [`BrickCells::take_quads`].
    fn make(mut self, quads: &[Quad]) -> Result<(Cutter, TriangleNames)> {
        let own = self.neighbours[OWN].as_ref().map(|vertices| Arc::clone(&vertices.cells));
        if let Some(cells) = &own
            && let Some(signs) = &cells.signs
        {
            if let Some(ranks) = &cells.ranks {
                self.merged_edges(signs, quads, &EdgeFilter::default().edges(signs, ranks))?;
            } else {
                dispatch!(level(), _simd => self.rows(cells, signs, quads))?;
            }
        }
        Ok((self.cutter.finish(), self.names))
    }

    /// All edges of the leaf, in the order of [`BrickCells::take_quads`].
    #[inline(always)]
    fn rows(&mut self, cells: &BrickCells, signs: &SignChanges, quads: &[Quad]) -> Result<()> {
        let mut quads = quads.iter();
        // Spelled out: with an axis that is not known beforehand every edge goes through memory.
        self.rows_along(Axis::X, cells, signs, &mut quads)?;
        self.rows_along(Axis::Y, cells, signs, &mut quads)?;
        self.rows_along(Axis::Z, cells, signs, &mut quads)
    }

    /// Those along an axis.
    #[inline(always)]
    fn rows_along(
        &mut self,
        axis: Axis,
        cells: &BrickCells,
        signs: &SignChanges,
        quads: &mut std::slice::Iter<'_, Quad>,
    ) -> Result<()> {
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                self.row(axis, j, k, cells, (signs, quads))?;
            }
        }
        Ok(())
    }

    /// All edges along `axis` whose lower samples lie in the row (j, k) and that this leaf owns; `quads` are those of
    /// these edges and of all after them.
    #[inline(always)]
    fn row(
        &mut self,
        axis: Axis,
        j: usize,
        k: usize,
        cells: &BrickCells,
        (signs, quads): (&SignChanges, &mut std::slice::Iter<'_, Quad>),
    ) -> Result<()> {
        let mut bits = signs.edges(axis, j, k);
        let inside = signs.row(j, k);
        while bits != 0 {
            let i = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let inside = inside >> i & 1 == 1;
            // None where no cell of the leaf is active: then all its edges with a sign change lie on its border.
            let Quad { vertices, fraction } = quads.next().unwrap_or(&Quad::UNKNOWN);
            let edge = (axis, [i, j, k], *fraction);
            self.cutter.tag = tag((axis, [i, j, k], *fraction), inside);
            if vertices.contains(&NO_VERTEX) {
                self.border(edge, vertices, inside)?;
            } else {
                self.plain(edge, vertices, cells, inside);
            }
        }
        Ok(())
    }

    /// The polygon of an edge among four plain cells of this leaf, none of which has a split face.
    #[inline(always)]
    fn plain(&mut self, edge: Edge, quad: &[u16; 4], cells: &BrickCells, inside: bool) {
        let [a, b, c, d] = *quad;
        // The leaf's own first place.
        let at = |n: u16| (u32::from(n), cells.positions[usize::from(n)]);
        let shape = if inside { QuadSplit::Quad } else { QuadSplit::TurnedBack };
        self.cutter.push_around(&self.placed(edge), [at(a), at(b), at(c), at(d)], shape, BOTH);
    }

    /// The polygon of an edge on the leaf's border, or next to a cell that is not plain, if this leaf owns it.
    #[inline(always)]
    fn border(&mut self, edge: Edge, quad: &[u16; 4], inside: bool) -> Result<()> {
        let (axis, low, _) = edge;
        let place = self.border_place(axis, low)?;
        match self.borders[place] {
            Border::Foreign => return Ok(()),
            Border::Equal(ref quarters) => {
                if let Some(corners) = self.equal(axis, low, quarters, quad) {
                    let corners = corners.map(|corner| name(&mut self.names, &corner));
                    let shape = if inside { QuadSplit::Quad } else { QuadSplit::Turned };
                    self.cutter.push_around(&self.placed(edge), corners, shape, BOTH);
                    return Ok(());
                }
            }
            Border::Unknown | Border::Uneven => {}
        }
        self.general(edge, inside)
    }

    /// Where in `borders`, which is then known, the edges like one along `axis` stand.
    #[inline(always)]
    fn border_place(&mut self, axis: Axis, low: [usize; 3]) -> Result<usize> {
        let (u, v) = axis.others();
        let side = |c: usize| usize::from(c > 0) + usize::from(c == BRICK_CELLS);
        let place = 9 * axis.index() + 3 * side(low[u.index()]) + side(low[v.index()]);
        if matches!(self.borders[place], Border::Unknown) {
            self.borders[place] = self.explore(axis, low)?;
        }
        Ok(place)
    }

    #[cold]
    fn explore(&mut self, axis: Axis, low: [usize; 3]) -> Result<Border> {
        if !self.owns(axis, low) {
            return Ok(Border::Foreign);
        }
        let mut quarters = [Quarter::default(); 4];
        for (n, [qu, qv]) in SQUARE.into_iter().enumerate() {
            let cell = cell_around(axis, low.map(|c| c as i32), [qu, qv]);
            let direction = direction_index(direction(cell));
            let LeafNeighbour::Same(leaf) = self.around[direction] else { return Ok(Border::Uneven) };
            self.fetch(leaf, direction)?;
            let step =
                std::array::from_fn(|a| (cell[a] - low[a] as i32).rem_euclid(BRICK_CELLS as i32) as usize);
            quarters[n] = Quarter { direction, step, edge: edge_index(axis, 1 - qu, 1 - qv), leaf };
        }
        Ok(Border::Equal(quarters))
    }

    /// The corners of a polygon among plain cells of leaves of this level, if no face between them has extra vertices;
    /// `quad` as in [`BrickCells::take_quads`].
    #[inline(always)]
    fn equal(
        &self,
        axis: Axis,
        low: [usize; 3],
        quarters: &[Quarter; 4],
        quad: &[u16; 4],
    ) -> Option<[SharedVertex; 4]> {
        let mut corners = [SharedVertex::default(); 4];
        for n in 0..4 {
            let quarter = &quarters[n];
            let vertices = self.neighbours[quarter.direction].as_ref()?;
            let number = self.among_plain(vertices, axis, low, (n, quarter), quad)?;
            let position = vertices.cells.positions[number as usize];
            corners[n] = SharedVertex { leaf: quarter.leaf, number, position, ..SharedVertex::default() };
        }
        Some(corners)
    }

    /// The vertex in a quadrant around an edge, by the number with which its cell was made, if the cell is plain and its
    /// faces at the edge have no extra vertices.
    #[inline(always)]
    fn among_plain(
        &self,
        vertices: &LeafVertices,
        axis: Axis,
        low: [usize; 3],
        (n, quarter): (usize, &Quarter),
        quad: &[u16; 4],
    ) -> Option<u32> {
        let cell = std::array::from_fn(|a| (low[a] + quarter.step[a]) % BRICK_CELLS);
        // Faces belong to their upper cells.
        let [qu, qv] = SQUARE[n];
        let (u, v) = axis.others();
        if qu == 1 && vertices.splits(u, cell) || qv == 1 && vertices.splits(v, cell) {
            return None;
        }
        match quad[n] {
            NO_VERTEX => vertices.cells.plain_vertex(cell, quarter.edge),
            vertex => Some(u32::from(vertex)),
        }
    }

    fn fetch(&mut self, leaf: u32, direction: usize) -> Result<()> {
        if self.neighbours[direction].is_none() {
            self.neighbours[direction] = Some(self.field.vertices(leaf)?);
        }
        Ok(())
    }

    /// The polygon of any edge, if this leaf owns it.
    fn general(&mut self, edge: Edge, inside: bool) -> Result<()> {
        let (axis, low, _) = edge;
        if !self.owns(axis, low) {
            return Ok(());
        }
        let polygon = self.polygon(axis, low)?;
        let corners = &polygon.corners[..polygon.count];
        if corners.len() < 3 {
            // All around the edge is merged into one vertex, or into two.
            return Ok(());
        }
        if self.only_wide && !corners.iter().any(|corner| corner.vertex.is_wide) {
            return Ok(());
        }
        if !corners.iter().any(|corner| corner.vertex.is_merged) {
            self.keep(&self.placed(edge), corners, inside);
            return Ok(());
        }
        let mark = self.next_mark();
        merged::triangulate(corners, |a, b, c| {
            let vertex = |n: usize| {
                let (name, position) = name(&mut self.names, &corners[n].vertex);
                (name | mark, position)
            };
            self.cutter.push_triangle([a, b, c].map(vertex), inside);
        });
        Ok(())
    }

    /// The mark of the next polygon with a merged vertex.
    fn next_mark(&mut self) -> u32 {
        if self.mark != 0 {
            self.mark ^= MergeMark::TURN;
        }
        self.mark
    }

    /// The facets of a polygon within the envelope of its edge.
    fn keep(&mut self, edge: &MinimalEdge, corners: &[Corner], inside: bool) {
        let mut vertex = |corner: &Corner| name(&mut self.names, &corner.vertex);
        match *corners {
            [a, b, c, d] if corners.iter().all(|corner| !corner.is_extra) => {
                let shape = if inside { QuadSplit::Quad } else { QuadSplit::Turned };
                let allowed = [a.is_finest || c.is_finest, b.is_finest || d.is_finest];
                self.cutter.push_around(edge, [a, b, c, d].map(|corner| vertex(&corner)), shape, allowed);
            }
            [a, b, c] if edge.pierces([a, b, c].map(|corner| corner.vertex.position)) => {
                self.cutter.push_triangle([a, b, c].map(|corner| vertex(&corner)), inside);
            }
            _ => {
                let corners: Vec<Vertex> = corners.iter().map(vertex).collect();
                self.cutter.push_fan(edge, &corners, inside);
            }
        }
    }

    /// Where an edge lies in the world.
    #[inline(always)]
    fn placed(&self, (axis, low, fraction): Edge) -> MinimalEdge {
        MinimalEdge::placed(&self.lattice, axis, low, f32::from(fraction) / 65536.0)
    }

    fn owns(&self, axis: Axis, low: [usize; 3]) -> bool {
        let mut best = (0, false);
        for quadrant in SQUARE {
            let cell = cell_around(axis, low.map(|c| c as i32), quadrant);
            let d = direction(cell);
            match self.around[direction_index(d)] {
                LeafNeighbour::Finer => return false,
                LeafNeighbour::Same(_) => best = best.max((quadrant_rank(quadrant) + 1, d == [0; 3])),
                LeafNeighbour::Coarser(_) | LeafNeighbour::Outside => {}
            }
        }
        best.1
    }
}

/// In which direction a cell with coordinates -1..=32 lies from the leaf.
#[inline]
pub(super) fn direction(cell: [i32; 3]) -> [i32; 3] {
    cell.map(|c| i32::from(c >= BRICK_CELLS as i32) - i32::from(c < 0))
}

/// The corner of a triangle.
#[inline(always)]
fn name(names: &mut TriangleNames, vertex: &SharedVertex) -> Vertex {
    (names.of(vertex.leaf, vertex.number), vertex.position)
}
