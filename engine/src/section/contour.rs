//! The boundary in a plane as closed polylines, by marching squares over the finest lattice.
//!
//! The plane is cut into tiles of 32 × 32 squares of the finest level. Every corner has one sign, that of the brick which
//! owns it, and every edge one passage, so loops close whatever the levels of the bricks are: each passage is where one
//! square's stretch of the boundary ends and the next one's begins.

use super::at_hand::{AtHand, Held, trilinear};
use super::face::Layer;
use super::plane::Plane;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_BITS, BRICK_CELLS, BRICK_POINTS, NodeKey, ROOT_BITS, spacing_bits};
use crate::progress::Progress;
use crate::store::BrickTree;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Tiles that a thread takes at once: a row of them lies close together in the file.
const TILES_AT_ONCE: usize = 16;
/// Memory of a point of a loop while loops are joined.
const POINT_BYTES: u64 = 96;

/// Bounds of the work.
#[derive(Clone, Copy, Debug)]
pub struct ContourLimits {
    /// Deepest level to use; `None` for all.
    pub level: Option<u8>,
    /// Bytes that points may take.
    pub memory_bytes: u64,
}

/// Closed polylines in a plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contour {
    /// World coordinates by the axes of [`Plane::sides`], first to the right and second upward: the inside lies to the left
    /// of every loop. The last point is joined to the first.
    pub loops: Vec<Vec<[f64; 2]>>,
    /// What they enclose, in square world units.
    pub area: f64,
    /// Their length.
    pub length: f64,
}

/// Numbers of edges: lower end and side.
type EdgeId = u64;

/// What a tile adds.
#[derive(Default)]
struct Part {
    /// Passages with their places, in cells from the root's first sample.
    points: Vec<(EdgeId, [f64; 2])>,
    /// Stretches of the boundary from passage to passage.
    stretches: Vec<(EdgeId, EdgeId)>,
}

/// The boundary w = 0.5 in a plane. Reads the leaves that the plane and the boundary pass, on all threads. Corners of the
/// result lie on the edges of the finest lattice.
///
/// # Errors
/// [`Error::Setting`] if there are more points than `limits` allow; [`Error::Interrupted`]; what reading the tree gives.
pub fn contour(
    tree: &dyn BrickTree,
    plane: Plane,
    limits: ContourLimits,
    progress: &dyn Progress,
) -> Result<Contour> {
    let deepest = tree.keys().last().map_or(0, |key| key.level());
    let level = limits.level.unwrap_or(deepest).min(deepest);
    let root = tree.root();
    let height = root.from_first_sample(plane.point([root.origin[0]; 2], plane.at))[plane.axis.index()];
    if !(0.0..f64::from(1u32 << ROOT_BITS)).contains(&height) {
        return Ok(Contour::default());
    }
    let squares = Squares { tree, plane, level, height };
    let tiles: Vec<[u32; 2]> = squares.tiles().into_iter().map(|[v, u]| [u, v]).collect();
    progress.phase("contouring", Some(tiles.len() as u64), "tiles");
    let points_max = limits.memory_bytes / POINT_BYTES;
    let mut whole = Part::default();
    for chunk in tiles.chunks(TILES_AT_ONCE * rayon::current_num_threads().max(1) * 4) {
        progress.check()?;
        let parts: Vec<Part> =
            chunk.par_chunks(TILES_AT_ONCE).map(|tiles| squares.several(tiles)).collect::<Result<_>>()?;
        for part in parts {
            whole.points.extend(part.points);
            whole.stretches.extend(part.stretches);
        }
        if whole.points.len() as u64 > points_max {
            return Err(Error::setting(
                format!("the contour has more than {points_max} points"),
                "allow more with --memory, or choose a coarser level with --level",
            ));
        }
        progress.advance(chunk.len() as u64);
    }
    let cell = root.spacing(level);
    let [right, up] = plane.sides().map(|side| root.to_world([1.0; 3])[side.index()]);
    Contour::of(whole, |[u, v]| [right + u * cell, up + v * cell])
}

/// The plane as squares of a level's lattice.
struct Squares<'a> {
    tree: &'a dyn BrickTree,
    plane: Plane,
    level: u8,
    /// In units from the root's first sample.
    height: f64,
}

/// A tile's corners: signs, and what they come from.
struct Corners {
    /// By v, bits by u.
    inside: [u64; BRICK_POINTS],
}

