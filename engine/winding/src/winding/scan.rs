//! Crossings of one triangle with the axis-parallel lines of a lattice.
//!
//! Every sample p counts as p + (ε, ε², ε³) (simulation of simplicity, Edelsbrunner & Mücke 1990), so a line meets a
//! triangle or does not, and a crossing lies before a sample or behind it, never on it.
//!
//! Both questions are answered in f64 under error bounds, row by row of lines, and settled in integers where a bound
//! does not decide. The first takes three edge functions in 64 bits, the second a quotient in 128 bits.

use super::edges::{EdgeMasks, LowerRange};
use super::lines::{AllEdges, EdgeSelection, LINES_MAX, ROWS, Sixteenth};
use crate::brick::ThinLines;
use crate::lattice::{Triangle, normal};
use crate::wide::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdFrom, SimdMask, f64x4, i32x4, mask64x4, u64x4,
};

/// A cubic block of samples `0..=last` along each axis, `1 << shift` units apart, sample 0 at the origin.
#[derive(Clone, Copy, Debug)]
pub struct SampleCube {
    /// log₂ of the spacing.
    pub shift: u32,
    /// Index of the last sample along an axis.
    pub last: i32,
}

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeCrossing {
    /// Index of the line along the axis after the crossed one in cyclic order (x → y → z → x).
    pub u: i32,
    /// Index of the line along the remaining axis.
    pub v: i32,
    /// Index of the sample before the crossing; the next one lies behind it. Where a function says
    /// so, the last sample's index stands for a crossing that lies between no two.
    pub lower: i32,
    /// Distance from that sample in 1/65536 of the spacing, rounded to nearest and at most 65535.
    pub offset: u16,
}

/// A triangle relative to sample 0 of a block, with what all three axes need.
pub struct ScanFacet {
    vertices: [[i32; 3]; 3],
    /// Twice the area vector.
    pub normal: [i64; 3],
    /// First and last line index that the bounding box meets, per axis, clipped to the block or just outside it.
    first: [i8; 3],
    last: [i8; 3],
    /// Largest size of a vertex's coordinate.
    size: i32,
}

// Bricks of few levels have ten thousands of them, scanned once for each axis.
const _: () = assert!(size_of::<ScanFacet>() == 72);

/// A number for each axis, and a zero.
#[inline(always)]
fn point<S: Simd>(simd: S, [x, y, z]: [i32; 3]) -> i32x4<S> {
    i32x4::simd_from(simd, [x, y, z, 0])
}

/// Without the fourth.
#[inline(always)]
fn axes<S: Simd>(numbers: i32x4<S>) -> [i32; 3] {
    let [x, y, z, _] = numbers.into();
    [x, y, z]
}

