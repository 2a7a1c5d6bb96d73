//! Splats in the world.

use super::levels::SplatLevels;
use crate::bsp::{Cell, Clip, NodeCells, SplatTree};
use crate::error::Result;
use crate::lattice::NodeKey;

/// Half the diagonal of a cell: a disc of this radius covers what a plane and the cell share.
const HALF_DIAGONAL: f64 = 0.866_025_403_784_438_6;

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

/// Calls `each` with the splats of the finest picture: those of cells that are not divided, or of `level`.
///
/// # Errors
/// If a temporary file cannot be read.
pub fn discs_of_levels(levels: &SplatLevels, level: Option<u8>, mut each: impl FnMut(Disc)) -> Result<()> {
    let last = level.unwrap_or(levels.deepest()).min(levels.deepest());
    let frame = Frame { origin: levels.root().to_world([1.0; 3]), edge: levels.root().edge };
    levels.each_node(|key, piece| {
        let hidden = |cell: &Cell| !is_reached(levels, key, cell);
        let plane = |cell: &Cell, n: usize| {
            let wanted = piece.of(cell)[n];
            let normal = super::cluster::unit(wanted.normal.map(f64::from));
            let offset = (0..3).map(|a| normal[a] * f64::from(wanted.mean[a])).sum::<f64>() / 4096.0;
            (normal, offset)
        };
        frame.node(key, last, piece, hidden, plane, &mut each);
        Ok(())
    })
}

/// The same of a file.
pub fn discs_of_tree(tree: &SplatTree, level: Option<u8>, mut each: impl FnMut(Disc)) {
    let header = tree.header();
    let last = level.unwrap_or(header.deepest).min(header.deepest);
    let frame = Frame { origin: header.origin, edge: header.edge };
    for (&key, piece) in tree.pieces() {
        let Some(key) = NodeKey::from_code(key) else { continue };
        let plane = |cell: &Cell, n: usize| {
            let splat = piece.of(cell)[n];
            let normal = super::cluster::unit(tree.directions().vector(splat.normal).map(f64::from));
            (normal, f64::from(splat.offset) / 16.0)
        };
        frame.node(key, last, piece, |_| false, plane, &mut each);
    }
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
}

impl Frame {
    fn node<S: Copy>(
        &self,
        key: NodeKey,
        last: u8,
        piece: &NodeCells<S>,
        hidden: impl Fn(&Cell) -> bool,
        plane: impl Fn(&Cell, usize) -> ([f64; 3], f64),
        each: &mut impl FnMut(Disc),
    ) {
        let level = key.level();
        if level > last {
            return;
        }
        let cell_size = self.edge / f64::from(32u32 << level);
        let first = key.first_sample();
        for cell in piece.cells.iter().filter(|cell| (level == last || !cell.divided) && !hidden(cell)) {
            let cell_centre: [f64; 3] = std::array::from_fn(|a| {
                self.origin[a] + (f64::from(first[a]) + f64::from(cell.at[a]) + 0.5) * cell_size
            });
            let planes: Vec<_> = (0..usize::from(cell.count)).map(|n| plane(cell, n)).collect();
            for (n, (normal, offset)) in planes.iter().enumerate() {
                let centre = std::array::from_fn(|a| cell_centre[a] + normal[a] * offset * cell_size);
                let mut cuts = Vec::new();
                for (pair, [a, b]) in
                    crate::bsp::PAIRS.into_iter().enumerate().filter(|(_, p)| p.contains(&n))
                {
                    let other = if a == n { b } else { a };
                    let sign = match cell.clip(pair) {
                        Clip::None => continue,
                        Clip::Convex => 1.0,
                        Clip::Concave => -1.0,
                    };
                    let (m, along) = planes[other];
                    let to_centre = (0..3).map(|a| m[a] * cell_centre[a]).sum::<f64>();
                    cuts.push((m.map(|c| c * sign), (to_centre + along * cell_size) * sign));
                }
                each(Disc {
                    centre,
                    normal: *normal,
                    radius: HALF_DIAGONAL * cell_size,
                    cell_centre,
                    cell: cell_size,
                    cuts,
                });
            }
        }
    }
}
