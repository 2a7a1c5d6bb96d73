//! Lines beside the samples of a brick, and where a segment's solid meets them.

use super::body::Body;
use super::brick_lattice::BrickLattice;
use super::eight_lines::{LANES, LinePlaces, eight_lines};
use super::segment::Segment;
use super::segments::Solids;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};

/// Lines that wait until there are eight of them.
struct Waiting {
    count: usize,
    lines: [usize; LANES],
    places: LinePlaces,
}

impl Waiting {
    /// Calls `each` with the lines that meet the body, and forgets them all.
    #[inline]
    fn ask(&mut self, body: &Body, axis: Axis, each: &mut impl FnMut(usize, (f64, f64))) {
        let [from, to] = eight_lines(body, axis, &self.places);
        for lane in 0..std::mem::take(&mut self.count) {
            if from[lane] < to[lane] {
                each(self.lines[lane], (from[lane], to[lane]));
            }
        }
    }
}

/// Calls `each` with the lines along an axis that a segment's solid meets, numbered k·33 + j by the other two axes in their
/// order, and where it begins and ends there, in units from the root's corner. Lines stand beyond the samples (j, k) by what `beside` says,
/// in cells from 0 to 1, by the other two axes: at (0, 0) they pass the samples.
pub fn for_lines(
    solids: &Solids,
    key: NodeKey,
    segment: &Segment,
    axis: Axis,
    beside: impl Fn(usize, usize) -> [f64; 2],
    mut each: impl FnMut(usize, (f64, f64)),
) {
    let lattice = BrickLattice::of(key);
    let (body, bounds) = (solids.body(segment), solids.bounds(segment));
    let a = axis.index();
    let [u, v] = axis.others_in_order().map(Axis::index);
    let (from, step) = (f64::from(segment.a[a]), f64::from(1u32 << lattice.shift));
    // A line may stand almost a cell beyond its sample.
    let near = |axis: usize| {
        let within = lattice.within(axis, bounds);
        within.start.saturating_sub(1)..within.end
    };
    let mut put = |line: usize, (first, last): (f64, f64)| each(line, (from + first, from + last));
    let mut waiting = Waiting { count: 0, lines: [0; LANES], places: [[0.0; LANES]; 2] };
    for k in near(v) {
        let z = lattice.offset(segment.a, v, k);
        for j in near(u) {
            let off = beside(j, k);
            let n = waiting.count;
            waiting.lines[n] = k * BRICK_POINTS + j;
            waiting.places[0][n] = lattice.offset(segment.a, u, j) + off[0] * step;
            waiting.places[1][n] = z + off[1] * step;
            waiting.count += 1;
            if waiting.count == LANES {
                waiting.ask(&body, axis, &mut put);
            }
        }
    }
    if waiting.count > 0 {
        waiting.ask(&body, axis, &mut put);
    }
}
