//! Crossings of one triangle with the axis-parallel lines of a lattice.
//!
//! Every sample p counts as p + (ε, ε², ε³) (simulation of simplicity, Edelsbrunner & Mücke 1990), so a line
//! meets a triangle or does not, and a crossing lies before a sample or behind it, never on it. Three i64
//! edge functions decide the first question; the second is a quotient evaluated in f64 under an error bound
//! and settled in 128-bit integers where the bound does not decide.

use crate::lattice::{Triangle, normal};

/// A cubic block of samples `0..=last` along each axis, `1 << shift` units apart, sample 0 at the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// log₂ of the spacing.
    pub shift: u32,
    /// Index of the last sample along an axis.
    pub last: i32,
}

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Crossing {
    /// Index of the line along the axis after the crossed one in cyclic order (x → y → z → x).
    pub u: i32,
    /// Index of the line along the remaining axis.
    pub v: i32,
    /// Index of the sample before the crossing; the next one lies behind it.
    pub lower: i32,
    /// Distance from that sample in 1/65536 of the spacing, rounded to nearest and at most 65535.
    pub offset: u16,
}

/// A triangle relative to sample 0 of a block, with what all three axes need.
pub(crate) struct Facet {
    vertices: [[i32; 3]; 3],
    /// Twice the area vector.
    pub normal: [i64; 3],
    /// First and last line index that the bounding box meets, per axis, clipped to the block.
    first: [i32; 3],
    last: [i32; 3],
}

