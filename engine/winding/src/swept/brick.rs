//! Samples and crossings of a brick of a union of solids.
//!
//! Of each lattice line the stretches are kept that lie in the union, with the solid and the surface that end them. Parts of a
//! tool only touch, so what is a rounding apart hangs together. Samples are those of the rows along x. A sign-changing edge
//! has one end inside; the stretch that holds it ends at the crossing. So memory is that of the union, not of the solids.

use super::line::{Interval, IntervalEnd};
use super::solid::SweptSolid;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, inside_from};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};
use crate::solid::normal_code;

/// Samples along a row.
const P: usize = BRICK_POINTS;
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

/// The samples of a brick that decide something, and those beside them; what others are does not matter.
pub struct WantedSamples {
    /// By row, z before y: a bit a sample.
    rows: Box<[u64; P * P]>,
}

impl WantedSamples {
    /// All of them.
    pub fn all() -> WantedSamples {
        WantedSamples { rows: Box::new([ALL; P * P]) }
    }

    /// Those of which some are inside, with their six neighbours: what is next to them places crossings.
    pub fn around(inside: &SignChanges) -> WantedSamples {
        let row = |j: usize, k: usize| inside.row(j, k) & ALL;
        let mut rows = Box::new([0; P * P]);
        for (n, wanted) in rows.iter_mut().enumerate() {
            let (j, k) = (n % P, n / P);
            let own = row(j, k);
            *wanted = (own | own << 1 | own >> 1) & ALL;
            let beside = [(j.wrapping_sub(1), k), (j + 1, k), (j, k.wrapping_sub(1)), (j, k + 1)];
            for (j, k) in beside.into_iter().filter(|(j, k)| *j < P && *k < P) {
                *wanted |= row(j, k);
            }
        }
        WantedSamples { rows }
    }

    /// Whether these are all samples.
    pub fn is_all(&self) -> bool {
        self.rows.iter().all(|row| *row == ALL)
    }

    fn row(&self, j: usize, k: usize) -> u64 {
        self.rows[k * P + j]
    }

    /// Whether both ends of an edge are among them.
    fn has_edge(&self, axis: Axis, lower: [usize; 3]) -> bool {
        let mut upper = lower;
        upper[axis.index()] += 1;
        [lower, upper].into_iter().all(|[i, j, k]| self.row(j, k) >> i & 1 == 1)
    }
}

/// An end of a stretch, and the solid that has it.
#[derive(Clone, Copy)]
struct StretchEnd {
    solid: u32,
    end: IntervalEnd,
}

/// A part of a line that lies in the union, with nothing of it beside.
#[derive(Clone, Copy)]
struct Stretch {
    low: StretchEnd,
    high: StretchEnd,
    /// Whether no gap, not even one of rounding, is known in it: a sample may stand there.
    whole: bool,
}

/// The stretches of one line, in order.
#[derive(Clone, Default)]
struct UnionLine(Vec<Stretch>);

impl UnionLine {
    /// Whether one of them holds all between two coordinates, so that no interval there changes anything.
    fn holds(&self, low: f64, high: f64) -> bool {
        let holds =
            |stretch: &Stretch| stretch.low.end.at <= low && high <= stretch.high.end.at && stretch.whole;
        self.0.iter().any(holds)
    }

    /// Joins an interval of a solid. Of equal ends the first that came stays.
    fn join(&mut self, solid: u32, interval: Interval) {
        let [low, high] = [interval.low, interval.high].map(|end| StretchEnd { solid, end });
        let (from, to) = (interval.low.at - TOUCH, interval.high.at + TOUCH);
        let first = self.0.partition_point(|stretch| stretch.high.end.at < from);
        let met = self.0[first..].iter().take_while(|stretch| stretch.low.end.at <= to).count();
        let mut joined = Stretch { low, high, whole: true };
        for stretch in &self.0[first..first + met] {
            let (low, high) = (stretch.low.end.at, stretch.high.end.at);
            let is_within = interval.low.at <= low && high <= interval.high.at;
            let overlaps = low <= interval.high.at && interval.low.at <= high;
            joined.whole &= is_within || stretch.whole && overlaps;
            if stretch.low.end.at <= joined.low.end.at {
                joined.low = stretch.low;
            }
            if stretch.high.end.at >= joined.high.end.at {
                joined.high = stretch.high;
            }
        }
        match met {
            0 => self.0.insert(first, joined),
            _ => {
                self.0[first] = joined;
                self.0.drain(first + 1..first + met);
            }
        }
    }

    /// The end of the stretch at a coordinate, the lower or the upper one; of several that touch there the farthest.
    fn end_from(&self, at: f64, lower: bool) -> Option<StretchEnd> {
        let holds =
            |stretch: &&Stretch| stretch.low.end.at <= at + TOUCH && at <= stretch.high.end.at + TOUCH;
        let mut held = self.0.iter().filter(holds);
        // In order, so the first has the lowest end and the last the highest.
        if lower {
            held.next().map(|stretch| stretch.low)
        } else {
            held.next_back().map(|stretch| stretch.high)
        }
    }
}

/// Working memory for evaluating bricks one after the other; one per thread.
#[derive(Default)]
pub struct SweptEvaluator {
    /// The lines along one axis.
    lines: Vec<UnionLine>,
}

