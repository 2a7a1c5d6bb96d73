//! Gaps between lines of one layer: where a line may be missing.
//!
//! Two lines that face each other across a void, farther apart than they are wide and with nothing between them, have a
//! gap as wide as their distance less a width, and as long as both run along it. A line that was not laid leaves the largest
//! one, so gaps are listed by their area.

use super::around::{Segments, SurroundingSegments, Tracer};
use super::role::may_be_sparse;
use crate::error::Result;
use crate::lattice::{NodeKey, dot, minus};
use crate::store::BeadSegment;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

/// Lines laid at their width stand a little nearer than that; one missing between makes it twice.
const APART: f64 = 1.25;
/// Lines farther apart than this are on two sides of the part, as those of a loop, and not of a line that is missing.
const FAR: f64 = 3.5;
/// Places along two lines at which what lies between them is asked.
const PLACES: u32 = 16;
/// A gap shorter than this share of a width is the turn of a raster.
const SHORT: f64 = 1.0;
/// Of the angle between two lines that run along each other.
const COSINE: f64 = 0.9;
/// Widths from a centre line to beside its bead.
const BESIDE: f64 = 0.55;
/// Leaves whose segments are kept.
const LEAVES_MOST: usize = 1 << 12;

/// A line at a void.
struct Line {
    number: u64,
    from: [f64; 3],
    to: [f64; 3],
    width: f64,
}

/// Pairs of lines with a gap between them, each of one layer, those of the largest gap first. Sparse infill has gaps of its own,
/// so its lines are left out if `is_sparse`.
///
/// # Errors
/// What reading the store gives.
pub(super) fn gaps(
    around: &SurroundingSegments,
    tracer: &Tracer<'_>,
    is_sparse: bool,
) -> Result<Vec<(u64, u64)>> {
    let tables = tracer.tables();
    let mut layers: BTreeMap<(u32, u32), Vec<Line>> = BTreeMap::new();
    for segment in around.segments().filter(|segment| segment.line > 0) {
        let bead = tables.beads[tables.bead_of(segment.pass).0 as usize];
        if !(is_sparse && may_be_sparse(&tables.features[usize::from(bead.feature)])) {
            layers.entry((bead.source, bead.layer)).or_default().push(Line::of(segment, tracer));
        }
    }
    let mut areas: BTreeMap<(u64, u64), f64> = BTreeMap::new();
    let mut read: BTreeMap<NodeKey, Segments> = BTreeMap::new();
    let mut is_covered = |at: [f64; 3]| {
        // Bricks lie along the walk of a line: the last ones are asked again and again.
        if read.len() > LEAVES_MOST {
            read.clear();
        }
        let Some(key) = tracer.leaf_at(at) else { return Ok(true) };
        let segments = match read.entry(key) {
            Entry::Occupied(held) => held.into_mut(),
            Entry::Vacant(place) => place.insert(tracer.segments(key)?),
        };
        Ok(segments.cover(at))
    };
    for lines in layers.values() {
        let grid = Grid::new(lines);
        for (n, one) in lines.iter().enumerate() {
            for &m in grid.near(one, FAR * grid.width).range(n + 1..) {
                let other = &lines[m];
                let area = area(one, other, &mut is_covered)?;
                if area > 0.0 && one.number != other.number {
                    let pair = (one.number.min(other.number), one.number.max(other.number));
                    *areas.entry(pair).or_default() += area;
                }
            }
        }
    }
    let mut pairs: Vec<((u64, u64), f64)> = areas.into_iter().collect();
    pairs.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    Ok(pairs.into_iter().map(|(pair, _)| pair).collect())
}

impl Line {
    fn of(segment: &BeadSegment, tracer: &Tracer<'_>) -> Line {
        let [from, to] = [segment.a, segment.b].map(|p| p.map(f64::from));
        Line { number: segment.line, from, to, width: tracer.width(segment) }
    }
}

/// The area of the gap between two lines; 0 without one.
fn area(one: &Line, other: &Line, is_covered: &mut impl FnMut([f64; 3]) -> Result<bool>) -> Result<f64> {
    let width = one.width.max(other.width);
    let (p, q) = (minus(one.to, one.from), minus(other.to, other.from));
    let lengths = [dot(p, p).sqrt(), dot(q, q).sqrt()];
    if lengths[0] < width || lengths[1] < width || dot(p, q).abs() < COSINE * lengths[0] * lengths[1] {
        return Ok(0.0);
    }
    // Along the first line, what of it the second one faces.
    let along = p.map(|c| c / lengths[0]);
    let ends = [other.from, other.to].map(|at| dot(minus(at, one.from), along));
    let (low, high) = (ends[0].min(ends[1]).max(0.0), ends[0].max(ends[1]).min(lengths[0]));
    if high - low < SHORT * width {
        return Ok(0.0);
    }
    let piece = (high - low) / f64::from(PLACES);
    let mut area = 0.0;
    let mut length = 0.0;
    for n in 0..PLACES {
        let t = low + (f64::from(n) + 0.5) * piece;
        let here = step(one.from, along, t);
        let there = step(other.from, q, ((t - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0));
        let across = minus(there, here);
        let apart = dot(across, across).sqrt();
        if !(APART * width..FAR * width).contains(&apart) {
            continue;
        }
        // From side to side, at places no farther apart than a quarter of a width.
        let sides = [BESIDE * one.width / apart, 1.0 - BESIDE * other.width / apart];
        let places = (4.0 * apart / width).ceil() as u32;
        let mut is_free = sides[0] < sides[1];
        for n in 0..=places {
            let between = sides[0] + (sides[1] - sides[0]) * f64::from(n) / f64::from(places);
            is_free = is_free && !is_covered(step(here, across, between))?;
        }
        if is_free {
            area += piece * (apart - width);
            length += piece;
        }
    }
    Ok(if length < SHORT * width { 0.0 } else { area })
}

/// Lines by the cells of a plane grid that they pass.
struct Grid<'a> {
    lines: &'a [Line],
    /// The widest one.
    width: f64,
    cells: BTreeMap<[i64; 2], Vec<usize>>,
}

