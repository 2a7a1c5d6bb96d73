//! Samples and crossings of a brick of a union of solids.
//!
//! Every sign-changing edge has one end inside. From there the intervals of the solids on the edge's line are followed, each
//! to the end of what holds the end before: parts of a tool only touch. The last one bounds the union; of several, the first.

use super::line::IntervalEnd;
use super::solid::SweptSolid;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, inside_from};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};
use crate::solid::normal_code;

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Lines of a block along each axis, and blocks of a brick.
const BLOCK: usize = 8;
const BLOCKS: usize = P.div_ceil(BLOCK);
/// Bits of a whole row.
const ALL: u64 = (1 << P) - 1;

/// Gaps of fewer units between two solids are rounding: parts of a tool touch.
const TOUCH: f64 = 1e-6;

/// Where a brick's samples lie, in units.
#[derive(Clone, Copy)]
struct Lattice {
    origin: [f64; 3],
    step: f64,
}

impl Lattice {
    fn of(key: NodeKey) -> Lattice {
        let step = f64::from(1u32 << key.spacing_bits());
        Lattice { origin: key.base().map(|base| f64::from(base + 1)), step }
    }

    /// The coordinate of a sample: a whole number.
    fn at(&self, axis: usize, index: usize) -> f64 {
        self.origin[axis] + index as f64 * self.step
    }

    /// The first sample along an axis that is not below a coordinate; 33 stands for none.
    fn first_from(&self, axis: usize, t: f64) -> usize {
        let near = ((t - self.origin[axis]) / self.step).clamp(0.0, P as f64);
        let mut index = (near as usize).min(P);
        // By the sample's own coordinate, so that all bricks decide alike.
        while index > 0 && self.at(axis, index - 1) >= t {
            index -= 1;
        }
        while index < P && self.at(axis, index) < t {
            index += 1;
        }
        index
    }

    /// The samples along an axis within bounds.
    fn within(&self, axis: usize, [low, high]: [[f64; 3]; 2]) -> std::ops::Range<usize> {
        self.first_from(axis, low[axis])..self.first_from(axis, high[axis])
    }
}

/// The end of a solid on an edge that reaches farthest.
#[derive(Clone, Copy)]
struct Best {
    depth: f64,
    solid: u32,
    end: IntervalEnd,
}

/// Working memory for evaluating bricks one after the other; one per thread.
#[derive(Default)]
pub struct SweptEvaluator {
    /// By row, the intervals of solids that have added samples or may bound edges.
    spans: Vec<Vec<(u32, IntervalEnd, IntervalEnd)>>,
    /// Of the axis at hand, by blocks of lines along it: the solids that may meet these, and those of them that are parts of
    /// tools.
    near: Vec<(Vec<u32>, Vec<u32>)>,
}

impl SweptEvaluator {
    /// The brick of the union of the solids with these numbers: samples are 1 inside and 0 outside. Others than those that
    /// touch the brick are ignored.
    pub fn brick(&mut self, key: NodeKey, solids: &[SweptSolid], list: &[u32]) -> Brick {
        let lattice = Lattice::of(key);
        let signs = self.signs(lattice, solids, list);
        let rows = |row: usize| signs.row(row % P, row / P);
        if (0..P * P).all(|row| rows(row) == 0) {
            return Brick::Uniform(0);
        }
        if (0..P * P).all(|row| rows(row) == ALL) {
            return Brick::Uniform(1);
        }
        let mut samples = Samples::filled(0);
        for (row, ws) in samples.0.chunks_exact_mut(P).enumerate() {
            let bits = rows(row);
            ws.iter_mut().enumerate().for_each(|(i, w)| *w = i16::from(bits >> i & 1 == 1));
        }
        let edges = [self.edges_along_rows(lattice, solids, &signs), Vec::new(), Vec::new()];
        let mut hermite = Hermite { edges };
        for axis in [Axis::Y, Axis::Z] {
            self.sort(lattice, solids, list, axis);
            hermite.edges[axis.index()] = self.edges_across(lattice, solids, &signs, axis);
        }
        Brick::Counts { samples, hermite }
    }