impl ScanFacet {
    /// `None` if the triangle meets no line of the block or has no area.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, t: &Triangle, origin: [i32; 3], block: SampleCube) -> Option<ScanFacet> {
        let base = point(simd, origin);
        let (p, q, r) = (point(simd, t[0]) - base, point(simd, t[1]) - base, point(simd, t[2]) - base);
        let (min, max) = (p.min(q).min(r), p.max(q).max(r));
        let below = (1 << block.shift) - 1;
        let first = ((min + below) >> block.shift).max(0).min(LINES_MAX);
        let last = (max >> block.shift).max(-1).min(block.last);
        // A line along one axis needs a line index along both others.
        let met = first.simd_le(last).to_bitmask() & 7;
        if met.count_ones() < 2 {
            return None;
        }
        let vertices = [axes(p), axes(q), axes(r)];
        let normal = normal(&vertices);
        let size = max.max(-min).reduce_max();
        let narrow = |lines: [i32; 3]| lines.map(|line| line as i8);
        let (first, last) = (narrow(axes(first)), narrow(axes(last)));
        (normal != [0; 3]).then_some(ScanFacet { vertices, normal, first, last, size })
    }

    /// Whether two facets have a vertex in common.
    pub fn shares_vertex(&self, other: &ScanFacet) -> bool {
        self.vertices.iter().any(|vertex| other.vertices.contains(vertex))
    }

    /// First and last line index along an axis.
    #[inline(always)]
    fn lines(&self, axis: usize) -> (i32, i32) {
        (self.first[axis].into(), self.last[axis].into())
    }

    /// Largest size of a coordinate of a vertex and of a line together: bounds rounding errors.
    #[inline(always)]
    fn reach(&self, block: SampleCube) -> f64 {
        f64::from(self.size) + f64::from(LINES_MAX + 1) * power_of_two(block.shift as i32)
    }

    /// The change of the winding number along `axis` at a crossing: entering through a facet whose outward
    /// normal points back adds one.
    #[inline]
    pub fn jump(&self, axis: usize) -> i32 {
        -(self.normal[axis].signum() as i32)
    }

    /// Calls `hit` for every crossing with a line along axis `A` whose (u, v) indices do not exceed the
    /// limits and that lies between two samples of the block.
    #[inline(always)]
    pub fn scan<S: Simd, const A: usize>(
        &self,
        simd: S,
        block: SampleCube,
        limit: [i32; 2],
        mut hit: impl FnMut(EdgeCrossing),
    ) {
        self.scan_lines::<S, A>(simd, block, limit, |c| {
            if c.lower < block.last {
                hit(c);
            }
        });
    }

    /// The same with crossings that, as at the last sample, lie between no two.
    #[inline(always)]
    pub fn scan_lines<S: Simd, const A: usize>(
        &self,
        simd: S,
        block: SampleCube,
        limit: [i32; 2],
        hit: impl FnMut(EdgeCrossing),
    ) {
        self.scan_chosen::<S, A>(simd, block, limit, &AllEdges, hit);
    }

    /// Whether one of some lines along `axis` may meet the triangle, by its bounding box; many small ones lie between them.
    #[inline(always)]
    pub fn may_meet(&self, axis: usize, lines: ThinLines) -> bool {
        let ((u, last_u), (v, last_v)) = (self.lines((axis + 1) % 3), self.lines((axis + 2) % 3));
        let (across, along) = (last_u - u + 1, last_v - v + 1);
        if across <= 0 || along <= 0 {
            return false;
        }
        let mut near = (v..=last_v).take(2).flat_map(|v| (u..=last_u).take(2).map(move |u| (u, v)));
        across > 2 || along > 2 || near.any(|(u, v)| lines.holds(u as usize, v as usize))
    }

    /// Calls `hit` for every crossing along axis `A` on some of the lines, between samples or not.
    #[inline(always)]
    pub fn scan_some<S: Simd, const A: usize>(
        &self,
        simd: S,
        block: SampleCube,
        lines: ThinLines,
        hit: impl FnMut(EdgeCrossing),
    ) {
        let limit = [block.last; 2];
        match lines {
            ThinLines::All => self.scan_chosen::<S, A>(simd, block, limit, &AllEdges, hit),
            ThinLines::Sixteenth => self.scan_chosen::<S, A>(simd, block, limit, &Sixteenth, hit),
        }
    }

    /// Calls `hit` for every crossing along axis `A` of one of the edges, and for some others: those close to such
    /// edges and, as at the last sample, those that lie between no two. To leave them out here would take a branch that
    /// no processor foresees.
    #[inline(always)]
    pub fn scan_edges<S: Simd, const A: usize>(
        &self,
        simd: S,
        block: SampleCube,
        edges: &EdgeMasks,
        hit: impl FnMut(EdgeCrossing),
    ) {
        // No vertex has the coordinate of a sample, so the bounding box begins behind the sample before its
        // first one.
        let (first, last) = self.lines(A);
        let end = (last + 1).clamp(0, block.last);
        let lowers = LowerRange::new((first - 1).clamp(0, end) as usize..end as usize);
        self.scan_chosen::<S, A>(simd, block, [block.last; 2], &EdgeSubset { edges, lowers }, hit);
    }

    #[inline(always)]
    fn scan_chosen<S: Simd, const A: usize>(
        &self,
        simd: S,
        block: SampleCube,
        limit: [i32; 2],
        choice: &impl EdgeSelection,
        hit: impl FnMut(EdgeCrossing),
    ) {
        let (u, v) = ((A + 1) % 3, (A + 2) % 3);
        let [lines_u, lines_v] = [(u, limit[0]), (v, limit[1])].map(|(axis, limit)| {
            let (first, last) = self.lines(axis);
            (first, last.min(limit))
        });
        if lines_u.0 > lines_u.1 || lines_v.0 > lines_v.1 || self.normal[A] == 0 {
            return;
        }
        // Fewer, longer rows.
        if lines_v.1 - lines_v.0 <= lines_u.1 - lines_u.0 {
            self.sweep::<S, A, false>(simd, block, lines_u, lines_v, choice, hit);
        } else {
            self.sweep::<S, A, true>(simd, block, lines_v, lines_u, choice, hit);
        }
    }

    /// Visits the lines inside the triangle row by row: along u in rows of equal v, or the other way round
    /// if `SWAP`. Ranges are (first, last).
    #[inline(always)]
    fn sweep<S: Simd, const A: usize, const SWAP: bool>(
        &self,
        simd: S,
        block: SampleCube,
        steps: (i32, i32),
        rows: (i32, i32),
        choice: &impl EdgeSelection,
        mut hit: impl FnMut(EdgeCrossing),
    ) {
        debug_assert!(block.last < LINES_MAX, "the lines of a row are bits of a word");
        let within = (u64::MAX >> (63 - steps.1)) & (u64::MAX << steps.0);
        let mut row = rows.0;
        let mut lines = asked::<S, SWAP>(simd, choice, (row, rows.1), within);
        while !any_bit(simd, lines) {
            row += ROWS as i32;
            if row > rows.1 {
                return;
            }
            lines = asked::<S, SWAP>(simd, choice, (row, rows.1), within);
        }
        let edges = Edges::new::<S, A, SWAP>(simd, self, block);
        let depth = Depth::new::<A, SWAP>(self, block);
        loop {
            let spans: [u64; ROWS] = edges.spans::<S, A, SWAP>(simd, row, lines).into();
            for (mut lines, row) in spans.into_iter().zip(row..) {
                let along = depth.row(row);
                while lines != 0 {
                    let line = lines.trailing_zeros() as i32;
                    lines &= lines - 1;
                    let (u, v) = if SWAP { (row, line) } else { (line, row) };
                    let at = depth.locate::<A>(self, block, along, line, (u, v));
                    let lower = (at >> 16).min(block.last as u64) as i32;
                    hit(EdgeCrossing { u, v, lower, offset: at as u16 });
                }
            }
            row += ROWS as i32;
            if row > rows.1 {
                return;
            }
            lines = asked::<S, SWAP>(simd, choice, (row, rows.1), within);
        }
    }
}