impl<'a> Grid<'a> {
    fn new(lines: &'a [Line]) -> Grid<'a> {
        let width = lines.iter().map(|line| line.width).fold(1.0, f64::max);
        let mut grid = Grid { lines, width, cells: BTreeMap::new() };
        for (n, line) in lines.iter().enumerate() {
            for cell in grid.passed(line, 0.0) {
                grid.cells.entry(cell).or_default().push(n);
            }
        }
        grid
    }

    /// Cells within a distance of places along a line, with those beside them.
    fn passed(&self, line: &Line, reach: f64) -> BTreeSet<[i64; 2]> {
        let side = FAR * self.width;
        let along = minus(line.to, line.from);
        let places = (dot(along, along).sqrt() / side).ceil().max(1.0);
        let mut cells = BTreeSet::new();
        for n in 0..=places as u32 {
            let at = step(line.from, along, f64::from(n) / places);
            let [low, high] = [-1.0, 1.0]
                .map(|way| [0, 1].map(|a| ((at[a] + way * (0.5 * side + reach)) / side).floor() as i64));
            cells.extend((low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| [x, y])));
        }
        cells
    }

    /// The lines within a distance of a line, and some beside.
    fn near(&self, line: &Line, reach: f64) -> BTreeSet<usize> {
        let cells = self.passed(line, reach);
        let found = cells.iter().filter_map(|cell| self.cells.get(cell)).flatten().copied();
        let box_of = |l: &Line, a: usize| (l.from[a].min(l.to[a]), l.from[a].max(l.to[a]));
        found
            .filter(|&n| {
                (0..2).all(|a| {
                    let (own, other) = (box_of(line, a), box_of(&self.lines[n], a));
                    own.0 - reach <= other.1 && other.0 <= own.1 + reach
                })
            })
            .collect()
    }
}

fn step(p: [f64; 3], along: [f64; 3], t: f64) -> [f64; 3] {
    [0, 1, 2].map(|a| p[a] + t * along[a])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(number: u64, from: [f64; 2], to: [f64; 2]) -> Line {
        Line { number, from: [from[0], from[1], 5.0], to: [to[0], to[1], 5.0], width: 10.0 }
    }

    #[test]
    fn a_gap_is_as_large_as_what_is_between() {
        let found = |one: &Line, other: &Line, is_covered: fn([f64; 3]) -> bool| {
            area(one, other, &mut |at| Ok(is_covered(at))).unwrap()
        };
        let one = line(1, [0.0, 0.0], [100.0, 0.0]);
        let other = line(3, [120.0, 20.0], [20.0, 20.0]);
        // Both run along from 20 to 100.
        assert_eq!(found(&one, &other, |_| false), 800.0);
        assert_eq!(found(&one, &other, |at| at[0] > 60.0), 400.0);
        assert_eq!(found(&one, &other, |at| at[1] > 13.0), 0.0);
        // Beside each other at their width, across, far away, and end to end.
        for other in [
            line(2, [0.0, 9.0], [100.0, 9.0]),
            line(2, [50.0, 20.0], [50.0, 90.0]),
            line(2, [0.0, 36.0], [100.0, 36.0]),
            line(2, [100.0, 20.0], [200.0, 20.0]),
        ] {
            assert_eq!(found(&one, &other, |_| false), 0.0);
        }
    }

    #[test]
    fn the_grid_has_all_that_is_near() {
        let mix = |n: u64, most: u64| (crate::lattice::mix(n) % most) as f64;
        let lines: Vec<Line> = (0..200)
            .map(|n| {
                let from = [mix(4 * n, 900), mix(4 * n + 1, 900)];
                line(n, from, [from[0] + mix(4 * n + 2, 300) - 150.0, from[1] + mix(4 * n + 3, 300) - 150.0])
            })
            .collect();
        let grid = Grid::new(&lines);
        for one in &lines {
            let near = grid.near(one, 35.0);
            for (m, other) in lines.iter().enumerate() {
                let places = |l: &Line| [0.0, 0.5, 1.0].map(|t| step(l.from, minus(l.to, l.from), t));
                let apart = places(one).into_iter().flat_map(|p| places(other).map(|q| minus(p, q)));
                if apart.map(|d| dot(d, d).sqrt()).fold(f64::INFINITY, f64::min) <= 35.0 {
                    assert!(near.contains(&m), "{} {m}", one.number);
                }
            }
        }
    }
}
