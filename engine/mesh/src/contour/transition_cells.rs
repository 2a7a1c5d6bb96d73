//! Cells next to finer leaves: the general form of the rules that the table of [`super::topology`] holds for
//! plain cells.
//!
//! The boundary of such a cell consists of *minimal faces*: its own faces, each replaced by the neighbours' where
//! these are finer. Minimal faces are bounded by *minimal edges*: a cell's edge is halved wherever a leaf around it is
//! finer.
//!
//! Every lattice point has one sign, and every face is cut by the one rule of [`cut_runs`]. Every sign-changing
//! minimal edge belongs to exactly two faces of the cell. So the cuts link into closed loops whatever the levels are.
//!
//! And both cells at a face cut it alike, so the mesh closes.

use super::cells::CellRow;
use super::envelope::MinimalEdge;
use super::face_vertices::{self, edge_key, face_key};
use super::field::LevelSet;
use super::leaves::{ContourLeaf, LeafNeighbour, LeafNeighbours, broken, direction_index, directions};
use super::planes::HermitePlane;
use super::surface::{HermiteSurface, LeafSurface};
use super::topology::{corners_in_run, cut_runs};
use crate::brick::SignChanges;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, Units};
use std::collections::HashMap;
use std::sync::Arc;

/// A sign-changing minimal edge on the boundary of a cell.
#[derive(Clone, Copy)]
pub(super) struct LoopCrossing {
    /// Name relative to the cell's lower corner.
    pub key: u64,
    /// In cell coordinates.
    pub plane: HermitePlane,
    /// Number of the loop through the edge.
    pub in_loop: u32,
    /// Lower end of the edge, counted from the root's first sample, and its level.
    pub lower: Units,
    pub level: u8,
    /// The edge in the world.
    pub edge: MinimalEdge,
}

/// A cut of a minimal face.
pub(super) struct MixedCut {
    /// Name of the face within the leaf, if the cell owns it.
    pub face: Option<u32>,
    /// The two edges that the cut joins, named relative to the face's lower corner.
    pub edges: [u64; 2],
    /// The same relative to the cell's lower corner, as [`LoopCrossing::key`]: that which enters the run that is cut off, and that
    /// which leaves it.
    keys: [u64; 2],
    /// Where it has its vertex if it must have one: [`face_vertices::SplitFace::half_way`], or that of several.
    pub at: [f32; 3],
    /// Whether the face has several cuts, each with a vertex.
    pub is_split: bool,
}

/// The loops of one mixed cell.
#[derive(Default)]
pub(super) struct MixedCell {
    /// Sorted by key.
    pub crossings: Vec<LoopCrossing>,
    /// Number of loops.
    pub loops: u32,
    /// The cuts of all minimal faces.
    pub cuts: Vec<MixedCut>,
    /// Number of the faces with several that the cell owns.
    pub split_faces: u64,
}

impl MixedCell {
    /// The crossings of the two edges that a cut joins.
    pub(super) fn ends(&self, cut: &MixedCut) -> [&LoopCrossing; 2] {
        // Those of all cuts are there.
        cut.keys.map(|key| &self.crossings[self.crossings.partition_point(|c| c.key < key)])
    }
}

const NOT_LOOPED: u32 = u32::MAX;

/// A leaf with finer leaves around it.
pub(super) struct TransitionLeaf<'a> {
    field: &'a LevelSet<'a>,
    leaf: u32,
    own: ContourLeaf,
    around: &'a LeafNeighbours,
    /// The leaf found last: queries come in clusters.
    last: u32,
    surfaces: HashMap<u32, Arc<LeafSurface>>,
}

/// What is gathered while walking round one cell.
#[derive(Default)]
struct Walk {
    /// Lower corner of the cell.
    base: Units,
    cell: MixedCell,
    /// Edges round the current face with the sign of the point where each starts.
    ring: Vec<(Option<LoopCrossing>, bool)>,
    /// The places there of the edges that start at corners of the face.
    corners: [usize; 4],
    /// Places there of the edges that enter and leave each run of inside points.
    runs: Vec<[usize; 2]>,
}

/// A face of a cell or a part of it.
#[derive(Clone, Copy)]
struct Face {
    axis: Axis,
    side: usize,
    corner: Units,
    level: u8,
}