/// All lines of as many rows as there are words before the middle, none of the others.
const FIRST_ROWS: [u64; 2 * ROWS] = [u64::MAX, u64::MAX, u64::MAX, u64::MAX, 0, 0, 0, 0];

// Functions, here and below: a closure may stay a call, compiled for the narrowest vectors.

/// The lines of [`ROWS`] rows that matter, up to the last row.
#[inline(always)]
fn asked<S: Simd, const SWAP: bool>(
    simd: S,
    choice: &impl EdgeSelection,
    (row, last): (i32, i32),
    within: u64,
) -> u64x4<S> {
    let rows = (last + 1 - row).min(ROWS as i32) as usize;
    let within_rows = u64x4::from_slice(simd, &FIRST_ROWS[ROWS - rows..][..ROWS]);
    choice.lines(simd, SWAP, row as usize) & within_rows & u64x4::splat(simd, within)
}

/// Whether any bit is set.
#[inline(always)]
fn any_bit<S: Simd>(simd: S, bits: u64x4<S>) -> bool {
    bits.simd_ne(u64x4::splat(simd, 0)).any_true()
}

/// Those of a set that begin at some samples of their lines.
struct EdgeSubset<'a> {
    edges: &'a EdgeMasks,
    lowers: LowerRange,
}

impl EdgeSelection for EdgeSubset<'_> {
    #[inline(always)]
    fn lines<S: Simd>(&self, simd: S, swap: bool, row: usize) -> u64x4<S> {
        self.edges.lines(simd, swap, row, self.lowers)
    }
}