impl Squares<'_> {
    /// The tiles that the boundary may pass, by v and u, in the order of rows.
    fn tiles(&self) -> BTreeSet<[u32; 2]> {
        let mut tiles = BTreeSet::new();
        for key in self.tree.keys() {
            let Some(node) = self.tree.node(key) else { continue };
            let is_seen = node.leaf && key.level() <= self.level || key.level() == self.level;
            if !is_seen || node.min >= 1 || node.max < 1 || !self.passes(key) {
                continue;
            }
            let up = self.level - key.level();
            let [u, v] = self.plane.within(key.position()).map(|p| p << up);
            // A square at the upper border has corners that the next tile owns.
            for v in v.saturating_sub(1)..v + (1 << up) {
                for u in u.saturating_sub(1)..u + (1 << up) {
                    tiles.insert([v, u]);
                }
            }
        }
        tiles
    }

    fn passes(&self, key: NodeKey) -> bool {
        let from = f64::from(key.base()[self.plane.axis.index()]);
        let edge = f64::from(1u32 << (ROOT_BITS - u32::from(key.level())));
        (from..from + edge).contains(&self.height)
    }

    fn several(&self, tiles: &[[u32; 2]]) -> Result<Part> {
        let mut part = Part::default();
        let mut at_hand = AtHand::new(self.tree, self.level);
        for &tile in tiles {
            // The next tile's bricks are in part this one's.
            if at_hand.count() > 8 {
                at_hand.clear();
            }
            self.tile(tile, &mut at_hand, &mut part)?;
        }
        Ok(part)
    }

    /// Position of a corner, in units from the root's first sample.
    fn units(&self, corner: [u32; 2]) -> [f64; 3] {
        let cell = f64::from(1u32 << spacing_bits(self.level));
        self.plane.point(corner.map(|c| f64::from(c) * cell), self.height)
    }

    fn tile(&self, tile: [u32; 2], at_hand: &mut AtHand<'_>, part: &mut Part) -> Result<()> {
        const LAST: usize = BRICK_CELLS;
        let first = tile.map(|t| t << BRICK_BITS);
        let mut corners = Corners { inside: [0; BRICK_POINTS] };
        // The tile's own corners, then those of the tiles to the right, above, and across.
        for [du, dv] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let from = [first[0] + du * LAST as u32, first[1] + dv * LAST as u32];
            let Some(held) = at_hand.at(self.units(from))? else { continue };
            let owner = Owner::of(self, held);
            let count = |d: u32| if d == 0 { LAST } else { 1 };
            for v in 0..count(dv) {
                for u in 0..count(du) {
                    let corner = [from[0] + u as u32, from[1] + v as u32];
                    let [u, v] = [u + du as usize * LAST, v + dv as usize * LAST];
                    corners.inside[v] |= u64::from(owner.is_inside(corner)) << u;
                }
            }
        }
        if corners.inside == [0; BRICK_POINTS] {
            return Ok(());
        }
        let Some(held) = at_hand.at(self.units(first))? else { return Ok(()) };
        let owner = Owner::of(self, held);
        corners.passages(first, &owner, &mut part.points);
        corners.stretches(first, &mut part.stretches);
        Ok(())
    }
}

/// A brick that owns corners.
struct Owner<'a> {
    squares: &'a Squares<'a>,
    held: &'a Held,
    /// Of a brick of the squares' own level that is not uniform.
    layer: Option<Layer<'a>>,
}

impl<'a> Owner<'a> {
    fn of(squares: &'a Squares<'a>, held: &'a Held) -> Owner<'a> {
        let axis = squares.plane.axis.index();
        let height = (squares.height - held.base[axis]) / held.spacing;
        let is_finest = held.key.level() == squares.level;
        let layer = is_finest.then(|| Layer::new(&held.brick, squares.plane, height)).flatten();
        Owner { squares, held, layer }
    }

    /// Samples on the root's own faces count as outside, so that every loop closes.
    fn is_inside(&self, corner: [u32; 2]) -> bool {
        let last = (BRICK_CELLS as u32) << self.squares.level;
        if corner.iter().any(|&c| c == 0 || c >= last) {
            return false;
        }
        match &self.layer {
            Some(layer) => layer.is_inside(corner.map(|c| c as usize % BRICK_CELLS)),
            None => self.value(corner) >= 0.5,
        }
    }

    /// w between the samples of a coarser brick, each taken as 0 to 1, so that overlaps move nothing.
    fn value(&self, corner: [u32; 2]) -> f64 {
        let local = self.held.local(self.squares.units(corner));
        trilinear(&self.held.brick, local, |w| w.clamp(0.0, 1.0))
    }

    /// Where along an edge from a corner, 0..1, the boundary passes.
    fn passage(&self, corner: [u32; 2], side: usize) -> f64 {
        if let Some(layer) = &self.layer {
            return layer.passage(corner.map(|c| c as usize % BRICK_CELLS), side);
        }
        let mut end = corner;
        end[side] += 1;
        let [a, b] = [corner, end].map(|corner| self.value(corner));
        let at = (0.5 - a) / (b - a);
        if (0.0..=1.0).contains(&at) { at } else { 0.5 }
    }
}

impl Corners {
    fn is_inside(&self, [u, v]: [usize; 2]) -> bool {
        self.inside[v] >> u & 1 == 1
    }

