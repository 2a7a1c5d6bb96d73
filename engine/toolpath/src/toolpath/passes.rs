//! Passes: stretches of a bead that do not come back onto themselves.
//!
//! A path of infill is one bead from the first line to the last, so beads do not tell that its lines overlap. Passes do.
//! Along a bead a new pass begins with the first segment that comes within a bead's width of an earlier stretch of the
//! pass, which
//!
//! - lies farther back along the path than two widths, and than four times its distance: so smooth bends begin none, nor
//!   do corners whose sides enclose more than 29°, however near to the corner their sides overlap;
//! - is of the same layer: along the tool's axis the two are no farther apart than a bead is high;
//! - is not the pass's own beginning, its first two widths, unless it is passed in the opposite direction: so a loop that
//!   closes is one pass, and its end does not count as another.
//!
//! Lines of a raster, loops of a spiral or of concentric infill that hang together, and a line that is retraced, are
//! passes. Segments are never cut. Where several short ones make a turn the new pass begins in the turn's middle.
//!
//! Where a loop goes on into the next, it begins at the place beside the pass's first point. It begins at most three
//! widths before the place where the path was found to come back. Widths are means of the two stretches.
//!
//! All this follows from the toolpath alone, in world units: no lattice and no other bead has a part in it.

mod contact;
mod grid;

use super::{Section, Toolpath, UP};
use crate::lattice::{length, minus};
use contact::{BACK_WIDTHS, Contact, ContactSegment};
use grid::SegmentGrid;
use rayon::prelude::*;
use std::ops::Range;

/// Widths by which a new pass may begin before the place where the path was found to come back.
const BEFORE_WIDTHS: f64 = 3.0;
/// What a path turns by, as the sum of the chords between its unit directions, before it can come back. To come within a
/// quarter of its own length of a place it must turn by 151° in all, and a chord is 2/π of its angle at least.
const TURN_LEAST: f64 = 1.67;
/// Beads looked at by one thread at once.
const BEADS_AT_ONCE: usize = 64;

/// The passes of a toolpath's beads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Passes {
    /// Segments, counted within their bead, with which passes begin that are not the first of their bead.
    starts: Vec<u32>,
    /// Where those of each bead end in `starts`.
    ends: Vec<u32>,
}

impl Passes {
    /// The passes of a toolpath. The threads of the current rayon pool find them, with the same result for any number.
    pub fn new(path: &Toolpath) -> Passes {
        let found: Vec<Vec<u32>> = (0..path.len())
            .into_par_iter()
            .with_min_len(BEADS_AT_ONCE)
            .map_init(SegmentGrid::default, |grid, bead| starts(path, bead, grid))
            .collect();
        let mut passes = Passes::default();
        for starts in found {
            passes.starts.extend(starts);
            passes.ends.push(passes.starts.len() as u32);
        }
        passes
    }

    /// One pass of each bead, whatever its path.
    pub fn whole(path: &Toolpath) -> Passes {
        Passes { starts: Vec::new(), ends: vec![0; path.len()] }
    }

    /// The segments with which the passes of a bead begin, but for the first, in order.
    pub fn starts(&self, bead: usize) -> &[u32] {
        let first = if bead == 0 { 0 } else { self.ends[bead - 1] as usize };
        &self.starts[first..self.ends[bead] as usize]
    }

    /// The passes of a bead as ranges of its segments, of which there are as many as given.
    pub fn of_bead(&self, bead: usize, segments: usize) -> impl Iterator<Item = Range<usize>> {
        let starts = self.starts(bead);
        (0..=starts.len()).map(move |n| {
            let first = if n == 0 { 0 } else { starts[n - 1] as usize };
            first..starts.get(n).map_or(segments, |&next| next as usize)
        })
    }
}

/// The segments with which passes of a bead begin that are not its first.
fn starts(path: &Toolpath, bead: usize, grid: &mut SegmentGrid) -> Vec<u32> {
    let mut found = Vec::new();
    let Some(mut walk) = Walk::new(path, bead, grid) else { return found };
    for number in 1..walk.segments() {
        walk.remember_before(number);
        if let Some(contact) = walk.contact(number) {
            let start = walk.start(number, &contact);
            found.push(start as u32);
            walk.begin(start);
        }
    }
    found
}

/// A walk along a bead.
struct Walk<'a> {
    path: &'a Toolpath,
    bead: usize,
    points: &'a [[f64; 3]],
    /// Way along the bead to each point.
    way: Vec<f64>,
    /// What the path has turned by before each segment.
    turn: Vec<f64>,
    /// Largest width, and the smallest.
    widest: f64,
    narrowest: f64,
    /// Segments of the pass that are in the grid, by number: from `first` to `known`.
    first: usize,
    known: usize,
    grid: &'a mut SegmentGrid,
}