/// The axes along which lines step and rows follow each other.
const fn sweep_axes<const A: usize, const SWAP: bool>() -> (usize, usize) {
    let (u, v) = ((A + 1) % 3, (A + 2) % 3);
    if SWAP { (v, u) } else { (u, v) }
}

/// Adding this rounds to an integer, which then stands in the low mantissa bits.
const ROUND: f64 = (1u64 << 52) as f64 * 1.5;

/// The three edges of a projected triangle: where each cuts a row, as a linear function in f64.
///
/// A line is inside when no edge function is negative; a tie counts as its perturbed value. An edge along the rows
/// bounds none of them: vertices are even and lines odd, so that rows within the bounding box lie strictly on its
/// inner side.
struct Edges<'a> {
    facet: &'a ScanFacet,
    block: SampleCube,
    /// Bounds on the lines from below, which count lines from 0 upwards.
    below: Bounds,
    /// Bounds from above, which count lines from [`LINES_MAX`] − 1 downwards, so that these are lower bounds too.
    above: Bounds,
    /// Largest distance from the middle between two lines that says of a bound between which two it surely lies.
    clear: f64,
}

/// A linear function of the row for each edge, very small for those that bound elsewhere; the largest value counts.
/// The fourth is the first once more.
struct Bounds {
    /// At row 0.
    at: [f64; 4],
    /// Change per row.
    slope: [f64; 4],
}

impl Bounds {
    /// Of the edges that `bounds` names.
    #[inline(always)]
    fn new<S: Simd>(simd: S, bounds: mask64x4<S>, at: f64x4<S>, slope: f64x4<S>) -> Bounds {
        let none = f64x4::splat(simd, f64::from(-LINES_MAX));
        Bounds {
            at: bounds.select(at, none).into(),
            slope: bounds.select(slope, f64x4::splat(simd, 0.0)).into(),
        }
    }

    /// The bound on the lines of some rows.
    #[inline(always)]
    fn of<S: Simd>(&self, rows: f64x4<S>) -> f64x4<S> {
        let Bounds { at, slope } = self;
        let first = rows * slope[0] + at[0];
        let largest = first.max(rows * slope[1] + at[1]).max(rows * slope[2] + at[2]);
        // Far bounds are brought near, off the integers.
        largest.max(-0.75).min(f64::from(LINES_MAX) - 0.25)
    }
}

/// From where to where the edges go along an axis, the first edge twice.
#[inline(always)]
fn ends<S: Simd>(simd: S, facet: &ScanFacet, axis: usize) -> [f64x4<S>; 2] {
    let [p, q, t] = &facet.vertices;
    let [p, q, t] = [f64::from(p[axis]), f64::from(q[axis]), f64::from(t[axis])];
    [f64x4::simd_from(simd, [p, q, t, p]), f64x4::simd_from(simd, [q, t, p, q])]
}

/// The integer in each lane, which is not negative.
#[inline(always)]
fn integers<S: Simd>(simd: S, values: f64x4<S>) -> u64x4<S> {
    // The sum has it in the low mantissa bits.
    (values + f64x4::splat(simd, (1u64 << 52) as f64)).bitcast::<u64x4<S>>() & 63
}