    /// Which samples lie inside.
    fn signs(&mut self, lattice: Lattice, solids: &[SweptSolid], list: &[u32]) -> SignChanges {
        let mut signs = SignChanges::outside();
        self.spans.resize(P * P, Vec::new());
        self.spans.iter_mut().for_each(Vec::clear);
        for &number in list {
            let solid = &solids[number as usize];
            let bounds = solid.bounds();
            let js = lattice.within(1, bounds);
            for k in lattice.within(2, bounds) {
                for j in js.clone() {
                    let bits = signs.row(j, k);
                    if bits == ALL {
                        continue;
                    }
                    let at = [0.0, lattice.at(1, j), lattice.at(2, k)];
                    let Some(interval) = solid.line(0, at) else { continue };
                    self.spans[k * P + j].push((number, interval.low, interval.high));
                    let first = lattice.first_from(0, interval.low.at);
                    let end = lattice.first_from(0, interval.high.at);
                    if first < end {
                        let mask = inside_from(1, first) & !(if end < P { inside_from(1, end) } else { 0 });
                        signs.set_row(j, k, bits | mask);
                    }
                }
            }
        }
        signs
    }

    /// Sorts solids by the blocks of lines along an axis that they may meet.
    fn sort(&mut self, lattice: Lattice, solids: &[SweptSolid], list: &[u32], axis: Axis) {
        self.near.resize(BLOCKS * BLOCKS, (Vec::new(), Vec::new()));
        for (all, parts) in &mut self.near {
            all.clear();
            parts.clear();
        }
        let blocks = |range: std::ops::Range<usize>| range.start / BLOCK..range.end.div_ceil(BLOCK);
        let [u, v] = axis.others_in_order().map(Axis::index);
        for &number in list {
            let solid = &solids[number as usize];
            let [us, vs] = [u, v].map(|axis| blocks(lattice.within(axis, solid.bounds())));
            for block in vs.flat_map(|v| us.clone().map(move |u| v * BLOCKS + u)) {
                let (all, parts) = &mut self.near[block];
                all.push(number);
                if solid.is_touched(axis.index()) {
                    parts.push(number);
                }
            }
        }
    }

    /// The crossings of edges along x, from the rows' own intervals.
    fn edges_along_rows(
        &self,
        lattice: Lattice,
        solids: &[SweptSolid],
        signs: &SignChanges,
    ) -> Vec<HermiteEdge> {
        let mut edges = Vec::new();
        signs.for_edges(Axis::X, |ijk| {
            let search = Search::new(lattice, signs, Axis::X, ijk);
            let best = search.follow(&self.spans[ijk[2] * P + ijk[1]]);
            edges.push(search.finish(best, solids));
        });
        edges
    }

    /// Those of edges across the rows, from the intervals of their own lines.
    fn edges_across(
        &self,
        lattice: Lattice,
        solids: &[SweptSolid],
        signs: &SignChanges,
        axis: Axis,
    ) -> Vec<HermiteEdge> {
        let (mut edges, mut spans, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        signs.for_edges(axis, |ijk| {
            let search = Search::new(lattice, signs, axis, ijk);
            spans.clear();
            let mut inside = ijk;
            inside[axis.index()] += usize::from(search.upper);
            let [u, v] = axis.others_in_order().map(|axis| ijk[axis.index()] / BLOCK);
            let (all, parts) = &self.near[v * BLOCKS + u];
            let row = &self.spans[inside[2] * P + inside[1]];
            if signs.row(inside[1], inside[2]) == ALL {
                // Solids that added nothing to the row are not kept there.
                search.gather(solids, all, &mut spans);
            } else {
                let x = search.at_inside()[0];
                let holds = |(_, low, high): &&(u32, IntervalEnd, IntervalEnd)| {
                    low.at <= x + TOUCH && x <= high.at + TOUCH
                };
                numbers.clear();
                numbers.extend(row.iter().filter(holds).map(|(number, ..)| *number));
                search.gather(solids, &numbers, &mut spans);
                search.gather(solids, parts, &mut spans);
            }
            let best = search.follow(&spans);
            edges.push(search.finish(best, solids));
        });
        edges
    }
}

/// One edge, and the solid that bounds the union on it.
struct Search {
    axis: usize,
    /// A point of its line.
    at: [f64; 3],
    /// The coordinate of its inside end.
    inside: f64,
    /// Whether that is its upper end.
    upper: bool,
    step: f64,
}

impl Search {
    fn new(lattice: Lattice, signs: &SignChanges, axis: Axis, lower: [usize; 3]) -> Search {
        let upper = !signs.is_inside(lower);
        let a = axis.index();
        let at = [0, 1, 2].map(|a| lattice.at(a, lower[a]));
        let inside = lattice.at(a, lower[a] + usize::from(upper));
        Search { axis: a, at, inside, upper, step: lattice.step }
    }

