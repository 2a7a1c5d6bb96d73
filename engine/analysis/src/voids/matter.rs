//! What the source has within a node: the triangles, or the segments of beads, that touch it.

use super::cells::CellBits;
use super::covered::{ROWS, solid_cells};
use crate::brick::{Brick, Hermite, point_index, point_position};
use crate::error::Result;
use crate::lattice::{
    BRICK_CELLS, BRICK_POINTS, CubeTest, MAX_LEVEL, NodeKey, RootCube, Triangle, Units, bounds, has_area,
    normal,
};
use crate::progress::Progress;
use crate::solid::{Segment, Solids};
use crate::soup::{Facets, runs};
use crate::winding::{Evaluator, TriangleList};
use rayon::prelude::*;
use std::collections::HashMap;

/// log₂ of the cells of a node along an axis.
const CELL_BITS: usize = BRICK_CELLS.ilog2() as usize;
/// Runs of triangles that are read between two looks at whether the user interrupts.
const RUNS_AT_ONCE: usize = 64;

/// The source within a node.
#[derive(Clone, Debug)]
pub(super) enum Matter {
    Triangles(Vec<Triangle>),
    Segments(Vec<Segment>),
}

/// w at the corners of a node's children.
pub(super) type Corners = [[[i16; 3]; 3]; 3];

impl Matter {
    /// Whether nothing touches the node.
    pub fn is_empty(&self) -> bool {
        match self {
            Matter::Triangles(triangles) => triangles.is_empty(),
            Matter::Segments(segments) => segments.is_empty(),
        }
    }

    /// What is known of a node's cells; of triangles also the samples, from that at the node's corner on.
    pub fn evaluate(
        &self,
        key: NodeKey,
        corner: i16,
        solids: Option<&Solids>,
    ) -> Result<(CellBits, Option<Brick>)> {
        match (self, solids) {
            (Matter::Segments(segments), Some(solids)) => Ok((of_segments(key, solids, segments), None)),
            (Matter::Segments(_), None) => Ok((CellBits::void(), None)),
            (Matter::Triangles(triangles), _) => {
                let (known, brick) = of_triangles(key, corner, triangles)?;
                Ok((known, Some(brick)))
            }
        }
    }

    /// What of it touches a child.
    pub fn of_child(&self, child: NodeKey, solids: Option<&Solids>) -> Matter {
        let (low, size) = cube(child);
        match (self, solids) {
            (Matter::Segments(segments), Some(solids)) => Matter::Segments(
                segments.iter().filter(|s| solids.touches_cube(s, low, size)).copied().collect(),
            ),
            (Matter::Segments(_), None) => Matter::Segments(Vec::new()),
            (Matter::Triangles(triangles), _) => {
                Matter::Triangles(triangles.iter().filter(|t| touches(t, low, size)).copied().collect())
            }
        }
    }
}

/// w at the corners of the children of a node with these samples.
pub(super) fn corners(brick: &Brick) -> Corners {
    let half = BRICK_CELLS / 2;
    let at = |x: usize, y: usize, z: usize| brick.sample([x * half, y * half, z * half]);
    std::array::from_fn(|x| std::array::from_fn(|y| std::array::from_fn(|z| at(x, y, z))))
}

/// Lower corner and size of a node, from its first sample to its last.
fn cube(key: NodeKey) -> (Units, i32) {
    (key.base().map(|b| b + 1), (BRICK_CELLS as i32) << key.spacing_bits())
}

fn meets((min, max): &(Units, Units), low: Units, size: i32) -> bool {
    (0..3).all(|a| min[a] <= low[a] + size && max[a] >= low[a])
}

fn touches(t: &Triangle, low: Units, size: i32) -> bool {
    meets(&bounds(t), low, size) && CubeTest::new(t, size).touches(low)
}

/// What a thing does to a cube.
enum Part {
    Misses,
    Fills,
    Touches,
}