impl<'a> Edges<'a> {
    #[inline(always)]
    fn new<S: Simd, const A: usize, const SWAP: bool>(
        simd: S,
        facet: &'a ScanFacet,
        block: SampleCube,
    ) -> Edges<'a> {
        let (s, r) = sweep_axes::<A, SWAP>();
        let per_step = power_of_two(-(block.shift as i32));
        let [from_s, to_s] = ends(simd, facet, s);
        let [from_r, to_r] = ends(simd, facet, r);
        let rise = to_r - from_r;
        let zero = f64x4::splat(simd, 0.0);
        let slope = rise.simd_eq(zero).select(zero, (to_s - from_s) / rise);
        let at = (from_s - slope * from_r) * per_step;
        // Edges that go one way bound the lines from below, those that go the other way from above.
        let way = rise * if (facet.normal[A] > 0) != SWAP { -1.0 } else { 1.0 };
        let below = Bounds::new(simd, way.simd_gt(zero), at, slope);
        let reflected = f64x4::splat(simd, f64::from(LINES_MAX - 1)) - at;
        let above = Bounds::new(simd, way.simd_lt(zero), reflected, -slope);
        let steepest = slope.abs().reduce_max();
        // No term carries more than five roundings of 2^-53 of its size; 2^-49 covers them all.
        let size = facet.reach(block) * (1.0 + steepest);
        let error = size * per_step * power_of_two(-49);
        // What the bound does not cover is decided exactly, row by row.
        let error = if error > 0.001 { 1.0 } else { error };
        Edges { facet, block, below, above, clear: 0.5 - error }
    }

    /// Those of the lines of a row, and of the rows after it, that lie inside.
    #[inline(always)]
    fn spans<S: Simd, const A: usize, const SWAP: bool>(
        &self,
        simd: S,
        row: i32,
        lines: u64x4<S>,
    ) -> u64x4<S> {
        let rows = f64x4::splat(simd, f64::from(row)) + f64x4::simd_from(simd, [0.0, 1.0, 2.0, 3.0]);
        let (from_below, from_above) = (self.below.of(rows), self.above.of(rows));
        // Lines outside at either end.
        let (below, above) = (from_below.ceil(), from_above.ceil());
        let (off_below, off_above) = (below - from_below - 0.5, above - from_above - 0.5);
        if off_below.abs().max(off_above.abs()).simd_ge(self.clear).any_true() {
            let positive = (self.facet.normal[A] > 0) != SWAP;
            let exact = self.spans_exactly(sweep_axes::<A, SWAP>(), positive, row, lines.into());
            return u64x4::simd_from(simd, exact);
        }
        let upwards = u64x4::splat(simd, u64::MAX) << integers(simd, below);
        lines & upwards & (u64x4::splat(simd, u64::MAX >> 1) >> integers(simd, above))
    }

    /// [`Edges::spans`] by exact edge functions.
    #[cold]
    #[inline(never)]
    fn spans_exactly(
        &self,
        axes: (usize, usize),
        positive: bool,
        row: i32,
        mut lines: [u64; ROWS],
    ) -> [u64; ROWS] {
        for (lines, row) in lines.iter_mut().zip(row..).filter(|(lines, _)| **lines != 0) {
            *lines &= self.span_exactly(axes, positive, row);
        }
        lines
    }

    /// The lines of one row that lie inside, by exact edge functions at every line.
    fn span_exactly(&self, (s, r): (usize, usize), positive: bool, row: i32) -> u64 {
        let sign = if positive { 1 } else { -1 };
        let at = |index: i32| i64::from(index) << self.block.shift;
        let inside = |line: &i32| {
            (0..3).all(|i| {
                let (a, b) = (self.facet.vertices[i], self.facet.vertices[(i + 1) % 3]);
                let along_s = -sign * i64::from(b[r] - a[r]);
                let along_r = sign * i64::from(b[s] - a[s]);
                let value = along_r * (at(row) - i64::from(a[r])) + along_s * (at(*line) - i64::from(a[s]));
                // ε belongs to the axis that comes first in x, y, z.
                let (first, second) = if s < r { (along_s, along_r) } else { (along_r, along_s) };
                value > 0 || (value == 0 && (first > 0 || (first == 0 && second > 0)))
            })
        };
        let (first, last) = self.facet.lines(s);
        (first..=last).filter(inside).fold(0, |bits, line| bits | 1 << line)
    }
}

/// 2^exponent.
#[inline(always)]
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Where a line crosses the triangle's plane, in 1/65536 of the spacing, as a linear function in f64.
struct Depth {
    /// At line 0 of row 0.
    at: f64,
    /// Change from one row to the next.
    row: f64,
    /// Change from one line of a row to the next.
    step: f64,
    /// Largest distance from an integer that says on which side of it the depth is surely rounded.
    clear: f64,
    /// Bound on the rounding error of the whole expression.
    error: f64,
}