impl Facet {
    /// `None` if the triangle meets no line of the block or has no area.
    #[inline]
    pub fn new(t: &Triangle, origin: [i32; 3], block: Block) -> Option<Facet> {
        let vertices = t.map(|p| std::array::from_fn(|a| p[a] - origin[a]));
        let below = (1 << block.shift) - 1;
        let mut first = [0; 3];
        let mut last = [0; 3];
        let mut met = 0;
        for a in 0..3 {
            let min = vertices[0][a].min(vertices[1][a]).min(vertices[2][a]);
            let max = vertices[0][a].max(vertices[1][a]).max(vertices[2][a]);
            first[a] = ((min + below) >> block.shift).max(0);
            last[a] = (max >> block.shift).min(block.last);
            met += i32::from(first[a] <= last[a]);
        }
        // A line along one axis needs a line index along both others.
        if met < 2 {
            return None;
        }
        let normal = normal(&vertices);
        (normal != [0; 3]).then_some(Facet { vertices, normal, first, last })
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
    pub fn scan<const A: usize>(&self, block: Block, limit: [i32; 2], hit: impl FnMut(Crossing)) {
        let (u, v) = ((A + 1) % 3, (A + 2) % 3);
        let lines_u = (self.first[u], self.last[u].min(limit[0]));
        let lines_v = (self.first[v], self.last[v].min(limit[1]));
        if lines_u.0 > lines_u.1 || lines_v.0 > lines_v.1 || self.normal[A] == 0 {
            return;
        }
        // Fewer, longer rows: a row costs as much as two to three crossings.
        if lines_v.1 - lines_v.0 <= lines_u.1 - lines_u.0 {
            self.sweep::<A, false>(block, lines_u, lines_v, hit);
        } else {
            self.sweep::<A, true>(block, lines_v, lines_u, hit);
        }
    }

    /// Visits the lines inside the triangle row by row: along u in rows of equal v, or the other way round
    /// if `SWAP`. Ranges are (first, last).
    #[inline(always)]
    fn sweep<const A: usize, const SWAP: bool>(
        &self,
        block: Block,
        steps: (i32, i32),
        rows: (i32, i32),
        mut hit: impl FnMut(Crossing),
    ) {
        debug_assert!(block.last < 64, "cuts beyond 64 are cut off");
        let edges = Edges::new::<A, SWAP>(self, block, steps.0, rows.0);
        let depth = Depth::new::<A, SWAP>(self, block, steps.0);
        let count = steps.1 - steps.0;
        for row in rows.0..=rows.1 {
            let (from, to) = edges.span::<A, SWAP>(row - rows.0, count);
            if from > to {
                continue;
            }
            let along = depth.row(block, row);
            for step in from..=to {
                let line = steps.0 + step;
                let (u, v) = if SWAP { (row, line) } else { (line, row) };
                if let Some((lower, offset)) = depth.locate::<A>(self, block, along, step, (u, v)) {
                    hit(Crossing { u, v, lower, offset });
                }
            }
        }
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
/// A line is inside when no edge function is negative; a tie counts as its perturbed value.
struct Edges<'a> {
    facet: &'a Facet,
    block: Block,
    /// First step and first row.
    origin: (i32, i32),
    /// (cut at the first row, change per row) of edges that bound the span from below and from above.
    lower: [(f64, f64); 2],
    upper: [(f64, f64); 2],
    /// Bound on the rounding error of the cuts.
    error: f64,
}

impl<'a> Edges<'a> {
    #[inline(always)]
    fn new<const A: usize, const SWAP: bool>(
        facet: &'a Facet,
        block: Block,
        step0: i32,
        row0: i32,
    ) -> Edges<'a> {
        let (s, r) = sweep_axes::<A, SWAP>();
        let (ps, pr) = (step0 << block.shift, row0 << block.shift);
        let per_step = power_of_two(-(block.shift as i32));
        let spacing = power_of_two(block.shift as i32);
        let mut lower = [(-2.0, 0.0); 2];
        let mut upper = [(f64::from(1 << 7), 0.0); 2];
        let mut size = 0.0;
        let (mut lowers, mut uppers) = (0, 0);
        // A lower bound is an edge that runs along the rows' order one way, an upper one the other way.
        let ascends = (facet.normal[A] > 0) != SWAP;
        for i in 0..3 {
            let (a, b) = (facet.vertices[i], facet.vertices[(i + 1) % 3]);
            let across = b[r] - a[r];
            // An edge along the rows bounds none of them: vertices are even and lines odd, so that rows
            // within the bounding box lie strictly on its inner side.
            if across == 0 {
                continue;
            }
            let slope = f64::from(b[s] - a[s]) / f64::from(across);
            let at = (f64::from(a[s] - ps) + slope * f64::from(pr - a[r])) * per_step;
            size = larger(size, f64::from((a[s] - ps).abs()) + slope.abs() * f64::from((pr - a[r]).abs()));
            size = larger(size, slope.abs() * 64.0 * spacing);
            if (across < 0) == ascends {
                lower[lowers & 1] = (at, slope);
                lowers += 1;
            } else {
                upper[uppers & 1] = (at, slope);
                uppers += 1;
            }
        }
        // No term carries more than five roundings of 2^-53 of its size; 2^-49 covers them all.
        let error = size * per_step * power_of_two(-49);
        Edges { facet, block, origin: (step0, row0), lower, upper, error }
    }

    /// First and last step in 0..=last of a row, counted from the first one, whose lines lie inside; an
    /// empty range if there is none.
    #[inline(always)]
    fn span<const A: usize, const SWAP: bool>(&self, row: i32, last: i32) -> (i32, i32) {
        let k = f64::from(row);
        let cut = |(at, slope): (f64, f64)| at + slope * k;
        // Far cuts are brought near, off the integers.
        let near = |c: f64| smaller(larger(c, -1.25), 64.25);
        let from = near(larger(cut(self.lower[0]), cut(self.lower[1])));
        let to = near(smaller(cut(self.upper[0]), cut(self.upper[1])));
        let (shifted_from, shifted_to) = (from + ROUND, to + ROUND);
        let (rest_from, rest_to) = (from - (shifted_from - ROUND), to - (shifted_to - ROUND));
        if smaller(rest_from.abs(), rest_to.abs()) <= self.error || self.error > 0.001 {
            return self.span_exactly(
                sweep_axes::<A, SWAP>(),
                (self.facet.normal[A].signum(), SWAP),
                row,
                last,
            );
        }
        let first = shifted_from.to_bits() as i32 + i32::from(rest_from > 0.0);
        let end = shifted_to.to_bits() as i32 - i32::from(rest_to < 0.0);
        (first.max(0), end.min(last))
    }

    /// [`Edges::span`] by exact edge functions at every step.
    #[cold]
    #[inline(never)]
    fn span_exactly(
        &self,
        (s, r): (usize, usize),
        (sign, swap): (i64, bool),
        row: i32,
        last: i32,
    ) -> (i32, i32) {
        let sign = if swap { -sign } else { sign };
        let at = |index: i32| i64::from(index) << self.block.shift;
        let pr = at(self.origin.1 + row);
        let inside = |step: i32| {
            let ps = at(self.origin.0 + step);
            (0..3).all(|i| {
                let (a, b) = (self.facet.vertices[i], self.facet.vertices[(i + 1) % 3]);
                let along_s = -sign * i64::from(b[r] - a[r]);
                let along_r = sign * i64::from(b[s] - a[s]);
                let value = along_r * (pr - i64::from(a[r])) + along_s * (ps - i64::from(a[s]));
                // ε belongs to the axis that comes first in x, y, z.
                let (first, second) = if s < r { (along_s, along_r) } else { (along_r, along_s) };
                value > 0 || (value == 0 && (first > 0 || (first == 0 && second > 0)))
            })
        };
        let Some(first) = (0..=last).find(|&step| inside(step)) else { return (1, 0) };
        let end = (first..=last).take_while(|&step| inside(step)).last();
        (first, end.unwrap_or(first))
    }
}

/// 2^exponent.
#[inline(always)]
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// One instruction, where `f64::max` also looks after NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// One instruction, where `f64::min` also looks after NaN.
#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Where a line crosses the triangle's plane, in 1/65536 of the spacing, as a linear function in f64.
struct Depth {
    /// At the first line, as far as the axis and the steps go.
    at: f64,
    /// Vertex 0 along the row axis, and the slope there.
    row_origin: i32,
    row_slope: f64,
    /// Change from one line of a row to the next.
    step: f64,
    /// Bound on the rounding error of the whole expression.
    error: f64,
}

impl Depth {
    #[inline(always)]
    fn new<const A: usize, const SWAP: bool>(facet: &Facet, block: Block, step0: i32) -> Depth {
        let (s, r) = sweep_axes::<A, SWAP>();
        // Powers of two, so the scaling is exact.
        let spacing = power_of_two(block.shift as i32);
        let scale = power_of_two(16 - block.shift as i32);
        let scaled = scale / facet.normal[A] as f64;
        let slope_s = facet.normal[s] as f64 * scaled;
        let slope_r = facet.normal[r] as f64 * scaled;
        let along = f64::from(facet.vertices[0][A]) * scale;
        let extent = |a: usize| {
            let p = facet.vertices;
            f64::from((p[1][a] - p[0][a]).abs().max((p[2][a] - p[0][a]).abs()))
        };
        // A line that meets the triangle is no farther from vertex 0 than the extent, nor is the first such
        // line. Each term carries at most six roundings of 2^-53 of its size and the step terms count twice;
        // 2^-48 leaves a factor of two and more.
        let size = along.abs() + slope_s.abs() * extent(s) + slope_r.abs() * extent(r);
        Depth {
            at: along + slope_s * f64::from(facet.vertices[0][s] - (step0 << block.shift)),
            row_origin: facet.vertices[0][r],
            row_slope: slope_r,
            step: slope_s * spacing,
            error: size * power_of_two(-48),
        }
    }

