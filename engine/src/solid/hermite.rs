//! Hermite edges of a union of solids.
//!
//! Every sign-changing edge has one end inside. Of the solids that cover that end, the one that reaches
//! farthest towards the other end bounds the union there. The place comes from the edge's own line; where
//! rounding has that line miss a solid that covers the sample by its row, the sample's own place stands in.

use super::body::Body;
use super::evaluate::{Lattice, Span};
use super::segments::Segment;
use crate::brick::{HermiteEdge, OctNormal, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS};

/// Samples along a row.
const P: usize = BRICK_POINTS;

/// The best candidates so far for each sign-changing edge of a brick.
#[derive(Default)]
pub(super) struct Boundary {
    /// Per axis and row: how many sign-changing edges the rows before hold.
    ranks: [Vec<u32>; 3],
    best: [Vec<Candidate>; 3],
}

/// Where a solid leaves an edge.
#[derive(Clone, Copy)]
struct Candidate {
    /// Units from the edge's inside end; negative before the first candidate.
    depth: f64,
    /// Whether the inside end is the upper one.
    upper_inside: bool,
    normal: OctNormal,
}

impl Boundary {
    /// Begins a brick.
    pub fn begin(&mut self, signs: &SignChanges) {
        let none = Candidate { depth: -1.0, upper_inside: false, normal: OctNormal(0) };
        for axis in Axis::ALL {
            let (ranks, best) = (&mut self.ranks[axis.index()], &mut self.best[axis.index()]);
            ranks.clear();
            let mut count = 0;
            for row in 0..P * P {
                ranks.push(count);
                count += signs.edges(axis, row % P, row / P).count_ones();
            }
            best.clear();
            best.resize(count as usize, none);
        }
    }

    /// Considers a span of a segment for all edges whose inside end it covers.
    #[inline]
    pub fn offer(
        &mut self,
        lattice: Lattice,
        signs: &SignChanges,
        segment: &Segment,
        span: &Span,
        mut body: impl FnMut() -> Body,
    ) {
        let (j, k) = (usize::from(span.row) % P, usize::from(span.row) / P);
        let inside = span.mask();
        let x_edges = signs.edges(Axis::X, j, k);
        let (first, last) = (usize::from(span.first), usize::from(span.end) - 1);
        if first > 0 && x_edges >> (first - 1) & 1 != 0 {
            self.add(lattice, signs, segment, body(), Axis::X, [first, j, k], true, Some(span.interval));
        }
        if last + 1 < P && x_edges >> last & 1 != 0 {
            self.add(lattice, signs, segment, body(), Axis::X, [last, j, k], false, Some(span.interval));
        }
        let mut beyond = |axis: Axis, outside: u64, upper_inside: bool| {
            let mut ends = inside & outside;
            while ends != 0 {
                let i = ends.trailing_zeros() as usize;
                ends &= ends - 1;
                self.add(lattice, signs, segment, body(), axis, [i, j, k], upper_inside, None);
            }
        };
        if j > 0 {
            beyond(Axis::Y, !signs.row(j - 1, k), true);
        }
        if j + 1 < P {
            beyond(Axis::Y, !signs.row(j + 1, k), false);
        }
        if k > 0 {
            beyond(Axis::Z, !signs.row(j, k - 1), true);
        }
        if k + 1 < P {
            beyond(Axis::Z, !signs.row(j, k + 1), false);
        }
    }

    /// Considers a segment for the edge along `axis` that ends inside at `sample`; `interval` is that of its
    /// line, if it is known already.
    #[allow(clippy::too_many_arguments)]
    fn add(
        &mut self,
        lattice: Lattice,
        signs: &SignChanges,
        segment: &Segment,
        body: Body,
        axis: Axis,
        sample: [usize; 3],
        upper_inside: bool,
        interval: Option<(f64, f64)>,
    ) {
        let a = axis.index();
        let mut at = [0, 1, 2].map(|c| lattice.offset(segment, c, sample[c]));
        let depth = match interval.or_else(|| body.line(a, at)) {
            Some((from, _)) if upper_inside => at[a] - from,
            Some((_, to)) => to - at[a],
            None => 0.0,
        };
        let depth = depth.clamp(0.0, f64::from(1u32 << lattice.shift));
        let mut lower = sample;
        lower[a] -= usize::from(upper_inside);
        let row = lower[2] * P + lower[1];
        let before = signs.edges(axis, lower[1], lower[2]) & ((1 << lower[0]) - 1);
        let best = &mut self.best[a][self.ranks[a][row] as usize + before.count_ones() as usize];
        if depth < best.depth {
            return;
        }
        at[a] += if upper_inside { -depth } else { depth };
        let outward = if upper_inside { -1 } else { 1 };
        let normal = normal_code(body.gradient(at), a, outward);
        // Where two solids end in one place, the order of the list must not decide.
        if depth > best.depth || normal < best.normal {
            *best = Candidate { depth, upper_inside, normal };
        }
    }

    /// The edges in the order of a brick.
    pub fn finish(&self, lattice: Lattice) -> [Vec<HermiteEdge>; 3] {
        let spacing = f64::from(1u32 << lattice.shift);
        let edge = |candidate: &Candidate| {
            let inside = candidate.depth / spacing;
            let fraction = if candidate.upper_inside { 1.0 - inside } else { inside };
            let offset = ((fraction * 65536.0 + 0.5) as u32).min(65535) as u16;
            HermiteEdge { offset, normal: candidate.normal }
        };
        [0, 1, 2].map(|a| self.best[a].iter().map(edge).collect())
    }
}

/// The code of a direction; of the edge's own outward one where the formula has none.
fn normal_code(gradient: [f64; 3], axis: usize, outward: i64) -> OctNormal {
    let largest = gradient.iter().fold(0.0f64, |m, c| if c.abs() > m { c.abs() } else { m });
    if largest > 0.0 && largest.is_finite() {
        let scale = f64::from(1u32 << 30) / largest;
        return OctNormal::from_integer(gradient.map(|c| (c * scale) as i64));
    }
    let mut unit = [0; 3];
    unit[axis] = outward;
    OctNormal::from_integer(unit)
}