impl Depth {
    #[inline(always)]
    fn new<const A: usize, const SWAP: bool>(facet: &ScanFacet, block: SampleCube) -> Depth {
        let (s, r) = sweep_axes::<A, SWAP>();
        // Powers of two, so the scaling is exact.
        let spacing = power_of_two(block.shift as i32);
        let scale = power_of_two(16 - block.shift as i32);
        let vertex = facet.vertices[0];
        let scaled = scale / facet.normal[A] as f64;
        let slope_s = facet.normal[s] as f64 * scaled;
        let slope_r = facet.normal[r] as f64 * scaled;
        let along = f64::from(vertex[A]) * scale;
        // Each term carries at most seven roundings of 2^-53 of its size; 2^-48 leaves a factor of four.
        let size = along.abs() + (slope_s.abs() + slope_r.abs()) * facet.reach(block);
        let error = size * power_of_two(-48);
        Depth {
            at: along + slope_s * f64::from(vertex[s]) + slope_r * f64::from(vertex[r]),
            row: slope_r * spacing,
            step: slope_s * spacing,
            clear: 0.5 - error,
            error,
        }
    }

    /// The depth at line 0 of the row.
    #[inline(always)]
    fn row(&self, row: i32) -> f64 {
        self.at - self.row * f64::from(row)
    }

    /// The distance of the crossing from sample 0 in 1/65536 of the spacing; what lies before that sample,
    /// and some of what lies behind the last one, becomes a very large number. `along` is the row's depth,
    /// `uv` the line's indices for the exact answer.
    #[inline(always)]
    fn locate<const A: usize>(
        &self,
        facet: &ScanFacet,
        block: SampleCube,
        along: f64,
        line: i32,
        uv: (i32, i32),
    ) -> u64 {
        let depth = along - self.step * f64::from(line);
        let shifted = depth + ROUND;
        let rest = depth - (shifted - ROUND);
        let rounded = shifted.to_bits().wrapping_sub(ROUND.to_bits());
        // A bound that reaches half a step settles nothing, wherever the depth seems to be. Near a sample, the
        // depth must be known to lie on one side of it.
        if rest.abs() > self.clear || rounded as u16 == 0 {
            return self.locate_slowly(facet, block, A, (rounded, rest), uv);
        }
        rounded
    }

    #[cold]
    #[inline(never)]
    fn locate_slowly(
        &self,
        facet: &ScanFacet,
        block: SampleCube,
        axis: usize,
        (rounded, rest): (u64, f64),
        uv: (i32, i32),
    ) -> u64 {
        if rest.abs() > self.clear || rest.abs() <= self.error {
            return locate_exactly(facet, block, axis, uv);
        }
        // The offset from the sample before is at most 65535.
        rounded.wrapping_sub(u64::from(rest < 0.0))
    }
}

/// [`Depth::locate`] in 128-bit integers.
fn locate_exactly(facet: &ScanFacet, block: SampleCube, axis: usize, (u, v): (i32, i32)) -> u64 {
    let (au, av) = ((axis + 1) % 3, (axis + 2) % 3);
    let n = facet.normal.map(i128::from);
    let a = facet.vertices[0].map(i128::from);
    let sign = n[axis].signum();
    let from_line = n[au] * (a[au] - (i128::from(u) << block.shift))
        + n[av] * (a[av] - (i128::from(v) << block.shift))
        + n[axis] * a[axis];
    // The crossing is at `numerator / (denominator · spacing)` samples from sample 0.
    let numerator = sign * from_line;
    let denominator = (sign * n[axis]) << block.shift;
    let mut lower = numerator.div_euclid(denominator);
    if numerator.rem_euclid(denominator) == 0 {
        // On a sample: it lies behind the crossing if the perturbed sample is on the side that the line
        // leaves to, that is if the first non-zero normal component has the sign of this axis's.
        let first = n.iter().find(|c| **c != 0).map_or(0, |c| c.signum());
        lower -= i128::from(first == sign);
    }
    let rest = numerator - lower * denominator;
    let offset = (rest * (65536 * 2) + denominator).div_euclid(2 * denominator);
    if (0..i128::from(block.last)).contains(&lower) {
        (lower << 16 | offset.min(65535)) as u64
    } else {
        u64::MAX
    }
}

#[cfg(test)]
#[path = "scan_tests.rs"]
mod tests;
