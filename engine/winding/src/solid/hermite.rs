//! Hermite edges of a union of solids.
//!
//! Every sign-changing edge has one end inside. Of the solids that cover that end, the one that reaches farthest
//! towards the other end bounds the union there; of several, the first of the toolpath.
//!
//! The place comes from the edge's own line; where rounding has that line miss a solid that covers the sample by its
//! row, the sample's own place stands in.

use super::body::Body;
use super::brick_lattice::{BrickLattice, RowSpan, SegmentList};
use super::segments::Solids;
use crate::brick::{HermiteEdge, OctNormal, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS};

/// Samples along a row.
const P: usize = BRICK_POINTS;

/// Working memory for finding the edges of bricks one after the other.
#[derive(Default)]
pub(super) struct HermiteScratch {
    /// Per axis and row: how many sign-changing edges the rows before hold.
    ranks: [Vec<u32>; 3],
    best: [Vec<Candidate>; 3],
    /// The solids of the brick's list, once needed.
    bodies: Vec<Option<Body>>,
}

/// Where a solid leaves an edge.
#[derive(Clone, Copy)]
struct Candidate {
    /// Units from the edge's inside end; negative before the first candidate.
    depth: f64,
    /// Position of the solid's segment in the brick's list.
    position: u32,
    end: End,
}

/// The inside end of a sign-changing edge.
#[derive(Clone, Copy)]
struct End {
    axis: Axis,
    sample: [u8; 3],
    /// Whether it is the upper end.
    upper: bool,
}

impl End {
    /// Its position relative to the first end of a segment.
    #[inline]
    fn at(self, lattice: BrickLattice, a: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| lattice.offset(a, axis, usize::from(self.sample[axis])))
    }
}

/// A brick and the segments that touch it.
#[derive(Clone, Copy)]
pub(super) struct BrickSegments<'a> {
    pub lattice: BrickLattice,
    pub solids: &'a Solids,
    pub list: SegmentList<'a>,
}

impl HermiteScratch {
    /// The Hermite edges along each axis, from the spans of all segments in the order of the toolpath.
    pub fn edges(
        &mut self,
        scene: BrickSegments<'_>,
        signs: &SignChanges,
        spans: &[RowSpan],
    ) -> [Vec<HermiteEdge>; 3] {
        self.begin(scene, signs);
        for span in spans {
            self.offer(scene, signs, span);
        }
        let spacing = f64::from(1u32 << scene.lattice.shift);
        let bodies = &mut self.bodies;
        let mut edge = |candidate: &Candidate| {
            let Candidate { depth, position, end } = *candidate;
            let a = end.axis.index();
            let body = bodies[position as usize].as_ref().expect("its depth came from its body");
            let mut at = end.at(scene.lattice, scene.list.get(position).a);
            at[a] += if end.upper { -depth } else { depth };
            let inside = depth / spacing;
            let fraction = if end.upper { 1.0 - inside } else { inside };
            let offset = ((fraction * 65536.0 + 0.5) as u32).min(65535) as u16;
            HermiteEdge { offset, normal: normal_code(body.gradient(at), a, if end.upper { -1 } else { 1 }) }
        };
        [0, 1, 2].map(|a| self.best[a].iter().map(&mut edge).collect())
    }

    fn begin(&mut self, scene: BrickSegments<'_>, signs: &SignChanges) {
        self.bodies.clear();
        self.bodies.resize(scene.list.indices.len(), None);
        let nobody = End { axis: Axis::X, sample: [0; 3], upper: false };
        let none = Candidate { depth: -1.0, position: 0, end: nobody };
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

    /// Considers a span for all edges whose inside end it covers.
    #[inline]
    fn offer(&mut self, scene: BrickSegments<'_>, signs: &SignChanges, span: &RowSpan) {
        let (j, k) = (usize::from(span.row) % P, usize::from(span.row) / P);
        let inside = span.mask();
        let mut beyond = |axis: Axis, outside: u64, upper: bool| {
            let mut ends = inside & outside;
            while ends != 0 {
                let i = ends.trailing_zeros() as u8;
                ends &= ends - 1;
                self.add(scene, signs, span, End { axis, sample: [i, j as u8, k as u8], upper });
            }
        };
        let row = signs.row(j, k);
        // A neighbour that does not exist counts as inside: no edge leads there.
        beyond(Axis::X, !(row << 1 | 1), true);
        beyond(Axis::X, !(row >> 1 | 1 << (P - 1)), false);
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

    /// Considers the solid of a span for one edge.
    fn add(&mut self, scene: BrickSegments<'_>, signs: &SignChanges, span: &RowSpan, end: End) {
        let a = end.axis.index();
        let mut lower = end.sample.map(usize::from);
        lower[a] -= usize::from(end.upper);
        let before = signs.edges(end.axis, lower[1], lower[2]) & ((1 << lower[0]) - 1);
        let slot = self.ranks[a][lower[2] * P + lower[1]] as usize + before.count_ones() as usize;
        let best = &mut self.best[a][slot];
        let segment = scene.list.get(span.position);
        let body = self.bodies[span.position as usize].get_or_insert_with(|| scene.solids.body(segment));
        let at = end.at(scene.lattice, segment.a);
        // Where segments overlap for long, as along a curve of short ones, most end here.
        let (low, high) = body.extent(a);
        if best.depth >= if end.upper { at[a] - low } else { high - at[a] } {
            return;
        }
        let interval = if a == 0 { Some(span.interval) } else { body.line(a, at) };
        let depth = match interval {
            Some((from, _)) if end.upper => at[a] - from,
            Some((_, to)) => to - at[a],
            None => 0.0,
        };
        let depth = depth.clamp(0.0, f64::from(1u32 << scene.lattice.shift));
        if depth > best.depth {
            *best = Candidate { depth, position: span.position, end };
        }
    }
}

/// The code of a direction; where it is none, of the outward one of an edge along `axis`.
pub fn normal_code(gradient: [f64; 3], axis: usize, outward: i64) -> OctNormal {
    let [x, y, z] = gradient;
    let sum = x.abs() + y.abs() + z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        let mut unit = [0; 3];
        unit[axis] = outward;
        return OctNormal::from_integer(unit);
    }
    // As OctNormal::from_integer does, without its divisions of integers.
    let scale = 32767.0 / sum;
    let [mut u, mut v] = [x, y].map(|c| {
        let scaled = c * scale;
        (if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i32
    });
    if z < 0.0 {
        let sign = |c: f64| if c < 0.0 { -1 } else { 1 };
        (u, v) = ((32767 - v.abs()) * sign(x), (32767 - u.abs()) * sign(y));
    }
    OctNormal(u32::from(u as i16 as u16) | u32::from(v as i16 as u16) << 16)
}