impl<'a> TransitionLeaf<'a> {
    pub(super) fn new(field: &'a LevelSet<'a>, leaf: u32, around: &'a LeafNeighbours) -> TransitionLeaf<'a> {
        let own = *field.leaves.get(leaf);
        TransitionLeaf { field, leaf, own, around, last: leaf, surfaces: HashMap::new() }
    }

    fn surface(&mut self, leaf: u32) -> Result<Arc<LeafSurface>> {
        if let Some(surface) = self.surfaces.get(&leaf) {
            return Ok(Arc::clone(surface));
        }
        let surface = self.field.surface(leaf)?;
        self.surfaces.insert(leaf, Arc::clone(&surface));
        Ok(surface)
    }

    /// Sets the bits of mixed cells: those at a border with finer leaves that have a sign change at their own
    /// corners or on any finer edge of their boundary.
    pub(super) fn mark(&mut self, rows: &mut [CellRow]) -> Result<()> {
        let mut touching = Vec::new();
        for d in directions().filter(|&d| self.around[direction_index(d)] == LeafNeighbour::Finer) {
            let range = |axis: usize| match d[axis] {
                -1 => 0..1,
                0 => 0..BRICK_CELLS,
                _ => BRICK_CELLS - 1..BRICK_CELLS,
            };
            let columns = range(0).fold(0u32, |bits, i| bits | 1 << i);
            for k in range(2) {
                for j in range(1) {
                    let row = &mut rows[k * BRICK_CELLS + j];
                    row.mixed |= row.active & columns;
                }
            }
            touching.clear();
            self.field.leaves.touching(self.own.key, d, &mut touching);
            for &fine in &touching {
                let leaf = *self.field.leaves.get(fine);
                if let (true, LeafSurface::Changes(changes)) = (leaf.changes, &*self.surface(fine)?) {
                    self.mark_next_to(&leaf, &changes.signs, d, rows);
                }
            }
        }
        for row in rows {
            row.active |= row.mixed;
        }
        Ok(())
    }

    /// Marks the cells that have a sign-changing edge of the leaf `fine`, which lies in direction `d`, on
    /// their boundary.
    fn mark_next_to(&self, fine: &ContourLeaf, signs: &SignChanges, d: [i32; 3], rows: &mut [CellRow]) {
        let shift = fine.key.level() - self.own.key.level();
        let first = fine.key.first_sample();
        let own_first = self.own.key.first_sample();
        // The fine leaf's samples on the common border.
        let range = |axis: usize| match d[axis] {
            1 => 0..1,
            0 => 0..BRICK_POINTS,
            _ => BRICK_POINTS - 1..BRICK_POINTS,
        };
        let columns = range(0).fold(0u64, |bits, i| bits | 1 << i);
        for along in Axis::ALL.into_iter().filter(|axis| d[axis.index()] == 0) {
            // The own cells, first and last along an axis, at the fine sample `at`.
            let span = |a: usize, at: usize| match d[a] {
                -1 => [0, 0],
                1 => [BRICK_CELLS - 1; 2],
                _ => {
                    let at = first[a] + at as u32;
                    let cell = ((at >> shift) - own_first[a]) as usize;
                    let on_line = a != along.index() && at & ((1 << shift) - 1) == 0;
                    [cell.saturating_sub(usize::from(on_line)), cell.min(BRICK_CELLS - 1)]
                }
            };
            for (j, k) in range(2).flat_map(|k| range(1).map(move |j| (j, k))) {
                let mut edges = signs.edges(along, j, k) & columns;
                let mut cells = 0u32;
                while edges != 0 {
                    let [low, high] = span(0, edges.trailing_zeros() as usize);
                    cells |= 1 << low | 1 << high;
                    edges &= edges - 1;
                }
                if cells == 0 {
                    continue;
                }
                let ([y0, y1], [z0, z1]) = (span(1, j), span(2, k));
                for row in [
                    z0 * BRICK_CELLS + y0,
                    z0 * BRICK_CELLS + y1,
                    z1 * BRICK_CELLS + y0,
                    z1 * BRICK_CELLS + y1,
                ] {
                    rows[row].mixed |= cells;
                }
            }
        }
    }

    /// The loops of a mixed cell.
    pub(super) fn loops(&mut self, cell: [usize; 3]) -> Result<MixedCell> {
        let bits = self.own.key.spacing_bits();
        let base: Units = std::array::from_fn(|a| self.own.key.base()[a] + ((cell[a] as i32) << bits));
        let mut walk = Walk { base, ..Walk::default() };
        for axis in Axis::ALL {
            for side in 0..2 {
                let mut corner = base;
                corner[axis.index()] += (side as i32) << bits;
                self.face(Face { axis, side, corner, level: self.own.key.level() }, &mut walk)?;
            }
        }
        self.link(walk)
    }

    /// The leaf at a position, `None` outside the root.
    fn leaf_at(&mut self, at: Units) -> Option<u32> {
        for leaf in [self.leaf, self.last] {
            let key = self.field.leaves.get(leaf).key;
            let base = key.base();
            let side = (BRICK_CELLS as u32) << key.spacing_bits();
            if (0..3).all(|a| (at[a].wrapping_sub(base[a]) as u32) < side) {
                return Some(leaf);
            }
        }
        let found = self.field.leaves.at(at)?;
        self.last = found;
        Some(found)
    }

    /// Cuts a face, or the finer faces that replace it.
    fn face(&mut self, face: Face, walk: &mut Walk) -> Result<()> {
        let (u, v) = face.axis.others();
        let mut probe = face.corner;
        probe[face.axis.index()] -= i32::from(face.side == 0);
        let other = self.leaf_at(probe);
        let other_level = other.map_or(0, |leaf| self.field.leaves.get(leaf).key.level());
        if other_level > face.level {
            let half = 1 << (crate::lattice::spacing_bits(face.level) - 1);
            for quarter in 0..4 {
                let mut corner = face.corner;
                corner[u.index()] += half * (quarter & 1);
                corner[v.index()] += half * (quarter >> 1);
                self.face(Face { corner, level: face.level + 1, ..face }, walk)?;
            }
            return Ok(());
        }
        self.ring(face, walk)?;
        walk.runs.clear();
        cut_runs(&walk.ring, |enter, leave| walk.runs.push([enter, leave]));
        walk.cell.crossings.extend(walk.ring.iter().filter_map(|(crossing, _)| *crossing));
        // As the finer cell this one owns the face, as an equal one only if it is the upper cell.
        let is_own = face.level == self.own.key.level()
            && (face.side == 0 || other.is_none() || other_level < face.level);
        self.keep_cuts(face, is_own, walk);
        Ok(())
    }

    /// Walks the minimal edges round a minimal face, counter-clockwise seen from outside the cell.
    fn ring(&mut self, face: Face, walk: &mut Walk) -> Result<()> {
        let (u, v) = face.axis.others();
        let size = 1 << crate::lattice::spacing_bits(face.level);
        walk.ring.clear();
        // Seen from above the ring runs along u, then v, then back; seen from below the other way round.
        let (first, second) = if face.side == 1 { (u, v) } else { (v, u) };
        let sides =
            [(first, second, true), (second, first, true), (first, second, false), (second, first, false)];
        for (n, (axis, across, forward)) in sides.into_iter().enumerate() {
            let mut lower = face.corner;
            // Backward along the first axis at the far end of the second; forward along the second axis at
            // the far end of the first.
            let is_far = (axis == first) != forward;
            lower[across.index()] += if is_far { size } else { 0 };
            let start = walk.ring.len();
            walk.corners[n] = start;
            self.edge(lower, axis, face.level, walk)?;
            if !forward {
                reverse(&mut walk.ring[start..]);
            }
        }
        Ok(())
    }

    /// Appends the minimal edges along an edge, in ascending order.
    fn edge(&mut self, lower: Units, axis: Axis, level: u8, walk: &mut Walk) -> Result<()> {
        let field = self.field;
        let leaves = &field.leaves;
        let owner = leaves.owner(axis, lower, |at| self.leaf_at(at));
        let leaf = owner.ok_or_else(|| broken(self.own.key))?;
        let key = leaves.get(leaf).key;
        if key.level() > level {
            self.edge(lower, axis, level + 1, walk)?;
            let mut middle = lower;
            middle[axis.index()] += 1 << crate::lattice::spacing_bits(level + 1);
            return self.edge(middle, axis, level + 1, walk);
        }
        let base = key.base();
        let low: [usize; 3] = std::array::from_fn(|a| ((lower[a] - base[a]) >> key.spacing_bits()) as usize);
        let mut high = low;
        high[axis.index()] += 1;
        let surface = self.surface(leaf)?;
        let starts = surface.is_inside(low);
        let crossing = match &*surface {
            LeafSurface::Changes(changes) if changes.signs.is_inside(high) != starts => {
                Some(self.crossing(changes, low, (lower, axis, level), walk.base))
            }
            _ => None,
        };
        walk.ring.push((crossing, starts));
        Ok(())
    }

    fn crossing(
        &self,
        changes: &HermiteSurface,
        low: [usize; 3],
        (lower, axis, level): (Units, Axis, u8),
        base: Units,
    ) -> LoopCrossing {
        let edge = changes.plane(axis, low);
        let relative: Units = std::array::from_fn(|a| lower[a] - base[a]);
        let spacing = f64::from(1 << self.own.key.spacing_bits());
        let mut at = relative.map(f64::from);
        at[axis.index()] += f64::from(edge.fraction) * f64::from(1 << crate::lattice::spacing_bits(level));
        let plane = (at.map(|c| c / spacing), edge.normal.map(f64::from));
        let edge = MinimalEdge::of_level(self.field.root, axis, lower, level, edge.rounded_down());
        LoopCrossing { key: edge_key(relative, axis, level), plane, in_loop: NOT_LOOPED, lower, level, edge }
    }

    /// Keeps the cuts of a face.
    fn keep_cuts(&self, face: Face, is_own: bool, walk: &mut Walk) {
        let own = self.own.key;
        let corner =
            std::array::from_fn(|a| ((face.corner[a] - own.base()[a]) >> own.spacing_bits()) as usize);
        let name = is_own.then(|| face_key(face.axis, corner));
        let is_split = walk.runs.len() > 1;
        walk.cell.split_faces += u64::from(is_split && is_own);
        if walk.runs.is_empty() {
            return;
        }
        let in_world =
            face_vertices::SplitFace::of_level(self.field.root, face.axis, face.corner, face.level);
        for &run in &walk.runs {
            let [Some(enter), Some(leave)] = run.map(|place| walk.ring[place].0) else { continue };
            let relative = |c: LoopCrossing| std::array::from_fn(|a| c.lower[a] - face.corner[a]);
            let edges = [enter, leave].map(|c| edge_key(relative(c), c.edge.axis, c.level));
            let cut = [&enter.edge, &leave.edge];
            let at = match is_split {
                true => in_world.half_way_of_several(cut, corners_in_run(run, walk.corners, walk.ring.len())),
                false => in_world.half_way(cut),
            };
            let keys = [enter.key, leave.key];
            walk.cell.cuts.push(MixedCut { face: name, edges, keys, at, is_split });
        }
    }

    /// Links the cuts into loops.
    fn link(&self, mut walk: Walk) -> Result<MixedCell> {
        let crossings = &mut walk.cell.crossings;
        crossings.sort_by_key(|c| c.key);
        crossings.dedup_by_key(|c| c.key);
        let mut cuts: Vec<[u64; 2]> = walk.cell.cuts.iter().map(|cut| cut.keys).collect();
        cuts.sort_unstable();
        for start in 0..crossings.len() {
            let mut at = start;
            while crossings[at].in_loop == NOT_LOOPED {
                crossings[at].in_loop = walk.cell.loops;
                let cut = cuts.binary_search_by_key(&crossings[at].key, |[enter, _]| *enter);
                let leave = cut.map(|n| cuts[n][1]).map_err(|_| broken(self.own.key))?;
                let next = crossings.binary_search_by_key(&leave, |c| c.key);
                at = next.map_err(|_| broken(self.own.key))?;
            }
            if crossings[start].in_loop == walk.cell.loops {
                walk.cell.loops += 1;
            }
        }
        Ok(walk.cell)
    }
}

/// Turns a part of a ring round: each edge then starts where it ended.
fn reverse(part: &mut [(Option<LoopCrossing>, bool)]) {
    for (crossing, starts) in part.iter_mut() {
        *starts ^= crossing.is_some();
    }
    part.reverse();
}