    /// Passages on the edges whose lower end the tile owns.
    fn passages(&self, first: [u32; 2], owner: &Owner<'_>, points: &mut Vec<(EdgeId, [f64; 2])>) {
        for v in 0..BRICK_CELLS {
            let row = self.inside[v];
            for (side, changes) in [row ^ row >> 1, row ^ self.inside[v + 1]].into_iter().enumerate() {
                for u in (0..BRICK_CELLS).filter(|u| changes >> u & 1 == 1) {
                    let corner = [first[0] + u as u32, first[1] + v as u32];
                    let mut at = corner.map(f64::from);
                    at[side] += owner.passage(corner, side);
                    points.push((edge(corner, side), at));
                }
            }
        }
    }

    /// Stretches through the tile's squares, the inside to their left. Of two opposite corners each is kept for itself.
    fn stretches(&self, first: [u32; 2], stretches: &mut Vec<(EdgeId, EdgeId)>) {
        for v in 0..BRICK_CELLS {
            for u in 0..BRICK_CELLS {
                let around =
                    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| self.is_inside([u + du, v + dv]));
                let at = |du: usize, dv: usize| [first[0] + (u + du) as u32, first[1] + (v + dv) as u32];
                // From each corner to the next one, counter-clockwise.
                let edges = || [edge(at(0, 0), 0), edge(at(1, 0), 1), edge(at(0, 1), 0), edge(at(0, 0), 1)];
                if around == [true; 4] || around == [false; 4] {
                    continue;
                }
                let edges = edges();
                for leaving in (0..4).filter(|&n| around[n] && !around[(n + 1) % 4]) {
                    // Back along the corners inside to where they begin.
                    let mut entering = (leaving + 3) % 4;
                    while around[entering] {
                        entering = (entering + 3) % 4;
                    }
                    stretches.push((edges[leaving], edges[entering]));
                }
            }
        }
    }
}

/// The number of the edge from a corner to the right (0) or upward (1).
fn edge([u, v]: [u32; 2], side: usize) -> EdgeId {
    u64::from(v) << 32 | u64::from(u) << 1 | side as u64
}

impl Contour {
    /// Joins stretches to loops, each beginning at its first edge.
    fn of(part: Part, world: impl Fn([f64; 2]) -> [f64; 2]) -> Result<Contour> {
        let Part { mut points, mut stretches } = part;
        points.par_sort_unstable_by_key(|(edge, _)| *edge);
        stretches.par_sort_unstable_by_key(|(from, _)| *from);
        let fit = points.len() == stretches.len()
            && points.iter().zip(&stretches).all(|((edge, _), (from, _))| edge == from);
        let find = |edge: EdgeId| points.binary_search_by_key(&edge, |(edge, _)| *edge).ok();
        let next: Option<Vec<usize>> = stretches.iter().map(|(_, to)| find(*to)).collect();
        let Some(next) = next.filter(|_| fit) else {
            return Err(Error::setting(
                "the tree contradicts itself",
                "check the store with `brickfield verify` and build it again",
            ));
        };
        let mut contour = Contour::default();
        let mut is_done = vec![false; points.len()];
        for first in 0..points.len() {
            let mut line: Vec<[f64; 2]> = Vec::new();
            let mut at = first;
            while !std::mem::replace(&mut is_done[at], true) {
                let point = world(points[at].1);
                if line.last() != Some(&point) {
                    line.push(point);
                }
                at = next[at];
            }
            if line.len() > 1 && line.first() == line.last() {
                line.pop();
            }
            if line.len() > 2 {
                contour.add(line);
            }
        }
        Ok(contour)
    }

    fn add(&mut self, line: Vec<[f64; 2]>) {
        let from = line[0];
        for (a, b) in line.iter().zip(line.iter().cycle().skip(1)) {
            // About a point of the loop, so that nothing large cancels.
            let [[ax, ay], [bx, by]] = [a, b].map(|p| [p[0] - from[0], p[1] - from[1]]);
            self.area += (ax * by - bx * ay) / 2.0;
            self.length += ((bx - ax).powi(2) + (by - ay).powi(2)).sqrt();
        }
        self.loops.push(line);
    }
}
