//! Splats in the world.

use super::levels::SplatLevels;
use crate::bsp::{Cell, Clip, NodeCells, PAIRS, SPLATS_MAX, Splat, SplatInput, SplatTree};
use crate::error::Result;
use crate::lattice::{NodeKey, unit};
use crate::page_draw::HALF_DIAGONAL;
use rayon::prelude::*;

/// A part of a plane: the disc of `radius` around `centre`, in world units.
#[derive(Clone, Debug, PartialEq)]
pub struct Disc {
    /// The middle of its cell, moved along the normal to the plane.
    pub centre: [f64; 3],
    /// Unit normal, outward.
    pub normal: [f64; 3],
    /// Half the diagonal of the cell.
    pub radius: f64,
    /// Middle of the cell.
    pub cell_centre: [f64; 3],
    /// Side of the cell.
    pub cell: f64,
    /// Planes that cut it: n and d, of which n · x ≤ d remains.
    pub cuts: Vec<([f64; 3], f64)>,
}

/// A cell with the planes of its splats.
pub(crate) struct CellPlanes {
    pub cell: Cell,
    /// Unit normals, and signed distances from the middle of the cell in cells; as many as the cell has splats.
    pub planes: [NormalAndOffset; SPLATS_MAX],
}

/// A unit normal and a signed distance.
type NormalAndOffset = ([f64; 3], f64);

/// Makes of each node that has splats of the finest picture, those of cells that are not divided, or of those of `level`, what
/// `make` does: from its least corner, the side of its cells, and these.
///
/// # Errors
/// If a temporary file cannot be read.
pub(crate) fn planes_of_levels<T: Send>(
    levels: &SplatLevels,
    level: Option<u8>,
    make: impl Fn([f64; 3], f64, &mut dyn Iterator<Item = CellPlanes>) -> T + Sync,
) -> Result<Vec<T>> {
    let last = level.unwrap_or(levels.deepest()).min(levels.deepest());
    let frame = Frame { origin: levels.root().to_world([1.0; 3]), edge: levels.root().edge, last };
    let one = |key: NodeKey, piece: &NodeCells<SplatInput>| {
        let hidden = |cell: &Cell| levels.is_pruned() && !is_reached(levels, key, cell);
        frame
            .node(key, piece, hidden, plane_of_input)
            .map(|(corner, size, mut cells)| make(corner, size, &mut cells))
    };
    let mut made: Vec<T> =
        levels.in_memory().par_iter().filter_map(|(key, piece)| one(*key, piece)).collect();
    levels.each_spilled(|key, piece| {
        made.extend(one(key, piece));
        Ok(())
    })?;
    Ok(made)
}

/// The same of a file.
pub(crate) fn planes_of_tree<T: Send>(
    tree: &SplatTree,
    level: Option<u8>,
    make: impl Fn([f64; 3], f64, &mut dyn Iterator<Item = CellPlanes>) -> T + Sync,
) -> Vec<T> {
    let frame = Frame::of_tree(tree, level);
    let plane = |splat: &Splat| plane_of_splat(tree, splat);
    let one = |(key, piece): (&u64, &NodeCells<Splat>)| {
        let key = NodeKey::from_code(*key)?;
        frame
            .node(key, piece, |_| false, plane)
            .map(|(corner, size, mut cells)| make(corner, size, &mut cells))
    };
    tree.pieces().par_iter().filter_map(one).collect()
}

/// Calls `each` with the splats of the finest picture: those of cells that are not divided, or of `level`.
///
/// # Errors
/// If a temporary file cannot be read.
pub fn discs_of_levels(levels: &SplatLevels, level: Option<u8>, mut each: impl FnMut(Disc)) -> Result<()> {
    let last = level.unwrap_or(levels.deepest()).min(levels.deepest());
    let frame = Frame { origin: levels.root().to_world([1.0; 3]), edge: levels.root().edge, last };
    levels.each_node(|key, piece| {
        let hidden = |cell: &Cell| levels.is_pruned() && !is_reached(levels, key, cell);
        if let Some((corner, size, cells)) = frame.node(key, piece, hidden, plane_of_input) {
            cells.for_each(|cell| discs_of(corner, size, &cell, &mut each));
        }
        Ok(())
    })
}

/// The same of a file.
pub fn discs_of_tree(tree: &SplatTree, level: Option<u8>, mut each: impl FnMut(Disc)) {
    let frame = Frame::of_tree(tree, level);
    for (&key, piece) in tree.pieces() {
        let Some(key) = NodeKey::from_code(key) else { continue };
        let plane = |splat: &Splat| plane_of_splat(tree, splat);
        if let Some((corner, size, cells)) = frame.node(key, piece, |_| false, plane) {
            cells.for_each(|cell| discs_of(corner, size, &cell, &mut each));
        }
    }
}