impl SweptEvaluator {
    /// The brick of the union of the solids with these numbers: samples are 1 inside and 0 outside. Others than those that
    /// touch the brick are ignored. Samples that are not wanted are either, and crossings beside them anywhere.
    pub fn brick(
        &mut self,
        key: NodeKey,
        solids: &[SweptSolid],
        list: &[u32],
        wanted: &WantedSamples,
    ) -> Brick {
        let lattice = Lattice::of(key);
        let signs = self.signs(lattice, solids, list, wanted);
        let rows = |row: usize| signs.row(row % P, row / P);
        if (0..P * P).all(|row| rows(row) & wanted.rows[row] == 0) {
            return Brick::Uniform(0);
        }
        if (0..P * P).all(|row| !rows(row) & wanted.rows[row] == 0) {
            return Brick::Uniform(1);
        }
        let mut samples = Samples::filled(0);
        for (row, ws) in samples.0.chunks_exact_mut(P).enumerate() {
            let bits = rows(row);
            ws.iter_mut().enumerate().for_each(|(i, w)| *w = i16::from(bits >> i & 1 == 1));
        }
        let mut hermite =
            Hermite { edges: [self.edges(lattice, solids, &signs, Axis::X), Vec::new(), Vec::new()] };
        for axis in [Axis::Y, Axis::Z] {
            self.follow_lines(lattice, solids, list, (&signs, wanted, axis));
            hermite.edges[axis.index()] = self.edges(lattice, solids, &signs, axis);
        }
        Brick::Counts { samples, hermite }
    }

    /// Which samples lie inside, with the lines along x; those of rows that are inside all along are not complete.
    fn signs(
        &mut self,
        lattice: Lattice,
        solids: &[SweptSolid],
        list: &[u32],
        wanted: &WantedSamples,
    ) -> SignChanges {
        let mut signs = SignChanges::outside();
        self.clear();
        for &number in list {
            let solid = &solids[number as usize];
            let bounds = solid.bounds();
            let [js, ks] = [1, 2].map(|axis| lattice.within(axis, bounds));
            let lines = solid.lines(0);
            for k in ks {
                for j in js.clone() {
                    let (bits, line) = (signs.row(j, k), &mut self.lines[k * P + j]);
                    if wanted.row(j, k) & !bits == 0 || line.holds(bounds[0][0], bounds[1][0]) {
                        continue;
                    }
                    let at = [0.0, lattice.at(1, j), lattice.at(2, k)];
                    let Some(interval) = lines.meet(at) else { continue };
                    line.join(number, interval);
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

    fn clear(&mut self) {
        self.lines.resize(P * P, UnionLine::default());
        self.lines.iter_mut().for_each(|line| line.0.clear());
    }

    /// The lines along an axis that have sign-changing edges.
    fn follow_lines(
        &mut self,
        lattice: Lattice,
        solids: &[SweptSolid],
        list: &[u32],
        (signs, wanted, axis): (&SignChanges, &WantedSamples, Axis),
    ) {
        self.clear();
        let [u, v] = axis.others_in_order().map(Axis::index);
        // By v, the bits of u.
        let mut crossed = [0u64; P];
        signs.for_edges(axis, |ijk| crossed[ijk[v]] |= u64::from(wanted.has_edge(axis, ijk)) << ijk[u]);
        for &number in list {
            let solid = &solids[number as usize];
            let bounds = solid.bounds();
            let [low, high] = bounds.map(|corner| corner[axis.index()]);
            let (us, lines) = (lattice.within(u, bounds), solid.lines(axis.index()));
            for b in lattice.within(v, bounds) {
                for a in us.clone().filter(|a| crossed[b] >> a & 1 == 1) {
                    let line = &mut self.lines[b * P + a];
                    if line.holds(low, high) {
                        continue;
                    }
                    let mut at = [0.0; 3];
                    (at[u], at[v]) = (lattice.at(u, a), lattice.at(v, b));
                    if let Some(interval) = lines.meet(at) {
                        line.join(number, interval);
                    }
                }
            }
        }
    }

    /// The crossings of the sign-changing edges along an axis, from the lines along it.
    fn edges(
        &self,
        lattice: Lattice,
        solids: &[SweptSolid],
        signs: &SignChanges,
        axis: Axis,
    ) -> Vec<HermiteEdge> {
        let [u, v] = axis.others_in_order().map(Axis::index);
        let mut edges = Vec::new();
        signs.for_edges(axis, |ijk| {
            let edge = CrossedEdge::new(lattice, signs, axis, ijk);
            let end = self.lines[ijk[v] * P + ijk[u]].end_from(edge.inside, edge.upper);
            edges.push(edge.crossing(end, solids));
        });
        edges
    }
}

/// A sign-changing edge.
struct CrossedEdge {
    axis: usize,
    /// A point of its line.
    at: [f64; 3],
    /// The coordinate of its inside end.
    inside: f64,
    /// Whether that is its upper end.
    upper: bool,
    step: f64,
}

impl CrossedEdge {
    fn new(lattice: Lattice, signs: &SignChanges, axis: Axis, lower: [usize; 3]) -> CrossedEdge {
        let upper = !signs.is_inside(lower);
        let a = axis.index();
        let at = [0, 1, 2].map(|a| lattice.at(a, lower[a]));
        let inside = lattice.at(a, lower[a] + usize::from(upper));
        CrossedEdge { axis: a, at, inside, upper, step: lattice.step }
    }

    /// Where the stretch ends that holds the inside end. Where rounding has all lines miss the sample, its own place stands in.
    fn crossing(&self, end: Option<StretchEnd>, solids: &[SweptSolid]) -> HermiteEdge {
        let depth =
            |end: StretchEnd| if self.upper { self.inside - end.end.at } else { end.end.at - self.inside };
        let inside = end.map_or(0.0, depth).clamp(0.0, self.step) / self.step;
        let fraction = if self.upper { 1.0 - inside } else { inside };
        let offset = ((fraction * 65536.0 + 0.5) as u32).min(65535) as u16;
        let outward = if self.upper { -1 } else { 1 };
        let normal = match &end {
            Some(StretchEnd { solid, end }) => {
                let direction = solids[*solid as usize].outward(self.axis, self.at, end);
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