    /// The inside end.
    fn at_inside(&self) -> [f64; 3] {
        let mut at = self.at;
        at[self.axis] = self.inside;
        at
    }

    /// Adds the intervals of solids that may have a part in the edge.
    fn gather(&self, solids: &[SweptSolid], list: &[u32], spans: &mut Vec<(u32, IntervalEnd, IntervalEnd)>) {
        for &number in list {
            let solid = &solids[number as usize];
            let [low, high] = solid.bounds();
            if self.misses(low[self.axis], high[self.axis]) {
                continue;
            }
            if let Some(interval) = solid.line(self.axis, self.at) {
                spans.push((number, interval.low, interval.high));
            }
        }
    }

    /// Whether what lies between two coordinates has no part in the edge.
    fn misses(&self, low: f64, high: f64) -> bool {
        let outside = if self.upper { self.inside - self.step } else { self.inside + self.step };
        let (from, to) = (self.inside.min(outside), self.inside.max(outside));
        high < from - TOUCH || low > to + TOUCH
    }

    /// From the inside end to where no interval leads on.
    fn follow(&self, spans: &[(u32, IntervalEnd, IntervalEnd)]) -> Option<Best> {
        let (mut best, mut reached): (Option<Best>, f64) = (None, 0.0);
        loop {
            let from = if self.upper { self.inside - reached } else { self.inside + reached };
            let mut next: Option<Best> = None;
            for &(solid, low, high) in spans {
                if low.at > from + TOUCH || high.at < from - TOUCH {
                    continue;
                }
                let end = if self.upper { low } else { high };
                let depth = if self.upper { self.inside - end.at } else { end.at - self.inside };
                if depth > next.map_or(reached, |next| next.depth) || (best.is_none() && next.is_none()) {
                    next = Some(Best { depth, solid, end });
                }
            }
            match next {
                Some(next) if best.is_none() || next.depth > reached => {
                    (best, reached) = (Some(next), next.depth.max(0.0));
                }
                _ => return best,
            }
            if reached >= self.step {
                return best;
            }
        }
    }

    /// The crossing. Where rounding has all lines miss the sample, its own place stands in.
    fn finish(&self, best: Option<Best>, solids: &[SweptSolid]) -> HermiteEdge {
        let depth = best.map_or(0.0, |best| best.depth).clamp(0.0, self.step);
        let inside = depth / self.step;
        let fraction = if self.upper { 1.0 - inside } else { inside };
        let offset = ((fraction * 65536.0 + 0.5) as u32).min(65535) as u16;
        let outward = if self.upper { -1 } else { 1 };
        let normal = match &best {
            Some(best) => {
                let direction = solids[best.solid as usize].outward(self.axis, self.at, &best.end);
                normal_code(direction, self.axis, outward)
            }
            None => {
                let mut unit = [0; 3];
                unit[self.axis] = outward;
                OctNormal::from_integer(unit)
            }
        };
        HermiteEdge { offset, normal }
    }
}