/// Goes down from a node to the cells that a thing touches. `part` is asked of cubes and of how often these were halved.
fn descend(
    key: NodeKey,
    halvings: usize,
    at: [usize; 3],
    part: &mut impl FnMut(Units, i32, usize) -> Part,
    each: &mut impl FnMut([usize; 3]),
) {
    let cells = BRICK_CELLS >> halvings;
    let bits = key.spacing_bits();
    let low = [0, 1, 2].map(|a| key.base()[a] + 1 + ((at[a] as i32) << bits));
    if !matches!(part(low, (cells as i32) << bits, halvings), Part::Touches) {
        return;
    }
    if cells == 1 {
        return each(at);
    }
    for octant in 0..8usize {
        let child = [0, 1, 2].map(|a| at[a] + (octant >> a & 1) * cells / 2);
        descend(key, halvings + 1, child, part, each);
    }
}

fn of_segments(key: NodeKey, solids: &Solids, segments: &[Segment]) -> CellBits {
    let mut known = CellBits { solid: solid_cells(solids, key, segments), ..CellBits::void() };
    for segment in segments {
        let bounds = solids.bounds(segment);
        let mut part = |low: Units, size: i32, _: usize| {
            if !meets(&bounds, low, size) || !solids.touches_cube(segment, low, size) {
                Part::Misses
            } else if solids.covers_cube(segment, low, size) {
                Part::Fills
            } else {
                Part::Touches
            }
        };
        descend(key, 0, [0; 3], &mut part, &mut |[i, j, k]| known.touched[k * BRICK_POINTS + j] |= 1 << i);
    }
    known
}

fn of_triangles(key: NodeKey, corner: i16, triangles: &[Triangle]) -> Result<(CellBits, Brick)> {
    let indices: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut evaluator = Evaluator::default();
    let list = TriangleList { array: triangles, indices: &indices };
    let evaluation = evaluator.evaluate(key, corner, list)?;
    let (signs, samples) = (evaluation.signs.clone(), evaluation.samples.clone());
    let mut known = CellBits::void();
    // By cell, the triangles that touch it.
    let mut touching: Vec<(u32, u32)> = Vec::new();
    for (number, triangle) in triangles.iter().enumerate() {
        let bounds = bounds(triangle);
        let size = |halvings: usize| (BRICK_CELLS as i32 >> halvings) << key.spacing_bits();
        let tests: [CubeTest; CELL_BITS + 1] = std::array::from_fn(|n| CubeTest::new(triangle, size(n)));
        let mut part = |low: Units, size: i32, halvings: usize| {
            let is_near = meets(&bounds, low, size) && tests[halvings].touches(low);
            if is_near { Part::Touches } else { Part::Misses }
        };
        descend(key, 0, [0; 3], &mut part, &mut |[i, j, k]| {
            known.touched[k * BRICK_POINTS + j] |= 1 << i;
            touching.push((point_index([i, j, k]) as u32, number as u32));
        });
    }
    let brick = Brick::Counts { samples, hermite: Hermite::default() };
    let mut solid_though_touched = vec![0u64; ROWS];
    touching.sort_unstable();
    for cell in touching.chunk_by(|a, b| a.0 == b.0) {
        let n = cell[0].0 as usize;
        let at = point_position(n);
        let row = at[2] * BRICK_POINTS + at[1];
        match settled(key, &brick, at, cell.iter().map(|&(_, number)| &triangles[number as usize])) {
            Some(true) => solid_though_touched[row] |= 1 << at[0],
            Some(false) => known.touched[row] &= !(1 << at[0]),
            None => {}
        }
    }
    for (row, (solid, touched)) in known.solid.iter_mut().zip(&known.touched).enumerate() {
        // A cell that nothing touches is as the sample at its corner.
        *solid = signs.row(row % BRICK_POINTS, row / BRICK_POINTS) & !touched | solid_though_touched[row];
    }
    Ok((known, brick))
}

