//! Walls and gaps between samples, which the samples do not show.

use super::brick_lattice::{BrickLattice, SegmentList};
use super::segment::Segment;
use super::segments::Solids;
use crate::brick::{ThinFeatures, ThinLines, ThinPair};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};

/// Samples along a row.
const P: usize = BRICK_POINTS;

/// What a segment covers of a line, between samples too.
#[derive(Clone, Copy)]
struct Reach {
    /// The line among the 33² of an axis.
    line: u16,
    pass: u32,
    /// Its interval, in units from sample 0.
    from: f64,
    to: f64,
    /// Indices of the first samples that are not below the two ends, 33 for none.
    first: u8,
    end: u8,
    /// Positions in the brick's list of the segments that have the two ends.
    segments: [u32; 2],
}

/// The intervals of all segments on some lines along `axis`.
fn reaches(
    solids: &Solids,
    lattice: BrickLattice,
    list: SegmentList<'_>,
    axis: usize,
    lines: ThinLines,
) -> Vec<Reach> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut out = Vec::new();
    for position in 0..list.indices.len() as u32 {
        let segment = list.get(position);
        let body = solids.body(segment);
        let bounds = solids.bounds(segment);
        for in_v in lattice.within(v, bounds) {
            for in_u in lattice.within(u, bounds).filter(|&in_u| lines.holds(in_u, in_v)) {
                let mut at = [0.0; 3];
                at[u] = lattice.offset(segment.a, u, in_u);
                at[v] = lattice.offset(segment.a, v, in_v);
                let Some((from, to)) = body.line(axis, at) else { continue };
                let shift = f64::from(segment.a[axis] - lattice.origin[axis]);
                out.push(Reach {
                    line: (in_v * P + in_u) as u16,
                    pass: segment.pass,
                    from: from + shift,
                    to: to + shift,
                    first: lattice.first_from(segment, axis, from) as u8,
                    end: lattice.first_from(segment, axis, to) as u8,
                    segments: [position; 2],
                });
            }
        }
    }
    out
}

/// Unites overlapping intervals of sorted ones.
fn unite(sorted: &[Reach], mut each: impl FnMut(Reach)) {
    let mut united = sorted[0];
    for next in &sorted[1..] {
        if next.from <= united.to {
            if next.to > united.to {
                (united.to, united.end) = (next.to, next.end);
                united.segments[1] = next.segments[1];
            }
        } else {
            each(united);
            united = *next;
        }
    }
    each(united);
}

/// The bit of the edge that ends at a sample, none for those outside the brick.
fn edge_before(sample: u8) -> u64 {
    if (1..P as u8).contains(&sample) { 1 << sample } else { 0 }
}

/// Whether a lattice edge along `axis` holds both an entry into a pass and an exit from one.
#[inline]
pub(super) fn crossings(solids: &Solids, lattice: BrickLattice, list: SegmentList<'_>, axis: usize) -> bool {
    let mut all = reaches(solids, lattice, list, axis, ThinLines::All);
    all.sort_unstable_by(|p, q| (p.line, p.pass).cmp(&(q.line, q.pass)).then(p.from.total_cmp(&q.from)));
    all.chunk_by(|p, q| p.line == q.line).any(|line| {
        let (mut entries, mut exits) = (0, 0);
        for pass in line.chunk_by(|p, q| p.pass == q.pass) {
            unite(pass, |united| {
                entries |= edge_before(united.first);
                exits |= edge_before(united.end);
            });
        }
        entries & exits != 0
    })
}

/// Whether an edge along `axis` holds a wall of the union with both faces, or a gap.
#[inline]
pub(super) fn boundary(solids: &Solids, lattice: BrickLattice, list: SegmentList<'_>, axis: usize) -> bool {
    let mut all = reaches(solids, lattice, list, axis, ThinLines::All);
    all.sort_unstable_by(|p, q| p.line.cmp(&q.line).then(p.from.total_cmp(&q.from)));
    all.chunk_by(|p, q| p.line == q.line).any(|line| {
        let (mut entries, mut exits) = (0, 0);
        unite(line, |united| {
            entries |= edge_before(united.first);
            exits |= edge_before(united.end);
        });
        entries & exits != 0
    })
}

/// Adds the walls and gaps of the union with both faces on one edge along `axis`: on all lines those of the apron too, else
/// of the edges that the brick owns.
pub(super) fn add_thin(
    solids: &Solids,
    lattice: BrickLattice,
    list: SegmentList<'_>,
    axis: Axis,
    lines: ThinLines,
    thin: &mut ThinFeatures,
) {
    let mut all = reaches(solids, lattice, list, axis.index(), lines);
    if lines != ThinLines::All {
        all.retain(|reach| {
            usize::from(reach.line) % P < BRICK_CELLS && usize::from(reach.line) / P < BRICK_CELLS
        });
    }
    all.sort_unstable_by(|p, q| {
        p.line.cmp(&q.line).then(p.from.total_cmp(&q.from)).then(p.segments.cmp(&q.segments))
    });
    let spacing = f64::from(1u32 << lattice.shift);
    let mut add = |line: u16, faces: [(f64, u32); 2], is_wall| {
        let normals =
            faces.map(|(at, position)| normal_at(solids, lattice, list.get(position), axis, line, at));
        let chord = ((faces[1].0 - faces[0].0) / spacing * 65536.0).round() as u32;
        thin.add_pair(&ThinPair { axis, normals, chord, spacing_bits: lattice.shift, is_wall });
    };
    for line in all.chunk_by(|p, q| p.line == q.line) {
        let mut last: Option<Reach> = None;
        unite(line, |united| {
            if let Some(last) = last
                && last.end == united.first
                && edge_before(united.first) != 0
            {
                add(united.line, [(last.to, last.segments[1]), (united.from, united.segments[0])], false);
            }
            if united.first == united.end && edge_before(united.first) != 0 {
                let [from, to] = united.segments;
                add(united.line, [(united.from, from), (united.to, to)], true);
            }
            last = Some(united);
        });
    }
}

/// The outward normal of a segment where a line along `axis` meets its surface, `at` units from sample 0.
fn normal_at(
    solids: &Solids,
    lattice: BrickLattice,
    segment: &Segment,
    axis: Axis,
    line: u16,
    at: f64,
) -> [f64; 3] {
    let a = axis.index();
    let mut place = [0.0; 3];
    place[(a + 1) % 3] = lattice.offset(segment.a, (a + 1) % 3, usize::from(line) % P);
    place[(a + 2) % 3] = lattice.offset(segment.a, (a + 2) % 3, usize::from(line) / P);
    place[a] = at - f64::from(segment.a[a] - lattice.origin[a]);
    solids.body(segment).gradient(place)
}