impl<'a> Walk<'a> {
    /// At the bead's beginning; `None` if it is too short to come back.
    fn new(path: &'a Toolpath, bead: usize, grid: &'a mut SegmentGrid) -> Option<Walk<'a>> {
        let points = path.points(bead);
        if points.len() < 3 {
            return None;
        }
        let (mut widest, mut narrowest, mut highest) = (0.0, f64::INFINITY, 0.0);
        let mut before = Section { width: f64::NAN, height: f64::NAN };
        for number in 0..points.len() - 1 {
            let section = path.section(bead, number);
            if section != before {
                widest = section.width.max(widest);
                narrowest = section.width.min(narrowest);
                highest = section.height.max(highest);
                before = section;
            }
        }
        let (way, turn) = ways(points);
        let length = way[way.len() - 1];
        // Both are also false for what is not finite.
        if !(length > BACK_WIDTHS * narrowest && length + highest < f64::INFINITY && narrowest > 0.0) {
            return None;
        }
        let is_upright = (0..points.len()).all(|point| path.axis(bead, point) == UP);
        let up = highest * contact::HEIGHTS;
        let reach = if is_upright { [widest, widest, up] } else { [widest.max(up); 3] };
        grid.reset(reach, length, points.len());
        Some(Walk { path, bead, points, way, turn, widest, narrowest, first: 0, known: 0, grid })
    }

    fn segments(&self) -> usize {
        self.points.len() - 1
    }

    fn stretch(&self, number: usize) -> ContactSegment {
        let Section { width, height } = self.path.section(self.bead, number);
        ContactSegment {
            a: self.points[number],
            b: self.points[number + 1],
            way: (self.way[number], self.way[number + 1]),
            width,
            height,
        }
    }

    /// Puts all segments into the grid that can be earlier stretches for a segment.
    fn remember_before(&mut self, number: usize) {
        let until = self.way[number + 1] - BACK_WIDTHS * self.narrowest;
        let turned = self.turn[number] - TURN_LEAST;
        while self.known < number && self.way[self.known] < until && self.turn[self.known] < turned {
            self.grid.insert(self.known as u32, self.points[self.known], self.points[self.known + 1]);
            self.known += 1;
        }
    }

    /// The first place found where a segment comes back to the pass.
    fn contact(&self, number: usize) -> Option<Contact> {
        if self.known == self.first {
            return None;
        }
        let here = self.stretch(number);
        let axis = self.path.axis(self.bead, number);
        let begun = self.way[self.first];
        self.grid.find(here.a, here.b, |earlier| {
            // What does not come near is most of all, so that is asked first.
            let e = earlier as usize;
            let (a, b) = (self.points[e], self.points[e + 1]);
            let reach = 0.5 * ((self.way[e + 1] - self.way[e]) + (here.way.1 - here.way.0)) + self.widest;
            let between = [0, 1].map(|i| a[i] + b[i] - here.a[i] - here.b[i]);
            if axis == UP && between[0] * between[0] + between[1] * between[1] > 4.0 * reach * reach {
                return None;
            }
            here.contact(&self.stretch(e), axis, begun)
        })
    }

    /// The segment with which the pass begins that a segment's contact asks for.
    fn start(&self, number: usize, contact: &Contact) -> usize {
        let Contact { earlier, here, is_opposite, width } = *contact;
        let place = if is_opposite { 0.5 * (earlier + here) } else { here - earlier + self.way[self.first] };
        let is_near = place >= self.way[number] - BEFORE_WIDTHS * width;
        let place = if is_near { place - 1e-6 * width } else { self.way[number] };
        let after = self.first + 1;
        after + self.way[after..number].partition_point(|&way| way < place)
    }

    fn begin(&mut self, start: usize) {
        self.first = start;
        self.known = start;
        self.grid.clear();
    }
}

/// The way along a path to each point, and the sum of turns before each segment.
fn ways(points: &[[f64; 3]]) -> (Vec<f64>, Vec<f64>) {
    let (mut ways, mut turns) = (Vec::with_capacity(points.len()), Vec::with_capacity(points.len()));
    let (mut way, mut turn, mut before) = (0.0, 0.0, None);
    ways.push(way);
    for pair in points.windows(2) {
        let step = minus(pair[1], pair[0]);
        let size = length(step);
        let direction = step.map(|c| if size > 0.0 { c / size } else { 0.0 });
        turn += before.map_or(0.0, |before| length(minus(direction, before)));
        before = Some(direction);
        way += size;
        ways.push(way);
        turns.push(turn);
    }
    (ways, turns)
}

#[cfg(test)]
mod tests;