/// Whether a cell is solid, or void, as a whole, whatever the triangles that touch it do there.
///
/// The way from a corner of the cell to any place in it is straight, so it crosses a triangle once at most, and always from the
/// side on which the corner lies. That tells whether w grows or falls there, and so what it is at most and at least.
fn settled<'a>(
    key: NodeKey,
    brick: &Brick,
    at: [usize; 3],
    triangles: impl Iterator<Item = &'a Triangle> + Clone,
) -> Option<bool> {
    let corners = (0..8usize).map(|n| [0, 1, 2].map(|a| at[a] + (n >> a & 1)));
    let is_solid = brick.sample(at) >= 1;
    if corners.clone().any(|corner| (brick.sample(corner) >= 1) != is_solid) {
        return None;
    }
    let is_settled = |corner: [usize; 3]| {
        let p = [0, 1, 2].map(|a| key.base()[a] + 1 + ((corner[a] as i32) << key.spacing_bits()));
        let outside = triangles.clone().filter(|t| is_outside(t, p)).count() as i64;
        let inside = triangles.clone().count() as i64 - outside;
        let w = i64::from(brick.sample(corner));
        if is_solid { w - inside >= 1 } else { w + outside < 1 }
    };
    corners.into_iter().any(is_settled).then_some(is_solid)
}

/// Whether a sample lies on the side of a triangle's plane to which its normal points, by the rule for ties.
fn is_outside(t: &Triangle, p: Units) -> bool {
    let normal = normal(t);
    let height: i128 = (0..3).map(|a| i128::from(normal[a]) * i128::from(p[a] - t[0][a])).sum();
    let first = normal.into_iter().find(|c| *c != 0).unwrap_or_default();
    if height == 0 { first > 0 } else { height > 0 }
}

/// The triangles that touch each of some nodes, snapped to the lattice, in the order of the sources.
///
/// # Errors
/// If the user interrupts.
pub(super) fn gather(
    sources: &[&dyn Facets],
    root: RootCube,
    keys: &[NodeKey],
    progress: &dyn Progress,
) -> Result<Vec<Vec<Triangle>>> {
    let places: HashMap<NodeKey, usize> = keys.iter().enumerate().map(|(n, key)| (*key, n)).collect();
    let levels: Vec<u8> =
        (0..=MAX_LEVEL).filter(|level| keys.iter().any(|key| key.level() == *level)).collect();
    let snap = root.snapper();
    let of_run = |(source, range): &(usize, std::ops::Range<u64>)| {
        let mut facets = Vec::new();
        sources[*source].read(range.clone(), &mut facets);
        let mut found: Vec<(usize, Triangle)> = Vec::new();
        for facet in &facets {
            let triangle: Triangle = facet.map(snap);
            if has_area(&triangle) {
                for_nodes(&triangle, &levels, keys, &places, |n| found.push((n, triangle)));
            }
        }
        found
    };
    let mut lists = vec![Vec::new(); keys.len()];
    for group in runs(sources).chunks(RUNS_AT_ONCE) {
        progress.check()?;
        let parts: Vec<Vec<(usize, Triangle)>> = group.par_iter().map(of_run).collect();
        parts.into_iter().flatten().for_each(|(n, triangle)| lists[n].push(triangle));
    }
    Ok(lists)
}

/// Calls `each` with the nodes that a triangle touches.
fn for_nodes(
    triangle: &Triangle,
    levels: &[u8],
    keys: &[NodeKey],
    places: &HashMap<NodeKey, usize>,
    mut each: impl FnMut(usize),
) {
    let (min, max) = bounds(triangle);
    for &level in levels {
        let bits = crate::lattice::spacing_bits(level) + CELL_BITS as u32;
        // Nodes reach from one unit above their base to one unit above the next one's, so both count at such a place.
        let ends =
            [0, 1, 2].map(|a| [(min[a] - 2).max(0) as u32 >> bits, (max[a].max(1) - 1) as u32 >> bits]);
        let count: u64 = ends.iter().map(|[from, to]| u64::from(to - from + 1)).product();
        if count > keys.len() as u64 {
            for (n, key) in keys.iter().enumerate().filter(|(_, key)| key.level() == level) {
                let (low, size) = cube(*key);
                if touches(triangle, low, size) {
                    each(n);
                }
            }
            continue;
        }
        for z in ends[2][0]..=ends[2][1] {
            for y in ends[1][0]..=ends[1][1] {
                for x in ends[0][0]..=ends[0][1] {
                    let Some(key) = NodeKey::new(level, [x, y, z]) else { continue };
                    let Some(&n) = places.get(&key) else { continue };
                    let (low, size) = cube(key);
                    if touches(triangle, low, size) {
                        each(n);
                    }
                }
            }
        }
    }
}