fn plane_of_input(splat: &SplatInput) -> NormalAndOffset {
    let normal = unit(splat.normal.map(f64::from));
    let offset = (0..3).map(|a| normal[a] * f64::from(splat.mean[a])).sum::<f64>() / 4096.0;
    (normal, offset)
}

fn plane_of_splat(tree: &SplatTree, splat: &Splat) -> NormalAndOffset {
    let normal = unit(tree.directions().vector(splat.normal).map(f64::from));
    (normal, f64::from(splat.offset) / 16.0)
}

/// Whether all that a cell is part of is divided.
fn is_reached(levels: &SplatLevels, key: NodeKey, cell: &Cell) -> bool {
    let (mut key, mut at) = (key, cell.at);
    while let Some(parent) = key.parent() {
        let offset = key.octant().offset();
        at = std::array::from_fn(|a| at[a] / 2 + 16 * offset[a] as u8);
        let piece = levels.above_deepest(parent);
        // Cells of a node are sorted, z first.
        let found = piece.and_then(|piece| {
            let order = |at: [u8; 3]| [at[2], at[1], at[0]];
            let place = piece.cells.binary_search_by_key(&order(at), |cell| order(cell.at)).ok()?;
            Some(piece.cells[place].divided)
        });
        if found != Some(true) {
            return false;
        }
        key = parent;
    }
    true
}

struct Frame {
    origin: [f64; 3],
    edge: f64,
    /// The deepest level that is wanted.
    last: u8,
}

impl Frame {
    fn of_tree(tree: &SplatTree, level: Option<u8>) -> Frame {
        let header = tree.header();
        let last = level.unwrap_or(header.deepest).min(header.deepest);
        Frame { origin: header.origin, edge: header.edge, last }
    }

    /// The least corner of a node, the side of its cells, and those of the picture; none below the last level.
    fn node<'a, S: Copy>(
        &self,
        key: NodeKey,
        piece: &'a NodeCells<S>,
        hidden: impl Fn(&Cell) -> bool + 'a,
        plane: impl Fn(&S) -> NormalAndOffset + 'a,
    ) -> Option<([f64; 3], f64, impl Iterator<Item = CellPlanes> + 'a)> {
        let level = key.level();
        if level > self.last {
            return None;
        }
        let size = self.edge / f64::from(32u32 << level);
        let first = key.first_sample();
        let corner = std::array::from_fn(|a| self.origin[a] + f64::from(first[a]) * size);
        let is_last = level == self.last;
        let cells = piece.cells.iter().filter(move |cell| (is_last || !cell.divided) && !hidden(cell));
        let cells = cells.map(move |cell| {
            let mut planes = [([0.0; 3], 0.0); SPLATS_MAX];
            for (to, splat) in planes.iter_mut().zip(piece.of(cell)) {
                *to = plane(splat);
            }
            CellPlanes { cell: *cell, planes }
        });
        Some((corner, size, cells))
    }
}

/// The splats of a cell in the world.
fn discs_of(
    corner: [f64; 3],
    size: f64,
    CellPlanes { cell, planes }: &CellPlanes,
    each: &mut impl FnMut(Disc),
) {
    let cell_centre: [f64; 3] = std::array::from_fn(|a| corner[a] + (f64::from(cell.at[a]) + 0.5) * size);
    for (n, (normal, offset)) in planes.iter().take(usize::from(cell.count)).enumerate() {
        let centre = std::array::from_fn(|a| cell_centre[a] + normal[a] * offset * size);
        let mut cuts = Vec::new();
        for (pair, [a, b]) in PAIRS.into_iter().enumerate().filter(|(_, p)| p.contains(&n)) {
            let other = if a == n { b } else { a };
            let sign = match cell.clip(pair) {
                Clip::None => continue,
                Clip::Convex => 1.0,
                Clip::Concave => -1.0,
            };
            let (m, along) = planes[other];
            let to_centre = (0..3).map(|a| m[a] * cell_centre[a]).sum::<f64>();
            cuts.push((m.map(|c| c * sign), (to_centre + along * size) * sign));
        }
        // A disc of this radius covers what a plane and the cell share.
        let radius = HALF_DIAGONAL * size;
        each(Disc { centre, normal: *normal, radius, cell_centre, cell: size, cuts });
    }
}
