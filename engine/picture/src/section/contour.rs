//! The boundary in a plane as closed polylines, by marching squares over the finest lattice.
//!
//! The plane is cut into tiles of 32 × 32 squares of the finest level. Every corner has one sign, that of the brick
//! which owns it, and every edge one passage, so loops close whatever the levels of the bricks are.
//!
//! Each passage is where one square's stretch of the boundary ends and the next one's begins. Within its square a
//! stretch bends as the normals at its ends say. A brick of a coarser level is asked for the boundary in its own,
//! larger squares.

use super::brick_finder::{BrickFinder, PlacedBrick, tell_places};
use super::cell::stretches;
use super::face::{Layer, PlaneCrossing};
use super::join::{Contour, ContourSegment, EdgeId, EdgePoint, TileContour, edge};
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
const POINT_BYTES: u64 = 256;

/// Bounds of the work.
#[derive(Clone, Copy, Debug)]
pub struct ContourLimits {
    /// Deepest level to use; `None` for all.
    pub level: Option<u8>,
    /// Bytes that points may take.
    pub memory_bytes: u64,
}

/// The boundary w = 0.5 in a plane. Reads the leaves that the plane and the boundary pass, on all threads. Corners of the
/// result lie on the edges of the finest lattice, and within its squares where the boundary bends there.
///
/// # Errors
/// [`Error::Setting`] if there are more points than `limits` allow; [`Error::Interrupted`]; what reading the tree gives.
pub fn contour(
    tree: &dyn BrickTree,
    plane: Plane,
    limits: ContourLimits,
    progress: &dyn Progress,
) -> Result<Contour> {
    let deepest = tree.deepest_level();
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
    let mut whole = TileContour::default();
    let at_once = TILES_AT_ONCE * rayon::current_num_threads().max(1) * 4;
    for (number, chunk) in tiles.chunks(at_once).enumerate() {
        progress.check()?;
        squares.tell(&tiles[number * at_once..tiles.len().min((number + 2) * at_once)]);
        let parts: Vec<TileContour> =
            chunk.par_chunks(TILES_AT_ONCE).map(|tiles| squares.several(tiles)).collect::<Result<_>>()?;
        for part in parts {
            whole.points.extend(part.points);
            whole.stretches.extend(part.stretches);
        }
        if whole.points.len() as u64 > points_max {
            return Err(Error::setting(
                format!("the contour has more than {points_max} points"),
                "allow more with `memory`, or choose a coarser level with `level`",
            ));
        }
        progress.advance(chunk.len() as u64);
    }
    let cell = root.spacing(level);
    let [right, up] = plane.sides().map(|side| root.to_world([1.0; 3])[side.index()]);
    Contour::of(whole, cell, |[u, v]| [right + u * cell, up + v * cell])
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

    /// Tells which bricks tiles look at.
    fn tell(&self, tiles: &[[u32; 2]]) {
        let corners = [[0, 0], [1, 0], [0, 1], [1, 1]];
        let corners = tiles.iter().flat_map(|[u, v]| corners.map(|[du, dv]| [u + du, v + dv]));
        let places = corners.map(|corner| self.units(corner.map(|c| c << BRICK_BITS)));
        tell_places(self.tree, self.level, places);
    }

    fn passes(&self, key: NodeKey) -> bool {
        let from = f64::from(key.base()[self.plane.axis.index()]);
        let edge = f64::from(1u32 << (ROOT_BITS - u32::from(key.level())));
        (from..from + edge).contains(&self.height)
    }

    fn several(&self, tiles: &[[u32; 2]]) -> Result<TileContour> {
        let mut part = TileContour::default();
        let mut at_hand = BrickFinder::new(self.tree, self.level);
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

    fn tile(&self, tile: [u32; 2], at_hand: &mut BrickFinder<'_>, part: &mut TileContour) -> Result<()> {
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
    held: &'a PlacedBrick,
    /// The boundary in the brick's own squares, if it is not uniform.
    layer: Option<&'a Layer>,
    /// Cells of the squares along one of these.
    ratio: u32,
}

impl<'a> Owner<'a> {
    fn of(squares: &'a Squares<'a>, held: &'a PlacedBrick) -> Owner<'a> {
        let layer = held.layer(squares.plane, squares.height);
        Owner { squares, held, layer, ratio: 1 << (squares.level - held.key.level()) }
    }

    /// A corner in the brick's own samples from its first one.
    fn local(&self, corner: [u32; 2]) -> [f64; 2] {
        self.squares.plane.within(self.held.local(self.squares.units(corner)))
    }

    /// Samples on the root's own faces count as outside, so that every loop closes.
    fn is_inside(&self, corner: [u32; 2]) -> bool {
        let last = (BRICK_CELLS as u32) << self.squares.level;
        if corner.iter().any(|&c| c == 0 || c >= last) {
            return false;
        }
        let Some(layer) = self.layer else { return self.held.brick.sample([0; 3]) >= 1 };
        match self.ratio {
            1 => layer.is_inside(corner.map(|c| c as usize % BRICK_CELLS)),
            _ => layer.is_inside_at(self.local(corner)),
        }
    }

    /// Where along an edge from a corner the boundary passes; the bound is in cells of the squares.
    fn passage(&self, corner: [u32; 2], side: usize) -> PlaneCrossing {
        let Some(layer) = self.layer else { return PlaneCrossing::UNKNOWN };
        let ratio = f64::from(self.ratio);
        let local = self.local(corner);
        let low = local.map(|c| c as usize);
        let part: [f64; 2] = std::array::from_fn(|n| local[n] - low[n] as f64);
        if self.ratio == 1 {
            return layer.passage(low, side);
        }
        if part[1 - side] > 0.0 {
            let cell = layer.cell(low);
            return cell.map_or(PlaneCrossing::UNKNOWN, |cell| cell.passage(part, side, 1.0 / ratio));
        }
        // Along one of the brick's own edges.
        let PlaneCrossing { at, normal, bound } = layer.passage(low, side);
        let at = (at - part[side]) * ratio;
        if !(0.0..=1.0).contains(&at) {
            return PlaneCrossing::UNKNOWN;
        }
        PlaneCrossing { at, normal, bound: bound * ratio }
    }
}

impl Corners {
    fn is_inside(&self, [u, v]: [usize; 2]) -> bool {
        self.inside[v] >> u & 1 == 1
    }

    /// Passages on the edges whose lower end the tile owns.
    fn passages(&self, first: [u32; 2], owner: &Owner<'_>, points: &mut Vec<(EdgeId, EdgePoint)>) {
        for v in 0..BRICK_CELLS {
            let row = self.inside[v];
            for (side, changes) in [row ^ row >> 1, row ^ self.inside[v + 1]].into_iter().enumerate() {
                for u in (0..BRICK_CELLS).filter(|u| changes >> u & 1 == 1) {
                    let corner = [first[0] + u as u32, first[1] + v as u32];
                    let mut at = corner.map(f64::from);
                    let PlaneCrossing { at: along, normal, bound } = owner.passage(corner, side);
                    at[side] += along;
                    points.push((edge(corner, side), EdgePoint { at, normal, bound }));
                }
            }
        }
    }

    /// Stretches through the tile's squares, the inside to their left.
    fn stretches(&self, first: [u32; 2], found: &mut Vec<ContourSegment>) {
        for v in 0..BRICK_CELLS {
            for u in 0..BRICK_CELLS {
                let around =
                    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| self.is_inside([u + du, v + dv]));
                if around == [true; 4] || around == [false; 4] {
                    continue;
                }
                let at = |du: usize, dv: usize| [first[0] + (u + du) as u32, first[1] + (v + dv) as u32];
                // From each corner to the next one, counter-clockwise.
                let edges = [edge(at(0, 0), 0), edge(at(1, 0), 1), edge(at(0, 1), 0), edge(at(0, 0), 1)];
                let is_alone = around[0] == around[1] || around[1] == around[2];
                let stretch = |(leaving, entering): (usize, usize)| ContourSegment {
                    from: edges[leaving],
                    to: edges[entering],
                    square: at(0, 0),
                    is_alone,
                };
                found.extend(stretches(around).map(stretch));
            }
        }
    }
}
