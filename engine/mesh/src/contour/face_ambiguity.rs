//! Which ambiguous faces are joined: whether two inside corners that face each other across a face touch on it, or the
//! outside ones do.
//!
//! The planes of the four crossings on a face's edges decide it, by the sum of their distances from its middle. Where
//! the surface is a convex wedge there, whose inside lies on the inside of all planes, the middle is within all of
//! them and the inside is joined.
//!
//! So it is in truth: a wedge holds the line between two of its points. Where it is a concave one the middle is
//! outside of all, and the inside is taken apart. In between the greater distances win.
//!
//! Both cells at a face must cut it alike, and leaves may differ in what they say of the edges between them: normals
//! that are differences of samples are one-sided at a border.
//!
//! So the leaf of the upper cell is asked, as it owns the face. Faces of cells that touch finer leaves, and those
//! towards coarser ones, are not joined ([`super::transition_cells`]), nor are those of cells all of whose faces are ambiguous
//! ([`may_join`]).

use super::field::LevelSet;
use super::surface::{HermiteSurface, LeafSurface};
use super::topology::{CellCase, may_join};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};

/// How the boundary of a cell is cut that touches no finer leaf; `changes` are those of its leaf, which is `key`.
#[inline(always)]
pub(super) fn kind(
    field: &LevelSet,
    key: NodeKey,
    changes: &HermiteSurface,
    cell: [usize; 3],
) -> Result<CellCase> {
    kind_of(field, key, changes, cell, changes.mask(cell))
}

/// The same with the cell's corner mask.
#[inline(always)]
pub(super) fn kind_of(
    field: &LevelSet,
    key: NodeKey,
    changes: &HermiteSurface,
    cell: [usize; 3],
    mask: u8,
) -> Result<CellCase> {
    let kind = CellCase::of(mask);
    if kind.loops().ambiguous == 0 { Ok(kind) } else { ambiguous_kind(field, key, changes, cell) }
}

/// That of a cell with ambiguous faces.
fn ambiguous_kind(
    field: &LevelSet,
    key: NodeKey,
    changes: &HermiteSurface,
    cell: [usize; 3],
) -> Result<CellCase> {
    let mask = changes.mask(cell);
    let ambiguous = CellCase::of(mask).loops().ambiguous;
    let mut joined = 0;
    for face in (0..6).filter(|face| ambiguous >> face & 1 == 1 && may_join(mask)) {
        let (axis, side) = (Axis::ALL[face / 2], face % 2);
        joined |= u8::from(is_joined(field, key, changes, cell, axis, side)?) << face;
    }
    Ok(CellCase::joined(mask, joined))
}

/// Whether the ambiguous face of such a cell across `axis` is joined, the lower or the upper one.
fn is_joined(
    field: &LevelSet,
    key: NodeKey,
    changes: &HermiteSurface,
    cell: [usize; 3],
    axis: Axis,
    side: usize,
) -> Result<bool> {
    let a = axis.index();
    let mut step = [0; 3];
    step[a] = 2 * side as i32 - 1;
    let beyond: [i32; 3] = std::array::from_fn(|n| cell[n] as i32 + step[n]);
    if field.leaves.touches_finer(key, beyond) {
        return Ok(false);
    }
    let other = beyond.map(|c| c.rem_euclid(BRICK_CELLS as i32) as usize);
    if (0..BRICK_CELLS as i32).contains(&beyond[a]) {
        let above = if side == 1 { other } else { cell };
        return Ok(may_join(changes.mask(other)) && is_within(changes, above, axis));
    }
    let neighbour = key.neighbour(step).and_then(|key| field.leaves.exact(key));
    let Some(leaf) = neighbour else { return Ok(false) };
    let surface = field.surface(leaf)?;
    let LeafSurface::Changes(others) = &*surface else { return Ok(false) };
    let (owner, above) = if side == 1 { (&**others, other) } else { (changes, cell) };
    Ok(may_join(others.mask(other)) && is_within(owner, above, axis))
}

/// Whether the middle of the lower face of `cell` across `axis`, all of whose edges are crossed, is rather within the
/// planes of the crossings than beyond them.
fn is_within(changes: &HermiteSurface, cell: [usize; 3], axis: Axis) -> bool {
    let (u, v) = axis.others();
    let distance = |along: Axis, across: Axis, offset: usize| {
        let mut low = cell;
        low[across.index()] += offset;
        let plane = changes.plane(along, low);
        let normal = plane.normal.map(f64::from);
        normal[along.index()] * (0.5 - f64::from(plane.fraction))
            + normal[across.index()] * (0.5 - offset as f64)
    };
    let sum = distance(u, v, 0) + distance(u, v, 1) + distance(v, u, 0) + distance(v, u, 1);
    sum < 0.0
}