    /// The depth at the first line of the row.
    #[inline(always)]
    fn row(&self, block: Block, row: i32) -> f64 {
        self.at + self.row_slope * f64::from(self.row_origin - (row << block.shift))
    }

    /// The sample before the crossing and the offset from it; `None` outside the block. `along` is the
    /// row's depth, `line` the (u, v) indices for the exact answer.
    #[inline(always)]
    fn locate<const A: usize>(
        &self,
        facet: &Facet,
        block: Block,
        along: f64,
        step: i32,
        line: (i32, i32),
    ) -> Option<(i32, u16)> {
        let depth = along - self.step * f64::from(step);
        let shifted = depth + ROUND;
        let rounded = (shifted.to_bits() as i64) - (ROUND.to_bits() as i64);
        let rest = depth - (shifted - ROUND);
        // A bound that reaches half a step settles nothing, wherever the depth seems to be.
        let doubtful = rest.abs() > 0.5 - self.error;
        if !doubtful {
            let mut lower = rounded >> 16;
            if rounded & 0xffff == 0 {
                // At a sample, so near that only the exact quotient tells the side.
                if rest.abs() <= self.error {
                    return locate_exactly(facet, block, A, line.0, line.1);
                }
                lower -= i64::from(rest < 0.0);
            }
            let offset = (rounded - (lower << 16)).min(65535);
            return (0..i64::from(block.last)).contains(&lower).then_some((lower as i32, offset as u16));
        }
        locate_exactly(facet, block, A, line.0, line.1)
    }
}

/// [`Depth::locate`] in 128-bit integers.
#[cold]
#[inline(never)]
fn locate_exactly(facet: &Facet, block: Block, axis: usize, u: i32, v: i32) -> Option<(i32, u16)> {
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
    (0..i128::from(block.last)).contains(&lower).then_some((lower as i32, offset.min(65535) as u16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Everything in i128 with the perturbation as explicit small numbers: coordinates times 2^60,
    /// ε = 2^40, ε² = 2^20, ε³ = 1 are far apart for the small triangles used here.
    fn reference<const A: usize>(t: &Triangle, block: Block) -> Vec<(i32, i32, i32)> {
        const EPS: [i128; 3] = [1 << 40, 1 << 20, 1];
        let (au, av) = ((A + 1) % 3, (A + 2) % 3);
        let n = normal(t).map(i128::from);
        let mut out = Vec::new();
        let at = |i: i32, a: usize| ((i128::from(i) << block.shift) << 60) + EPS[a];
        for v in 0..=block.last {
            for u in 0..=block.last {
                let inside = (0..3).all(|i| {
                    let (a, b) = (t[i].map(i128::from), t[(i + 1) % 3].map(i128::from));
                    let e = (b[au] - a[au]) * (at(v, av) - (a[av] << 60))
                        - (b[av] - a[av]) * (at(u, au) - (a[au] << 60));
                    e * n[A].signum() > 0
                });
                if n[A] == 0 || !inside {
                    continue;
                }
                let side = |i: i32| {
                    let mut p = [0i128; 3];
                    (p[A], p[au], p[av]) = (at(i, A), at(u, au), at(v, av));
                    (0..3).map(|a| n[a] * (p[a] - (i128::from(t[0][a]) << 60))).sum::<i128>() * n[A].signum()
                };
                if let Some(lower) = (0..block.last).find(|&i| side(i) < 0 && side(i + 1) > 0) {
                    out.push((u, v, lower));
                }
            }
        }
        out
    }

    fn scanned<const A: usize>(t: &Triangle, block: Block) -> Vec<(i32, i32, i32)> {
        let mut out = Vec::new();
        if let Some(facet) = Facet::new(t, [0; 3], block) {
            facet.scan::<A>(block, [block.last; 2], |c| out.push((c.u, c.v, c.lower)));
        }
        out.sort_unstable_by_key(|&(u, v, _)| (v, u));
        out
    }

    /// Odd vertices, many on 45° faces through samples, some far outside.
    fn triangle() -> impl Strategy<Value = Triangle> {
        let vertex = prop::array::uniform3(-6i32..22).prop_map(|v| v.map(|c| 2 * c + 1));
        (prop::array::uniform3(vertex.clone()), vertex, 0..4usize).prop_map(|(mut t, d, flatten)| {
            if flatten < 3 {
                // Force a 45° plane: one coordinate a copy of another up to an even shift.
                for p in &mut t {
                    p[flatten] = p[(flatten + 1) % 3] + 2 * (d[0] / 8);
                }
            }
            t
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        #[test]
        fn crossings_match_the_perturbed_reference(t in triangle(), shift in 1u32..4) {
            let block = Block { shift, last: 6 };
            prop_assert_eq!(scanned::<0>(&t, block), reference::<0>(&t, block));
            prop_assert_eq!(scanned::<1>(&t, block), reference::<1>(&t, block));
            prop_assert_eq!(scanned::<2>(&t, block), reference::<2>(&t, block));
        }

        #[test]
        fn fast_and_exact_location_agree(t in prop::array::uniform3(prop::array::uniform3(-(1i32 << 22)..1 << 22)),
                                         shift in 3u32..20) {
            let t = t.map(|v| v.map(|c| 2 * c + 1));
            let block = Block { shift, last: 32 };
            if let Some(facet) = Facet::new(&t, [0; 3], block) {
                let mut checked = Vec::new();
                facet.scan::<0>(block, [32, 32], |c| checked.push((0, c)));
                facet.scan::<1>(block, [32, 32], |c| checked.push((1, c)));
                facet.scan::<2>(block, [32, 32], |c| checked.push((2, c)));
                for (axis, c) in checked {
                    let exact = locate_exactly(&facet, block, axis, c.u, c.v);
                    prop_assert_eq!(Some((c.lower, c.offset)), exact);
                }
            }
        }
    }

    #[test]
    fn an_edge_shared_by_two_triangles_belongs_to_one() {
        // A square through samples, split along both diagonals: each line crosses exactly once.
        let block = Block { shift: 1, last: 8 };
        for flip in [false, true] {
            let p = [[1, 1, 3], [13, 1, 3], [13, 13, 3], [1, 13, 3]];
            let (a, b) = if flip {
                ([p[0], p[1], p[3]], [p[1], p[2], p[3]])
            } else {
                ([p[0], p[1], p[2]], [p[0], p[2], p[3]])
            };
            let mut all = scanned::<2>(&a, block);
            all.extend(scanned::<2>(&b, block));
            all.sort_unstable();
            let expected: Vec<_> = (1..=6).flat_map(|u| (1..=6).map(move |v| (u, v, 1))).collect();
            assert_eq!(all, expected);
        }
    }
}
